"""One series of tap tests and what follows from its rows: where each value started, and how it has changed since.

Made once for a standing and handed on with it. What is worked out of it lasts as long as it does.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property
from itertools import chain, compress

import numpy as np
from numpy.typing import NDArray

from dsm import PreloadLeft, calibrate, preload_left
from lobewatch.decay.change_point import Fall, newest_change
from lobewatch.decay.readings import NOTHING_KNOWN, SeriesScatter
from lobewatch.decay.trend import TapValue, Trend, newest_percents, trend_of
from lobewatch.history.history import WATCHED, Row
from lobewatch.machine import Machine
from lobewatch.measuring.estimate import UNKNOWN, Estimate


@dataclass(frozen=True, eq=False)
class ValueHistory:
    """One value of a series: the tap tests that know it, its trend, its start and its change."""

    name: str
    """Field of a row, one of `WATCHED`."""
    rows: tuple[Row, ...]
    """Rows of the series, oldest first, n of them."""
    numbers: NDArray[np.float64]
    """Value of each row and its standard error, shape (n, 2)."""
    is_asked: NDArray[np.bool_]
    """Whether anything is asked about a row that nobody has answered, shape (n,)."""
    beside: ValueHistory | None = None
    """The same value in the other direction; None where nothing is known of it, or where it does not count."""
    scatter: SeriesScatter = NOTHING_KNOWN
    """What is known of its scatter beforehand."""

    @cached_property
    def known(self) -> tuple[Row, ...]:
        """Rows that know the value."""
        return self._select(np.isfinite(self.numbers[:, 0]))

    @cached_property
    def sure(self) -> tuple[Row, ...]:
        """Rows that know the value and that nothing is asked about: those that others are compared with."""
        return self._select(np.isfinite(self.numbers[:, 0]) & ~self.is_asked)

    @cached_property
    def trend(self) -> Trend | None:
        """Trend of the sure rows as on the day of the newest; None where none has a positive value."""
        taps = self.taps
        beside = [] if self.beside is None else self.beside.taps
        return trend_of(taps, taps[-1].time, beside, self.scatter) if taps else None

    @property
    def taps(self) -> list[TapValue]:
        """The sure rows as points of a trend.

        Temperature and operator count for the frequency alone: of the others nothing is known beforehand.
        """
        rows, numbers = self._positive
        errors = np.where(np.isfinite(numbers[:, 1]), 100 * numbers[:, 1] / numbers[:, 0], math.nan).tolist()
        under, times = [row.conditions for row in rows], [row.time for row in rows]
        hours = [_number(conditions.hours) for conditions in under]
        reclamped = [conditions.reclamped for conditions in under]
        if self.name == "frequency":
            temperatures, operators = [_number(it.temperature_c) for it in under], [row.operator for row in rows]
        else:
            temperatures, operators = [math.nan] * len(rows), [""] * len(rows)
        return [*map(TapValue, times, numbers[:, 0].tolist(), errors, temperatures, hours, operators, reclamped)]

    @cached_property
    def start(self) -> Estimate:
        """Value that the series is compared with, not one tap test but where its first ones lie; UNKNOWN without any.

        From 8 points on its error is the scatter from tap test to tap test.
        """
        if not self.known:
            return UNKNOWN
        first: Estimate = getattr((self.sure or self.known)[0], self.name)
        trend = self.trend
        if trend is None or (trend.past is None and self.name != "frequency"):
            return first
        value = trend.first * math.exp(trend.start / 100)
        return Estimate(value, first.std if trend.past is None else value * trend.spread / 100)

    @property
    def change(self) -> Estimate:
        """Change (%) from the start to the last row; unknown where that does not know the value."""
        return self.change_at(self.rows[-1])

    def change_at(self, row: Row) -> Estimate:
        """Change (%) from the start to a row; unknown where that does not know the value."""
        value: Estimate = getattr(row, self.name)
        if not value.is_known:
            return UNKNOWN
        return Estimate(0.0, 0.0) if self.start == value else value.change_since(self.start)

    def newest_change(self) -> tuple[datetime, Fall] | None:
        """The change that the newest points are sure of, whatever the temperature, and its time; None without one."""
        rows, numbers = self._positive
        reclamped = [row.conditions.reclamped for row in rows]
        times, percents = newest_percents([row.time for row in rows], numbers[:, 0].tolist(), reclamped)
        change = newest_change(np.array(percents))
        return None if change is None else (times[change.point], change)

    @property
    def _positive(self) -> tuple[tuple[Row, ...], NDArray[np.float64]]:
        """The sure rows whose value is one to take a logarithm of, with their numbers, shape (n, 2)."""
        counts = np.isfinite(self.numbers[:, 0]) & ~self.is_asked & (self.numbers[:, 0] > 0)
        return self._select(counts), self.numbers[counts]

    @property
    def watched(self) -> tuple[Row, ...]:
        """The rows that the trend is of, oldest first."""
        return self._positive[0]

    def _select(self, counts: NDArray[np.bool_]) -> tuple[Row, ...]:
        return self.rows if counts.all() else tuple(compress(self.rows, counts.tolist()))


@dataclass(frozen=True, eq=False)
class SeriesHistory:
    """The rows of one tool and direction, and the history of each value that is watched."""

    rows: tuple[Row, ...]
    """Rows of the series, oldest first; one at least."""
    values: Mapping[str, ValueHistory]
    """History of each value, by its name in `WATCHED`."""

    @property
    def frequency(self) -> ValueHistory:
        """The natural frequency of the mode followed (Hz)."""
        return self.values["frequency"]

    @property
    def fall(self) -> Estimate:
        """Fall of the frequency (%) to the newest test, or where that is in question, to another that fell farther."""
        newest = [rows[-1] for rows in (self.frequency.known, self.frequency.sure) if rows]
        change = min(map(self.frequency.change_at, newest), key=lambda change: change.value, default=UNKNOWN)
        return Estimate(-change.value + 0.0, change.std)

    def below_since(self, percent: float) -> Row | None:
        """The first of the newest tap tests that all show a fall of so much (%); None where the newest does not."""
        first = None
        for row in reversed(self.frequency.known):
            if -self.frequency.change_at(row).value < percent and (first is not None or not row.questions):
                break
            first = row if -self.frequency.change_at(row).value >= percent else first
        return first

    @property
    def falling_since(self) -> Row | None:
        """The tap test that raised the alarm of the watch over the frequency; None where none is open."""
        trend = self.frequency.trend
        if trend is None or trend.open_fall is None:
            return None
        return self.frequency.watched[trend.points[trend.open_fall.raised].taps[0]]


def series_history(
    rows: Iterable[Row], beside: Iterable[Row] = (), scatter: SeriesScatter = NOTHING_KNOWN
) -> SeriesHistory:
    """The history of a series from its rows, oldest first, one at least.

    beside: rows of the same tool in the other direction; scatter: what is known of that of the frequency beforehand.
    """
    values = _value_histories(tuple(rows))
    others = _value_histories(tuple(beside))
    values["frequency"] = replace(values["frequency"], beside=others["frequency"], scatter=scatter)
    return SeriesHistory(values["frequency"].rows, values)


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _value_histories(rows: tuple[Row, ...]) -> dict[str, ValueHistory]:
    flat = chain.from_iterable(chain.from_iterable([row.watched for row in rows]))
    numbers = np.fromiter(flat, np.float64, 2 * len(WATCHED) * len(rows)).reshape(-1, len(WATCHED), 2)
    is_asked = np.array([bool(row.questions) for row in rows], dtype=np.bool_)
    return {name: ValueHistory(name, rows, numbers[:, k], is_asked) for k, name in enumerate(WATCHED)}


def preload_of(series: SeriesHistory, machine: Machine) -> PreloadLeft | None:
    """The preload left in the bearings of a machine, from the change of their stiffness; see dsm.preload_left.

    None where no two tests gave a bearing stiffness, or not the newest, where the first or the newest leaves it open,
    or where one of the calibrated bearings has rollers.
    """
    stiffness = series.values["bearing_stiffness"]
    change = stiffness.change
    if machine.spindle is None or not change.is_known or len(stiffness.sure) < 2:
        return None
    if any(_is_open(row, machine) for row in (stiffness.sure[0], series.rows[-1])):
        return None
    calibrated = [bearing for bearing in machine.spindle.build().bearings if bearing.group]
    return preload_left(calibrated, 1 + change.value / 100)


def _is_open(row: Row, machine: Machine) -> bool:
    """Whether the frequency of a tap test leaves the bearings open, or belongs to another model."""
    frequency, std = row.frequency
    try:
        model = machine.model(row.tool)
        return calibrate(model, frequency, std if math.isfinite(std) else None, machine.mode.model_mode).is_open
    except (ValueError, ArithmeticError):
        return True
