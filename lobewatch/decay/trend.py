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

from lobewatch.decay.change_point import Watch, watch_both
from lobewatch.decay.day_points import PercentSeries, Span, divide_into_points
from lobewatch.decay.forecast import ENOUGH, Forecast, PastFit, Rate, fit_past

MOST = 1000
"""Number of newest points that alone are judged; chosen, as the work grows with its square."""
MONTH = 30.44
"""Mean length of a month (days)."""
HORIZON_DAYS = 36 * MONTH
"""Time ahead (days) beyond which nothing is foretold; chosen."""
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


class DayPoint(NamedTuple):
    """The tap tests of one day together."""

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
    events: tuple[datetime, ...] = ()
    """Times of events; one after an alarm ends that alarm."""

    @property
    def watched(self) -> int:
        """Point from which on it is watched: the first after the event that ended the last alarm."""
        return self._judged[0]

    @property
    def watch(self) -> Watch:
        """Watch over the points from there on, for a fall."""
        return self._judged[1]

    @property
    def rise(self) -> Watch:
        """Watch over the points from there on, for a rise."""
        return self._judged[2]

    def on(self, now: datetime, events: Sequence[datetime]) -> Trend:
        """This trend as judged on another day and with other events."""
        return replace(self, today=int(day(now)), events=tuple(events))

    @cached_property
    def _judged(self) -> tuple[int, Watch, Watch]:
        points, watched = self.points, 0
        y, warmth = (np.array([getattr(point, name) for point in points]) for name in ("percent", "temperature"))
        while True:
            fall, rise = watch_both(y[watched:], warmth[watched:])
            at = None if fall.alarm_at is None else points[watched + fall.alarm_at].time
            ended = [] if at is None else [event for event in self.events if event > at]
            if not ended:
                return watched, fall, rise
            watched = sum(point.time < ended[0] for point in points)

    @cached_property
    def forecast(self) -> Forecast | None:
        """Forecast over days since 1970; None below 8 points."""
        return None if self.past is None else self.past.ahead(self.today + HORIZON_DAYS, self.today)

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
    def spread(self) -> float:
        """Standard deviation from point to point around the fitted line (%); 0 while it is not known."""
        return 0.0 if self.past is None else self.past.spread

    @property
    def rate(self) -> Rate | None:
        """Change in % a month now, with its 95 % interval; None below 8 points."""
        return None if self.past is None else Rate(*(MONTH * rate for rate in self.past.rate))

    @property
    def fallen_since(self) -> datetime | None:
        """Time at which the fall began or happened that the alarm is about; None without alarm."""
        return None if self.watch.fall is None else self.points[self.watched + self.watch.fall.point].time


def trend_of(series: Sequence[TapValue], now: datetime, events: Sequence[datetime] = ()) -> Trend:
    """Judge a series, oldest first, one value at least; an event after an alarm ends that alarm.

    now: the forecast begins with its day, and is the same for all of it.
    """
    points = _newest_points(series)
    return Trend(points, series[0].value, _past(points), int(day(now)), tuple(events))


def _newest_points(series: Sequence[TapValue]) -> tuple[DayPoint, ...]:
    """The newest points of a series, oldest first."""
    times, values, errors, temperatures = zip(*series, strict=True)
    percents = PercentSeries(times, _percents(values), temperatures)
    return tuple(_point(percents, errors, span) for span in divide_into_points(percents, MOST)[-MOST:])


def _point(series: PercentSeries, errors: Sequence[float], span: Span) -> DayPoint:
    first, end = span
    time = series.times[first]
    if end - first == 1:
        return DayPoint(time, series.percents[first], errors[first], series.temperatures[first], (first,))
    error = math.sqrt(sum(error**2 for error in errors[first:end])) / (end - first)
    return DayPoint(time, series.percent(span), error, series.temperature(span), tuple(range(first, end)))


def newest_percents(times: Sequence[datetime], values: Sequence[float]) -> tuple[list[datetime], list[float]]:
    """Time and percent of the newest points of a series whose temperatures do not count, oldest first."""
    series = PercentSeries(tuple(times), _percents(values), (math.nan,) * len(times))
    spans = divide_into_points(series, MOST)[-MOST:] if times else ()
    return [times[first] for first, _ in spans], [series.percent(span) for span in spans]


def _percents(values: Sequence[float]) -> tuple[float, ...]:
    """Changes of values, 100 ln of each over the first."""
    log, first = math.log, values[0] if values else 1.0
    return tuple([100 * log(value / first) for value in values])


def _past(points: Sequence[DayPoint]) -> PastFit | None:
    if len(points) < ENOUGH:
        return None
    y, warmth = (np.array([getattr(point, name) for point in points]) for name in ("percent", "temperature"))
    return fit_past(days_of(points), y, warmth)


def days_of(points: Sequence[DayPoint]) -> Floats:
    """Days since 1970, shape (n,)."""
    return np.array([point.time.timestamp() for point in points]) / 86400


def day(time: datetime) -> float:
    """Days since 1970."""
    return time.timestamp() / 86400


def date(days: float) -> datetime:
    """Date of so many days since 1970."""
    return datetime.fromtimestamp(86400 * days, UTC)
