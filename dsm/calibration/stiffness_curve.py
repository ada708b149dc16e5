"""Bearing stiffness over measured frequency."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsm.calibration.bearing_eigenproblem import calibrated_bearings
from dsm.calibration.stiffness_factor import stiffness_factor
from dsm.spindle.spindle import Spindle


def stiffness_curve(
    spindle: Spindle, frequency: ArrayLike, mode: int = 1, group: str | None = None
) -> NDArray[np.float64]:
    """Bearing stiffness (N/m) for which each frequency is that mode, shape (n,); NaN where it cannot be.

    frequency: (n,) Hz, > 0. The stiffnesses keep their given ratios; what is returned is their mean over the group
    (None: over all bearings that have one), the common stiffness where all are equal. Raises ValueError for
    frequencies that are not > 0, and as calibrate for the bearings. Figure 8 of Gaber & Hashemi, Shock and Vibration,
    2015, is such a curve.
    """
    return mean_stiffness(spindle, group) * stiffness_factor(spindle, frequency, mode, group)


def mean_stiffness(spindle: Spindle, group: str | None = None) -> float:
    """Mean stiffness of the bearings of a group (N/m); None: of all that have one."""
    chosen = calibrated_bearings(spindle, group)
    return math.fsum(spindle.bearings[index].stiffness for index in chosen) / len(chosen)
