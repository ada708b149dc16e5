"""What the fit of a band leaves about one of its modes."""

from __future__ import annotations

import numpy as np

from modal.bands.extraction import FittedBand
from modal.fitting import BandFit

ABOUT, ABOUT_LINES = 3.0, 16
"""It counts within so many half-widths of the mode, and on so many lines at least."""


def left_about(band: FittedBand, i: int) -> tuple[float, float]:
    """rms of the residual about mode i as a share of its peak, and over that of the noise (from third differences)."""
    fit, weight = band.fit, band.data.weight
    distance = np.abs(band.data.frequency - fit.frequency[i])
    reach = max(ABOUT * fit.damping_ratio[i] * fit.frequency[i], np.sort(distance)[min(ABOUT_LINES, distance.size) - 1])
    near = fit.complex_residual[:, distance <= reach]
    rms = np.sqrt(np.mean(np.abs(near) ** 2) * fit.residual.size / fit.freedom)
    noise = noise_of(fit)
    nearest = np.argmin(distance + 1e9 * (weight == 0), axis=1)
    peaks = weight[np.arange(nearest.size), nearest] * np.abs(fit.constant[:, i] / (2 * fit.damping_ratio[i]))
    return float(rms / np.max(peaks)), float(rms / noise) if noise > 0 else 1.0


def noise_of(fit: BandFit) -> float:
    """rms of the noise in the weighted FRFs of a band, from third differences of what the fit leaves."""
    return float(np.median(np.abs(np.diff(fit.complex_residual, 3))) / np.sqrt(20 * np.log(2)))
