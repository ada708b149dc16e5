"""The modes that have a peak, fitted to the lines around it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from modal.bands.extraction import Array, BandLines, FittedBand
from modal.bands.find_resonances import Resonance
from modal.fitting import LEAST_TERMS, BandFit, fit_band, with_real_constants
from modal.poles import physical_poles

LARGEST_ERROR = 1 / 3
"""Relative standard error of damping ratio and stiffness above which a peak is not a mode."""
LEAST_SHARE = 0.05
"""Share of its peak of the mobility that a mode has; 1 dB of prominence needs twice this."""
LARGEST_DAMPING = 0.9
"""Damping ratio up to which a mode oscillates visibly; the fit itself ends at 1."""
CLEAR = 0.05
"""A fit from the peaks alone that leaves less than this share (rms) needs no LSCF poles to start from."""


def fit_peaks(data: BandLines, resonances: Sequence[Resonance]) -> FittedBand | None:
    """The resonances of a band, each from its own width, or from the LSCF pole nearest to it; None where none fits."""
    starts = np.array([(r.frequency, r.half_width / r.frequency) for r in resonances]).T
    height = np.array([r.height for r in resonances])
    fitted = _fitted(data, starts, height, LEAST_TERMS)
    if fitted is None or fitted[1].size < height.size or _left(fitted[0], data) > CLEAR:
        from_poles = _fitted(data, _nearest_poles(data, resonances, starts), height, LEAST_TERMS)
        fitted = _better(fitted, from_poles)
    if fitted is None:
        return None
    return FittedBand(data, tuple(resonances), fitted[1], fitted[0], LEAST_TERMS)


def fit_again(band: FittedBand, data: BandLines) -> FittedBand | None:
    """The modes of a band fitted to other data; None where none of them is left. Those that a person chose all stay."""
    if band.by_hand:
        poles, held = band.fit.poles, band.fit.held
        fit = fit_band(data.frequency, data.own, data.weight, poles, band.terms, held)
        return band if fit is None else replace(band, data=data, fit=fit)
    fitted = _fitted(data, band.fit.poles, band.height, band.terms)
    return None if fitted is None else replace(band, data=data, fit=fitted[0], height=fitted[1])


def fit_real(band: FittedBand) -> FittedBand:
    """The band with real modal constants, where they do."""
    data = band.data
    fit = with_real_constants(band.fit, data.frequency, data.own, data.weight, band.terms)
    return replace(band, fit=fit) if np.all(are_modes(fit, data.frequency, band.height)) else band


def are_modes(fit: BandFit, frequency: Array, height: Array, largest_error: float = LARGEST_ERROR) -> NDArray[np.bool_]:
    """Which lie in the band, are high enough, and are known well enough in one of the FRFs at least."""
    return np.asarray(
        (fit.frequency > frequency[0])
        & (fit.frequency < frequency[-1])
        & (fit.damping_ratio < LARGEST_DAMPING)
        & (fit.mobility_peak > LEAST_SHARE * height)
        & (fit.standard_error[1] < largest_error * fit.damping_ratio)
        & np.any(fit.size_error < largest_error, axis=0)
    )


def _nearest_poles(data: BandLines, resonances: Sequence[Resonance], starts: Array) -> Array:
    """Starts (2, m) with the highest LSCF pole within the half-width of each resonance, where there is one."""
    poles, starts = physical_poles(data.chart), starts.copy()
    for i, resonance in enumerate(resonances):
        near = np.abs(poles.frequency - resonance.frequency) < resonance.half_width
        if np.any(near):
            best = np.argmax(np.where(near, poles.largest / poles.damping_ratio, 0))
            starts[:, i] = poles.frequency[best], poles.damping_ratio[best]
    return starts


def _left(fit: BandFit, data: BandLines) -> float:
    """What a fit leaves, as a share (rms) of what it was fitted to."""
    return float(np.sqrt(fit.sum_of_squares) / np.linalg.norm(data.own * data.weight))


def _better(a: tuple[BandFit, Array] | None, b: tuple[BandFit, Array] | None) -> tuple[BandFit, Array] | None:
    """The one with more modes, of two with as many that which leaves less."""
    return max(
        (fit for fit in (a, b) if fit is not None),
        key=lambda fit: (fit[1].size, -fit[0].sum_of_squares),
        default=None,
    )


def _fitted(data: BandLines, starts: Array, height: Array, terms: int) -> tuple[BandFit, Array] | None:
    """Fit after the weakest of those that turn out to be no modes are taken out, one by one."""
    while height.size:
        fit = fit_band(data.frequency, data.own, data.weight, starts, terms)
        sure = np.zeros(height.size, bool) if fit is None else are_modes(fit, data.frequency, height)
        if fit is not None and np.all(sure):
            return fit, height
        keep = np.arange(sure.size) != np.argmin(np.where(sure, np.inf, height))
        starts, height = starts[:, keep], height[keep]
    return None
