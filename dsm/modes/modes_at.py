"""Natural modes as seen at one place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsm.modes.find_modes import find_modes
from dsm.spindle.spindle import Spindle


def modes_at(spindle: Spindle, count: int, position: float = 0.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Natural frequencies (Hz) and modal stiffness at one place (N/m) of the lowest modes, shape (count,) each.

    position: distance from the tool tip (m). The receptance there is the sum over all modes of 1/K/(1 - (f/f_n)^2).
    K is 0 for a motion without bending and inf where the mode is at rest. Raises ValueError for a position off the
    shaft, and as natural_frequencies.
    """
    modes = find_modes(spindle, count, places=[position])
    return modes.frequency, modes.stiffness_at(position)
