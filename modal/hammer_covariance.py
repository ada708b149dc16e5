"""What the noise of the hammer does to modes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition import Hit, force_noise
from modal.extract import Extraction, FittedBand


def hammer_covariance(state: Extraction, band: FittedBand, hits: Sequence[Hit]) -> NDArray[np.float64]:
    """Covariance of the values of one band by the noise of the hammer inside the force windows of these hits.

    Each sample of that noise shifts all lines together (`force_noise`), and the modes by one Gauss-Newton step; shape
    (3 m, 3 m), frequencies, damping ratios and flexibilities; 0 without hits.
    """
    part = band.lines
    real, imaginary = np.hsplit(band.fit.influence, 2)
    by_share = (real - 1j * imaginary) * (state.weight * state.frf.receptance)[part]
    covariance = np.zeros(2 * [len(by_share)])
    for columns in force_noise(hits, state.frf.frequency[part]) if hits else ():
        steps = (by_share @ columns).real
        covariance += steps @ steps.T
    return covariance
