"""What a demo foretells, beside what its spindle would have done."""

from __future__ import annotations

import math
from datetime import datetime, timedelta
from typing import NamedTuple

from lobewatch.decay.forecast import DateRange
from lobewatch.decay.trend import MONTH, Trend, day
from lobewatch.logbook import Logbook
from lobewatch.logbook.outlook import outlook
from lobewatch.tap.stories.story import Wear

FARTHER = 0.02
"""Fall of the frequency from where it is, that is foretold."""


class Foretold(NamedTuple):
    """One level, foretold after the last test."""

    what: str
    """Which."""
    reached: DateRange | None
    """When it is reached, in days since 1970; None where nothing can be foretold."""
    horizon: float
    """Up to which was looked (days since 1970); NaN where nothing can be foretold."""
    truth: float | None
    """When the emulated spindle, without scatter, is there (days since 1970); None where it never is."""


def foretold(logbook: Logbook, wear: Wear) -> list[Foretold]:
    """After the last test: a fall of so much more in x, and each program that will not be stable."""
    last = logbook.history.rows[-1].time
    found = outlook(logbook, last)
    x = next((one for one in found.standing.series if one.direction == "x"), None)
    if x is None or x.trend is None:
        return []
    level = x.trend.points[-1].percent if x.trend.forecast is None else float(x.trend.forecast.fitted[-1])
    told = [
        _foretold(
            f"f_1 in x {100 * FARTHER:g} % lower than now", x.trend, level + 100 * math.log1p(-FARTHER), wear, last
        )
    ]
    for name, fate in found.programs.items():
        fall = fate.critical.not_stable
        if 0 < fall < math.inf and fate.not_stable is not None:
            own = x.trend.points[-1].percent + 100 * math.log1p(-fall)
            one = _foretold(f"{name} not stable", x.trend, own, wear, last)
            told.append(one._replace(reached=fate.not_stable))
    return told


def _foretold(what: str, trend: Trend, level: float, wear: Wear, last: datetime) -> Foretold:
    month = wear.month_of(trend.first * math.exp(level / 100))
    at = None if month is None else day(last + timedelta(days=MONTH * (month - wear.months + 1)))
    if trend.forecast is None:
        return Foretold(what, None, math.nan, at)
    return Foretold(what, trend.forecast.reached(level), float(trend.forecast.dates[-1]), at)
