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
    """
    held = [(bearing.position, 0) for bearing in spindle.bearings] if rigid_bearings else []
    return find_modes(spindle, count, held=held).frequency
