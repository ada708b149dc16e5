"""Estimate errors of modes from single hits: hammer noise, jackknife, linearity check."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy

from acquisition import Frf, Hit, remove_sensor_mass
from acquisition.arrays import find_median
from acquisition.estimation.estimate_frf import compute_cross_spectra, propagate_force_noise_through
from modal.arrays import Complexes, Floats
from modal.bands.dense_bands import MAX_HIDDEN_MODE_ERROR
from modal.bands.extraction import Extraction, FittedBand, replace_band
from modal.bands.fit_peaks import refit_real_constants
from modal.bands.merge_modes import MIN_SHAPE_MAC, merge_pair, overlapping_pairs
from modal.bands.residual_analysis import moving_mode_variance
from modal.fitting.band_fit import BandFit
from modal.modes.match_modes import mac
from modal.modes.mode import Mode, add_remark
from modal.quality.assess_mode import MAX_HIT_SCATTER_RATIO
from modal.quality.trust import Trust, assess_trust

HitsOfFrf = tuple[Sequence[Hit], list[Frf]]
"""Hits that an FRF was averaged from, and the FRFs without one of them each."""


class HitCovariance(NamedTuple):
    """Covariances of a band from the scatter of its hits, in the order of `BandFit`."""

    of_mean: Floats
    """Jackknife covariance of the fit to all hits."""
    of_single: Floats
    """Covariance of single hits about that fit, soft hits as much as hard ones."""
    noise_gain: float
    """Variance of noise in a single hit, mean over the hits, over that of their mean."""
    n_hits: int
    """Number of hits, of the FRF with the fewest."""


def hit_covariances(
    state: Extraction, band: FittedBand, pairs: Sequence[HitsOfFrf]
) -> tuple[Floats | int, HitCovariance | None]:
    """Return the covariances of a band by the noise of the hammer and over the hits; None for less than three hits."""
    by_hammer = sum(hammer_covariance(state, band, i, hits) for i, (hits, _) in enumerate(pairs))
    n_hits = min((len(without) for _, without in pairs), default=0)
    if not n_hits:
        return by_hammer, None
    each = [jackknife_covariance(state, band, i, *pair) for i, pair in enumerate(pairs)]
    of_mean, of_single = (np.sum([getattr(one, name) for one in each], axis=0) for name in ("of_mean", "of_single"))
    return by_hammer, HitCovariance(of_mean, of_single, max(one.noise_gain for one in each), n_hits)


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


def jackknife_covariance(
    state: Extraction, band: FittedBand, i: int, hits: Sequence[Hit], without: Sequence[Frf]
) -> HitCovariance:
    """Return the jackknife covariance of a band, (n - 1)/n times the sum of squares over FRF i without one hit each.

    Each is refitted by one Gauss-Newton step from the fit to all hits, which is exact to first order in the change.
    Source: Efron & Stein (1981), The jackknife estimate of variance, Annals of Statistics 9, 586.
    """
    all_hits = np.mean([frf.receptance[band.lines] for frf in without], axis=0)
    steps, n, power = band_changes(state, band, i, without, all_hits), len(without), hit_peaks(hits) ** 2
    alone = single_hit_factors(power)[:, np.newaxis] * steps
    gain = float(np.sum(power) * np.mean(1 / power))
    return HitCovariance((n - 1) / n * steps.T @ steps, alone.T @ alone / n, gain, n)


def hit_peaks(hits: Sequence[Hit]) -> Floats:
    """Return the largest force of each hit (N), shape (n,)."""
    return np.array([_hit_peak(hit) for hit in hits])


@lru_cache(maxsize=64)
def _hit_peak(hit: Hit) -> float:
    return float(np.max(hit.force)) - find_median(hit.force)


def single_hit_factors(power: Floats) -> Floats:
    """Return the change of a fit to one hit alone, over the change of the fit without it, shape (n,).

    H1 weighs a hit by its power p: with all of them it is the mean by p, so that one hit alone is as far from it as the
    FRF without it, times -(sum p - p)/p.
    """
    return np.asarray((power - np.sum(power)) / power)


def decay_covariance(band: FittedBand) -> HitCovariance | None:
    """Return the covariances of the values of a band from the scatter of its decays; None for fewer than three."""
    fit, count = band.fit, len(band.fit.constant)
    if count < MIN_HITS_FOR_JACKKNIFE:
        return None
    parts = fit.residual.reshape(count, -1)
    pulls = [part @ fit.influence_of(i).T for i, part in enumerate(parts)]
    outer = np.transpose(pulls) @ np.array(pulls)
    of_mean = np.asarray(count / (count - 1) * fit.residual.size / fit.degrees_of_freedom * outer)
    return HitCovariance(of_mean, count * of_mean, count, count)


def single_hit_variance(fit: BandFit, noise: Floats, hits: HitCovariance, shape: Floats) -> Floats:
    """Return the variances by which hits differ beyond noise, in the order of `BandFit`.

    Noise averages out over the hits. A machine that changes from hit to hit, or a hit beside its point, does not: the
    next test differs from this one as a hit from another. Frequencies count alike for all hits, as the softest may have
    met the lowest one, sizes and damping ratios by power. noise: covariance of the mean of the hits; shape: variances
    of merged modes, whose frequencies are already known apart. From the widened peak of the mean, a Gauss-Newton step
    overstates a change of a pole by x half-widths, as about x (1 + x^2).
    """
    m, half_width = fit.frequency.size, np.prod(fit.poles, axis=0)
    by_noise = MAX_HIT_SCATTER_RATIO**2 * np.diag(noise)
    variance = hits.n_hits * np.maximum(np.diag(hits.of_mean) - by_noise, 0.0)
    variance[:m] = np.maximum(np.diag(hits.of_single) - hits.noise_gain * by_noise, 0.0)[:m]
    scale = np.concatenate([half_width, fit.damping_ratio])
    variance[: 2 * m] /= (1 + variance[: 2 * m] / scale**2) ** 2
    spread = np.sqrt(np.where(shape[:m] > 0, shape[:m], variance[:m]))
    variance[:m] = 0.0
    return np.asarray(variance + moving_mode_variance(fit, spread))


MAX_UNSTEADY_RESIDUAL = 0.15
"""Largest residual near the mode that replaces an unsteady pair, over its peak; two half-widths apart leave 0.1."""


def merge_scattered_pairs(state: Extraction, pairs: Sequence[HitsOfFrf]) -> Extraction:
    """Merge pairs of overlapping modes whose sizes differ from hit to hit: one mode that is now here, now there.

    Each of two modes that exist in every hit keeps its size. pairs: as `hit_covariances`.
    """
    for band in state.bands:
        state = replace_band(state, band, _merge_scattered_pairs(state, band, pairs))
    return state


def _merge_scattered_pairs(state: Extraction, band: FittedBand, pairs: Sequence[HitsOfFrf]) -> FittedBand:
    near = [] if band.edits else [*overlapping_pairs(band.fit)]
    _, over_hits = hit_covariances(state, band, pairs) if near else (0, None)
    if over_hits is None:
        return band
    p, m = band.fit.constant.shape
    error = np.sqrt(np.diag(over_hits.of_mean)).reshape(-1, m)[2 : 2 + p] / np.abs(band.fit.constant)
    is_unsteady = np.all(
        (error > MAX_HIDDEN_MODE_ERROR) & (error > MAX_HIT_SCATTER_RATIO * band.fit.size_error), axis=0
    )
    for i, j in near:
        is_one = is_unsteady[i] and is_unsteady[j]
        merged = merge_pair(band, i, j, MAX_UNSTEADY_RESIDUAL) if is_one else None
        if merged is not None:
            return _merge_scattered_pairs(state, refit_real_constants(merged), pairs)
    return band


def merge_scattered_decay_pairs(state: Extraction) -> Extraction:
    """Merge pairs of overlapping modes whose sizes differ from decay to decay: one mode that is now here, now there.

    Two modes that exist in every decay keep the ratio of their sizes, as hits at one point excite close modes alike.
    """
    for band in state.bands:
        state = replace_band(state, band, _merge_scattered_decay_pairs(band))
    return state


def _merge_scattered_decay_pairs(band: FittedBand) -> FittedBand:
    for i, j in () if band.edits else overlapping_pairs(band.fit):
        merged = merge_pair(band, i, j, MAX_UNSTEADY_RESIDUAL) if _scatters_over_decays(band.fit, i, j) else None
        if merged is not None:
            return _merge_scattered_decay_pairs(merged)
    return band


def _scatters_over_decays(fit: BandFit, i: int, j: int) -> bool:
    """Return whether the ratio of the constants of two modes differs from decay to decay by more than noise."""
    size = np.abs(fit.constant[:, [i, j]])
    by_noise = np.sum(np.sqrt(np.mean((fit.size_error[:, [i, j]] * size) ** 2, axis=0) / np.mean(size**2, axis=0)))
    outside = 1 - mac(fit.constant[:, i], fit.constant[:, j])
    return bool(outside > max(1 - MIN_SHAPE_MAC, (MAX_HIT_SCATTER_RATIO * by_noise) ** 2))


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

    hits: those of the driving point; without: its FRF without each of them. A line is fitted to the frequencies of
    single hits over their peaks, weighted by power.
    """
    peaks = hit_peaks(hits)
    if len(hits) < MIN_HITS_FOR_LINEARITY or np.max(peaks) < MIN_LINEARITY_FORCE_RATIO * np.min(peaks):
        return [*modes]
    steps = band_changes(state, band, 0, without, state.frf.receptance[band.lines])[:, : len(modes)]
    changes = single_hit_factors(peaks**2)[:, np.newaxis] * steps
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
