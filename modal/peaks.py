"""Peaks of a curve, as scipy.signal finds them, which takes longer to import than to find them a thousand times."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def peaks(values: Floats) -> NDArray[np.intp]:
    """Places in values (n,) that are higher than what stands on both sides, of level ones the middle, rising."""
    ends = np.append(np.flatnonzero(values[1:] != values[:-1]), values.size - 1)
    starts = np.append(0, ends[:-1] + 1)
    level = values[starts]
    rises = level[1:] > level[:-1]
    top = np.flatnonzero(rises[:-1] & ~rises[1:]) + 1
    return np.asarray((starts[top] + ends[top]) // 2)


def prominences(values: Floats, tops: NDArray[np.intp]) -> Floats:
    """Height of each of the places over the higher one of the lowest points that part it from higher ones, (k,)."""
    found = np.empty(tops.size)
    for k, top in enumerate(tops.tolist()):
        higher = values > values[top]
        before, after = np.flatnonzero(higher[:top]), np.flatnonzero(higher[top:])
        left = np.min(values[before[-1] + 1 if before.size else 0 : top + 1])
        right = np.min(values[top : top + after[0] if after.size else None])
        found[k] = values[top] - max(left, right)
    return found
