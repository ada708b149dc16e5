"""Fit a grid of spindle harmonics and sidebands to spectral peaks."""

from typing import NamedTuple

import numpy as np

from lobewatch.arrays import Floats, Indices
from lobewatch.cuts.chatter_detection.spectrum import SpectralPeaks

MAX_SIDEBAND_FAMILIES = 4
"""Largest number of sideband families, one for each frequency that is not a harmonic."""
MAX_GRID_ERRORS = 10.0
"""Distance (standard errors) above which a peak is not on the harmonic grid."""
GRID_TOLERANCES = 1.2, 0.6, 0.6, 0.6
"""Distances (bins) within which peaks belong to the harmonic grid, one for each least-squares step; chosen.

The first is a peak width (`PEAK_TOLERANCE`), since a speed by votes is rough, the others half of that."""
MAX_SPEED_CHANGE = 0.005
"""Relative change of the spindle frequency above which least squares have diverged; chosen."""


class SidebandFamily(NamedTuple):
    """Peaks at sign * r + k f with the spindle frequency f."""

    indices: Indices
    """Indices of the peaks of the family, shape (n,)."""
    sign: Floats
    """Sign of r in each peak, shape (n,); 0 if r is 0."""
    order: Floats
    """Order k of each peak, shape (n,)."""


class SpindleSpeed(NamedTuple):
    """True spindle speed with its error."""

    frequency: float
    """Spindle frequency (Hz)."""
    error: float
    """Standard error (Hz); inf unless it follows from several peaks."""
    share: float
    """Share of the checked peaks that it explains."""
    agreeing: int
    """Number of matching peaks beyond those that determine it."""
    misfit: float
    """Mean square distance of all peaks from it, in standard errors of each, at most `MAX_GRID_ERRORS` squared."""


def refine_speed(frequency: float, peaks: SpectralPeaks, bin_width: float) -> SpindleSpeed:
    """Refine a spindle frequency (Hz) by least squares over its harmonic grid; bin_width: of the spectrum (Hz)."""
    speed = SpindleSpeed(frequency, np.inf, 0.0, 0, MAX_GRID_ERRORS**2)
    for tolerance in GRID_TOLERANCES:
        families = find_sideband_families(speed.frequency, peaks, tolerance * bin_width)
        rows = np.concatenate([_design_rows(family, number, len(families)) for number, family in enumerate(families)])
        places = np.concatenate([family.indices for family in families])
        if np.linalg.matrix_rank(rows) < len(families):
            return speed
        root = 1 / peaks[places].frequency_error(bin_width)
        scaled, measured = rows * root[:, np.newaxis], peaks.frequency[places] * root
        solution = np.linalg.lstsq(scaled, measured, rcond=None)[0]
        if abs(solution[0] / frequency - 1) > MAX_SPEED_CHANGE:
            return speed
        error = float(np.sqrt(np.linalg.inv(scaled.T @ scaled)[0, 0]))
        away = np.minimum(np.abs(scaled @ solution - measured), MAX_GRID_ERRORS)
        misfit = float(np.sum(away**2) + (len(peaks) - places.size) * MAX_GRID_ERRORS**2) / len(peaks)
        share, agreeing = places.size / len(peaks), places.size - len(families)
        speed = SpindleSpeed(float(solution[0]), error, share, agreeing, misfit)
    return speed


def find_sideband_families(frequency: float, peaks: SpectralPeaks, tolerance: float) -> list[SidebandFamily]:
    """Find the harmonics of a frequency (Hz), then the sideband families of the clearest peaks left."""
    order = np.round(peaks.frequency / frequency)
    comb = (np.abs(peaks.frequency - order * frequency) < tolerance) & (order > 0)
    families = [SidebandFamily(np.flatnonzero(comb), np.zeros(int(comb.sum())), order[comb])]
    left = ~comb
    for _ in range(MAX_SIDEBAND_FAMILIES):
        if not np.any(left):
            break
        anchor = peaks.frequency[np.flatnonzero(left)[np.argmax(peaks.clearness[left])]]
        beyond, mirrored = peaks.frequency - anchor, peaks.frequency + anchor
        up, down = np.round(beyond / frequency), np.round(mirrored / frequency)
        off, off_mirrored = np.abs(beyond - up * frequency), np.abs(mirrored - down * frequency)
        members = left & (np.minimum(off, off_mirrored) < tolerance)
        sign = np.where(off <= off_mirrored, 1.0, -1.0)
        if np.count_nonzero(members) > 1:
            order = np.where(sign > 0, up, down)
            families.append(SidebandFamily(np.flatnonzero(members), sign[members], order[members]))
        left &= ~members
    return families


def _design_rows(family: SidebandFamily, number: int, count: int) -> Floats:
    """Return the rows of the least-squares problem for one family, shape (n, count)."""
    rows = np.zeros((family.indices.size, count))
    rows[:, number] = family.sign
    rows[:, 0] = family.order
    return rows
