"""Points of a series that stand alone: a clamping that went wrong, a reading of heavy-tailed scatter."""

from __future__ import annotations

from bisect import insort
from math import copysign, sqrt
from statistics import median

import numpy as np
from numpy.typing import NDArray

BEFORE = 7
"""Points before it that one is held against; chosen."""
FEWEST = 3
"""Points before it below which none is said to stand alone; chosen."""
FARTHEST = 3.0
"""Scatters that a point may be away from those before it; one that stands alone is drawn in to there; chosen."""
CONFIRMED = 0.7
"""Share of its distance that the next point is away, too, where it does not stand alone; chosen."""
MAD = 1.4826
"""Standard deviation of normal scatter over its median absolute deviation."""

Floats = NDArray[np.float64]


def drawn_in(y: Floats) -> Floats:
    """A series (n,) with the points that stand alone drawn in to 3 scatters from those before them.

    What a point becomes follows from those until the one after it, so that the last one is as it was measured.
    """
    values: list[float] = y.tolist()
    steps: list[float] = []
    for i in range(1, len(values) - 1):
        if i >= FEWEST:
            middle = median(values[max(i - BEFORE, 0) : i])
            away, after = values[i] - middle, values[i + 1] - middle
            limit = FARTHEST * MAD / sqrt(2) * steps[len(steps) // 2]
            if abs(away) > limit and after / away < CONFIRMED:
                values[i] = middle + copysign(limit, away)
        insort(steps, abs(y[i] - y[i - 1]))
    return np.array(values)
