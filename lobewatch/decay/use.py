"""Running hours as the time of a series: its past in days of use, its future in days."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

RECENT = 180.0
"""Days before the last point over which use goes on as it is now, two points at least; chosen."""

STANDSTILL = 1e-6
"""Days between two points that the spindle stood still between."""

Floats = NDArray[np.float64]


def days_of_use(days: Floats, hours: Floats) -> Floats:
    """Days (n,) at which the points would lie had the spindle always run as much a day as lately; the last one stays.

    days: increasing; hours: that it had run (h). The days themselves where hours are missing or go back, or where it
    has not run lately.
    """
    begin = max(min(int(np.searchsorted(days, days[-1] - RECENT)), days.size - 2), 0)
    lately = hours[-1] - hours[begin]
    if not np.isfinite(hours).all() or np.any(np.diff(hours) < 0) or lately <= 0:
        return days
    days_an_hour = (days[-1] - days[begin]) / lately
    return np.asarray(days[-1] - (hours[-1] - hours) * days_an_hour - STANDSTILL * np.arange(days.size)[::-1])
