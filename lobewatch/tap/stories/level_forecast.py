"""Levels that a demo foretells, beside the truth: what its spindle would have done."""

from __future__ import annotations

import math
from datetime import datetime, timedelta
from typing import NamedTuple

from lobewatch.decay.reach import Reach
from lobewatch.decay.trend import MONTH, Trend, day
from lobewatch.logbook import Logbook
from lobewatch.logbook.outlook import outlook
from lobewatch.tap.stories.story import Wear

FARTHER = 0.02
"""Fall of the frequency from where it is, that is foretold, as a share; chosen."""


class LevelForecast(NamedTuple):
    """One level, foretold after the last test."""

    level: str
    """Level for people."""
    reached: Reach
    """When it is reached."""
    truth: float | None
    """Date at which the emulated spindle, without scatter, is there (days since 1970); None where it never is."""


def forecast_levels(logbook: Logbook, wear: Wear) -> list[LevelForecast]:
    """Forecasts after the last test: a fall of so much more in x, and each program that will not be stable."""
    last = logbook.history.rows[-1].time
    prospect = outlook(logbook, last)
    x = next((series for series in prospect.standing.series if series.direction == "x"), None)
    if x is None or x.trend is None:
        return []
    percent = x.trend.points[-1].percent if x.trend.forecast is None else float(x.trend.forecast.fitted[-1])
    title = f"f_1 in x {100 * FARTHER:g} % lower than now"
    forecasts = [_forecast(title, x.trend, percent + 100 * math.log1p(-FARTHER), wear, last)]
    for name, critical in prospect.critical.items():
        reached = prospect.programs[name].not_stable
        if 0 < critical.not_stable < math.inf and reached.is_known:
            percent = x.trend.points[-1].percent + 100 * math.log1p(-critical.not_stable)
            forecasts.append(_forecast(f"{name} not stable", x.trend, percent, wear, last)._replace(reached=reached))
    return forecasts


def _forecast(level: str, trend: Trend, percent: float, wear: Wear, last: datetime) -> LevelForecast:
    """Dates at which a series falls to a level, foretold and true; percent: 100 ln(f/f_first) there."""
    month = wear.month_of(trend.first * math.exp(percent / 100))
    truth = None if month is None else day(last + timedelta(days=MONTH * (month - wear.months + 1)))
    return LevelForecast(level, trend.reach(percent), truth)
