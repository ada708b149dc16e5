"""Places along a shaft: which count as one, and which of many is nearest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SAME_PLACE = 1e-9
"""Places on the shaft nearer to each other than this part of its length, as by rounding, count as one."""


def nearest(positions: NDArray[np.float64], place: float) -> int:
    """Index of the position nearest to a place, the first of several."""
    return int(np.argmin(np.abs(positions - place)))
