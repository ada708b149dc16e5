"""The trend of one value of a series: its points, alarm, where they started and where they go."""

from __future__ import annotations

import math
from bisect import bisect
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lobewatch.decay.day_points import DAY, PercentSeries, Span, divide_into_points
from lobewatch.decay.detection import DetectedFall, Detection, detect
from lobewatch.decay.forecast import ENOUGH, Forecast, PastFit, Rate, fit_past
from lobewatch.decay.reach import NOBODY_KNOWS, Reach
from lobewatch.decay.readings import NOTHING_KNOWN, Readings, SeriesScatter
from lobewatch.decay.shapes import Shape
from lobewatch.decay.use import days_of_use

MOST = 1000
"""Number of newest points that alone are judged; chosen, as the work grows with its square."""
MONTH = 30.44
"""Mean length of a month (days)."""
HORIZON_DAYS = 36 * MONTH
"""Time after the last point (days) beyond which nothing is foretold; chosen."""
SETTLED = 0.4
"""Rate of a fall over its mean rate so far below which it has slowed down; chosen."""
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
    hours: float = math.nan
    """Running hours of the spindle (h)."""
    operator: str = ""
    """Who held the hammer."""
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
    hours: float
    """Running hours of the spindle at the first of them (h)."""
    operator: str
    """Who held the hammer for the first of them."""
    taps: tuple[int, ...]
    """Numbers of the tap tests in the series."""


@dataclass(frozen=True, eq=False)
class Trend:
    """One series, judged."""

    points: tuple[DayPoint, ...]
    """Points, oldest first; one at least."""
    first: float
    """Value that the percents are of: that of the first tap test."""
    readings: Readings
    """Percents of the points, and what is known of them."""
    past: PastFit | None
    """Shapes that it allows, over days of use, those behind the last point being days since 1970; None below 8
    points."""
    today: int
    """Day since 1970 that it is judged on."""

    def on(self, now: datetime) -> Trend:
        """This trend as judged on another day."""
        return replace(self, today=int(day(now)))

    @cached_property
    def detection(self) -> Detection:
        """What the watch over its points has seen."""
        return detect(self.readings)

    @cached_property
    def forecast(self) -> Forecast | None:
        """Forecast over days since 1970; None below 8 points."""
        return None if self.past is None else self.past.ahead(float(self.past.dates[-1]) + HORIZON_DAYS)

    @cached_property
    def course(self) -> Shape | None:
        """The shape that fits it best, its start in days since 1970; None below 8 points."""
        if self.past is None or self.forecast is None:
            return None
        shape = self.forecast.likeliest
        return shape._replace(start=float(np.interp(shape.start, self.past.dates, days_of(self.points))))

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
    def is_settling(self) -> bool:
        """Whether the open fall began among the first points and has slowed down since, as new bearings run in."""
        if self.past is None or self.open_fall is None or self.open_fall.fall.point >= ENOUGH:
            return False
        fallen = self.start - float(self.past.fitted[-1])
        mean = fallen / float(self.past.dates[-1] - self.past.dates[0])
        return -self.past.rate.value < SETTLED * mean

    @property
    def fallen_since(self) -> datetime | None:
        """Time at which the fall began or happened that the alarm is about; None without alarm."""
        return None if self.open_fall is None else self.points[self.open_fall.fall.point].time


def trend_of(
    series: Sequence[TapValue],
    now: datetime,
    other: Sequence[TapValue] = (),
    known: SeriesScatter = NOTHING_KNOWN,
) -> Trend:
    """Judge a series, oldest first, one value at least.

    now: its day tells whether that is too long ago to foretell anything; other: of the other direction, likewise;
    known: what is known of its scatter beforehand.
    """
    points = _newest_points(series)
    readings = _readings(points, _newest_points(other) if other else (), known)
    return Trend(points, series[0].value, readings, _past(points, readings), int(day(now)))


def _newest_points(series: Sequence[TapValue]) -> tuple[DayPoint, ...]:
    """The newest points of a series, oldest first."""
    times, values, _, temperatures, _, _, reclamped = zip(*series, strict=True)
    percents = PercentSeries(times, _percents(values), temperatures, reclamped)
    return tuple(_point(percents, series, span) for span in [*divide_into_points(percents)][-MOST:])


def _point(percents: PercentSeries, series: Sequence[TapValue], span: Span) -> DayPoint:
    first, end = span
    error = math.sqrt(sum(tap.error**2 for tap in series[first:end])) / (end - first)
    changed, warm = percents.percent(span), percents.temperature(span)
    begun = series[first]
    return DayPoint(begun.time, changed, error, warm, begun.hours, begun.operator, tuple(range(first, end)))


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


def _past(points: Sequence[DayPoint], readings: Readings) -> PastFit | None:
    if len(points) < ENOUGH:
        return None
    return fit_past(days_of_use(days_of(points), np.array([point.hours for point in points])), readings)


def _readings(points: Sequence[DayPoint], others: Sequence[DayPoint], known: SeriesScatter) -> Readings:
    percents, temperatures = ([getattr(point, name) for point in points] for name in ("percent", "temperature"))
    operators, other = tuple(point.operator for point in points), np.array([*_beside(points, others)])
    return Readings(np.array(percents), np.array(temperatures), operators, other, known)


def _beside(points: Sequence[DayPoint], others: Sequence[DayPoint]) -> Iterator[float]:
    """Percent of the other direction nearest in time to each point, NaN where there is none within a day."""
    times = [other.time for other in others]
    for point in points:
        at = bisect(times, point.time)
        near = min(others[max(at - 1, 0) : at + 1], key=lambda other: abs(other.time - point.time), default=None)
        yield near.percent if near is not None and abs(near.time - point.time) < DAY else math.nan


def days_of(points: Sequence[DayPoint]) -> Floats:
    """Days since 1970, shape (n,)."""
    return np.array([point.time.timestamp() for point in points]) / 86400


def day(time: datetime) -> float:
    """Days since 1970."""
    return time.timestamp() / 86400


def date(days: float) -> datetime:
    """Date of so many days since 1970."""
    return datetime.fromtimestamp(86400 * days, UTC)
