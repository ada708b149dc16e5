"""Search a fitted band for modes without a peak of their own and for close pairs."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from modal.arrays import Floats
from modal.bands.extraction import FittedBand
from modal.bands.fit_peaks import MIN_MODE_PEAK_SHARE, are_modes
from modal.bands.residual_analysis import has_rounding_residual, has_white_residual, residual_noise, systematic_error
from modal.fitting.band_fit import MAX_RESIDUAL_TERMS
from modal.fitting.fit_band import fit_band, mode_pair_gain, residual_term_gain
from modal.poles import select_physical_poles

HIDDEN_MODE_F_RATIO = 40.0
"""F ratio of the sum of squares that a mode without a peak must reach."""
RESIDUAL_TERM_F_RATIO = 6.0
"""F ratio that a further residual term must reach."""
MAX_HIDDEN_MODE_ERROR = 1 / 6
"""Largest relative standard error of damping ratio and stiffness of a mode without a peak."""

SYSTEMATIC_ERROR_MARGIN = 1.6
"""Factor on the systematic errors of a mode without a peak, which must be certain even if they are the largest met.

A steel beam, whose peaks are no more linear than 1 %, has no pairs then (tests/validation/test_ladisk_beam.py).
"""


def refine_dense_band(band: FittedBand) -> FittedBand:
    """Add modes without a peak of their own if the sum of squares asks for them.

    A band whose residual is white noise or rounding is returned as it is.
    """
    if has_white_residual(band.fit) or has_rounding_residual(band):
        return band
    bent = _add_residual_terms(band)
    for starts in _trial_modes(band, split=bent.terms > band.terms):
        height = np.full(starts.shape[1], np.max(band.height))
        fit = fit_band(band.data.frequency, band.data.target, band.data.weight, starts, band.terms)
        if fit is None or not fit.passes_f_test(band.fit, RESIDUAL_TERM_F_RATIO) or not fit.has_lower_aic(bent.fit):
            continue
        is_hidden = fit.passes_f_test(band.fit, HIDDEN_MODE_F_RATIO)
        if is_hidden and np.all(are_modes(fit, band.data.frequency, height, MAX_HIDDEN_MODE_ERROR)):
            refitted = _add_residual_terms(replace(band, fit=fit, height=height))
            if _is_well_determined(refitted):
                return refitted
        if has_white_residual(fit) and np.all(are_modes(fit, band.data.frequency, height, np.inf)):
            bent = replace(bent, close_frequencies=tuple(sorted(fit.frequency.tolist())))
    return bent


def _is_well_determined(band: FittedBand) -> bool:
    """Return whether all modes are certain enough, systematic errors included."""
    more, fit = systematic_error(band), band.fit
    variance = np.diag(more.factor * fit.covariance + SYSTEMATIC_ERROR_MARGIN**2 * more.covariance)
    error = np.sqrt(variance).reshape(-1, fit.frequency.size)
    sizes = error[2 : 2 + len(fit.constant)] / np.abs(fit.constant)
    is_certain = np.any(sizes < MAX_HIDDEN_MODE_ERROR, axis=0)
    return bool(np.all(is_certain & (error[1] < MAX_HIDDEN_MODE_ERROR * fit.damping_ratio)))


def _trial_modes(band: FittedBand, split: bool) -> Iterator[Floats]:
    """Yield start values (2, m) for more modes, from all high LSCF poles down; then for a split of the highest mode."""
    fit, fitted, poles = band.fit, band.fit.poles, select_physical_poles(band.data.chart)
    size = np.pi * poles.frequency * poles.largest / poles.damping_ratio
    high = size > MIN_MODE_PEAK_SHARE * np.max(band.height)
    starts = np.stack([poles.frequency, poles.damping_ratio])[:, high]
    alone = [k for k in range(band.height.size) if not np.any(np.abs(starts[0] - fitted[0, k]) < np.prod(fitted[:, k]))]
    starts, size = np.hstack([starts, fitted[:, alone]]), np.concatenate([size[high], fit.mobility_peak[alone]])
    for n in range(size.size, band.height.size, -1):
        yield starts[:, np.argsort(-size)[:n]]
    if split:
        yield split_pole(fitted, int(np.argmax(fit.mobility_peak)))


def _add_residual_terms(band: FittedBand) -> FittedBand:
    """Add residual terms while they lower the sum of squares by more than chance."""
    data = band.data
    for terms in range(band.terms + 1, MAX_RESIDUAL_TERMS + 1):
        least = RESIDUAL_TERM_F_RATIO * len(data.target) * band.fit.sum_of_squares / band.fit.degrees_of_freedom
        if residual_term_gain(band.fit, data.frequency, data.weight, terms - 1) < least:
            break
        fit = fit_band(data.frequency, data.target, data.weight, band.fit.poles, terms)
        if fit is None or not fit.passes_f_test(band.fit, RESIDUAL_TERM_F_RATIO):
            break
        if not np.all(are_modes(fit, data.frequency, band.height)):
            break
        band = replace(band, fit=fit, terms=terms)
    return band


MIN_PAIR_GAIN = 9.0
"""Least gain of a pair per unknown over chance; a single mode reaches it once in 8000 cases (exp -9)."""
PAIR_TRIAL_OFFSET = 0.35
"""Half the distance of the two trial modes (half-power half-widths)."""
MAX_PAIR_SIZE_CHANGE = 2.0
"""Largest change of a mode's size by a pair (standard errors) for which its stiffness counts as its own."""
MAX_PAIR_RESIDUAL_TO_NOISE = 2.0
"""Largest residual of a pair over the noise (rms)."""
MIN_PAIR_SHARE = 0.01
"""Least contribution of a pair over the mode (rms): real peaks are no more linear than that."""


def mark_close_modes(band: FittedBand) -> FittedBand:
    """Record the frequencies of two close modes that may replace one fitted mode, whose K is then that of both.

    Conditions: a single mode does not explain the peak, two leave white noise, and neither is as large as the one.
    """
    fit, data = band.fit, band.data
    i = (
        None
        if band.close_frequencies or band.merged or has_rounding_residual(band)
        else _least_likely_single_mode(band)
    )
    if i is None:
        return band
    pair = fit_band(data.frequency, data.target, data.weight, split_pole(fit.poles, i), band.terms)
    if pair is None or not (has_white_residual(pair) and pair.has_lower_aic(fit)):
        return band
    height = np.full(pair.frequency.size, np.max(band.height))
    larger = np.max(np.abs(pair.constant[0, -2:])) / abs(fit.constant[0, i])
    is_own = abs(larger - 1) < MAX_PAIR_SIZE_CHANGE * fit.size_error[0, i]
    if is_own or not np.all(are_modes(pair, data.frequency, height, np.inf)):
        return band
    return replace(band, close_frequencies=tuple(sorted(pair.frequency[-2:].tolist())))


def _least_likely_single_mode(band: FittedBand) -> int | None:
    """Return the mode that is least likely to be a single one.

    None if chance explains all of them, a pair adds next to nothing, or it leaves far more than noise.
    """
    fit, data = band.fit, band.data
    gains = [mode_pair_gain(fit, data.frequency, data.weight, band.terms, i) for i in range(fit.frequency.size)]
    i, unknowns = int(np.argmax(gains)), 2 * len(data.target)
    chance = MIN_PAIR_GAIN * unknowns * fit.sum_of_squares / fit.degrees_of_freedom
    next_to_nothing = (MIN_PAIR_SHARE * float(np.linalg.norm(data.weight * fit.of_mode(i, data.frequency)))) ** 2
    noise = (MAX_PAIR_RESIDUAL_TO_NOISE * residual_noise(fit)) ** 2 * fit.complex_residual.size
    return i if gains[i] > max(chance, next_to_nothing, fit.sum_of_squares - noise) else None


def split_pole(poles: Floats, i: int) -> Floats:
    """Replace one pole by two, which come last, shape (2, m + 1)."""
    frequency, damping_ratio = poles[:, i]
    apart = PAIR_TRIAL_OFFSET * damping_ratio * frequency
    pair = [[frequency - apart, frequency + apart], 2 * [damping_ratio]]
    return np.hstack([np.delete(poles, i, axis=1), pair])
