"""How far the values of a series are from where they started, and what that calls for; the one place that says so."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Sequence
from datetime import datetime
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import Remark
from lobewatch.decay.change_point import newest_change
from lobewatch.decay.trend import TapValue, Trend, newest_percents, trend_of
from lobewatch.history.history import WATCHED, Row
from lobewatch.history.series_columns import SeriesColumns, series_columns
from lobewatch.machine import Limits
from lobewatch.measuring.estimate import UNKNOWN, Estimate

OTHERS = {"damping_ratio": "damping ratio", "stiffness": "stiffness K", "bearing_stiffness": "bearing stiffness"}
"""Fields of a row that are watched beside the frequency, and what they are called."""
KEPT = 16
"""Series that are remembered, for one standing asks for each several times."""


def known_rows(rows: Sequence[Row], name: str) -> tuple[Row, ...]:
    """Those that know a value and that nothing is asked about: what others are compared with."""
    found = _columns(tuple(rows))
    return found.rows_that(found.known(name, and_sure=True))


def rows_with(rows: Sequence[Row], name: str) -> tuple[Row, ...]:
    """Those that know a value."""
    found = _columns(tuple(rows))
    return found.rows_that(found.known(name))


@lru_cache(maxsize=KEPT)
def _columns(rows: tuple[Row, ...]) -> SeriesColumns:
    return series_columns(rows)


def trend_in(rows: Sequence[Row], name: str, now: datetime, events: Sequence[datetime] = ()) -> Trend | None:
    """The trend of a value (frequency, damping_ratio, stiffness or bearing_stiffness); None where none is known."""
    found = _trend(tuple(rows), name)
    return None if found is None else found.on(now, events)


@lru_cache(maxsize=KEPT)
def _trend(rows: tuple[Row, ...], name: str) -> Trend | None:
    """As on the day of its newest tap test, without events."""
    taps = _taps(rows, name)
    return trend_of(taps, taps[-1].time) if taps else None


def _taps(rows: tuple[Row, ...], name: str) -> list[TapValue]:
    """The temperature counts for the frequency alone: of the others nothing is known beforehand."""
    found, values = _positive(rows, name)
    errors = np.where(np.isfinite(values[:, 1]), 100 * values[:, 1] / values[:, 0], math.nan).tolist()
    warmth = [row.conditions.temperature_c if name == "frequency" else None for row in found]
    temperatures = [math.nan if one is None else one for one in warmth]
    times = [row.time for row in found]
    return [*map(TapValue, times, values[:, 0].tolist(), errors, temperatures)]


def _positive(rows: tuple[Row, ...], name: str) -> tuple[tuple[Row, ...], NDArray[np.float64]]:
    """The rows that others are compared with and whose value is one to take a logarithm of; with these values and
    their standard errors, shape (n, 2)."""
    found = _columns(rows)
    values = found.values[:, WATCHED.index(name)]
    count = found.known(name, and_sure=True) & (values[:, 0] > 0)
    return found.rows_that(count), values[count]


def start(rows: Sequence[Row], name: str) -> Estimate:
    """The value that a series is compared with, not one tap test but where its first ones lie; UNKNOWN without any.

    From 8 points on its error is the scatter from tap test to tap test.
    """
    known = known_rows(rows, name) or rows_with(rows, name)
    if not known:
        return UNKNOWN
    first: Estimate = getattr(known[0], name)
    found = _trend(tuple(rows), name)
    if found is None or (found.past is None and name != "frequency"):
        return first
    value = found.first * math.exp(found.start / 100)
    return Estimate(value, first.std if found.past is None else value * found.spread / 100)


def change_since_start(rows: Sequence[Row], name: str) -> Estimate:
    """Change (%) of a value from where its series started to the last row; unknown where that does not know it."""
    now: Estimate = getattr(rows[-1], name)
    if not now.is_known:
        return UNKNOWN
    then = start(rows, name)
    return Estimate(0.0, 0.0) if then == now else now.change_since(then)


def fall_of(rows: Sequence[Row]) -> Estimate:
    """Fall of the frequency (%) to the newest test, or where that is in question, to another if that fell farther."""
    known = rows_with(rows, "frequency") or tuple(rows)
    sure = known_rows(rows, "frequency")
    changes = [change_since_start(some, "frequency") for some in ([known] if sure == known else [known, sure]) if some]
    change = min(changes, key=lambda one: one.value)
    return Estimate(-change.value + 0.0, change.std)


def about_fall(name: str, fall: Estimate, limits: Limits) -> Iterator[Remark]:
    """The limits of machine.toml."""
    text = f"frequency fallen by {fall.value:.1f} % since the first tests"
    if fall.value >= limits.frequency_alarm_percent:
        cure = "Do not cut on: have the bearings, the tool and its clamping looked at, then tap again."
        yield Remark("frequency-alarm", name, f"{text} (alarm at {limits.frequency_alarm_percent:g} %)", cure)
    elif fall.value >= limits.frequency_warn_percent:
        cure = "Tap again to be sure; if it stays, have the bearings and the tool's clamping looked at soon."
        yield Remark("frequency-warn", name, f"{text} (warning at {limits.frequency_warn_percent:g} %)", cure)


def about_trend(name: str, trend: Trend, path: Path | str = "MACHINE") -> Iterator[Remark]:
    """What the watch over the series calls for; path: of the folder, for the commands."""
    event = f'lobewatch event {shlex.quote(str(path))} "what was done"'
    if trend.watch.fall is not None and trend.fallen_since is not None:
        fall = trend.watch.fall
        how = "fell at once before" if fall.kind == "step" else "has been falling since"
        text = f"frequency {how} {trend.fallen_since:%Y-%m-%d}, by {_relative(fall.size, fall.half_width)}"
        cure = "Have the bearings, the tool and its clamping looked at"
        yield Remark("decay", name, text, f"{cure}; {event} ends this alarm, --new-baseline with it after a repair.")
    elif trend.watch.asks_again:
        text = "the newest test is lower than those before it"
        yield Remark("decay-doubtful", name, text, "Clamp the tool anew and tap again: that shows whether it fell.")
    if trend.rise.fall is not None:
        rise = trend.rise.fall
        text = f"frequency rose by {_relative(-rise.size, rise.half_width)}: assembly changed?"
        yield Remark("frequency-rose", name, text, f"If so: {event} --new-baseline")


def about_others(name: str, rows: Sequence[Row], trend: Trend | None) -> Iterator[Remark]:
    """What the watch over damping ratio, stiffness and bearing stiffness has found: remarks alone.

    trend: of the frequency; where that has changed, the bearing stiffness that follows from it says nothing more.
    """
    known = trend is not None and (trend.watch.fall or trend.rise.fall)
    for field, word in OTHERS.items():
        if known and field == "bearing_stiffness":
            continue
        found, values = _positive(tuple(rows), field)
        times, percents = newest_percents([row.time for row in found], values[:, 0].tolist())
        change = newest_change(np.array(percents))
        if change is not None:
            since = f"{times[change.point]:%Y-%m-%d}"
            verbs = ("fell", "falling") if change.size > 0 else ("rose", "rising")
            how = f"{verbs[0]} at once before" if change.kind == "step" else f"has been {verbs[1]} since"
            yield Remark("value-changed", name, f"{word} {how} {since}, by {_relative(change.size, change.half_width)}")


def _relative(fall: float, half_width: float) -> str:
    """Of a logarithm in %, with the half-width of its 95 % interval."""
    share = math.exp(-fall / 100)
    return f"{100 * abs(1 - share):.2f} ±{half_width * share:.2f} %"
