"""Modes band by band: LSCF poles to start from, least squares to refine them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from threadpoolctl import threadpool_limits

from acquisition import Frf
from modal.extraction import Array, ComplexArray, Extraction, FittedBand
from modal.find_resonances import Resonance, find_resonances, resonances_beside
from modal.fit_band import RESIDUAL_POWERS, BandFit, fit_band, gain_of_a_term
from modal.line_weights import line_weights
from modal.local_bands import LocalBand, local_bands
from modal.physical_poles import physical_poles
from modal.stabilise import stabilise
from modal.usable_lines import usable_lines

ORDERS = 10
"""Highest order of the LSCF models of a band, several times the modes that one holds."""
SWEEPS = 3
"""Rounds over the bands after the second, each with the tails of the other bands' modes as they are then."""
SETTLED = 0.01
"""Change of those tails, as a share of what the fit leaves, that is not worth another fit."""
LARGEST_ERROR = 1 / 3
"""Relative standard error of damping ratio and stiffness above which a peak is not a mode."""
LEAST_SHARE = 0.05
"""Share of its peak of the mobility that a mode has; 1 dB of prominence needs twice this."""
HIDDEN_F = 40.0
"""A mode without a peak of its own lowers the sum of squares by this many times what three unknowns do by chance."""
LEAST_TERMS = 4
"""Complex residual terms that every band has."""
TERM_F = 6.0
"""A further residual term lowers it by this many times what two unknowns do by chance."""
STRAY = 8.0
"""A single line counts for nothing where it is this many times as far off as the median of the lines about it."""
ROUNDING = 1e-8
"""Share of the largest value below which no residual means anything."""
SPLIT = 0.35
"""Half the distance at which two modes in place of one are tried (half-power half-widths)."""
HIDDEN_ERROR = 1 / 6
"""Relative standard error that its damping ratio and stiffness have at most."""


def extract(frfs: Sequence[Frf], band: tuple[float, float] | None = None) -> Extraction:
    """Find and fit all modes of these FRFs between band[0] and band[1] (Hz), with poles that are common to all.

    One FRF, or several on the same lines, the driving point first. Raises ValueError as `fit_points`.
    """
    with threadpool_limits(limits=1):
        return _extract(tuple(usable_lines(frf, band) for frf in _with_common_band(frfs)))


def _extract(lines: tuple[Frf, ...]) -> Extraction:
    weight = np.array([line_weights(frf) for frf in lines])
    resonances = _common([find_resonances(frf) for frf in lines])
    state = _started(lines, weight, resonances)
    more = _beside(state, resonances)
    state = _started(lines, weight, more) if len(more) > len(resonances) else state
    state = _swept(state, SWEEPS if len(state.bands) > 1 else 0)
    stray = _stray_lines(state)
    return _swept(replace(state, weight=np.where(stray, 0.0, weight)), 0) if np.any(stray) else state


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


def _started(lines: tuple[Frf, ...], weight: Array, resonances: list[Resonance]) -> Extraction:
    """A first fit of every band around these."""
    state = Extraction(lines, weight, ())
    found = (_first(state, local) for local in local_bands(resonances, lines[0].frequency))
    return replace(state, bands=tuple(band for band in found if band is not None))


def _beside(state: Extraction, known: list[Resonance]) -> list[Resonance]:
    """Known resonances with those that stand out of what the fit of these leaves in any of the FRFs."""
    for frf, fitted in zip(state.frfs, state.receptance(state.frf.frequency), strict=True):
        known = resonances_beside(known, replace(frf, receptance=frf.receptance - fitted))
    return known


def _swept(state: Extraction, times: int) -> Extraction:
    """All bands fitted again, the first time with a closer look, then so many times more."""
    for sweep in range(1 + times):
        for i in range(len(state.bands)):
            state = _again(state, i, look_closer=sweep == 0)
        state = replace(state, bands=tuple(band for band in state.bands if band.height.size))
    return state


def _stray_lines(state: Extraction) -> NDArray[np.bool_]:
    """Lines that stand far out of the residual on both sides of them: hum, or a carrier; shape (p, n)."""
    stray = np.zeros(state.weight.shape, bool)
    for band in state.bands:
        weight = state.weight[:, band.lines]
        for one, left, own in zip(stray, np.abs(state.left(band)) * weight, np.abs(band.own) * weight, strict=True):
            far = left > STRAY * np.maximum(median_filter(left, size=11), np.median(left))
            one[band.lines] |= far & (left > ROUNDING * np.max(own))
    return stray


def _first(state: Extraction, local: LocalBand) -> FittedBand | None:
    """The resonances of a band, each from the LSCF pole nearest to it, else from its own width."""
    part = local.lines
    f, weight = state.frf.frequency[part], state.weight[:, part]
    own = np.array([frf.receptance[part] for frf in state.frfs])
    chart = stabilise(f, own, weight, ORDERS)
    poles = physical_poles(chart)
    starts = np.array([(r.frequency, r.half_width / r.frequency) for r in local.resonances]).T
    for i, resonance in enumerate(local.resonances):
        near = np.abs(poles.frequency - resonance.frequency) < resonance.half_width
        if np.any(near):
            best = np.argmax(np.where(near, poles.largest / poles.damping_ratio, 0))
            starts[:, i] = poles.frequency[best], poles.damping_ratio[best]
    height = np.array([r.height for r in local.resonances])
    fitted = _fit(f, own, weight, starts, height)
    if fitted is None:
        return None
    return FittedBand(part, local.resonances, fitted[1], fitted[0], own, LEAST_TERMS, (), chart)


def _again(state: Extraction, i: int, look_closer: bool) -> Extraction:
    """Fit band i to what the modes of all others leave; closer: also look for modes that have no peak."""
    band = state.bands[i]
    f, own, weight = state.frf.frequency[band.lines], state.own(band), state.weight[:, band.lines]
    change = np.linalg.norm((own - band.own) * weight)
    if not look_closer and change**2 < SETTLED**2 * band.fit.sum_of_squares:
        return state
    starts = np.stack([band.fit.frequency, band.fit.damping_ratio])
    fitted = _fit(f, own, weight, starts, band.height, band.terms)
    if fitted is None:
        new = replace(band, height=np.empty(0))
    else:
        new = replace(band, fit=fitted[0], height=fitted[1], own=own)
        new = _with_hidden(new, f, own, weight) if look_closer else new
    return replace(state, bands=(*state.bands[:i], new, *state.bands[i + 1 :]))


def _with_hidden(band: FittedBand, f: Array, own: ComplexArray, weight: Array) -> FittedBand:
    """The band with those modes added that have no peak of their own, where the sum of squares asks for them."""
    bent = _with_terms(band, f, own, weight)
    for starts in _more_modes(band, split=bent.terms > band.terms):
        height = np.full(starts.shape[1], np.max(band.height))
        fit = fit_band(f, own, weight, starts, band.terms)
        if fit is None or not _is_better(fit, band.fit, TERM_F) or not _is_likelier(fit, bent.fit):
            continue
        if _is_better(fit, band.fit, HIDDEN_F) and np.all(_are_modes(fit, f, height, HIDDEN_ERROR)):
            return _with_terms(replace(band, fit=fit, height=height), f, own, weight)
        if np.all(_are_modes(fit, f, height, np.inf)):
            bent = replace(bent, suspects=tuple(sorted(fit.frequency.tolist())))
    return bent


def _more_modes(band: FittedBand, split: bool) -> Iterator[Array]:
    """Starts (2, m) for more modes than are fitted, from all high LSCF poles down; then two for the highest mode."""
    fit, poles = band.fit, physical_poles(band.chart)
    known = np.stack([fit.frequency, fit.damping_ratio])
    size = np.pi * poles.frequency * poles.largest / poles.damping_ratio
    high = size > LEAST_SHARE * np.max(band.height)
    starts = np.stack([poles.frequency, poles.damping_ratio])[:, high]
    alone = [k for k in range(band.height.size) if not np.any(np.abs(starts[0] - known[0, k]) < np.prod(known[:, k]))]
    starts, size = np.hstack([starts, known[:, alone]]), np.concatenate([size[high], fit.mobility_peak[alone]])
    for n in range(size.size, band.height.size, -1):
        yield starts[:, np.argsort(-size)[:n]]
    if split:
        i = int(np.argmax(fit.mobility_peak))
        apart = SPLIT * known[1, i] * known[0, i]
        halves = [[known[0, i] - apart, known[0, i] + apart], 2 * [known[1, i]]]
        yield np.hstack([np.delete(known, i, axis=1), halves])


def _with_terms(band: FittedBand, f: Array, own: ComplexArray, weight: Array) -> FittedBand:
    """The band with as many residual terms as lower the sum of squares for more than by chance."""
    for terms in range(band.terms + 1, len(RESIDUAL_POWERS) + 1):
        least = TERM_F * len(own) * band.fit.sum_of_squares / band.fit.freedom
        if gain_of_a_term(band.fit, f, weight, terms - 1) < least:
            break
        fit = fit_band(f, own, weight, np.stack([band.fit.frequency, band.fit.damping_ratio]), terms)
        if fit is None or not _is_better(fit, band.fit, TERM_F) or not np.all(_are_modes(fit, f, band.height)):
            break
        band = replace(band, fit=fit, terms=terms)
    return band


def _is_better(more: BandFit, fewer: BandFit, least: float) -> bool:
    """Whether the sum of squares falls by more than `least` times what the further unknowns take off by chance."""
    gain = (fewer.sum_of_squares - more.sum_of_squares) / max(fewer.freedom - more.freedom, 1)
    return gain > least * more.sum_of_squares / more.freedom


def _is_likelier(fit: BandFit, other: BandFit) -> bool:
    """By the information criterion of Akaike (sum of squares and number of unknowns)."""
    variance = min(one.sum_of_squares / one.freedom for one in (fit, other))
    return fit.sum_of_squares - 2 * variance * fit.freedom < other.sum_of_squares - 2 * variance * other.freedom


def _fit(
    f: Array, own: ComplexArray, weight: Array, starts: Array, height: Array, terms: int = LEAST_TERMS
) -> tuple[BandFit, Array] | None:
    """Fit after the weakest of those that turn out to be no modes are taken out, one by one."""
    while height.size:
        fit = fit_band(f, own, weight, starts, terms)
        sure = np.zeros(height.size, bool) if fit is None else _are_modes(fit, f, height)
        if fit is not None and np.all(sure):
            return fit, height
        keep = np.arange(sure.size) != np.argmin(np.where(sure, np.inf, height))
        starts, height = starts[:, keep], height[keep]
    return None


def _are_modes(
    fit: BandFit, frequency: Array, height: Array, largest_error: float = LARGEST_ERROR
) -> NDArray[np.bool_]:
    """Which lie in the band, are high enough, and are known well enough in one of the FRFs at least."""
    damping_error, flexibility_error = fit.standard_error[1], fit.standard_error[2:]
    return np.asarray(
        (fit.frequency > frequency[0])
        & (fit.frequency < frequency[-1])
        & (fit.damping_ratio < 1)
        & (fit.mobility_peak > LEAST_SHARE * height)
        & (damping_error < largest_error * fit.damping_ratio)
        & np.any(flexibility_error < largest_error * np.abs(fit.flexibility), axis=0)
    )
