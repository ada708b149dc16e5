"""The fitted line of a series and what it may become, as values over days."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lobewatch.decay.trend import Trend, days_of

AHEAD = 0.5
"""Of the length of the series, that is drawn beyond it."""

Floats = NDArray[np.float64]


class TrendCurve(NamedTuple):
    """Values in the unit of the series."""

    days: Floats
    """Since 1970, from the first point on, shape (n,)."""
    line: Floats
    """Of the mixture, shape (n,)."""
    days_ahead: Floats
    """From today on, shape (m,)."""
    low: Floats
    """Below it with a chance of 10 %, shape (m,)."""
    high: Floats
    """Above it with a chance of 10 %, shape (m,)."""


def course_of(trend: Trend) -> TrendCurve | None:
    """None below 8 points."""
    found = trend.forecast
    if found is None:
        return None
    past = days_of(trend.points)
    near = found.dates <= max(past[-1] + AHEAD * (past[-1] - past[0]), found.dates[1])
    low, high = (trend.first * np.exp(found.fan(quantile)[near] / 100) for quantile in (0.1, 0.9))
    line = np.append(found.fitted, found.line[near])
    return TrendCurve(
        np.append(past, found.dates[near]), trend.first * np.exp(line / 100), found.dates[near], low, high
    )
