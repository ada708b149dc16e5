"""Modes band by band: found as peaks, fitted, settled with each other's tails, and looked at closer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import Frf
from modal.bands.extraction import Extraction, FittedBand
from modal.bands.find_resonances import Resonance, find_resonances, resonances_beside
from modal.bands.fit_peaks import fit_peaks, fit_real
from modal.bands.line_weights import line_weights
from modal.bands.local_bands import LocalBand, local_bands
from modal.bands.look_closer import look_closer
from modal.bands.noise_by_height import weights_by_residual
from modal.bands.one_thread import one_thread
from modal.bands.settle import settle
from modal.bands.suspected_pair import with_suspects
from modal.bands.usable_lines import usable_lines

ROUNDS = 4
"""Most rounds in which weights follow what the fits leave."""
SAME_WEIGHT = 0.2
"""Relative change of weights that is not worth another fit."""
STRAY = 8.0
"""A single line counts for nothing where it is this many times as far off as the median of the lines about it."""
ROUNDING = 1e-8
"""Share of the largest value below which no residual means anything."""


def extract(frfs: Sequence[Frf], band: tuple[float, float] | None = None) -> Extraction:
    """Find and fit all modes of these FRFs between band[0] and band[1] (Hz), with poles that are common to all.

    One FRF, or several on the same lines, the driving point first. Raises ValueError as `fit_points`.

    >>> frf = synthesize([Mode(500.0, 0.02, 2e7), Mode(900.0, 0.03, 5e7)], np.arange(1.0, 1501.0))
    >>> state = extract([frf])
    >>> [f"{band.fit.frequency[0]:.1f} Hz" for band in state.bands]
    ['500.0 Hz', '900.0 Hz']
    >>> float(abs(state.receptance - frf.receptance).max() / abs(frf.receptance).max()) < 1e-6
    True
    """
    with one_thread():
        return _extract(tuple(usable_lines(frf, band) for frf in _with_common_band(frfs)))


def _extract(lines: tuple[Frf, ...]) -> Extraction:
    empty = Extraction(lines, np.array([line_weights(frf) for frf in lines]), ())
    peaks = _common([find_resonances(frf) for frf in lines])
    state = settle(_fitted(empty, peaks))
    beside = _beside(state, peaks)
    state = state if len(beside) == len(peaks) else settle(_fitted(state, beside))
    closer = tuple(look_closer(band) for band in state.bands)
    if any(new is not old for new, old in zip(closer, state.bands, strict=True)):
        state = settle(replace(state, bands=closer))
    stray = _stray_lines(state)
    if np.any(stray):
        state = settle(replace(state, weight=np.where(stray, 0.0, state.weight)))
    state = _reweighted(state)
    return replace(state, bands=tuple(fit_real(with_suspects(band)) for band in state.bands))


def _reweighted(state: Extraction) -> Extraction:
    """Bands fitted with the weights that what they leave asks for, until those stay about as they are."""
    given = state.weight
    for _ in range(ROUNDS):
        weight = weights_by_residual(state, given)
        for band in state.bands:
            before = state.weight[:, band.lines]
            if np.all(np.abs(weight[:, band.lines] - before) <= SAME_WEIGHT * before):
                weight[:, band.lines] = before
        if np.array_equal(weight, state.weight):
            break
        state = settle(replace(state, weight=weight))
    return state


def _with_common_band(frfs: Sequence[Frf]) -> list[Frf]:
    """All with the narrowest usable band."""
    if not frfs:
        raise ValueError("there is no FRF; give one or more, the driving point first")
    if any(not np.array_equal(frf.frequency, frfs[0].frequency) for frf in frfs):
        raise ValueError("the FRFs differ in their frequency lines; measure or export all with the same settings")
    usable = [frf.usable_band for frf in frfs if frf.usable_band is not None]
    common = (max(low for low, _ in usable), min(high for _, high in usable)) if usable else None
    return [replace(frf, usable_band=common) for frf in frfs]


def _common(found: Sequence[list[Resonance]]) -> list[Resonance]:
    """Resonances of all FRFs by rising frequency, of two nearer to each other than a half-width the higher."""
    common: list[Resonance] = []
    for new in sorted(chain.from_iterable(found), key=lambda r: -r.height):
        if all(abs(new.frequency - old.frequency) >= max(new.half_width, old.half_width) for old in common):
            common.append(new)
    return sorted(common, key=lambda r: r.frequency)


def _fitted(before: Extraction, resonances: list[Resonance]) -> Extraction:
    """A first fit of every band around these, the highest first, each without the tails of those before.

    A band that was there before as it is now keeps its fit.
    """
    wanted = sorted(local_bands(resonances, before.frf.frequency), key=lambda local: -local.height)
    kept = [band for band in before.bands if any(_is_of(band, local) for local in wanted)]
    state = replace(before, bands=tuple(kept))
    for local in wanted:
        if not any(_is_of(band, local) for band in kept):
            band = fit_peaks(state.data(local.lines), local.resonances)
            state = state if band is None else replace(state, bands=(*state.bands, band))
    return replace(state, bands=tuple(sorted(state.bands, key=lambda band: band.lines.start)))


def _is_of(band: FittedBand, local: LocalBand) -> bool:
    """Whether a band was laid around these peaks on these lines."""
    return (band.resonances, band.lines) == (local.resonances, local.lines)


def _beside(state: Extraction, known: list[Resonance]) -> list[Resonance]:
    """Known resonances with those that stand out of what the fit of these leaves in any of the FRFs."""
    for frf, fitted in zip(state.frfs, state.receptance, strict=True):
        known = resonances_beside(known, replace(frf, receptance=frf.receptance - fitted))
    return known


def _stray_lines(state: Extraction) -> NDArray[np.bool_]:
    """Lines that stand far out of the residual on both sides of them: hum, or a carrier; shape (p, n)."""
    stray = np.zeros(state.weight.shape, bool)
    for band in state.bands:
        size = np.abs(band.data.own) * band.data.weight
        for mask, left, own in zip(stray, np.abs(band.fit.complex_residual), size, strict=True):
            far = left > STRAY * np.maximum(scipy.ndimage.median_filter(left, size=11), np.median(left))
            mask[band.lines] |= far & (left > ROUNDING * np.max(own))
    return stray
