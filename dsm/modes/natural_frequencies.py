"""Natural frequencies of a spindle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsm.modes.find_modes import find_modes
from dsm.spindle.spindle import Spindle


def natural_frequencies(spindle: Spindle, count: int, rigid_bearings: bool = False) -> NDArray[np.float64]:
    """The `count` lowest bending frequencies (Hz), shape (count,), rising, none missed; 0 for motions without bending.

    rigid_bearings: the exact limit of infinitely stiff bearings, which hold the deflection and leave the slope free.
    Without rotary inertia and shear, and with the same bearing stiffness in all directions, the frequencies seen from
    the housing do not depend on speed. Raises ValueError for count < 1, ArithmeticError where rounding spoils the
    count of modes.

    A shaft on two knife edges, f_n = n^2 pi / (2 L^2) sqrt(E I / (rho A)):

    >>> shaft = Spindle([Segment(0.5, 0.05)], [Bearing(0.0, np.inf), Bearing(0.5, np.inf)])
    >>> natural_frequencies(shaft, 3).round(1).tolist()  # Hz
    [406.2, 1624.9, 3656.0]
    >>> [round(float(n**2 * np.pi / (2 * 0.5**2) * np.sqrt(210e9 / 7850)) * 0.05 / 4, 1) for n in (1, 2, 3)]
    [406.2, 1624.9, 3656.0]
    """
    held = [(bearing.position, 0) for bearing in spindle.bearings] if rigid_bearings else []
    return find_modes(spindle, count, held=held).frequency
