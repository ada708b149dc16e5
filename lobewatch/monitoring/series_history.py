"""History of one series of tap tests: start, trend and change of each monitored value.

Made once for a status and handed on with it. What is worked out of it lasts as long as it does.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property
from itertools import chain, compress
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from dsm import RemainingPreload, calibrate, remaining_preload
from lobewatch.arrays import Flags, Floats
from lobewatch.history.history import WATCHED_VALUES, HistoryRow
from lobewatch.machine import Machine
from lobewatch.measurement.estimate import UNKNOWN_ESTIMATE, Estimate
from lobewatch.monitoring.alarm_estimate import SeriesChange
from lobewatch.monitoring.change_detection import find_newest_change
from lobewatch.monitoring.series_drop import NO_DROP, UNKNOWN_DROP, SeriesDrop
from lobewatch.monitoring.series_points import NO_SERIES_PRIOR, SeriesScatterPrior
from lobewatch.monitoring.trend import TapValue, Trend, fit_trend, list_newest_points


@dataclass(frozen=True, eq=False)
class ValueHistory:
    """One value of a series: its tap tests, trend, start and change."""

    name: str
    """Field of a row, one of `WATCHED_VALUES`."""
    rows: tuple[HistoryRow, ...]
    """Rows of the series, oldest first, shape (n,)."""
    values: Floats
    """Value of each row and its standard error, shape (n, 2)."""
    has_questions: Flags
    """True for each row with unanswered questions, shape (n,)."""
    other_direction: "ValueHistory | None" = None
    """Same value in the other direction; None if unknown or irrelevant."""
    scatter_prior: SeriesScatterPrior = NO_SERIES_PRIOR
    """Prior scatter of the series."""

    @cached_property
    def known_rows(self) -> tuple[HistoryRow, ...]:
        """Rows with the value."""
        return self._select(np.isfinite(self.values[:, 0]))

    @cached_property
    def reference_rows(self) -> tuple[HistoryRow, ...]:
        """Rows with the value and without questions, to which others are compared."""
        return self._select(np.isfinite(self.values[:, 0]) & ~self.has_questions)

    @cached_property
    def trend(self) -> Trend | None:
        """Trend of the reference rows on the day of the newest; None without a positive value."""
        taps = self.tap_values
        other_rows = [] if self.other_direction is None else self.other_direction.tap_values
        return fit_trend(taps, taps[-1].time, other_rows, self.scatter_prior) if taps else None

    @property
    def tap_values(self) -> list[TapValue]:
        """Reference rows as points of a trend."""
        return self._make_tap_values(*self.trend_values)

    def _make_tap_values(self, rows: Sequence[HistoryRow], numbers: Floats) -> list[TapValue]:
        """Make points of rows with their numbers (n, 2).

        Temperature and operator count for the frequency only: their effect on other values is unknown.
        """
        errors = np.where(np.isfinite(numbers[:, 1]), 100 * numbers[:, 1] / numbers[:, 0], math.nan).tolist()
        under, times = [row.conditions for row in rows], [row.time for row in rows]
        hours = [_or_nan(conditions.hours) for conditions in under]
        reclamped = [conditions.reclamped for conditions in under]
        if self.name == "frequency":
            temperatures, operators = [_or_nan(it.temperature_c) for it in under], [row.operator for row in rows]
        else:
            temperatures, operators = [math.nan] * len(rows), [""] * len(rows)
        return [*map(TapValue, times, numbers[:, 0].tolist(), errors, temperatures, hours, operators, reclamped)]

    @cached_property
    def first_row(self) -> HistoryRow | None:
        """First row with the value, without questions if there is one; None without any."""
        return next(iter(self.reference_rows or self.known_rows), None)

    @cached_property
    def start(self) -> Estimate:
        """Value at the start of the series, from its first tests together; UNKNOWN if there is none.

        From 8 points on its error is the scatter from tap test to tap test.
        """
        if self.first_row is None:
            return UNKNOWN_ESTIMATE
        first: Estimate = getattr(self.first_row, self.name)
        trend = self.trend
        if trend is None or (trend.past_fit is None and self.name != "frequency"):
            return first
        value = trend.first_value * math.exp(trend.start / 100)
        return Estimate(value, first.std if trend.past_fit is None else value * trend.spread / 100)

    @cached_property
    def _reference_trend(self) -> Trend | None:
        """Trend, or that of the first row alone if all rows have questions; None without a positive value."""
        if self.trend is not None or self.first_row is None:
            return self.trend
        taps = self._make_tap_values([self.first_row], np.array([getattr(self.first_row, self.name)]))
        return fit_trend(taps, taps[0].time, known=self.scatter_prior) if taps[0].value > 0 else None

    @property
    def change(self) -> Estimate:
        """Change (%) from the start to the last row, the drop with the other sign; unknown if that has no value."""
        drop = self.drop_at(self.rows[-1])
        return Estimate(-drop.value + 0.0, drop.std)

    def first_row_of(self, point: int) -> HistoryRow:
        """Return the row of the first tap test of a point of the trend."""
        return self.trend_values[0][0 if self.trend is None else self.trend.points[point].taps[0]]

    @cached_property
    def _point_numbers(self) -> dict[str, int]:
        """Number of the point of the trend by the id of its tap tests; empty for values other than the frequency."""
        if self.trend is None or self.name != "frequency":
            return {}
        rows = self.trend_values[0]
        return {rows[tap].tap_id: number for number, point in enumerate(self.trend.points) for tap in point.taps}

    def drop_at(self, row: HistoryRow) -> SeriesDrop:
        """Return the drop (%) from the start to a row; unknown if the row has no value.

        Tap tests of one point have its drop, none if it is the first. The interval of a value other than the
        frequency is unknown below 8 points, as its usual scatter is.
        """
        point = self._point_numbers.get(row.tap_id)
        if point is not None and self.trend is not None:
            return self.trend.drop_at(point) if point or self.trend.points[0].taps[0] else NO_DROP
        percent, trend = self.percent_below_start(row), self._reference_trend
        if trend is None or math.isnan(percent):
            return UNKNOWN_DROP
        if row is self.first_row:
            return NO_DROP
        if trend.past_fit is None and self.name != "frequency":
            return SeriesDrop(percent)
        (tap,) = self._make_tap_values([row], np.array([getattr(row, self.name)]))
        return trend.drop_model.drop_at(percent, tap.temperature, tap.operator, tap.error)

    def percent_below_start(self, row: HistoryRow) -> float:
        """Return the drop (%) of a row without its interval; NaN if the row has no value."""
        point = self._point_numbers.get(row.tap_id)
        if point is not None and self.trend is not None:
            return float(self.trend.drops[point])
        trend, number = self._reference_trend, float(getattr(row, self.name).value)
        if trend is None or not number > 0:
            return math.nan
        if trend.past_fit is None and self.name != "frequency":
            return 100 * (1 - number / self.start.value)
        (tap,) = self._make_tap_values([row], np.array([getattr(row, self.name)]))
        percent = 100 * math.log(number / trend.first_value)
        return trend.drop_model.percent_below_start(percent, tap.temperature, tap.operator)

    def find_newest_change(self) -> tuple[datetime, SeriesChange] | None:
        """Find the change that the newest points are sure of, and its time, or None."""
        points = list_newest_points(self.tap_values)
        change = find_newest_change(np.array([point.percent for point in points]))
        return None if change is None else (points[change.point].time, change)

    @property
    def trend_values(self) -> tuple[tuple[HistoryRow, ...], Floats]:
        """Reference rows with a positive value, with their numbers, shape (n, 2)."""
        counts = np.isfinite(self.values[:, 0]) & ~self.has_questions & (self.values[:, 0] > 0)
        return self._select(counts), self.values[counts]

    def _select(self, counts: Flags) -> tuple[HistoryRow, ...]:
        return self.rows if counts.all() else tuple(compress(self.rows, counts.tolist()))


@dataclass(frozen=True, eq=False)
class SeriesHistory:
    """Rows of one tool and direction, with the history of each monitored value."""

    rows: tuple[HistoryRow, ...]
    """Rows of the series, oldest first, at least one."""
    values: Mapping[str, ValueHistory]
    """History of each value by its name."""

    @property
    def frequency(self) -> ValueHistory:
        """Natural frequency of the followed mode (Hz)."""
        return self.values["frequency"]

    @property
    def drop(self) -> SeriesDrop:
        """Frequency drop (%) to the newest test, or to an earlier larger one if the newest has questions.

        The one number of a drop, which all texts, tables and figures show.
        """
        newest = {
            rows[-1].tap_id: rows[-1] for rows in (self.frequency.known_rows, self.frequency.reference_rows) if rows
        }
        return max(map(self.frequency.drop_at, newest.values()), key=lambda drop: drop.value, default=UNKNOWN_DROP)

    def first_below(self, percent: float) -> HistoryRow | None:
        """Find the first of the newest tap tests that all show a drop of this much (%), or None."""
        first = None
        for row in reversed(self.frequency.known_rows):
            is_below = self.frequency.percent_below_start(row) >= percent
            if not is_below and (first is not None or not row.questions):
                break
            first = row if is_below else first
        return first

    @property
    def first_falling(self) -> HistoryRow | None:
        """Tap test that triggered the frequency alarm; None if no alarm is open."""
        trend = self.frequency.trend
        if trend is None or trend.open_drop is None:
            return None
        return self.frequency.first_row_of(trend.open_drop.triggered_at)


def build_series_history(
    rows: Iterable[HistoryRow], other_rows: Iterable[HistoryRow] = (), scatter: SeriesScatterPrior = NO_SERIES_PRIOR
) -> SeriesHistory:
    """Build the history of a series from its rows, oldest first, one at least.

    other_rows: rows of the same tool in the other direction; scatter: prior of the scatter of the frequency.
    """
    values = _build_value_histories(tuple(rows))
    others = _build_value_histories(tuple(other_rows))
    values["frequency"] = replace(values["frequency"], other_direction=others["frequency"], scatter_prior=scatter)
    return SeriesHistory(values["frequency"].rows, values)


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


def _build_value_histories(rows: tuple[HistoryRow, ...]) -> dict[str, ValueHistory]:
    flat = chain.from_iterable(chain.from_iterable(map(attrgetter(*WATCHED_VALUES), rows)))
    numbers = np.fromiter(flat, np.float64, 2 * len(WATCHED_VALUES) * len(rows)).reshape(-1, len(WATCHED_VALUES), 2)
    is_asked = np.array([bool(row.questions) for row in rows], dtype=np.bool_)
    return {name: ValueHistory(name, rows, numbers[:, k], is_asked) for k, name in enumerate(WATCHED_VALUES)}


class BearingChange(NamedTuple):
    """Bearing stiffness at the start and now, by the model and the drop of the frequency (N/m)."""

    start: float
    """Stiffness at the frequency of the start."""
    newest: float
    """Stiffness now."""
    low: float
    """Lower end of the 95 % interval of the stiffness now, with reclamping and the uncertainty of the start."""
    high: float
    """Upper end."""

    @property
    def percent(self) -> float:
        """Change since the start (%)."""
        return 100 * (self.newest / self.start - 1)

    @property
    def half_width(self) -> float:
        """Half the width of the 95 % interval of the change (%)."""
        return 50 * (self.high - self.low) / self.start


def compare_bearings(series: SeriesHistory, machine: Machine) -> BearingChange | None:
    """Compare the bearing stiffness with that at the start, by the drop of the frequency.

    None where no two tests gave a bearing stiffness, or not the newest, or where one of the frequencies leaves it
    open or belongs to another model, or until a second clamping confirms the newest test.
    """
    trend = series.frequency.trend
    if trend is not None and trend.needs_repeat:
        return None
    stiffness, drop = series.values["bearing_stiffness"], series.drop
    if machine.spindle is None or drop.interval is None or len(stiffness.reference_rows) < 2:
        return None
    if not series.rows[-1].bearing_stiffness.is_known:
        return None
    start, drops = series.frequency.start.value, (0.0, drop.value, *reversed(drop.interval))
    found = [_calibrate_bearings(series.rows[-1].tool, start * (1 - percent / 100), machine) for percent in drops]
    values = [value for value in found if value is not None]
    return BearingChange(*values) if len(values) == len(found) else None


def _calibrate_bearings(tool: str, frequency: float, machine: Machine) -> float | None:
    """Return the bearing stiffness at a frequency; None if that leaves it open or belongs to another model."""
    try:
        found = calibrate(machine.model(tool), frequency, None, machine.mode.model_mode)
    except (ValueError, ArithmeticError):
        return None
    return None if found.is_open else found.bearing_stiffness


MAX_PRELOAD_RATIO = 2.0
"""Largest upper end of a stated preload over its lower end; chosen."""


def estimate_preload(series: SeriesHistory, machine: Machine) -> RemainingPreload | None:
    """Estimate the preload left in the bearings from the change of their stiffness; see dsm.remaining_preload.

    None until a change of the frequency is proven, where one of the calibrated bearings has rollers, or where the
    range is too wide to say anything.
    """
    trend = series.frequency.trend
    if machine.spindle is None or trend is None or not trend.is_change_proven:
        return None
    change = compare_bearings(series, machine)
    if change is None:
        return None
    calibrated = [bearing for bearing in machine.spindle.build().bearings if bearing.group]
    left = remaining_preload(calibrated, change.low / change.start, change.high / change.start)
    return None if left is None or left.high > MAX_PRELOAD_RATIO * left.low else left
