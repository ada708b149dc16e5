"""Trend of one value of a series: points, start, alarm and forecast."""

import math
from bisect import bisect
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import cached_property
from statistics import median
from typing import NamedTuple

import numpy as np

from lobewatch.arrays import Floats
from lobewatch.monitoring.change_detection import DetectedDrop, Detection, detect_changes
from lobewatch.monitoring.forecast import MIN_FORECAST_POINTS, Forecast, PastFit, Rate
from lobewatch.monitoring.level_model import build_level_model
from lobewatch.monitoring.newest_point import fit_confirmed_past, measure_newest_distance
from lobewatch.monitoring.scatter_check import ScatterCheck, check_scatter
from lobewatch.monitoring.series_drop import DropModel, SeriesDrop, model_drop
from lobewatch.monitoring.series_points import (
    MAX_OUTLIER_DISTANCE,
    NO_SERIES_PRIOR,
    Readings,
    SeriesScatterPrior,
    days_of_use,
)
from lobewatch.monitoring.threshold_dates import NO_FORECAST, ThresholdDates
from lobewatch.monitoring.trend_shapes import TrendShape

SAME_CLAMPING_TIME = timedelta(hours=24)
"""Time within which tap tests share a clamping unless recorded otherwise; chosen."""
MAX_TREND_POINTS = 1000
"""Number of newest points that are evaluated, as the work grows with its square; chosen."""
DAYS_PER_MONTH = 30.44
"""Mean length of a month (days)."""
FORECAST_HORIZON_DAYS = 36 * DAYS_PER_MONTH
"""Longest forecast after the last point (days); chosen."""
MAX_STEADY_WEIGHT = 0.05
"""Largest weight of a steady series with which a shape is stated; chosen."""
MAX_RUN_IN_RATE = 0.4
"""Present rate of a drop over its mean rate, below which it has slowed down; chosen."""


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
    """Operator with the hammer."""
    reclamped: bool = False
    """True if the tool was reclamped for the test."""


class TrendPoint(NamedTuple):
    """Tap tests of one clamping together."""

    time: datetime
    """Time of the first test."""
    percent: float
    """Change as 100 ln of the value over that of the first tap test of the series: mean, or median of three or more."""
    error: float
    """Standard error from the tap tests only (%)."""
    temperature: float
    """Mean of the recorded temperatures (degC)."""
    hours: float
    """Running hours of the spindle at the first test (h)."""
    operator: str
    """Operator of the first test."""
    taps: tuple[int, ...]
    """Indices of the tap tests in the series."""


@dataclass(frozen=True, eq=False)
class Trend:
    """Evaluated series."""

    points: tuple[TrendPoint, ...]
    """Points, oldest first, at least one."""
    first_value: float
    """Reference of the percentages, the value of the first tap test."""
    readings: Readings
    """Percentages of the points, with temperatures, operators and prior."""
    past_fit: PastFit | None
    """Fitted shapes over days of use, those after the last point being days since 1970; None below 8 points.

    A newest point that nothing confirms yet is left out."""
    today: int
    """Day of the evaluation (days since 1970)."""

    def at_day(self, now: datetime) -> "Trend":
        """Return this trend as of another day."""
        return replace(self, today=int(days_since_epoch(now)))

    @cached_property
    def detection(self) -> Detection:
        """Changes detected by the monitor."""
        return detect_changes(self.readings)

    @property
    def needs_repeat(self) -> bool:
        """True if only the newest point shows a drop."""
        is_low = self.newest_distance < -MAX_OUTLIER_DISTANCE
        return self.detection.needs_repeat or (is_low and self.open_drop is None)

    @property
    def is_newest_high(self) -> bool:
        """True if only the newest point shows a rise."""
        return self.newest_distance > MAX_OUTLIER_DISTANCE and self.open_drop is None

    @cached_property
    def newest_distance(self) -> float:
        """Distance of the newest point from earlier ones, see `measure_newest_distance`."""
        return measure_newest_distance(build_level_model(self.readings).y)

    @cached_property
    def forecast(self) -> Forecast | None:
        """Forecast over days since 1970; None below 8 points."""
        past = self.past_fit
        return None if past is None else past.forecast(float(past.dates[-1]) + FORECAST_HORIZON_DAYS)

    @cached_property
    def likeliest_shape(self) -> TrendShape | None:
        """Likeliest shape, its start in days since 1970; None below 8 points."""
        if self.past_fit is None or self.forecast is None:
            return None
        shape = self.forecast.likeliest
        return shape._replace(start=float(np.interp(shape.start, self.past_fit.dates, point_days(self.points))))

    @cached_property
    def drop_model(self) -> DropModel:
        """Start and scatter of the series, by which each value becomes a drop."""
        return model_drop(self.readings, np.array([point.error for point in self.points]), self.past_fit)

    @property
    def start(self) -> float:
        """Start (%): the highest of the fitted line at the first 8 points, else of the first three points."""
        return self.drop_model.start

    @cached_property
    def drops(self) -> Floats:
        """Drop of each point since the start (%), at the mean conditions, shape (n,)."""
        model = self.drop_model
        return np.array([model.percent_below_start(it.percent, it.temperature, it.operator) for it in self.points])

    def drop_at(self, point: int) -> SeriesDrop:
        """Return the drop of a point with its interval; point: its index."""
        it = self.points[point]
        return self.drop_model.drop_at(float(self.drops[point]), it.temperature, it.operator, it.error)

    @property
    def is_drop_proven(self) -> bool:
        """True if the last two points both prove a drop, or both a rise."""
        last = [self.drop_at(point) for point in range(max(len(self.points) - 2, 0), len(self.points))]
        return len(last) > 1 and all(one.is_proven and one.value * last[-1].value > 0 for one in last)

    @property
    def is_change_proven(self) -> bool:
        """True if the value has changed for certain: an open alarm, a rise, or two points that prove a drop."""
        return bool(self.open_drop or self.detection.rise or self.is_drop_proven)

    @property
    def has_certain_shape(self) -> bool:
        """True if a steady series has a weight of at most 5 %, so that a shape and its beginning can be stated."""
        past = self.past_fit
        if past is None:
            return False
        kinds = np.array([shape.kind for family in past.families for shape in family.shapes])
        return float(past.weight[kinds == "none"].sum()) <= MAX_STEADY_WEIGHT

    @cached_property
    def scatter_check(self) -> ScatterCheck | None:
        """Check of the scatter for independence; None below 20 points."""
        has_changed = bool(self.detection.drops) or self.detection.rise is not None
        return check_scatter(100 * np.log1p(-self.drops / 100), self.past_fit, has_changed=has_changed)

    @property
    def is_stale(self) -> bool:
        """True if today is beyond any forecast after the last point."""
        return self.forecast is not None and self.today > self.forecast.dates[-1]

    @property
    def has_forecast(self) -> bool:
        """True if the series is long and recent enough."""
        return self.past_fit is not None and not self.is_stale

    def forecast_level(self, percent: float, error: float = 0.0) -> ThresholdDates:
        """Forecast when a level is reached: 100 ln of the frequency over that of its first test, with its error."""
        if self.forecast is None or self.is_stale:
            return NO_FORECAST
        dates = self.forecast.crossing_dates(percent, error)
        first, last = (float(day) for day in self.forecast.dates[[0, -1]])
        earliest, probable, latest = (None if day == math.inf else max(day, first) for day in dates)
        return ThresholdDates(False, earliest, probable, latest, last)

    @property
    def spread(self) -> float:
        """Standard deviation from point to point around the fitted line (%); 0 if unknown."""
        return 0.0 if self.past_fit is None else self.past_fit.spread

    @property
    def rate(self) -> Rate | None:
        """Present change (% per month) with its 95 % interval; None below 8 points."""
        return None if self.past_fit is None else Rate(*(DAYS_PER_MONTH * rate for rate in self.past_fit.rate))

    @cached_property
    def open_drop(self) -> DetectedDrop | None:
        """Newest drop with an open alarm; None without alarm. A newest point that nothing confirms does not count."""
        drop = next(reversed(self.detection.open_drops), None)
        if drop is None or self.past_fit is None or self.past_fit.n_fitted == len(self.points):
            return drop
        return replace(drop, readings=drop.readings.until(drop.readings.y.size - 1))

    @property
    def is_run_in(self) -> bool:
        """True if the open drop began among the first points and has slowed down, as of bearings that run in.

        A sudden drop does not: it is over at once.
        """
        if self.past_fit is None or self.open_drop is None or self.open_drop.change.point >= MIN_FORECAST_POINTS:
            return False
        if self.open_drop.change.kind in ("step", "mixed"):
            return False
        mean = (self.start - float(self.past_fit.fitted[-1])) / float(self.past_fit.dates[-1] - self.past_fit.dates[0])
        return -self.past_fit.rate.value < MAX_RUN_IN_RATE * mean

    @property
    def drop_since(self) -> datetime | None:
        """Time at which the drop of the alarm began or happened; None without alarm."""
        return None if self.open_drop is None else self.points[self.open_drop.change.point].time


def fit_trend(
    taps: Sequence[TapValue], now: datetime, other: Sequence[TapValue] = (), known: SeriesScatterPrior = NO_SERIES_PRIOR
) -> Trend:
    """Fit the trend of a series of taps, oldest first, with at least one value.

    now: its day decides if the last point is too old for a forecast; other: taps of the other direction; known: prior
    of the scatter.
    """
    points = list_newest_points(taps)
    percents, warmth = (np.array([getattr(point, name) for point in points]) for name in ("percent", "temperature"))
    others = np.array([*_other_percents(points, list_newest_points(other))])
    days = days_of_use(point_days(points), np.array([point.hours for point in points]))
    readings = Readings(percents, warmth, tuple(point.operator for point in points), others, known, days)
    return Trend(points, taps[0].value, readings, fit_confirmed_past(days, readings), int(days_since_epoch(now)))


def list_newest_points(taps: Sequence[TapValue]) -> tuple[TrendPoint, ...]:
    """List the newest points of a series, oldest first."""
    percents = [100 * math.log(tap.value / taps[0].value) for tap in taps]
    spans = [*_divide_into_points(taps)][-MAX_TREND_POINTS:]
    return tuple(_build_point(taps[first:end], percents[first:end], first) for first, end in spans)


def _divide_into_points(taps: Sequence[TapValue]) -> Iterator[tuple[int, int]]:
    """Divide the tap tests of a series into points: indices of the first test of each, and after its last."""
    first = 0
    for end, tap in enumerate(taps):
        if end and (tap.reclamped or tap.time - taps[first].time >= SAME_CLAMPING_TIME):
            yield first, end
            first = end
    if taps:
        yield first, len(taps)


def _build_point(taps: Sequence[TapValue], percents: Sequence[float], first: int) -> TrendPoint:
    error = math.sqrt(sum(tap.error**2 for tap in taps)) / len(taps)
    changed = median(percents) if len(taps) > 2 else (percents[0] + percents[-1]) / 2
    recorded = [tap.temperature for tap in taps if not math.isnan(tap.temperature)]
    warm, numbers = sum(recorded) / len(recorded) if recorded else math.nan, tuple(range(first, first + len(taps)))
    return TrendPoint(taps[0].time, changed, error, warm, taps[0].hours, taps[0].operator, numbers)


def _other_percents(points: Sequence[TrendPoint], others: Sequence[TrendPoint]) -> Iterator[float]:
    """Yield the percent of the other direction within a day of each point, else NaN."""
    times = [other.time for other in others]
    for point in points:
        at = bisect(times, point.time)
        near = min(others[max(at - 1, 0) : at + 1], key=lambda other: abs(other.time - point.time), default=None)
        yield near.percent if near is not None and abs(near.time - point.time) < SAME_CLAMPING_TIME else math.nan


def point_days(points: Sequence[TrendPoint]) -> Floats:
    """Return the days since 1970 of points, shape (n,)."""
    return np.array([point.time.timestamp() for point in points]) / 86400


def days_since_epoch(time: datetime) -> float:
    """Return the days since 1970."""
    return time.timestamp() / 86400
