"""Extract all modes of one or several FRFs, band by band."""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import cache
from itertools import chain

import numpy as np
import scipy
from threadpoolctl import ThreadpoolController

from acquisition import Frf
from modal.arrays import Complexes, Flags, Floats
from modal.bands.dense_bands import mark_close_modes, refine_dense_band
from modal.bands.extraction import Extraction, FittedBand
from modal.bands.find_resonances import Resonance, add_residual_resonances, find_resonances
from modal.bands.fit_peaks import fit_peaks, group_into_bands, iterate_bands, refit_real_constants
from modal.bands.frf_lines import line_weights, usable_lines
from modal.bands.merge_modes import merge_phantom_pairs
from modal.bands.residual_analysis import has_rounding_residual


def limit_to_one_thread() -> AbstractContextManager[object]:
    """Limit the numerical libraries to one thread: with two, small matrices take three times as long."""
    limited: AbstractContextManager[object] = _thread_controller().limit(limits=1)
    return limited


@cache
def _thread_controller() -> ThreadpoolController:
    """Find the libraries once: it takes as long as a fit."""
    return ThreadpoolController()


MIN_NOISE_GROWTH_EVIDENCE = 4.0
"""Twice the log likelihood gain from which noise grows with the FRF; chance reaches it once in 44 cases."""
MAX_SCORING_STEPS = 12
"""Most steps of Fisher scoring; about five are usual."""
SCORING_TOLERANCE = 1e-6
"""Relative change of the shares at convergence."""
MIN_NOISE_FLOOR_SHARE = 1e-4
"""Least share of the noise floor in the variance at the mean squared height."""


def update_line_weights(state: Extraction, given: Floats) -> Floats:
    """Return line weights (p, n) that follow from the residuals of the bands; given: weights without that knowledge.

    Noise proportional to the FRF (of the hammer, of the hit position, of leakage) is largest on the peaks. Equal
    weights spread it over the whole band: the errors of damping ratio and stiffness come out too small.
    """
    weight = given.copy()
    for band in state.bands:
        if not has_rounding_residual(band):
            weight[:, band.lines] /= _noise_profile(state.residual(band), band, given[:, band.lines])
    return weight


def _noise_profile(left: Complexes, band: FittedBand, given: Floats) -> Floats:
    """Return the rms of the weighted noise by line over that of the band, for each FRF, shape (p, n).

    left: residual of the receptances (m/N); given: weights, all of shape (p, n).
    """
    height = np.abs((band.data.target - left) * given) ** 2
    variance = _fit_noise_variance(np.abs(left * given) ** 2, height, given > 0)
    return np.asarray(np.sqrt(np.maximum(variance / np.mean(variance), MIN_NOISE_FLOOR_SHARE**2)))


def _fit_noise_variance(left: Floats, height: Floats, counts: Flags) -> Floats:
    """Fit the likeliest variance by line of each FRF, floor + slope height or equal on all lines, shape (p, n).

    left, height: squares of the residual and of the model; counts: lines used, all (p, n).
    """
    columns = np.stack([np.ones(left.shape), height / np.mean(height, axis=1, keepdims=True)], axis=1)
    known, squares = columns * counts[:, np.newaxis], left * counts
    mean = np.sum(squares, axis=1) / np.sum(counts, axis=1)
    equal = share = np.stack([np.where(mean > 0, mean, 1.0), np.zeros(mean.size)], axis=1)[:, np.newaxis]
    for _ in range(MAX_SCORING_STEPS):
        before, variance = share, share @ columns
        scaled = known / variance
        share = np.maximum((squares[:, np.newaxis] / variance) @ scaled.mT @ np.linalg.pinv(scaled @ scaled.mT), 0.0)
        share[..., 0] = np.maximum(share[..., 0], MIN_NOISE_FLOOR_SHARE * share[..., 1])
        if np.all(np.abs(share - before) <= SCORING_TOLERANCE * before):
            break
    likely, even = (_log_likelihood(squares, (values @ columns)[:, 0], counts) for values in (share, equal))
    share = np.where((2 * (likely - even) > MIN_NOISE_GROWTH_EVIDENCE)[:, np.newaxis, np.newaxis], share, equal)
    return np.asarray(np.where(mean[:, np.newaxis] > 0, (share @ columns)[:, 0], 0.0))


def _log_likelihood(left: Floats, variance: Floats, counts: Flags) -> Floats:
    """Return the log likelihood of these variances for complex normal residuals of each FRF, shape (p,)."""
    return np.asarray(-np.sum((np.log(variance) + left / variance) * counts, axis=1))


MAX_REWEIGHTING_ROUNDS = 4
"""Most rounds in which weights follow the residuals."""
MIN_WEIGHT_CHANGE = 0.2
"""Relative change of weights that needs a new fit."""
STRAY_LINE_RATIO = 8.0
"""Residual of a stray line over the median of the lines around it."""
STRAY_ROUNDING_SHARE = 1e-8
"""Share of the largest value below which a residual is rounding."""


def extract_modes(frfs: Sequence[Frf], band: tuple[float, float] | None = None) -> Extraction:
    """Find and fit all modes of one or several FRFs with common poles.

    Parameters
    ----------
    frfs : sequence of Frf
        FRFs on the same lines, the driving point first.
    band : tuple of float, optional
        Lowest and highest frequency (Hz).

    Returns
    -------
    Extraction
        Fitted bands of modes.

    Raises
    ------
    ValueError
        As `fit_common_modes`.

    Examples
    --------
    >>> frf = synthesize_frf([Mode(500.0, 0.02, 2e7), Mode(900.0, 0.03, 5e7)], np.arange(1.0, 1501.0))
    >>> state = extract_modes([frf])
    >>> [f"{band.fit.frequency[0]:.1f} Hz" for band in state.bands]
    ['500.0 Hz', '900.0 Hz']
    >>> float(abs(state.receptance - frf.receptance).max() / abs(frf.receptance).max()) < 1e-6
    True
    """
    with limit_to_one_thread():
        return _extract_bands(tuple(usable_lines(frf, band) for frf in _limit_to_common_band(frfs)))


def _extract_bands(lines: tuple[Frf, ...]) -> Extraction:
    empty = Extraction(lines, np.array([line_weights(frf) for frf in lines]), ())
    peaks = _merge_resonances([find_resonances(frf) for frf in lines])
    state = iterate_bands(_fit_bands(empty, peaks))
    extended = peaks
    for frf, fitted in zip(state.frfs, state.receptance, strict=True):
        extended = add_residual_resonances(extended, replace(frf, receptance=frf.receptance - fitted))
    state = state if len(extended) == len(peaks) else iterate_bands(_fit_bands(state, extended))
    refined = tuple(refine_dense_band(band) for band in state.bands)
    if any(new is not old for new, old in zip(refined, state.bands, strict=True)):
        state = iterate_bands(replace(state, bands=refined))
    stray = _stray_lines(state)
    if np.any(stray):
        state = iterate_bands(replace(state, weight=np.where(stray, 0.0, state.weight)))
    state = _reweight(state)
    merged = tuple(merge_phantom_pairs(band) for band in state.bands)
    if any(new is not old for new, old in zip(merged, state.bands, strict=True)):
        state = iterate_bands(replace(state, bands=merged))
    return replace(state, bands=tuple(refit_real_constants(mark_close_modes(band)) for band in state.bands))


def _reweight(state: Extraction) -> Extraction:
    """Refit the bands with weights from their residuals until the weights converge."""
    given = state.weight
    for _ in range(MAX_REWEIGHTING_ROUNDS):
        weight = update_line_weights(state, given)
        for band in state.bands:
            before = state.weight[:, band.lines]
            if np.all(np.abs(weight[:, band.lines] - before) <= MIN_WEIGHT_CHANGE * before):
                weight[:, band.lines] = before
        if np.array_equal(weight, state.weight):
            break
        state = iterate_bands(replace(state, weight=weight))
    return state


def _limit_to_common_band(frfs: Sequence[Frf]) -> list[Frf]:
    """Give all FRFs the narrowest usable band."""
    if not frfs:
        raise ValueError("no FRF given. Give one or more FRFs, with that of the driving point first.")
    if any(not np.array_equal(frf.frequency, frfs[0].frequency) for frf in frfs):
        raise ValueError("the FRFs have different frequency lines. Export all FRFs with the same settings.")
    usable = [frf.usable_band for frf in frfs if frf.usable_band is not None]
    common = (max(low for low, _ in usable), min(high for _, high in usable)) if usable else None
    return [replace(frf, usable_band=common) for frf in frfs]


def _merge_resonances(found: Sequence[list[Resonance]]) -> list[Resonance]:
    """Merge the resonances of all FRFs by rising frequency; of two within a half-width the higher stays."""
    common: list[Resonance] = []
    for new in sorted(chain.from_iterable(found), key=lambda r: -r.height):
        if not any(new.overlaps(old) for old in common):
            common.append(new)
    return sorted(common, key=lambda r: r.frequency)


def _fit_bands(before: Extraction, resonances: list[Resonance]) -> Extraction:
    """Fit every band around these resonances for the first time, the highest first, without tails of earlier ones.

    An earlier band with the same resonances and lines keeps its fit.
    """
    local_bands = group_into_bands(resonances, before.frf.frequency)
    state = replace(before, bands=tuple(b for b in before.bands if (b.resonances, b.lines) in local_bands))
    kept = [(band.resonances, band.lines) for band in state.bands]
    for local in sorted(local_bands, key=lambda local: -max(r.height for r in local.resonances)):
        if local not in kept:
            band = fit_peaks(state.data(local.lines), local.resonances)
            state = state if band is None else replace(state, bands=(*state.bands, band))
    return replace(state, bands=tuple(sorted(state.bands, key=lambda band: band.lines.start)))


def _stray_lines(state: Extraction) -> Flags:
    """Return which lines far exceed the residual on both sides of them (hum, a carrier), shape (p, n)."""
    stray = np.zeros(state.weight.shape, bool)
    for band in state.bands:
        size = np.abs(band.data.target) * band.data.weight
        for mask, left, own in zip(stray, np.abs(band.fit.complex_residual), size, strict=True):
            far = left > STRAY_LINE_RATIO * np.maximum(scipy.ndimage.median_filter(left, size=11), np.median(left))
            mask[band.lines] |= far & (left > STRAY_ROUNDING_SHARE * np.max(own))
    return stray
