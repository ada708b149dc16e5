"""Velocity and displacement over time as the acceleration that a hit holds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquisition.files.contents.settle_unit import MOTIONS
from acquisition.hit import Hit
from acquisition.verdicts.find_overload import find_overload


def hit_of_motion(force: NDArray[np.float64], response: NDArray[np.float64], rate: float, quantity: str) -> Hit:
    """A hit from its force (N) and a response in SI of this quantity; an overload is looked for in what was recorded.

    Differentiated in the frequency domain, times 2 pi i f: the FRF is that of the recorded motion to rounding, as all
    that follows divides again. ValueError as of a hit.
    """
    recorded = Hit(force, response, rate)
    order = len(MOTIONS) - 1 - MOTIONS.index(quantity)
    if not order:
        return recorded
    spectrum = np.fft.rfft(recorded.acceleration - np.mean(recorded.acceleration))
    spectrum *= (2j * np.pi * np.fft.rfftfreq(recorded.acceleration.size, 1 / rate)) ** order
    acceleration = np.fft.irfft(spectrum, recorded.acceleration.size)
    return Hit(recorded.force, acceleration, rate, overload=2 if find_overload(recorded, 1) else 0)
