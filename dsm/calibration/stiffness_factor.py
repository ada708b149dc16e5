"""Bearing stiffness from natural frequencies, without a root search."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsm.calibration.bearing_eigenproblem import bearing_eigenproblem
from dsm.matrix.frequency_axis import frequency_axis
from dsm.spindle.spindle import Spindle


def stiffness_factor(
    spindle: Spindle, frequency: ArrayLike, mode: int = 1, group: str | None = None
) -> NDArray[np.float64]:
    """Factor on the bearing stiffnesses that puts a mode (1 is the lowest) at each frequency; NaN where none does.

    frequency: (n,) Hz, > 0; shape of the result (n,). group: the bearings that the factor is for; None: all that have
    a group. One eigenproblem of the order of the number of bearings for each frequency.
    """
    f = frequency_axis(frequency)
    if np.any(f == 0):
        raise ValueError("frequency=0 Hz is not > 0")
    problem = bearing_eigenproblem(spindle, f, group)
    index = problem.pick(mode)
    value = problem.values[np.arange(f.size), np.where(index < 0, 0, index)]
    return np.where(index < 0, np.nan, -1 / value)
