"""Places along a shaft: which count as one, and which of many is nearest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

SAME_PLACE = 1e-9
"""Places on the shaft nearer to each other than this part of its length, as by rounding, count as one."""


def nearest(positions: NDArray[np.float64], place: float) -> int:
    """Index of the position nearest to a place, the first of several."""
    return int(nearest_each(positions, [place])[0])


def nearest_each(positions: NDArray[np.float64], places: Sequence[float]) -> NDArray[np.int_]:
    """The same for each of several places, shape (n,)."""
    return np.asarray(np.abs(np.array(places)[:, np.newaxis] - positions).argmin(axis=1))
