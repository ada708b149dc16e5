"""The trend of one value of a series: its points, alarm, where they started and where they go."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lobewatch.decay.day_points import PercentSeries, Span, divide_into_points
from lobewatch.decay.detection import DetectedFall, Detection, detect
from lobewatch.decay.forecast import ENOUGH, Forecast, PastFit, Rate, fit_past
from lobewatch.decay.reach import NOBODY_KNOWS, Reach

MOST = 1000
"""Number of newest points that alone are judged; chosen, as the work grows with its square."""
MONTH = 30.44
"""Mean length of a month (days)."""
HORIZON_DAYS = 36 * MONTH
"""Time after the last point (days) beyond which nothing is foretold; chosen."""
STARTERS = 3
"""Points that the start of a series is looked for in while it has no fitted line; chosen."""

Floats = NDArray[np.float64]


class TapValue(NamedTuple):
    """One value of a series, from one tap test."""

    time: datetime
    """Time of the tap test."""
    value: float
    """Value, positive."""
    error: float = math.nan
    """Standard error of the value (%)."""
    temperature: float = math.nan
    """Temperature of the spindle (degC)."""
    reclamped: bool = False
    """Whether the tool was clamped anew for it."""


class DayPoint(NamedTuple):
    """The tap tests of one clamping together."""

    time: datetime
    """Time of the first of them."""
    percent: float
    """Change, 100 ln of the value over that of the first tap test of the series: mean, median from three on."""
    error: float
    """Standard error by the tap tests alone (%)."""
    temperature: float
    """Mean of the temperatures recorded (degC)."""
    taps: tuple[int, ...]
    """Numbers of the tap tests in the series."""


@dataclass(frozen=True, eq=False)
class Trend:
    """One series, judged."""

    points: tuple[DayPoint, ...]
    """Points, oldest first; one at least."""
    first: float
    """Value that the percents are of: that of the first tap test."""
    past: PastFit | None
    """Shapes that it allows, over days since 1970; None below 8 points."""
    today: int
    """Day since 1970 that it is judged on."""

    def on(self, now: datetime) -> Trend:
        """This trend as judged on another day."""
        return replace(self, today=int(day(now)))

    @cached_property
    def detection(self) -> Detection:
        """What the watch over its points has seen."""
        return detect(*_values_of(self.points))

    @cached_property
    def forecast(self) -> Forecast | None:
        """Forecast over days since 1970; None below 8 points."""
        return None if self.past is None else self.past.ahead(float(self.past.dates[-1]) + HORIZON_DAYS)

    @property
    def start(self) -> float:
        """Its start (%): the highest of the fitted line at the first 8 points, else of the first three points.

        A first test clamped badly must not hide a fall for ever, and a mean of the first ones would hide that of a
        spindle that falls from the beginning.
        """
        if self.past is not None:
            return float(self.past.fitted[:ENOUGH].max())
        return max(point.percent for point in self.points[:STARTERS])

    @property
    def is_stale(self) -> bool:
        """Whether today is farther from its last point than anything is foretold."""
        return self.forecast is not None and self.today > self.forecast.dates[-1]

    @property
    def can_be_foretold(self) -> bool:
        """Whether it is long enough, and young enough."""
        return self.past is not None and not self.is_stale

    def reach(self, percent: float, error: float = 0.0) -> Reach:
        """When it falls to a level: 100 ln of the frequency there over that of its first test; error: of that."""
        if self.forecast is None or self.is_stale:
            return NOBODY_KNOWS
        dates = self.forecast.reached(percent, error)
        first, last = (float(day) for day in self.forecast.dates[[0, -1]])
        earliest, probable, latest = (None if day == math.inf else max(day, first) for day in dates)
        return Reach(False, earliest, probable, latest, last)

    @property
    def spread(self) -> float:
        """Standard deviation from point to point around the fitted line (%); 0 while it is not known."""
        return 0.0 if self.past is None else self.past.spread

    @property
    def rate(self) -> Rate | None:
        """Change in % a month now, with its 95 % interval; None below 8 points."""
        return None if self.past is None else Rate(*(MONTH * rate for rate in self.past.rate))

    @property
    def open_fall(self) -> DetectedFall | None:
        """The newest fall whose alarm is open; None without alarm."""
        return next(reversed(self.detection.open_falls), None)

    @property
    def fallen_since(self) -> datetime | None:
        """Time at which the fall began or happened that the alarm is about; None without alarm."""
        return None if self.open_fall is None else self.points[self.open_fall.fall.point].time


def trend_of(series: Sequence[TapValue], now: datetime) -> Trend:
    """Judge a series, oldest first, one value at least.

    now: its day tells whether that is too long ago to foretell anything.
    """
    points = _newest_points(series)
    return Trend(points, series[0].value, _past(points), int(day(now)))


def _newest_points(series: Sequence[TapValue]) -> tuple[DayPoint, ...]:
    """The newest points of a series, oldest first."""
    times, values, errors, temperatures, reclamped = zip(*series, strict=True)
    percents = PercentSeries(times, _percents(values), temperatures, reclamped)
    return tuple(_point(percents, errors, span) for span in [*divide_into_points(percents)][-MOST:])


def _point(series: PercentSeries, errors: Sequence[float], span: Span) -> DayPoint:
    first, end = span
    time = series.times[first]
    if end - first == 1:
        return DayPoint(time, series.percents[first], errors[first], series.temperatures[first], (first,))
    error = math.sqrt(sum(error**2 for error in errors[first:end])) / (end - first)
    return DayPoint(time, series.percent(span), error, series.temperature(span), tuple(range(first, end)))


def newest_percents(
    times: Sequence[datetime], values: Sequence[float], reclamped: Sequence[bool]
) -> tuple[list[datetime], list[float]]:
    """Time and percent of the newest points of a series whose temperatures do not count, oldest first."""
    series = PercentSeries(tuple(times), _percents(values), (math.nan,) * len(times), tuple(reclamped))
    spans = [*divide_into_points(series)][-MOST:] if times else []
    return [times[first] for first, _ in spans], [series.percent(span) for span in spans]


def _percents(values: Sequence[float]) -> tuple[float, ...]:
    """Changes of values, 100 ln of each over the first."""
    log, first = math.log, values[0] if values else 1.0
    return tuple([100 * log(value / first) for value in values])


def _past(points: Sequence[DayPoint]) -> PastFit | None:
    if len(points) < ENOUGH:
        return None
    return fit_past(days_of(points), *_values_of(points))


def _values_of(points: Sequence[DayPoint]) -> tuple[Floats, Floats]:
    """Percents and temperatures of points, shape (n,) each."""
    percents, temperatures = ([getattr(point, name) for point in points] for name in ("percent", "temperature"))
    return np.array(percents), np.array(temperatures)


def days_of(points: Sequence[DayPoint]) -> Floats:
    """Days since 1970, shape (n,)."""
    return np.array([point.time.timestamp() for point in points]) / 86400


def day(time: datetime) -> float:
    """Days since 1970."""
    return time.timestamp() / 86400


def date(days: float) -> datetime:
    """Date of so many days since 1970."""
    return datetime.fromtimestamp(86400 * days, UTC)
