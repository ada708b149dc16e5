"""Errors of a fit that are no noise: what it leaves is alike from line to line, as unfitted structure is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from modal.bands.extraction import Array, ComplexArray, FittedBand
from modal.bands.left_about import left_about
from modal.fitting import MOST_TERMS, BandFit, values_nearby

SIGNIFICANT = 3.0
"""Times 1/sqrt(lines) that the share of independent values must be below 1; white noise is so in one of 700."""
HIDDEN = 4.0
"""Standard error that may hide in what is left about a mode, over the part that is no noise as a share of its peak."""
CHANCE = 2.0
"""Times the noise that may be left about a mode where noise is uneven, and nothing else is there."""
ROUNDING = 1e-7
"""Share of what was measured below which a residual means nothing."""
FEWER = 2
"""Residual terms that the fit is tried without again; without more it may follow no mode at all."""
PARTS = ((0.1, 1.0), (0.0, 0.9), (0.1, 0.9), (0.2, 0.8))
"""Of the lines of a band, that the fit is tried on again ..."""
PEAK = 2.0
"""... for the modes of which they hold all lines within so many half-widths; others have no peak there."""


@dataclass(frozen=True, eq=False)
class Systematic:
    """What is to be added to the errors of a band."""

    factor: float
    """Factor on the covariance from the residual: real values fitted over those that count as independent; 1 where
    white."""
    freedom: float
    """Degrees of freedom that are left."""
    covariance: Array
    """Covariance of the errors in the order of `BandFit`, by how far other bands and residual terms move them; 0 where
    white."""


def systematic(band: FittedBand) -> Systematic:
    """Errors beyond those of white noise, where the residual of a band is coloured; none where it is white.

    Structure that the model lacks leaves a residual that is alike over many lines. As many of its values are
    independent as its power fills bins of their transform, (sum P)^2 / sum P^2; white noise fills half of them.
    What such structure shifts in the modes the residual does not show: each band is fitted again with fewer and more
    residual terms and on parts of its lines, and each value may be off by as much as the fit that moves it most; a part
    that cuts a peak says nothing of that mode. What is left about a mode beyond twice the noise, in squares, as a share
    of its peak, may hide an error of four times that share of its half-width, its damping ratio and its size, whatever
    its colour: by that the same hits differ on several sensors.
    """
    fit = band.fit
    hidden = _hidden(band)
    independent = _independent_values(fit)
    is_white = independent > fit.freedom * (1 - SIGNIFICANT / np.sqrt(fit.residual.size / 2))
    if is_white or leaves_rounding(band):
        return Systematic(1.0, fit.freedom, np.diag(hidden**2))
    moved = np.array(list(_moves(band))).reshape(-1, hidden.size)
    most = np.max(np.abs(moved), axis=0, initial=0.0)
    return Systematic(max(fit.freedom / independent, 1.0), min(fit.freedom, independent), np.diag(most**2 + hidden**2))


def _hidden(band: FittedBand) -> Array:
    """Errors that may hide in what the fit leaves about each mode, where it is more than noise, in the order of
    `BandFit`: as shares of half-width, damping ratio and size."""
    fit, left = band.fit, [left_about(band, i) for i in range(band.fit.frequency.size)]
    of_peak, of_noise = np.array(left).T
    share = HIDDEN * of_peak * np.sqrt(1 - (CHANCE / np.maximum(of_noise, CHANCE)) ** 2)
    share = np.zeros(share.size) if leaves_rounding(band) else share
    sizes = (share * np.abs(fit.constant)).ravel()
    free = np.where(fit.held, 0.0, share)
    return np.concatenate([free * np.prod(fit.poles, axis=0), free * fit.damping_ratio, sizes, sizes])


def leaves_rounding(band: FittedBand) -> bool:
    """Whether its fit leaves so little that it means nothing."""
    scale = np.linalg.norm(band.data.own * band.data.weight)
    return bool(band.fit.sum_of_squares < (ROUNDING * scale) ** 2)


def _independent_values(fit: BandFit) -> float:
    """How many of the real values that a fit leaves are independent; about all of them for white noise."""
    power = np.abs(np.fft.fft(fit.complex_residual, axis=1)) ** 2
    return float(4 * power.sum() ** 2 / np.sum(power**2)) if power.any() else float(fit.residual.size)


def _moves(band: FittedBand) -> Iterator[Array]:
    """Changes of the same modes with other residual terms, and on parts of the lines, in the order of `BandFit`; 0 of
    those that a part cuts."""
    fit, data, n = band.fit, band.data, band.data.frequency.size
    everything = slice(0, n)
    tries = [(everything, terms) for terms in range(band.terms - FEWER, MOST_TERMS + 1) if terms != band.terms]
    for part, terms in [*tries, *((slice(round(low * n), round(high * n)), band.terms) for low, high in PARTS)]:
        values = values_nearby(fit, data.frequency[part], data.own[:, part], data.weight[:, part], terms)
        if values is not None:
            moved = _moved(fit, *values).reshape(-1, fit.frequency.size)
            yield np.where(_is_cut(fit, np.delete(data.frequency, part)), 0.0, moved).ravel()


def _is_cut(fit: BandFit, left_out: Array) -> NDArray[np.bool_]:
    """Whether lines (Hz) that are left out belong to the peak of each mode, (m,)."""
    distance = np.abs(left_out[:, np.newaxis] - fit.frequency)
    return np.asarray(np.any(distance < PEAK * np.prod(fit.poles, axis=0), axis=0))


def _moved(fit: BandFit, poles: Array, constant: ComplexArray) -> Array:
    """Change to other values, in the order of `BandFit`."""
    turn = np.exp(-1j * np.angle(fit.constant))
    off = (constant - fit.constant) * turn
    return np.concatenate([(poles - fit.poles).ravel(), off.real.ravel(), off.imag.ravel()])
