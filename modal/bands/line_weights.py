"""How much each line of an FRF counts in a fit."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import Frf

SMOOTHED_OVER = 25
"""Lines over which the variance is averaged, so that a line that is small by chance does not count for more."""
OUTSTANDING = 8.0
"""Times the median about it that the variance of an undisturbed line never reaches."""
MOST_AVERAGES = 10
"""Hits that few people average more of."""
LEAST_VARIANCE = 1e-6
"""Share of the mean variance below which no line is believed."""


def line_weights(frf: Frf) -> NDArray[np.float64]:
    """Weights of the receptance, 1/rms of its noise up to a factor, shape (n,).

    The noise is that of the coherence where there are three averages or more (random error times |H|, squared and
    averaged over neighbouring lines). Else it is taken as equal on all lines of the quantity that was measured.
    """
    factor = measuring_factor(frf)
    error = frf.random_error
    if error is None:
        return factor
    variance = _smoothed((error * np.abs(frf.receptance) * factor) ** 2)
    mean = np.mean(variance)
    return factor if mean == 0 else factor / np.sqrt(np.maximum(variance, LEAST_VARIANCE * mean) / mean)


def incoherent(frf: Frf) -> NDArray[np.float64]:
    """rms of the noise of what was measured that its coherence tells, shape (n,); 0 where it tells nothing.

    A coherence below 1 is that of several hits: of ten, where nobody said how many.
    """
    if frf.coherence is None:
        return np.zeros(frf.frequency.size)
    averages = frf.n_averages if frf.n_averages > 1 else MOST_AVERAGES
    g2 = np.clip(frf.coherence, 1e-12, 1.0)
    size = np.abs(frf.receptance) * measuring_factor(frf)
    return np.asarray(size * np.sqrt((1 - g2) / (2 * averages * g2)))


def _smoothed(variance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Running mean that a disturbed line (hum) does not spread over; such a line keeps its own variance."""
    most = OUTSTANDING * scipy.ndimage.median_filter(variance, SMOOTHED_OVER)
    return np.where(
        variance > most, variance, scipy.ndimage.uniform_filter1d(np.minimum(variance, most), SMOOTHED_OVER)
    )


def measuring_factor(frf: Frf) -> NDArray[np.float64]:
    """|measured quantity| over |receptance|: 1, omega or omega^2 by line, shape (n,)."""
    power = {"receptance": 0, "mobility": 1, "accelerance": 2}[frf.measured_as]
    return np.asarray((2 * np.pi * frf.frequency) ** power)
