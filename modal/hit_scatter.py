"""Estimate errors of modes from single hits: hammer noise, jackknife, linearity check."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from acquisition import Frf, Hit, Remark, remove_sensor_mass
from acquisition.estimation.estimate_frf import compute_cross_spectra, propagate_force_noise_through
from modal.arrays import Complexes, Floats
from modal.bands.extraction import Extraction, FittedBand
from modal.modes.mode import Mode
from modal.quality.trust import Trust, assess_trust


def hammer_covariance(state: Extraction, band: FittedBand, i: int, hits: Sequence[Hit]) -> Floats:
    """Covariance of the values of one band by the noise of the hammer inside the force windows of the hits of FRF i.

    Each sample of that noise shifts all lines of the FRF together (`propagate_force_noise`), and the modes by one Gauss-Newton
    step; shape as `BandFit.covariance`, 0 without hits. Where a mass was taken off (`remove_sensor_mass`), an FRF without it
    shifts by 1 - mass w^2 H of what the measured one does.
    """
    part, frf = band.lines, state.frfs[i]
    real, imaginary = np.hsplit(band.fit.influence_of(i), 2)
    loading = 1 - frf.mass_removed * (2 * np.pi * frf.frequency) ** 2 * frf.receptance
    by_share = (real - 1j * imaginary) * (state.weight[i] * frf.receptance * loading)[part]
    covariance = np.zeros_like(band.fit.covariance)
    for steps in propagate_force_noise_through(by_share, hits, frf.frequency[part]) if hits else ():
        covariance += steps.real @ steps.real.T
    return covariance


MIN_HITS_FOR_JACKKNIFE = 3
"""With two the interval would be 6 times wider than the error is likely to be."""


def leave_one_out_frfs(hits: Sequence[Hit], frf: Frf) -> list[Frf]:
    """FRFs (H1) of all hits but one, for each hit, on the lines of frf; none for fewer than three hits.

    The spectra of each hit are worked out once, and taken from their sum.

    Raises ValueError where a hit has other lines than the FRF.
    """
    parts = [_matching_lines(hit, frf) for hit in hits]
    if len(hits) < MIN_HITS_FOR_JACKKNIFE:
        return []
    lines = parts[0]
    spectra = [(s_ff[1:][lines], s_fx[1:][lines]) for s_ff, _, s_fx in (compute_cross_spectra([hit]) for hit in hits)]
    s_ff, s_fx = (np.sum(column, axis=0) for column in zip(*spectra, strict=True))
    per_line = -1 / (2 * np.pi * frf.frequency) ** 2
    fewer = (Frf(frf.frequency, (s_fx - fx) / (s_ff - ff) * per_line) for ff, fx in spectra)
    return [remove_sensor_mass(one_less, frf.mass_removed) for one_less in fewer]


def _matching_lines(hit: Hit, frf: Frf) -> slice:
    """Those of frf among the lines above 0 Hz that an FRF of this hit has."""
    frequency = np.fft.rfftfreq(hit.force.size, 1 / hit.sample_rate)[1:]
    first = int(np.searchsorted(frequency, frf.frequency[0]))
    part = slice(first, first + frf.frequency.size)
    if not np.array_equal(frequency[part], frf.frequency):
        raise ValueError("hits and FRF differ in their frequency lines; give the hits that this FRF was averaged from")
    return part


def jackknife_covariance(state: Extraction, band: FittedBand, i: int, without: Sequence[Frf]) -> Floats:
    """Covariance of the values of one band, (n - 1)/n times the sum of squares over FRF i without one hit each.

    Each is refitted by one Gauss-Newton step from the fit to all hits, which is exact to first order in the change;
    shape as `BandFit.covariance`. Source: Efron & Stein (1981), The jackknife estimate of variance, Annals of
    Statistics 9, 586.
    """
    all_hits = np.mean([frf.receptance[band.lines] for frf in without], axis=0)
    steps, n = band_changes(state, band, i, without, all_hits), len(without)
    return np.asarray((n - 1) / n * steps.T @ steps)


def band_changes(state: Extraction, band: FittedBand, i: int, without: Sequence[Frf], reference: Complexes) -> Floats:
    """What the values of a band change by when FRF i is one of these instead of the reference (m/N, on its lines).

    A row each, to first order; columns as `BandFit.covariance`.
    """
    part = band.lines
    change = (np.array([frf.receptance[part] for frf in without]) - reference) * state.weight[i, part]
    return np.asarray(np.concatenate([change.real, change.imag], axis=1) @ band.fit.influence_of(i).T)


MIN_HITS_FOR_LINEARITY = 6
"""Hits that a slope is told from, at least."""
MIN_LINEARITY_FORCE_RATIO = 1.3
"""Force of the hardest hit over that of the softest, at least."""
MIN_LINEARITY_CHANGE = 1e-3
"""Relative change of the frequency from the softest hit to the hardest that is worth saying; chosen."""
LINEARITY_CONFIDENCE = 0.9995
"""Probability that chance gives no such slope to one side."""


def add_linearity_remarks(
    state: Extraction, band: FittedBand, modes: Sequence[Mode], hits: Sequence[Hit], without: Sequence[Frf]
) -> list[Mode]:
    """Modes of a band, the trusted ones whose frequency surely changes with the force of single hits with a remark.

    hits: those of the driving point; without: its FRF without each of them. H1 weighs a hit by its power p: with all of
    them it is the mean by p, so that one hit alone is as far from it as the FRF without it, times -(sum p - p)/p. A
    line is fitted to the frequencies of single hits over their peaks, weighted by p.
    """
    peaks = np.array([np.max(hit.force) - np.median(hit.force) for hit in hits])
    if len(hits) < MIN_HITS_FOR_LINEARITY or np.max(peaks) < MIN_LINEARITY_FORCE_RATIO * np.min(peaks):
        return [*modes]
    alone = band_changes(state, band, 0, without, state.frf.receptance[band.lines])[:, : len(modes)]
    return [_add_linearity_remark(mode, peaks, _change_per_hit(alone[:, i], peaks**2)) for i, mode in enumerate(modes)]


def _change_per_hit(change: Floats, power: Floats) -> Floats:
    """Change of the frequency (Hz) of single hits against all, from that without each."""
    return np.asarray(-change * (np.sum(power) - power) / power)


def _add_linearity_remark(mode: Mode, peaks: Floats, change: Floats) -> Mode:
    slope, error = _fit_line(peaks, change)
    sure = float(scipy.special.stdtrit(peaks.size - 2, LINEARITY_CONFIDENCE))
    is_felt = abs(slope) * np.ptp(peaks) > MIN_LINEARITY_CHANGE * mode.frequency
    if assess_trust(mode) is not Trust.TRUSTED or not is_felt or abs(slope) < sure * error:
        return mode
    per, words = 100 * 100 / mode.frequency, "softens" if slope < 0 else "stiffens"
    forces = f"from {np.min(peaks):.0f} to {np.max(peaks):.0f} N"
    shift = f"{per * slope:+.2g} ± {per * error:.1g} % for 100 N more, {forces}"
    text = f"{words} with the force of the hit: f_n changes by {shift}"
    cure = "look at joints and clamping; hit equally hard"
    return replace(mode, remarks=(*mode.remarks, Remark("force-dependent", f"{mode.frequency:.0f} Hz", text, cure)))


def _fit_line(x: Floats, y: Floats) -> tuple[float, float]:
    """Slope and its standard error, weighted by x^2."""
    columns = np.column_stack([x, x**2])
    value, *_ = np.linalg.lstsq(columns, x * y, rcond=None)
    left = x * y - columns @ value
    variance = float(left @ left) / (x.size - 2) * np.linalg.inv(columns.T @ columns)[1, 1]
    return float(value[1]), float(np.sqrt(variance))
