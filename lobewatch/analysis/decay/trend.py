"""What the tap tests of one tool and direction say together: points, alarm, where they started and where they go."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lobewatch.analysis.decay.change_point import Watch, calls_for_another, watch
from lobewatch.analysis.decay.forecast import ENOUGH, Forecast, forecast

TOGETHER = timedelta(hours=24)
"""Tap tests within so long are one point."""
MOST = 1000
"""The newest points, which alone are judged: the work grows with the square of their number."""
HORIZON_DAYS = 36 * 30.44
"""Nothing is foretold for later."""

Floats = NDArray[np.float64]


class Tapped(NamedTuple):
    """One value of a series."""

    time: datetime
    """Of the tap test."""
    value: float
    """What was found, positive."""
    error: float = math.nan
    """Standard error of the tap test (%)."""
    temperature: float = math.nan
    """Of the spindle (degC)."""


class Point(NamedTuple):
    """Tap tests of one day."""

    time: datetime
    """Of the first of them."""
    percent: float
    """100 ln of the value over that of the first tap test: mean, median from three on."""
    error: float
    """Standard error by the tap tests alone (%)."""
    temperature: float
    """Mean of those recorded (degC)."""
    taps: tuple[int, ...]
    """Which of the series."""


@dataclass(frozen=True, eq=False)
class Trend:
    """One series, judged."""

    points: tuple[Point, ...]
    """Oldest first; one at least."""
    first: float
    """The value that the percents are of: that of the first tap test."""
    watched: int
    """Point from which on it is watched: the first after the event that ended the last alarm."""
    watch: Watch
    """Of the points from there on."""
    rise: Watch
    """The same of the mirror image."""
    forecast: Forecast | None
    """Over days since 1970; None below 8 points."""
    today: int
    """Day since 1970 that it is judged on."""

    @property
    def start(self) -> float:
        """Where it started (%): the highest of the fitted line at the first 8 points, else of the first three points.

        A first test clamped badly must not hide a fall for ever, and a mean of the first ones would hide that of a
        spindle that falls from the beginning.
        """
        if self.forecast is not None:
            return float(self.forecast.fitted[:ENOUGH].max())
        return max(point.percent for point in self.points[:3])

    @property
    def is_stale(self) -> bool:
        """Whether today is farther from its last point than anything is foretold."""
        return self.forecast is not None and self.today > self.forecast.dates[-1]

    @property
    def spread(self) -> float:
        """Standard deviation from point to point around the fitted line (%); 0 while it is not known."""
        return 0.0 if self.forecast is None else self.forecast.spread

    @property
    def fallen_since(self) -> datetime | None:
        """When the fall began or happened that the alarm is about; None without alarm."""
        return None if self.watch.fall is None else self.points[self.watched + self.watch.fall.point].time


def trend_of(series: Sequence[Tapped], now: datetime, events: Sequence[datetime] = ()) -> Trend:
    """Judge a series, oldest first, one value at least; an event after an alarm ends that alarm.

    Foretold from the day of `now` on; the same for all of a day.
    """
    return _trend(tuple(series), int(day(now)), tuple(events))


@lru_cache(maxsize=1024)
def _trend(series: tuple[Tapped, ...], today: int, events: tuple[datetime, ...]) -> Trend:
    points = _points(series)[-MOST:]
    y = np.array([point.percent for point in points])
    warmth = np.array([point.temperature for point in points])
    watched = 0
    while True:
        found = watch(y[watched:], warmth[watched:])
        ended = [] if found.alarm_at is None else [at for at in events if at > points[watched + found.alarm_at].time]
        if not ended:
            break
        watched = sum(point.time < ended[0] for point in points)
    return Trend(
        tuple(points),
        series[0].value,
        watched,
        found,
        watch(-y[watched:], warmth[watched:]),
        _forecast(points, today),
        today,
    )


def _points(series: Sequence[Tapped]) -> list[Point]:
    """A tap test that was asked for by the one before it is a point of its own: it confirms or clears."""
    points: list[Point] = []
    for i, tapped in enumerate(series):
        same_day = bool(points) and tapped.time - points[-1].time < TOGETHER
        if same_day and not _calls_for_another(points[-MOST:]):
            points[-1] = _point(series, (*points[-1].taps, i))
        else:
            points.append(_point(series, (i,)))
    return points


def _calls_for_another(points: Sequence[Point]) -> bool:
    y, warmth = (np.array([getattr(point, name) for point in points]) for name in ("percent", "temperature"))
    return calls_for_another(y, warmth)


def _point(series: Sequence[Tapped], group: Sequence[int]) -> Point:
    percents = [100 * math.log(series[i].value / series[0].value) for i in group]
    middle = np.median(percents) if len(group) > 2 else np.mean(percents)
    error = math.sqrt(sum(series[i].error ** 2 for i in group)) / len(group)
    warm = [series[i].temperature for i in group if math.isfinite(series[i].temperature)]
    return Point(series[group[0]].time, float(middle), error, float(np.mean(warm)) if warm else math.nan, tuple(group))


def _forecast(points: Sequence[Point], today: int) -> Forecast | None:
    dates = np.array([day(point.time) for point in points])
    if dates.size < ENOUGH:
        return None
    y, warmth = (np.array([getattr(point, name) for point in points]) for name in ("percent", "temperature"))
    return forecast(dates, y, today + HORIZON_DAYS, warmth, today)


def day(time: datetime) -> float:
    """Days since 1970."""
    return time.timestamp() / 86400


def date(days: float) -> datetime:
    """Of so many days since 1970."""
    return datetime.fromtimestamp(86400 * days, UTC)
