"""Bearing stiffness over measured frequency."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsm.calibration.stiffness_factor import stiffness_factor
from dsm.calibration.stiffness_groups import calibrated_parts, parts_stiffness
from dsm.spindle.spindle import Spindle


def stiffness_curve(
    spindle: Spindle, frequency: ArrayLike, mode: int = 1, group: str | None = None
) -> NDArray[np.float64]:
    """Bearing stiffness (N/m) for which each frequency is that mode, shape (n,); NaN where it cannot be.

    frequency: (n,) Hz, > 0. The stiffnesses keep their given ratios; what is returned is their mean over the group
    (None: over all bearings that have one), the common stiffness where all are equal. Raises ValueError for
    frequencies that are not > 0, and as calibrate for the bearings. Figure 8 of Gaber & Hashemi, Shock and Vibration,
    2015, is such a curve.

    >>> spindle = Spindle([Segment(0.1, 0.03), Segment(0.4, 0.06)], [Bearing(0.15, 2.5e8), Bearing(0.4, 2.5e8)])
    >>> f = natural_frequencies(spindle, 1)[0]
    >>> (stiffness_curve(spindle, [f, 0.9 * f, 3 * f]) / 1e6).round(1).tolist()  # N/um; no bearing gives the last one
    [250.0, 196.9, nan]
    """
    mean = parts_stiffness(spindle, calibrated_parts(spindle, group))
    return mean * stiffness_factor(spindle, frequency, mode, group)
