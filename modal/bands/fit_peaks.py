"""Group resonances into bands, fit the peaks of each band, and iterate until all bands agree."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from modal.arrays import Flags, Floats
from modal.bands.extraction import BandData, Extraction, FittedBand
from modal.bands.find_resonances import Resonance
from modal.fitting import MIN_RESIDUAL_TERMS, BandFit, fit_band, fit_real_constants, remove_residual_terms
from modal.poles import select_physical_poles

JOINT_FIT_DISTANCE = 4.0
"""Neighbours nearer than this many times the sum of their half-widths are fitted together."""
MAX_RESONANCES_PER_BAND = 6
"""Most resonances that are fitted together: the time of a fit grows with their square, and more of them often do not
settle."""
BAND_MARGIN_HALF_WIDTHS = 8.0
"""A local band ends this many half-widths beyond its outer resonances."""
MIN_BAND_MARGIN_LINES = 6
"""Lines that a local band has at least on either side, where there are as many."""


@dataclass(frozen=True)
class LocalBand:
    """Resonances that are fitted together."""

    resonances: tuple[Resonance, ...]
    """Resonances by rising frequency."""
    lines: slice
    """Place on the frequency axis."""

    @property
    def height(self) -> float:
        """Of its highest resonance (m/s/N)."""
        return max(resonance.height for resonance in self.resonances)


def group_into_bands(resonances: Sequence[Resonance], frequency: Floats) -> list[LocalBand]:
    """Bands around close resonances; neighbouring ones meet between them, in proportion to their half-widths.

    resonances come by rising frequency, frequency (Hz) has shape (n,).
    """
    groups = [part for group in _close_groups(resonances) for part in _split_group(group)]
    meetings = [_band_boundary(a[-1], b[0]) for a, b in pairwise(groups)]
    borders = zip(groups, [-np.inf, *meetings], [*meetings, np.inf], strict=False)
    return [LocalBand(group, _band_lines(group, below, above, frequency)) for group, below, above in borders]


def _close_groups(resonances: Sequence[Resonance]) -> Iterator[tuple[Resonance, ...]]:
    group: tuple[Resonance, ...] = ()
    for resonance in resonances:
        if group and not _are_close(group[-1], resonance):
            yield group
            group = ()
        group = (*group, resonance)
    if group:
        yield group


def _split_group(group: tuple[Resonance, ...]) -> Iterator[tuple[Resonance, ...]]:
    """The group, or what is left of it when it is cut at its widest gaps until no part is too large."""
    if len(group) <= MAX_RESONANCES_PER_BAND:
        yield group
        return
    gaps = [(b.frequency - a.frequency) / (a.half_width + b.half_width) for a, b in pairwise(group)]
    widest = int(np.argmax(gaps)) + 1
    yield from _split_group(group[:widest])
    yield from _split_group(group[widest:])


def _are_close(a: Resonance, b: Resonance) -> bool:
    return b.frequency - a.frequency < JOINT_FIT_DISTANCE * (a.half_width + b.half_width)


def _band_boundary(a: Resonance, b: Resonance) -> float:
    return (a.frequency * b.half_width + b.frequency * a.half_width) / (a.half_width + b.half_width)


def _band_lines(group: tuple[Resonance, ...], below: float, above: float, frequency: Floats) -> slice:
    low = max(below, min(r.frequency - BAND_MARGIN_HALF_WIDTHS * r.half_width for r in group))
    high = min(above, max(r.frequency + BAND_MARGIN_HALF_WIDTHS * r.half_width for r in group))
    first, last = np.searchsorted(frequency, [group[0].frequency, group[-1].frequency])
    start = min(int(np.searchsorted(frequency, low)), int(first) - MIN_BAND_MARGIN_LINES)
    end = max(int(np.searchsorted(frequency, high, side="right")), int(last) + MIN_BAND_MARGIN_LINES + 1)
    return slice(max(start, 0), end)


MAX_PEAK_FIT_ERROR = 1 / 3
"""Relative standard error of damping ratio and stiffness above which a peak is not a mode."""
MIN_MODE_PEAK_SHARE = 0.05
"""Share of its peak of the mobility that a mode has; 1 dB of prominence needs twice this."""
MAX_FITTED_DAMPING = 0.9
"""Damping ratio up to which a mode oscillates visibly; the fit itself ends at 1."""
MAX_DIRECT_FIT_RESIDUAL = 0.05
"""A fit from the peaks alone that leaves less than this share (rms) needs no LSCF poles to start from."""


def fit_peaks(data: BandData, resonances: Sequence[Resonance]) -> FittedBand | None:
    """The resonances of a band, each from its own width, or from the LSCF pole nearest to it; None where none fits."""
    starts = np.array([(r.frequency, r.half_width / r.frequency) for r in resonances]).T
    height = np.array([r.height for r in resonances])
    fitted = _fit_valid_modes(data, starts, height, MIN_RESIDUAL_TERMS)
    if fitted is None or fitted[1].size < height.size or _residual_share(fitted[0], data) > MAX_DIRECT_FIT_RESIDUAL:
        from_poles = _fit_valid_modes(data, _nearest_poles(data, resonances, starts), height, MIN_RESIDUAL_TERMS)
        fitted = _better_fit(fitted, from_poles)
    if fitted is None:
        return None
    return FittedBand(data, tuple(resonances), fitted[1], fitted[0], MIN_RESIDUAL_TERMS)


def refit_band(band: FittedBand, data: BandData) -> FittedBand | None:
    """The modes of a band fitted to other data; None where none of them is left. Those that a person chose all stay."""
    if band.edits:
        poles, held = band.fit.poles, band.fit.held
        fit = fit_band(data.frequency, data.target, data.weight, poles, band.terms, held)
        return band if fit is None else replace(band, data=data, fit=fit)
    fitted = _fit_valid_modes(data, band.fit.poles, band.height, band.terms)
    return None if fitted is None else replace(band, data=data, fit=fitted[0], height=fitted[1])


def refit_with_real_constants(band: FittedBand) -> FittedBand:
    """The band with real modal constants, where they do."""
    data = band.data
    fit = fit_real_constants(band.fit, data.frequency, data.target, data.weight, band.terms)
    return replace(band, fit=fit) if np.all(are_modes(fit, data.frequency, band.height)) else band


def are_modes(fit: BandFit, frequency: Floats, height: Floats, largest_error: float = MAX_PEAK_FIT_ERROR) -> Flags:
    """Which lie in the band, are high enough, and are known well enough in one of the FRFs at least."""
    return np.asarray(
        (fit.frequency > frequency[0])
        & (fit.frequency < frequency[-1])
        & (fit.damping_ratio < MAX_FITTED_DAMPING)
        & (fit.mobility_peak > MIN_MODE_PEAK_SHARE * height)
        & (fit.standard_error[1] < largest_error * fit.damping_ratio)
        & np.any(fit.size_error < largest_error, axis=0)
    )


def _nearest_poles(data: BandData, resonances: Sequence[Resonance], starts: Floats) -> Floats:
    """Starts (2, m) with the highest LSCF pole within the half-width of each resonance, where there is one."""
    poles, starts = select_physical_poles(data.chart), starts.copy()
    for i, resonance in enumerate(resonances):
        near = np.abs(poles.frequency - resonance.frequency) < resonance.half_width
        if np.any(near):
            best = np.argmax(np.where(near, poles.largest / poles.damping_ratio, 0))
            starts[:, i] = poles.frequency[best], poles.damping_ratio[best]
    return starts


def _residual_share(fit: BandFit, data: BandData) -> float:
    """What a fit leaves, as a share (rms) of what it was fitted to."""
    return float(np.sqrt(fit.sum_of_squares) / np.linalg.norm(data.target * data.weight))


def _better_fit(a: tuple[BandFit, Floats] | None, b: tuple[BandFit, Floats] | None) -> tuple[BandFit, Floats] | None:
    """The one with more modes, of two with as many that which leaves less."""
    return max(
        (fit for fit in (a, b) if fit is not None), key=lambda fit: (fit[1].size, -fit[0].sum_of_squares), default=None
    )


def _fit_valid_modes(data: BandData, starts: Floats, height: Floats, terms: int) -> tuple[BandFit, Floats] | None:
    """Fit after the weakest of those that turn out to be no modes are taken out, one by one."""
    while height.size:
        fit = fit_band(data.frequency, data.target, data.weight, starts, terms)
        sure = np.zeros(height.size, bool) if fit is None else are_modes(fit, data.frequency, height)
        if fit is not None and np.all(sure):
            return fit, height
        keep = np.arange(sure.size) != np.argmin(np.where(sure, np.inf, height))
        starts, height = starts[:, keep], height[keep]
    return None


MAX_BAND_SWEEPS = 4
"""Most rounds over the bands, each with the tails of the other bands' modes as they are then."""
TAIL_CHANGE_TOLERANCE = 0.01
"""Change of those tails beyond the residual terms, as a share of what the fit leaves, that is not worth another fit."""


def iterate_bands(state: Extraction) -> Extraction:
    """Bands fitted again, where their weights are others, and until the tails of the others' modes stay as they are."""
    for _ in range(MAX_BAND_SWEEPS):
        before = state.bands
        for band in before:
            state = _replace_band(state, band, _refit_changed_band(state, band))
        if all(new is old for new, old in zip(state.bands, before, strict=False)):
            break
    return state


def _refit_changed_band(state: Extraction, band: FittedBand) -> FittedBand | None:
    """A band fitted to what the modes of all others leave now; the same where that has not changed."""
    data = state.data(band.lines, without=band)
    return (
        band if np.array_equal(data.weight, band.data.weight) and _has_converged(band, data) else refit_band(band, data)
    )


def _has_converged(band: FittedBand, data: BandData) -> bool:
    """Whether the weighted data of a band has not changed by more than its residual terms take up."""
    off, most = data.target - band.data.target, TAIL_CHANGE_TOLERANCE * np.sqrt(band.fit.sum_of_squares)
    if np.linalg.norm(off * data.weight) < most:
        return True
    return bool(np.linalg.norm(remove_residual_terms(data.frequency, off, data.weight, band.terms)) < most)


def _replace_band(state: Extraction, old: FittedBand, new: FittedBand | None) -> Extraction:
    bands = (new if band is old else band for band in state.bands)
    return state if new is old else replace(state, bands=tuple(band for band in bands if band is not None))
