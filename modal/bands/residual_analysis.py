"""Test the residual of a band fit: whiteness, model comparison, systematic errors."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from modal.arrays import Complexes, Flags, Floats
from modal.bands.extraction import FittedBand
from modal.fitting.band_fit import MAX_RESIDUAL_TERMS, BandFit
from modal.fitting.fit_band import refit_nearby

RESIDUAL_BLOCKS = 48
"""Blocks of lines whose mean residuals are compared with white noise."""
MAX_WHITENESS_EXCESS = 1.0
"""Standard deviations that the block means of a white residual may exceed their expected size by."""


def has_white_residual(fit: BandFit) -> bool:
    """Return whether the means of neighbouring residuals are as small as those of independent errors."""
    residual = fit.complex_residual
    length = max(2, residual.shape[1] // RESIDUAL_BLOCKS)
    blocks = residual[:, : residual.shape[1] // length * length].reshape(len(residual), -1, length)
    size = np.sum(np.abs(blocks.mean(axis=2)) ** 2) * length
    expected = fit.sum_of_squares / residual.size * blocks[..., 0].size
    return bool(size < expected * (1 + MAX_WHITENESS_EXCESS / np.sqrt(blocks[..., 0].size)))


NEAR_MODE_HALF_WIDTHS, MIN_NEAR_MODE_LINES = 3.0, 16
"""Half-widths around a mode, and lines at least, that its own residual is taken from."""


def residual_near_mode(band: FittedBand, i: int) -> tuple[float, float]:
    """Return the residual rms near mode i over its peak, and over the noise rms from third differences."""
    fit, weight = band.fit, band.data.weight
    distance = np.abs(band.data.frequency - fit.frequency[i])
    width = NEAR_MODE_HALF_WIDTHS * fit.damping_ratio[i] * fit.frequency[i]
    reach = max(width, np.sort(distance)[min(MIN_NEAR_MODE_LINES, distance.size) - 1])
    near = fit.complex_residual[:, distance <= reach]
    rms = np.sqrt(np.mean(np.abs(near) ** 2) * fit.residual.size / fit.degrees_of_freedom)
    noise = residual_noise(fit)
    nearest = np.argmin(distance + 1e9 * (weight == 0), axis=1)
    peaks = weight[np.arange(nearest.size), nearest] * np.abs(fit.constant[:, i] / (2 * fit.damping_ratio[i]))
    return float(rms / np.max(peaks)), float(rms / noise) if noise > 0 else 1.0


def residual_noise(fit: BandFit) -> float:
    """Return the noise rms in the weighted FRFs of a band, from third differences of the residual."""
    return float(np.median(np.abs(np.diff(fit.complex_residual, 3))) / np.sqrt(20 * np.log(2)))


MIN_CORRELATION_SIGNIFICANCE = 3.0
"""Multiple of 1/sqrt(lines) by which the share of independent values is below 1 if the residual is correlated.

White noise reaches it once in 700 cases.
"""
HIDDEN_POLE_ERROR_FACTOR, HIDDEN_SIZE_ERROR_FACTOR = 2.5, 4.0
"""Standard errors of pole and size of a mode over the non-noise part of its residual, as a share of its peak.

Repeated measurements agree with them (docs/studies/modal.md). Sizes differ more, as no hit meets the same place.
"""
MAX_UNEVEN_NOISE_RATIO = 2.0
"""Residual over noise near a mode that uneven noise may cause by itself."""
RESIDUAL_ROUNDING_SHARE = 1e-7
"""Share of the measured values below which a residual is rounding."""
REDUCED_RESIDUAL_TERMS = 2
"""Number of residual terms left out in trial fits; with fewer terms the fit may follow no mode at all."""
TRIAL_LINE_RANGES = ((0.1, 1.0), (0.0, 0.9), (0.1, 0.9), (0.2, 0.8))
"""Ranges of the lines of a band used in trial fits, as shares."""
TRIAL_PEAK_HALF_WIDTHS = 2.0
"""Half-widths around a mode that a trial range must hold completely; else the peak is cut."""


class SystematicError(NamedTuple):
    """Errors to be added to those of a band because its residual is not white noise."""

    factor: float
    """Factor on the covariance from the residual: real values over independent values; 1 for white noise."""
    degrees_of_freedom: float
    """Remaining degrees of freedom."""
    covariance: Floats
    """Covariance of the errors in the order of `BandFit`, from trial fits; 0 for white noise."""
    shape: Floats
    """Variances of the errors in the same order, because merged or suspected modes are no exact poles; else 0."""


def systematic_error(band: FittedBand) -> SystematicError:
    """Estimate the errors beyond those of white noise, if the residual of a band is correlated.

    Structure that the model lacks leaves a residual that is alike over many lines. As many of its values are
    independent as its power fills bins of their transform, (sum P)^2 / sum P^2; white noise fills half of them.
    The residual does not show how far such structure shifts the modes. So each band is fitted again with fewer and more
    residual terms and on parts of its lines. Each value gets the rms shift as its error; a part that cuts a peak
    does not count for that mode. The residual near a mode beyond twice the noise, in squares, as a share
    of its peak, may hide an error of 2.5 times that share of its half-width and its zeta, and of 4 times of its size,
    whatever its correlation: repeated measurements of the same point differ by that.
    """
    hidden, independent, freedom = _hidden_error(band), _count_independent_values(band.fit), band.fit.degrees_of_freedom
    share = 1 - MIN_CORRELATION_SIGNIFICANCE / np.sqrt(band.fit.residual.size / 2)
    shape = _shape_variance(band)
    if independent > freedom * share or has_rounding_residual(band):
        return SystematicError(1.0, freedom, np.diag(hidden**2), shape)
    moved = np.array(list(_trial_changes(band))).reshape(-1, hidden.size)
    by_trials = np.sum(moved**2, axis=0) / np.maximum(np.count_nonzero(moved, axis=0), 1)
    factor, left = max(freedom / independent, 1.0), min(freedom, independent)
    return SystematicError(factor, left, np.diag(by_trials + hidden**2), shape)


def _shape_variance(band: FittedBand) -> Floats:
    """Return the variances of modes that may be several in the order of `BandFit`, 0 for the others."""
    spread = [band.frequency_spread(i) for i in range(band.fit.frequency.size)]
    return moving_mode_variance(band.fit, np.array(spread))


def moving_mode_variance(fit: BandFit, spread: Floats) -> Floats:
    """Return the variances of modes whose frequency differs during the measurement, in the order of `BandFit`.

    spread: standard deviation of the frequencies (Hz), shape (m,). The mean over 1 / (1 + i x), x in half-widths, has a
    peak that is lower by the mean square of x: zeta is too large, and K too small, by up to that share.
    """
    share = (spread / np.prod(fit.poles, axis=0)) ** 2
    sizes = (share * np.abs(fit.constant)).ravel()
    return np.concatenate([spread, share * fit.damping_ratio, sizes, sizes]) ** 2


def _hidden_error(band: FittedBand) -> Floats:
    """Return the errors that the residual near each mode may hide, in the order of `BandFit`."""
    fit, left = band.fit, [residual_near_mode(band, i) for i in range(band.fit.frequency.size)]
    of_peak, of_noise = np.array(left).T
    noise_share = MAX_UNEVEN_NOISE_RATIO / np.maximum(of_noise, MAX_UNEVEN_NOISE_RATIO)
    share = of_peak * np.sqrt(1 - noise_share**2) * (not has_rounding_residual(band))
    sizes = (HIDDEN_SIZE_ERROR_FACTOR * share * np.abs(fit.constant)).ravel()
    free = HIDDEN_POLE_ERROR_FACTOR * np.where(fit.held, 0.0, share)
    return np.concatenate([free * np.prod(fit.poles, axis=0), free * fit.damping_ratio, sizes, sizes])


def has_rounding_residual(band: FittedBand) -> bool:
    """Return whether the residual is no more than rounding."""
    scale = np.linalg.norm(band.data.target * band.data.weight)
    return bool(band.fit.sum_of_squares < (RESIDUAL_ROUNDING_SHARE * scale) ** 2)


def _count_independent_values(fit: BandFit) -> float:
    """Estimate how many of the real residuals are independent; about all of them for white noise."""
    power = np.abs(np.fft.fft(fit.complex_residual, axis=1)) ** 2
    return float(4 * power.sum() ** 2 / np.sum(power**2)) if power.any() else float(fit.residual.size)


def _trial_changes(band: FittedBand) -> Iterator[Floats]:
    """Yield the changes of the modes in trial fits, in the order of `BandFit`; 0 for modes whose peak a trial cuts."""
    fit, data, n = band.fit, band.data, band.data.frequency.size
    counts = range(band.terms - REDUCED_RESIDUAL_TERMS, MAX_RESIDUAL_TERMS + 1)
    trials = [(slice(0, n), terms) for terms in counts if terms != band.terms]
    trials += [(slice(round(low * n), round(high * n)), band.terms) for low, high in TRIAL_LINE_RANGES]
    for part, terms in trials:
        values = refit_nearby(fit, data.frequency[part], data.target[:, part], data.weight[:, part], terms)
        if values is not None:
            moved = _change_of_values(fit, *values).reshape(-1, fit.frequency.size)
            yield np.where(_is_peak_cut(fit, np.delete(data.frequency, part)), 0.0, moved).ravel()


def _is_peak_cut(fit: BandFit, left_out: Floats) -> Flags:
    """Return for each mode whether lines that are left out (Hz) belong to its peak, shape (m,)."""
    distance = np.abs(left_out[:, np.newaxis] - fit.frequency)
    return np.asarray(np.any(distance < TRIAL_PEAK_HALF_WIDTHS * np.prod(fit.poles, axis=0), axis=0))


def _change_of_values(fit: BandFit, poles: Floats, constant: Complexes) -> Floats:
    turn = np.exp(-1j * np.angle(fit.constant))
    off = (constant - fit.constant) * turn
    return np.concatenate([(poles - fit.poles).ravel(), off.real.ravel(), off.imag.ravel()])
