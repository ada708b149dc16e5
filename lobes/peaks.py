"""Peaks of a curve, as scipy.signal.find_peaks finds them, which takes longer to import than all of lobes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def peaks(values: NDArray[np.float64], prominence: float) -> NDArray[np.intp]:
    """Places of the peaks of a curve (n,), n > 0, of at least this prominence; of a flat top the middle, rounded down.

    The prominence of a peak is its height above the higher of the two lowest points between it and whatever is higher
    on either side, or the end. The ends of the curve are no peaks.
    """
    starts = np.concatenate(([0], np.flatnonzero(np.diff(values)) + 1))
    ends = np.concatenate((starts[1:], [values.size])) - 1
    height = values[starts]
    tops = map(int, np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] > height[2:])) + 1)
    kept = [top for top in tops if height[top] - max(_foot(height, top, -1), _foot(height, top, 1)) >= prominence]
    return np.asarray((starts[kept] + ends[kept]) // 2)


def _foot(height: NDArray[np.float64], top: int, step: int) -> float:
    """The lowest point on one side of a peak before something higher, or the end."""
    side = height[top::step]
    higher = np.flatnonzero(side > height[top])
    return float(np.min(side[: higher[0]] if higher.size else side))
