"""Estimate errors of modes from single hits: hammer noise, jackknife, linearity check."""

from collections.abc import Sequence

import numpy as np
import scipy

from acquisition import Frf, Hit, remove_sensor_mass
from acquisition.estimation.estimate_frf import compute_cross_spectra, propagate_force_noise_through
from modal.arrays import Complexes, Floats
from modal.bands.dense_bands import MAX_HIDDEN_MODE_ERROR
from modal.bands.extraction import Extraction, FittedBand, replace_band
from modal.bands.fit_peaks import refit_real_constants
from modal.bands.merge_modes import merge_pair, overlapping_pairs
from modal.bands.residual_analysis import moving_mode_variance
from modal.fitting.band_fit import BandFit
from modal.modes.mode import Mode, add_remark
from modal.quality.assess_mode import MAX_HIT_SCATTER_RATIO
from modal.quality.trust import Trust, assess_trust

HitsOfFrf = tuple[Sequence[Hit], list[Frf]]
"""Hits that an FRF was averaged from, and the FRFs without one of them each."""


def hit_covariances(
    state: Extraction, band: FittedBand, pairs: Sequence[HitsOfFrf]
) -> tuple[Floats | int, Floats | None, int]:
    """Return the covariances of a band by the noise of the hammer and over the hits, and the number of these hits."""
    by_hammer = sum(hammer_covariance(state, band, i, hits) for i, (hits, _) in enumerate(pairs))
    n_hits = min((len(without) for _, without in pairs), default=0)
    jackknives = [jackknife_covariance(state, band, i, without) for i, (_, without) in enumerate(pairs) if n_hits]
    return by_hammer, np.sum(jackknives, axis=0) if n_hits else None, n_hits


def hammer_covariance(state: Extraction, band: FittedBand, i: int, hits: Sequence[Hit]) -> Floats:
    """Return the covariance of a band by the hammer noise inside the force windows of the hits of FRF i.

    Each sample of that noise shifts all lines of the FRF together (`propagate_force_noise`), and the modes by one
    Gauss-Newton step. Shape as `BandFit.covariance`, 0 without hits. If a mass was subtracted (`remove_sensor_mass`),
    the
    FRF without it shifts by 1 - mass w^2 H times the measured one.
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
"""Fewest hits of a jackknife; with two the interval would be 6 times wider than the likely error."""


def leave_one_out_frfs(hits: Sequence[Hit], frf: Frf) -> list[Frf]:
    """Return the FRFs (H1) of all hits but one, for each hit, on the lines of frf; none for fewer than three hits.

    Raises ValueError if a hit has other lines than the FRF.
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
    """Return the slice of the lines above 0 Hz of a hit that are those of the FRF."""
    frequency = np.fft.rfftfreq(hit.force.size, 1 / hit.sample_rate)[1:]
    first = int(np.searchsorted(frequency, frf.frequency[0]))
    part = slice(first, first + frf.frequency.size)
    if not np.array_equal(frequency[part], frf.frequency):
        raise ValueError("hits and FRF have different frequency lines. Give the hits averaged in this FRF.")
    return part


def jackknife_covariance(state: Extraction, band: FittedBand, i: int, without: Sequence[Frf]) -> Floats:
    """Return the jackknife covariance of a band, (n - 1)/n times the sum of squares over FRF i without one hit each.

    Each is refitted by one Gauss-Newton step from the fit to all hits, which is exact to first order in the change;
    shape as `BandFit.covariance`. Source: Efron & Stein (1981), The jackknife estimate of variance, Annals of
    Statistics 9, 586.
    """
    all_hits = np.mean([frf.receptance[band.lines] for frf in without], axis=0)
    steps, n = band_changes(state, band, i, without, all_hits), len(without)
    return np.asarray((n - 1) / n * steps.T @ steps)


def decay_covariance(band: FittedBand) -> Floats | None:
    """Return the covariance of the values of a band from the scatter of its decays; None for fewer than three.

    Shape as `BandFit.covariance`.
    """
    fit, count = band.fit, len(band.fit.constant)
    if count < MIN_HITS_FOR_JACKKNIFE:
        return None
    parts = fit.residual.reshape(count, -1)
    pulls = [part @ fit.influence_of(i).T for i, part in enumerate(parts)]
    outer = np.transpose(pulls) @ np.array(pulls)
    return np.asarray(count / (count - 1) * fit.residual.size / fit.degrees_of_freedom * outer)


def single_hit_variance(fit: BandFit, noise: Floats, over_hits: Floats, n_hits: int, shape: Floats) -> Floats:
    """Return the variances by which hits differ beyond noise, in the order of `BandFit`.

    Noise averages out over the hits. A machine that changes from hit to hit, or a hit beside its point, does not: the
    next test differs from this one as a hit from another. noise, over_hits: covariances of the mean of n hits; shape:
    variances of merged modes, whose frequencies are already known apart.
    """
    m, half_width = fit.frequency.size, np.prod(fit.poles, axis=0)
    beyond = np.diag(over_hits) - MAX_HIT_SCATTER_RATIO**2 * np.diag(noise)
    variance = n_hits * np.maximum(beyond, 0.0)
    shift = np.sqrt(variance[:m]) / half_width
    spread = np.where(shape[:m] > 0, np.sqrt(shape[:m]), half_width * shift / (1 + shift**2))
    variance[:m] = 0.0
    return np.asarray(variance + moving_mode_variance(fit, spread))


MAX_UNSTEADY_RESIDUAL = 0.15
"""Largest residual near the mode that replaces an unsteady pair, over its peak; two half-widths apart leave 0.1."""


def merge_scattered_pairs(state: Extraction, pairs: Sequence[HitsOfFrf]) -> Extraction:
    """Merge pairs of overlapping modes whose sizes differ from hit to hit: the one mode of a hit is now here, now there.

    Each of two modes that exist in every hit keeps its size. pairs: as `hit_covariances`.
    """
    for band in state.bands:
        state = replace_band(state, band, _merge_scattered_pairs(state, band, pairs))
    return state


def _merge_scattered_pairs(state: Extraction, band: FittedBand, pairs: Sequence[HitsOfFrf]) -> FittedBand:
    near = [] if band.edits else [*overlapping_pairs(band.fit)]
    _, over_hits, _ = hit_covariances(state, band, pairs) if near else (0, None, 0)
    if over_hits is None:
        return band
    p, m = band.fit.constant.shape
    error = np.sqrt(np.diag(over_hits)).reshape(-1, m)[2 : 2 + p] / np.abs(band.fit.constant)
    is_unsteady = np.all((error > MAX_HIDDEN_MODE_ERROR) & (error > MAX_HIT_SCATTER_RATIO * band.fit.size_error), axis=0)
    for i, j in near:
        is_one = is_unsteady[i] and is_unsteady[j]
        merged = merge_pair(band, i, j, MAX_UNSTEADY_RESIDUAL) if is_one else None
        if merged is not None:
            return _merge_scattered_pairs(state, refit_real_constants(merged), pairs)
    return band


def band_changes(state: Extraction, band: FittedBand, i: int, without: Sequence[Frf], reference: Complexes) -> Floats:
    """Return the first-order changes of a band if FRF i is replaced by each of `without`.

    One row each, against the reference (m/N, on the lines of the band); columns as `BandFit.covariance`.
    """
    part = band.lines
    change = (np.array([frf.receptance[part] for frf in without]) - reference) * state.weight[i, part]
    return np.asarray(np.concatenate([change.real, change.imag], axis=1) @ band.fit.influence_of(i).T)


MIN_HITS_FOR_LINEARITY = 6
"""Fewest hits of a linearity check."""
MIN_LINEARITY_FORCE_RATIO = 1.3
"""Least force of the hardest hit over that of the softest."""
MIN_LINEARITY_CHANGE = 1e-3
"""Least relative change of frequency from the softest hit to the hardest that is reported; chosen."""
LINEARITY_CONFIDENCE = 0.9995
"""One-sided confidence of the slope."""


def add_linearity_remarks(
    state: Extraction, band: FittedBand, modes: Sequence[Mode], hits: Sequence[Hit], without: Sequence[Frf]
) -> list[Mode]:
    """Add a remark to trusted modes whose frequency changes with the force of the hit.

    hits: those of the driving point; without: its FRF without each of them. H1 weighs a hit by its power p: with all of
    them it is the mean by p, so that one hit alone is as far from it as the FRF without it, times -(sum p - p)/p. A
    line is fitted to the frequencies of single hits over their peaks, weighted by p.
    """
    peaks = np.array([np.max(hit.force) - np.median(hit.force) for hit in hits])
    if len(hits) < MIN_HITS_FOR_LINEARITY or np.max(peaks) < MIN_LINEARITY_FORCE_RATIO * np.min(peaks):
        return [*modes]
    alone = band_changes(state, band, 0, without, state.frf.receptance[band.lines])[:, : len(modes)]
    power = (peaks**2)[:, np.newaxis]
    changes = -alone * (np.sum(power) - power) / power
    return [_add_linearity_remark(mode, peaks, change) for mode, change in zip(modes, changes.T, strict=True)]


def _add_linearity_remark(mode: Mode, peaks: Floats, change: Floats) -> Mode:
    slope, error = _fit_line(peaks, change)
    sure = float(scipy.special.stdtrit(peaks.size - 2, LINEARITY_CONFIDENCE))
    is_felt = abs(slope) * np.ptp(peaks) > MIN_LINEARITY_CHANGE * mode.frequency
    if assess_trust(mode) is not Trust.TRUSTED or not is_felt or abs(slope) < sure * error:
        return mode
    per, words = 100 * 100 / mode.frequency, "softens" if slope < 0 else "stiffens"
    shift = f"frequency {per * slope:+.2g} ± {per * error:.1g} % (± standard error) per 100 N"
    text = f"mode {words} with hit force: {shift}, hits of {np.min(peaks):.0f} to {np.max(peaks):.0f} N"
    return add_remark(mode, "force-dependent", text, "Check joints and clamping, and give all hits the same force")


def _fit_line(x: Floats, y: Floats) -> tuple[float, float]:
    """Return the slope and its standard error, weighted by x^2."""
    columns = np.column_stack([x, x**2])
    value, *_ = np.linalg.lstsq(columns, x * y, rcond=None)
    left = x * y - columns @ value
    variance = float(left @ left) / (x.size - 2) * np.linalg.inv(columns.T @ columns)[1, 1]
    return float(value[1]), float(np.sqrt(variance))
