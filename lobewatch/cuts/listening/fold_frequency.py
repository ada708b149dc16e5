"""Frequencies that sound alike: where samples, or teeth, are taken no more often than so many times a second."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def fold_frequency(frequency: Floats | float, rate: Floats | float) -> Floats:
    """Frequencies (Hz) as they are found again between 0 and half of a rate (Hz): of samples, or of teeth."""
    rest = np.mod(frequency, rate)
    return np.asarray(np.minimum(rest, rate - rest))


def family_distance(frequency: Floats | float, other: float, tooth_frequency: float) -> Floats:
    """Distance of frequencies from +-other + k tooth passing (Hz): those that chatter at one of them sounds with."""
    return np.minimum(
        fold_frequency(frequency - other, tooth_frequency), fold_frequency(frequency + other, tooth_frequency)
    )
