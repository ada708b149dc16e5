"""Modes band by band: LSCF poles to start from, least squares to refine them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from threadpoolctl import threadpool_limits

from acquisition import Frf
from modal.find_resonances import Resonance, find_resonances, resonances_beside
from modal.fit_band import RESIDUAL_POWERS, BandFit, fit_band, gain_of_a_term
from modal.line_weights import line_weights
from modal.local_bands import LocalBand, local_bands
from modal.physical_poles import physical_poles
from modal.stabilise import StabilisationChart, stabilise
from modal.usable_lines import usable_lines

Array = NDArray[np.float64]

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


@dataclass(frozen=True, eq=False)
class FittedBand:
    """Some neighbouring modes that were fitted together."""

    lines: slice
    """Where on the frequency axis."""
    resonances: tuple[Resonance, ...]
    """The peaks that the band was laid around."""
    height: Array
    """What the mobility of each mode is measured against, its own peak or the highest of the band (m/s/N), (m,)."""
    fit: BandFit
    """Their values."""
    own: NDArray[np.complex128]
    """What they were fitted to: the receptance without the modes of all other bands (m/N)."""
    terms: int
    """Complex residual terms."""
    suspects: tuple[float, ...]
    """Frequencies of modes that may stand here instead of those fitted, but are too uncertain (Hz)."""
    chart: StabilisationChart
    """LSCF poles of these lines."""


@dataclass(frozen=True, eq=False)
class Extraction:
    """All that was found in one FRF."""

    frf: Frf
    """The lines that were used."""
    weight: Array
    """Their weights, shape (n,)."""
    bands: tuple[FittedBand, ...]
    """By rising frequency."""

    def receptance(self, frequency: Array, without: FittedBand | None = None) -> NDArray[np.complex128]:
        """Of all modes found but those of one band (m/N) at these frequencies (Hz), shape (n,)."""
        parts = [band.fit.receptance(frequency)[0] for band in self.bands if band is not without]
        return np.asarray(sum(parts, np.zeros(frequency.size, complex)))

    def own(self, band: FittedBand) -> NDArray[np.complex128]:
        """Measured receptance on the lines of a band without the modes of all others (m/N)."""
        part = band.lines
        return np.asarray(self.frf.receptance[part] - self.receptance(self.frf.frequency[part], without=band))

    def left(self, band: FittedBand) -> NDArray[np.complex128]:
        """Measured receptance on the lines of a band less the fit with its residual terms (m/N); 0 at stray lines."""
        real, imaginary = np.split(band.fit.residual, 2)
        weight = self.weight[band.lines]
        return np.asarray((real + 1j * imaginary) / np.where(weight > 0, weight, np.inf))


def extract(frf: Frf, band: tuple[float, float] | None = None) -> Extraction:
    """Find and fit all modes between band[0] and band[1] (Hz). Raises ValueError as `fit_modes`."""
    with threadpool_limits(limits=1):
        return _extract(usable_lines(frf, band))


def _extract(lines: Frf) -> Extraction:
    weight, resonances = line_weights(lines), find_resonances(lines)
    state = _started(lines, weight, resonances)
    left = replace(lines, receptance=lines.receptance - state.receptance(lines.frequency))
    more = resonances_beside(resonances, left)
    state = _started(lines, weight, more) if len(more) > len(resonances) else state
    state = _swept(state, SWEEPS if len(state.bands) > 1 else 0)
    stray = _stray_lines(state)
    return _swept(replace(state, weight=np.where(stray, 0.0, weight)), 0) if np.any(stray) else state


def _started(lines: Frf, weight: Array, resonances: list[Resonance]) -> Extraction:
    """A first fit of every band around these."""
    found = (_first(lines, weight, local) for local in local_bands(resonances, lines.frequency))
    return Extraction(lines, weight, tuple(band for band in found if band is not None))


def _swept(state: Extraction, times: int) -> Extraction:
    """All bands fitted again, the first time with a closer look, then so many times more."""
    for sweep in range(1 + times):
        for i in range(len(state.bands)):
            state = _again(state, i, look_closer=sweep == 0)
        state = replace(state, bands=tuple(band for band in state.bands if band.height.size))
    return state


def _stray_lines(state: Extraction) -> NDArray[np.bool_]:
    """Lines that stand far out of the residual on both sides of them: hum, or a carrier."""
    stray = np.zeros(state.weight.size, bool)
    for band in state.bands:
        size = np.abs(state.left(band)) * state.weight[band.lines]
        far = size > STRAY * np.maximum(median_filter(size, size=11), np.median(size))
        stray[band.lines] |= far & (size > ROUNDING * np.max(np.abs(band.own) * state.weight[band.lines]))
    return stray


def _first(frf: Frf, weight: Array, local: LocalBand) -> FittedBand | None:
    """The resonances of a band, each from the LSCF pole nearest to it, else from its own width."""
    part = local.lines
    f, own, w = frf.frequency[part], frf.receptance[part], weight[part]
    chart = stabilise(f, own[None], w[None], ORDERS)
    poles = physical_poles(chart)
    starts = np.array([(r.frequency, r.half_width / r.frequency) for r in local.resonances]).T
    for i, resonance in enumerate(local.resonances):
        near = np.abs(poles.frequency - resonance.frequency) < resonance.half_width
        if np.any(near):
            best = np.argmax(np.where(near, np.abs(poles.flexibility[:, 0]) / poles.damping_ratio, 0))
            starts[:, i] = poles.frequency[best], poles.damping_ratio[best]
    height = np.array([r.height for r in local.resonances])
    fitted = _fit(f, own, w, starts, height)
    if fitted is None:
        return None
    return FittedBand(part, local.resonances, fitted[1], fitted[0], own, LEAST_TERMS, (), chart)


def _again(state: Extraction, i: int, look_closer: bool) -> Extraction:
    """Fit band i to what the modes of all others leave; closer: also look for modes that have no peak."""
    band = state.bands[i]
    f, own, weight = state.frf.frequency[band.lines], state.own(band), state.weight[band.lines]
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


def _with_hidden(band: FittedBand, f: Array, own: NDArray[np.complex128], weight: Array) -> FittedBand:
    """The band with those modes added that have no peak of their own, where the sum of squares asks for them."""
    bent = _with_terms(band, f, own, weight)
    for starts in _more_modes(band, split=bent.terms > band.terms):
        height = np.full(starts.shape[1], np.max(band.height))
        fit = fit_band(f, own[None], weight[None], starts, band.terms)
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
    size = np.pi * poles.frequency * np.abs(poles.flexibility[:, 0]) / poles.damping_ratio
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


def _with_terms(band: FittedBand, f: Array, own: NDArray[np.complex128], weight: Array) -> FittedBand:
    """The band with as many residual terms as lower the sum of squares for more than by chance."""
    for terms in range(band.terms + 1, len(RESIDUAL_POWERS) + 1):
        if gain_of_a_term(band.fit, f, weight, terms - 1) < TERM_F * band.fit.sum_of_squares / band.fit.freedom:
            break
        fit = fit_band(f, own[None], weight[None], np.stack([band.fit.frequency, band.fit.damping_ratio]), terms)
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
    f: Array, own: NDArray[np.complex128], weight: Array, starts: Array, height: Array, terms: int = LEAST_TERMS
) -> tuple[BandFit, Array] | None:
    """Fit after the weakest of those that turn out to be no modes are taken out, one by one."""
    while height.size:
        fit = fit_band(f, own[None], weight[None], starts, terms)
        sure = np.zeros(height.size, bool) if fit is None else _are_modes(fit, f, height)
        if fit is not None and np.all(sure):
            return fit, height
        keep = np.arange(sure.size) != np.argmin(np.where(sure, np.inf, height))
        starts, height = starts[:, keep], height[keep]
    return None


def _are_modes(
    fit: BandFit, frequency: Array, height: Array, largest_error: float = LARGEST_ERROR
) -> NDArray[np.bool_]:
    _, damping_error, flexibility_error = fit.standard_error
    return np.asarray(
        (fit.frequency > frequency[0])
        & (fit.frequency < frequency[-1])
        & (fit.damping_ratio < 1)
        & (fit.mobility_peak > LEAST_SHARE * height)
        & (damping_error < largest_error * fit.damping_ratio)
        & (flexibility_error < largest_error * np.abs(fit.flexibility[0]))
    )
