"""Bearing stiffness over measured frequency."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsm.spindle import Spindle
from dsm.stiffness_factor import stiffness_factor


def stiffness_curve(spindle: Spindle, frequency: ArrayLike, mode: int = 1) -> NDArray[np.float64]:
    """Bearing stiffness (N/m) for which each frequency is that mode, shape (n,); NaN where it cannot be.

    frequency: (n,) Hz, > 0. The stiffnesses keep their given ratios; what is returned is their mean, which is the
    common stiffness where all are equal. Raises ValueError for frequencies that are not > 0 and for fewer than two
    bearings. Figure 8 of Gaber & Hashemi, Shock and Vibration, 2015, is such a curve.
    """
    return spindle.mean_bearing_stiffness * stiffness_factor(spindle, frequency, mode)
