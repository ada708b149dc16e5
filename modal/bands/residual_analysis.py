"""Test the residual of a band fit: whiteness, model comparison, systematic errors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from modal.arrays import Complexes, Flags, Floats
from modal.bands.extraction import FittedBand
from modal.fitting import MAX_RESIDUAL_TERMS, BandFit, refit_nearby

RESIDUAL_BLOCKS = 48
"""Runs of lines that the means of what a fit leaves are looked at in."""
MAX_WHITENESS_EXCESS = 1.0
"""Standard deviations that their size may lie above what independent errors have."""


def has_white_residual(fit: BandFit) -> bool:
    """Whether the means of neighbouring lines are as small as those of independent errors."""
    left = fit.complex_residual
    length = max(2, left.shape[1] // RESIDUAL_BLOCKS)
    blocks = left[:, : left.shape[1] // length * length].reshape(len(left), -1, length)
    size = np.sum(np.abs(blocks.mean(axis=2)) ** 2) * length
    expected = fit.sum_of_squares / left.size * blocks[..., 0].size
    return bool(size < expected * (1 + MAX_WHITENESS_EXCESS / np.sqrt(blocks[..., 0].size)))


def passes_f_test(more: BandFit, fewer: BandFit, least: float) -> bool:
    """Whether the sum of squares falls by more than `least` times what the further unknowns take off by chance."""
    gain = (fewer.sum_of_squares - more.sum_of_squares) / max(fewer.degrees_of_freedom - more.degrees_of_freedom, 1)
    return gain > least * more.sum_of_squares / more.degrees_of_freedom


def has_lower_aic(fit: BandFit, other: BandFit) -> bool:
    """By the information criterion of Akaike (sum of squares and number of unknowns)."""
    variance = min(candidate.sum_of_squares / candidate.degrees_of_freedom for candidate in (fit, other))
    return (
        fit.sum_of_squares - 2 * variance * fit.degrees_of_freedom
        < other.sum_of_squares - 2 * variance * other.degrees_of_freedom
    )


NEAR_MODE_HALF_WIDTHS, MIN_NEAR_MODE_LINES = 3.0, 16
"""It counts within so many half-widths of the mode, and on so many lines at least."""


def residual_near_mode(band: FittedBand, i: int) -> tuple[float, float]:
    """rms of the residual about mode i as a share of its peak, and over that of the noise (from third differences)."""
    fit, weight = band.fit, band.data.weight
    distance = np.abs(band.data.frequency - fit.frequency[i])
    reach = max(
        NEAR_MODE_HALF_WIDTHS * fit.damping_ratio[i] * fit.frequency[i],
        np.sort(distance)[min(MIN_NEAR_MODE_LINES, distance.size) - 1],
    )
    near = fit.complex_residual[:, distance <= reach]
    rms = np.sqrt(np.mean(np.abs(near) ** 2) * fit.residual.size / fit.degrees_of_freedom)
    noise = residual_noise(fit)
    nearest = np.argmin(distance + 1e9 * (weight == 0), axis=1)
    peaks = weight[np.arange(nearest.size), nearest] * np.abs(fit.constant[:, i] / (2 * fit.damping_ratio[i]))
    return float(rms / np.max(peaks)), float(rms / noise) if noise > 0 else 1.0


def residual_noise(fit: BandFit) -> float:
    """rms of the noise in the weighted FRFs of a band, from third differences of what the fit leaves."""
    return float(np.median(np.abs(np.diff(fit.complex_residual, 3))) / np.sqrt(20 * np.log(2)))


MIN_CORRELATION_SIGNIFICANCE = 3.0
"""Times 1/sqrt(lines) that the share of independent values must be below 1; white noise is so in one of 700."""
HIDDEN_ERROR_FACTOR = 4.0
"""Standard error that may hide in what is left about a mode, over the part that is no noise as a share of its peak."""
MAX_UNEVEN_NOISE_RATIO = 2.0
"""Times the noise that may be left about a mode where noise is uneven, and nothing else is there."""
RESIDUAL_ROUNDING_SHARE = 1e-7
"""Share of what was measured below which a residual means nothing."""
REDUCED_RESIDUAL_TERMS = 2
"""Residual terms that the fit is tried without again; without more it may follow no mode at all."""
TRIAL_LINE_RANGES = ((0.1, 1.0), (0.0, 0.9), (0.1, 0.9), (0.2, 0.8))
"""Of the lines of a band, that the fit is tried on again ..."""
TRIAL_PEAK_HALF_WIDTHS = 2.0
"""... for the modes of which they hold all lines within so many half-widths; others have no peak there."""


@dataclass(frozen=True, eq=False)
class SystematicError:
    """What is to be added to the errors of a band."""

    factor: float
    """Factor on the covariance from the residual: real values fitted over those that count as independent; 1 where
    white."""
    degrees_of_freedom: float
    """Degrees of freedom that are left."""
    covariance: Floats
    """Covariance of the errors in the order of `BandFit`, by how far other bands and residual terms move them; 0 where
    white."""


def systematic_error(band: FittedBand) -> SystematicError:
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
    hidden = _hidden_error(band)
    independent = _count_independent_values(fit)
    is_white = independent > fit.degrees_of_freedom * (
        1 - MIN_CORRELATION_SIGNIFICANCE / np.sqrt(fit.residual.size / 2)
    )
    if is_white or has_rounding_residual(band):
        return SystematicError(1.0, fit.degrees_of_freedom, np.diag(hidden**2))
    moved = np.array(list(_trial_changes(band))).reshape(-1, hidden.size)
    most = np.max(np.abs(moved), axis=0, initial=0.0)
    return SystematicError(
        max(fit.degrees_of_freedom / independent, 1.0),
        min(fit.degrees_of_freedom, independent),
        np.diag(most**2 + hidden**2),
    )


def _hidden_error(band: FittedBand) -> Floats:
    """Errors that may hide in what the fit leaves about each mode, where it is more than noise, in the order of
    `BandFit`: as shares of half-width, damping ratio and size."""
    fit, left = band.fit, [residual_near_mode(band, i) for i in range(band.fit.frequency.size)]
    of_peak, of_noise = np.array(left).T
    share = (
        HIDDEN_ERROR_FACTOR
        * of_peak
        * np.sqrt(1 - (MAX_UNEVEN_NOISE_RATIO / np.maximum(of_noise, MAX_UNEVEN_NOISE_RATIO)) ** 2)
    )
    share = np.zeros(share.size) if has_rounding_residual(band) else share
    sizes = (share * np.abs(fit.constant)).ravel()
    free = np.where(fit.held, 0.0, share)
    return np.concatenate([free * np.prod(fit.poles, axis=0), free * fit.damping_ratio, sizes, sizes])


def has_rounding_residual(band: FittedBand) -> bool:
    """Whether its fit leaves so little that it means nothing."""
    scale = np.linalg.norm(band.data.target * band.data.weight)
    return bool(band.fit.sum_of_squares < (RESIDUAL_ROUNDING_SHARE * scale) ** 2)


def _count_independent_values(fit: BandFit) -> float:
    """How many of the real values that a fit leaves are independent; about all of them for white noise."""
    power = np.abs(np.fft.fft(fit.complex_residual, axis=1)) ** 2
    return float(4 * power.sum() ** 2 / np.sum(power**2)) if power.any() else float(fit.residual.size)


def _trial_changes(band: FittedBand) -> Iterator[Floats]:
    """Changes of the same modes with other residual terms, and on parts of the lines, in the order of `BandFit`; 0 of
    those that a part cuts."""
    fit, data, n = band.fit, band.data, band.data.frequency.size
    everything = slice(0, n)
    tries = [
        (everything, terms)
        for terms in range(band.terms - REDUCED_RESIDUAL_TERMS, MAX_RESIDUAL_TERMS + 1)
        if terms != band.terms
    ]
    for part, terms in [
        *tries,
        *((slice(round(low * n), round(high * n)), band.terms) for low, high in TRIAL_LINE_RANGES),
    ]:
        values = refit_nearby(fit, data.frequency[part], data.target[:, part], data.weight[:, part], terms)
        if values is not None:
            moved = _change_of_values(fit, *values).reshape(-1, fit.frequency.size)
            yield np.where(_is_peak_cut(fit, np.delete(data.frequency, part)), 0.0, moved).ravel()


def _is_peak_cut(fit: BandFit, left_out: Floats) -> Flags:
    """Whether lines (Hz) that are left out belong to the peak of each mode, (m,)."""
    distance = np.abs(left_out[:, np.newaxis] - fit.frequency)
    return np.asarray(np.any(distance < TRIAL_PEAK_HALF_WIDTHS * np.prod(fit.poles, axis=0), axis=0))


def _change_of_values(fit: BandFit, poles: Floats, constant: Complexes) -> Floats:
    """Change to other values, in the order of `BandFit`."""
    turn = np.exp(-1j * np.angle(fit.constant))
    off = (constant - fit.constant) * turn
    return np.concatenate([(poles - fit.poles).ravel(), off.real.ravel(), off.imag.ravel()])
