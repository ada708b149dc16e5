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

    >>> shaft = Spindle([Segment(0.5, 0.05)], [Bearing(0.0, np.inf), Bearing(0.5, np.inf)])
    >>> frequency, stiffness = modes_at(shaft, 2, position=0.125)
    >>> frequency.round(1).tolist(), (stiffness / 1e6).round(1).tolist()  # Hz, N/um
    ([406.2, 1624.9], [50.2, 401.7])
    """
    modes = find_modes(spindle, count, places=[position])
    return modes.frequency, modes.stiffness_at(position)
