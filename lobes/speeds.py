"""The one check of spindle speeds."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def check_speeds(speed_rpm: ArrayLike) -> NDArray[np.float64]:
    """Spindle speeds (rpm) as a 1-D array; ValueError unless there is one at least and all are finite and > 0."""
    speed = np.atleast_1d(np.asarray(speed_rpm, dtype=np.float64))
    if speed.ndim != 1 or speed.size == 0:
        raise ValueError(f"speed_rpm has shape {speed.shape}; a 1-D array of at least one speed (rpm) is needed")
    bad = np.flatnonzero(~(np.isfinite(speed) & (speed > 0)))
    if bad.size:
        raise ValueError(f"speed_rpm[{bad[0]}]={speed[bad[0]]} is not a finite speed > 0 rpm; leave such speeds out")
    return speed
