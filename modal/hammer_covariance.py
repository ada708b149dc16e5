"""What the noise of the hammer does to modes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition import Hit
from acquisition.estimation import force_noise_through
from modal.bands.extraction import Extraction, FittedBand


def hammer_covariance(state: Extraction, band: FittedBand, i: int, hits: Sequence[Hit]) -> NDArray[np.float64]:
    """Covariance of the values of one band by the noise of the hammer inside the force windows of the hits of FRF i.

    Each sample of that noise shifts all lines of the FRF together (`force_noise`), and the modes by one Gauss-Newton
    step; shape as `BandFit.covariance`, 0 without hits. Where a mass was taken off (`without_mass`), an FRF without it
    shifts by 1 - mass w^2 H of what the measured one does.
    """
    part, frf = band.lines, state.frfs[i]
    real, imaginary = np.hsplit(band.fit.influence_of(i), 2)
    loading = 1 - frf.mass_removed * (2 * np.pi * frf.frequency) ** 2 * frf.receptance
    by_share = (real - 1j * imaginary) * (state.weight[i] * frf.receptance * loading)[part]
    covariance = np.zeros_like(band.fit.covariance)
    for steps in force_noise_through(by_share, hits, frf.frequency[part]) if hits else ():
        covariance += steps.real @ steps.real.T
    return covariance
