"""Group resonances into bands, fit the peaks of each band, and iterate until all bands agree."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from modal.arrays import Flags, Floats
from modal.bands.extraction import BandData, Extraction, FittedBand, replace_band
from modal.bands.find_resonances import Resonance
from modal.fitting.band_fit import MIN_RESIDUAL_TERMS, BandFit
from modal.fitting.fit_band import fit_band, fit_real_constants, project_band
from modal.poles import select_physical_poles

JOINT_FIT_DISTANCE = 4.0
"""Distance of neighbours fitted together, over the sum of their half-widths."""
MAX_RESONANCES_PER_BAND = 6
"""Most resonances fitted together: the time grows with their square, and more often fail to converge."""
BAND_MARGIN_HALF_WIDTHS = 8.0
"""Half-widths that a band extends beyond its outer resonances."""
MIN_BAND_MARGIN_LINES = 6
"""Fewest lines of a band on either side of its resonances."""


class LocalBand(NamedTuple):
    """Resonances to be fitted together."""

    resonances: tuple[Resonance, ...]
    """Resonances by rising frequency."""
    lines: slice
    """Place on the frequency axis."""


def group_into_bands(resonances: Sequence[Resonance], frequency: Floats) -> list[LocalBand]:
    """Group close resonances into bands that meet between them in proportion to the half-widths.

    resonances come by rising frequency; frequency (Hz) has shape (n,).
    """
    gaps = [(b.frequency - a.frequency, a.half_width + b.half_width) for a, b in pairwise(resonances)]
    breaks = [i for i, (gap, widths) in enumerate(gaps, 1) if gap >= JOINT_FIT_DISTANCE * widths]
    close = [tuple(resonances[i:j]) for i, j in pairwise([0, *breaks, len(resonances)]) if i < j]
    groups = [part for group in close for part in _split_group(group)]
    meetings = [_band_boundary(a[-1], b[0]) for a, b in pairwise(groups)]
    borders = zip(groups, [-np.inf, *meetings], [*meetings, np.inf], strict=False)
    return [LocalBand(group, _band_lines(group, below, above, frequency)) for group, below, above in borders]


def _split_group(group: tuple[Resonance, ...]) -> Iterator[tuple[Resonance, ...]]:
    """Split a group at its widest gaps until no part is too large."""
    if len(group) <= MAX_RESONANCES_PER_BAND:
        yield group
        return
    gaps = [(b.frequency - a.frequency) / (a.half_width + b.half_width) for a, b in pairwise(group)]
    widest = int(np.argmax(gaps)) + 1
    yield from _split_group(group[:widest])
    yield from _split_group(group[widest:])


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
"""Largest relative standard error of damping ratio and stiffness of a mode with a peak."""
MIN_MODE_PEAK_SHARE = 0.05
"""Least mobility peak of a mode over its reference height; 1 dB of prominence needs twice this."""
MAX_FITTED_DAMPING = 0.9
"""Largest damping ratio of a mode that visibly oscillates; the fit itself ends at 1."""
MAX_DIRECT_FIT_RESIDUAL = 0.05
"""Largest relative residual (rms) of a fit started from the peaks that needs no LSCF poles."""


def fit_peaks(data: BandData, resonances: Sequence[Resonance]) -> FittedBand | None:
    """Fit the resonances of a band, started from their widths or from the nearest LSCF poles; None if none fits."""
    starts = np.array([(r.frequency, r.half_width / r.frequency) for r in resonances]).T
    height = np.array([r.height for r in resonances])
    fits = [_fit_valid_modes(data, starts, height, MIN_RESIDUAL_TERMS)]
    if fits[0] is None or fits[0][1].size < height.size or _residual_share(fits[0][0], data) > MAX_DIRECT_FIT_RESIDUAL:
        nearest = _nearest_poles(data, resonances, starts)
        if not np.array_equal(nearest, starts):
            fits.append(_fit_valid_modes(data, nearest, height, MIN_RESIDUAL_TERMS))
    bands = [FittedBand(data, tuple(resonances), fit[1], fit[0], MIN_RESIDUAL_TERMS) for fit in fits if fit is not None]
    return max(bands, key=lambda band: (band.height.size, -band.fit.sum_of_squares), default=None)


def refit_band(band: FittedBand, data: BandData) -> FittedBand | None:
    """Fit the modes of a band to other data; edited modes all stay, and None means that no mode is left."""
    if band.edits:
        fit = fit_band(data.frequency, data.target, data.weight, band.fit.poles, band.terms, band.fit.held)
        return band if fit is None else replace(band, data=data, fit=fit)
    fitted = _fit_valid_modes(data, band.fit.poles, band.height, band.terms)
    return None if fitted is None else replace(band, data=data, fit=fitted[0], height=fitted[1])


def refit_real_constants(band: FittedBand) -> FittedBand:
    """Fit real modal constants if they describe the band as well."""
    data = band.data
    fit = fit_real_constants(band.fit, data.frequency, data.target, data.weight, band.terms)
    return replace(band, fit=fit) if np.all(are_modes(fit, data.frequency, band.height)) else band


def are_modes(fit: BandFit, frequency: Floats, height: Floats, largest_error: float = MAX_PEAK_FIT_ERROR) -> Flags:
    """Return which fits are in the band, are high enough, and are certain enough in at least one of the FRFs."""
    return np.asarray(
        (fit.frequency > frequency[0])
        & (fit.frequency < frequency[-1])
        & (fit.damping_ratio < MAX_FITTED_DAMPING)
        & (fit.mobility_peak > MIN_MODE_PEAK_SHARE * height)
        & (fit.standard_error[1] < largest_error * fit.damping_ratio)
        & np.any(fit.size_error < largest_error, axis=0)
    )


def _nearest_poles(data: BandData, resonances: Sequence[Resonance], starts: Floats) -> Floats:
    """Replace start values (2, m) by the highest LSCF pole within the half-width of each resonance, if there is one."""
    poles, starts = select_physical_poles(data.chart), starts.copy()
    for i, resonance in enumerate(resonances):
        near = np.abs(poles.frequency - resonance.frequency) < resonance.half_width
        if np.any(near):
            best = np.argmax(np.where(near, poles.largest / poles.damping_ratio, 0))
            starts[:, i] = poles.frequency[best], poles.damping_ratio[best]
    return starts


def _residual_share(fit: BandFit, data: BandData) -> float:
    """Return the residual rms over that of the data."""
    return float(np.sqrt(fit.sum_of_squares) / np.linalg.norm(data.target * data.weight))


def _fit_valid_modes(data: BandData, starts: Floats, height: Floats, terms: int) -> tuple[BandFit, Floats] | None:
    """Fit modes, removing the weakest invalid one until all are valid."""
    while height.size:
        fit = fit_band(data.frequency, data.target, data.weight, starts, terms)
        sure = np.zeros(height.size, bool) if fit is None else are_modes(fit, data.frequency, height)
        if fit is not None and np.all(sure):
            return fit, height
        keep = np.arange(sure.size) != np.argmin(np.where(sure, np.inf, height))
        starts, height = starts[:, keep], height[keep]
    return None


MAX_BAND_SWEEPS = 4
"""Most sweeps over the bands, each with the current tails of the other bands."""
TAIL_CHANGE_TOLERANCE = 0.01
"""Change of the tails beyond the residual terms, over the residual, that needs no new fit."""


def iterate_bands(state: Extraction) -> Extraction:
    """Refit bands whose weights changed, until the tails of the other bands no longer change."""
    for _ in range(MAX_BAND_SWEEPS):
        before = state.bands
        for band in before:
            data = state.data(band.lines, without=band)
            if not (np.array_equal(data.weight, band.data.weight) and _has_converged(band, data)):
                state = replace_band(state, band, refit_band(band, data))
        if all(new is old for new, old in zip(state.bands, before, strict=False)):
            break
    return state


def _has_converged(band: FittedBand, data: BandData) -> bool:
    """Return whether the weighted data of a band has changed by no more than its residual terms take up."""
    off, most = data.target - band.data.target, TAIL_CHANGE_TOLERANCE * np.sqrt(band.fit.sum_of_squares)
    if np.linalg.norm(off * data.weight) < most:
        return True
    projected = project_band(data.frequency, off, data.weight, band.terms, band.fit.held)
    return bool(np.linalg.norm(projected.data) < most)
