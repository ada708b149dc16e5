"""Frequencies that sound alike: where samples, or teeth, are taken no more often than so many times a second."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def fold_frequency(frequency: Floats | float, rate: Floats | float) -> Floats:
    """Frequencies (Hz) as they are found again between 0 and half of a rate (Hz): of samples, or of teeth."""
    remainder = np.mod(frequency, rate)
    return np.asarray(np.minimum(remainder, rate - remainder))


def family_distance(frequency: Floats | float, chatter: float, teeth: float) -> Floats:
    """Distance (Hz) of frequencies from +-chatter + k teeth, those that chatter at a frequency (Hz) sounds with."""
    return np.minimum(fold_frequency(frequency - chatter, teeth), fold_frequency(frequency + chatter, teeth))
