"""What the limits of machine.toml and the watch over a series call for."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator
from pathlib import Path

from acquisition import ACROSS, Remark
from lobewatch.decay.series_history import SeriesHistory
from lobewatch.decay.trend import Trend
from lobewatch.history.history import Row
from lobewatch.machine import Limits
from lobewatch.measuring.estimate import Estimate

BESIDE = {"damping_ratio": "damping ratio", "stiffness": "stiffness K"}
"""Values that are watched beside the frequency, and what they are called; that of the bearings follows from it."""
LEAST_CHANGE = 0.1
"""Change of these (%) that is told; no verdict feels a smaller one, and computed data have such."""
SETTLING = "; it fell among its first tests and has slowed since: settling (run-in)?"
"""What is said of a fall as that of bearings that run in; it rings like any other."""


def about_loss(name: str, newest: Row) -> Iterator[Remark]:
    """Remark on a newest test that does not show the mode followed."""
    if not newest.frequency.is_known and newest.direction != ACROSS:
        cure = "Tap again: the mode that is followed was not found in the newest test."
        yield Remark("mode-lost", name, "the newest test does not show the mode followed", cure)


def about_fall(name: str, fall: Estimate, limits: Limits) -> Iterator[Remark]:
    """Remark on a fall that has reached a limit of machine.toml."""
    text = f"frequency fallen by {fall.value:.1f} % since the first tests"
    if fall.value >= limits.frequency_alarm_percent:
        cure = "Before the next part have the bearings, the tool and its clamping looked at, then tap again."
        yield Remark("frequency-alarm", name, f"{text} (alarm at {limits.frequency_alarm_percent:g} %)", cure)
    elif fall.value >= limits.frequency_warn_percent:
        cure = "Tap again to be sure; if it stays, have the bearings and the tool's clamping looked at soon."
        yield Remark("frequency-warn", name, f"{text} (warning at {limits.frequency_warn_percent:g} %)", cure)


def about_trend(name: str, trend: Trend, path: Path | str = "MACHINE") -> Iterator[Remark]:
    """Remarks on what the watch over the frequency sees: a fall, a doubt, a rise. path: of the folder, for commands."""
    folder = shlex.quote(str(path))
    event = f'lobewatch event {folder} "what was done" --new-baseline'
    if trend.open_fall is not None:
        fall = trend.open_fall.fall
        course = "fell at once before" if fall.kind == "step" else "has been falling since"
        text = f"frequency {course} {trend.fallen_since:%Y-%m-%d}, by {_relative(fall.size, fall.half_width)}"
        text += SETTLING if trend.is_settling else ""
        cure = f"Have the bearings, the tool and its clamping looked at; after a repair: {event}"
        yield Remark("decay", name, text, f"{cure}. Known already: lobewatch ack {folder}")
    elif trend.detection.asks_again:
        text = "the newest test is lower than those before it"
        cure = f"Clamp the tool anew and tap again: lobewatch tap {folder} --reclamped shows whether it fell."
        yield Remark("decay-doubtful", name, text, cure)
    if trend.detection.rise is not None:
        rise = trend.detection.rise
        text = f"frequency rose by {_relative(-rise.size, rise.half_width)}: assembly changed?"
        yield Remark("frequency-rose", name, text, f"If so: {event}")


def about_others(name: str, series: SeriesHistory) -> Iterator[Remark]:
    """Remarks on changes of damping ratio and stiffness."""
    for field, word in BESIDE.items():
        newest = series.values[field].newest_change()
        if newest is not None and abs(newest[1].size) >= LEAST_CHANGE:
            time, change = newest
            verbs = ("fell", "falling") if change.size > 0 else ("rose", "rising")
            course = f"{verbs[0]} at once before" if change.kind == "step" else f"has been {verbs[1]} since"
            by = _relative(change.size, change.half_width)
            text = f"{word} {course} {time:%Y-%m-%d}, by {by}; programs are judged with it, the light does not watch it"
            yield Remark("value-changed", name, text)


def _relative(fall: float, half_width: float) -> str:
    """Size of a change (%), from that of its logarithm (%) with the half-width of its 95 % interval."""
    share = math.exp(-fall / 100)
    return f"{100 * abs(1 - share):.2f} ±{half_width * share:.2f} %"
