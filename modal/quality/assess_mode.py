"""Add quality figures and remarks to a fitted mode."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from acquisition import Remark, is_smoothed
from modal.bands.extraction import FIXED_MODE, Extraction, FittedBand
from modal.bands.fit_peaks import MAX_PEAK_FIT_ERROR
from modal.bands.frf_lines import mean_coherence
from modal.bands.residual_analysis import residual_near_mode
from modal.bands.window_shape import has_hann_shape
from modal.fitting.band_fit import MIN_RESIDUAL_TERMS
from modal.modes.measurement_effects import common_delay
from modal.modes.mode import UNKNOWN_PHASE_STD_DEG, Mode, add_remark, change_covariances, mode_remark, ratio_or_zero
from modal.quality.trust import MAX_MISFIT_RATIO, MAX_REMAINING_DECAY, MIN_MISFIT_SHARE, relative_error, trust_rules


def with_truncation_error(mode: Mode) -> Mode:
    """Add the effect of a truncated decay to the errors of a mode.

    On the lines of the record (multiples of one over its length T) the mode is 1 - exp(lambda T) of itself, with
    size exp(-zeta w T) = remaining_decay and unknown phase: K and the phase of the modal constant are off
    by up to that share, by 1/sqrt(2) of it in the mean square. f and zeta are affected only if the hit came late in
    the record or zeros were appended, and by less; they get the same share of zeta f and of zeta. Beyond 5 %
    the errors stay: the mode is doubtful then, and lines that were computed without a record have no truncation.
    A fixed value keeps its error of 0.

    Source: integral of exp((lambda - iw) t) from 0 to T.

    >>> mode = Mode(500.0, 0.01, 2e7, np.diag([0.01, 1e-4, 1e5]) ** 2, remaining_decay=0.04)
    >>> [f"{error:.2g}" for error in with_truncation_error(mode).standard_error]  # Hz, -, N/m
    ['0.14', '0.0003', '5.7e+05']
    """
    if not mode.remaining_decay or mode.remaining_decay > MAX_REMAINING_DECAY:
        return mode
    share = mode.remaining_decay / np.sqrt(2)
    off = share * np.array([mode.damping_ratio * mode.frequency, mode.damping_ratio, mode.stiffness])
    widened = change_covariances(mode, lambda own: own + np.diag(np.where(np.diag(own) > 0, off, 0.0) ** 2))
    of_phase = min(float(np.hypot(mode.phase_deg_std, np.degrees(share))), UNKNOWN_PHASE_STD_DEG)
    if mode.phase_correlation is None or mode.best_covariance is None:
        return replace(widened, phase_deg_std=of_phase)
    kept = ratio_or_zero(mode.standard_error * mode.phase_deg_std, widened.standard_error * of_phase)
    return replace(widened, phase_deg_std=of_phase, phase_correlation=mode.phase_correlation * kept)


MIN_GOOD_COHERENCE = 0.9
"""Least mean coherence between the half-power points for hits that agree."""
MAX_CONSTANT_PHASE_DEG = 20.0
"""Largest phase of a real modal constant beyond the delay between the channels (degrees)."""
DOMINANT_NEIGHBOUR_RATIO = 20.0
"""Peak of a strong mode over that of a small one on its flank, which may be its own non-linearity."""
MIN_REMAINING_DECAY, REPORTED_REMAINING_DECAY = 0.005, 0.02
"""Remaining decay that is reported if it makes most of the error of K, and in any case."""
REPORTED_MODE_ERROR = 0.2
"""Relative standard error of damping ratio or stiffness that is reported."""
MIN_SMOOTHED_HALF_WIDTH_LINES = 12.0
"""Half-power half-width (lines) from which smoothing over five lines changes a mode by less than 2 %."""
MAX_HIT_SCATTER_RATIO = 3.0
"""Largest standard error over hits, over that of the fit, that noise may cause by itself."""
MAX_HALF_POWER_DIFFERENCE, MIN_HALF_POWER_LINES = 0.25, 4
"""Largest relative difference of the half-power damping ratio, and fewest lines between its points."""


def assess_mode(state: Extraction, band: FittedBand, i: int, mode: Mode) -> Mode:
    """Add the quality figures of mode i of a band, and the remarks that follow from them."""
    share, misfit = residual_near_mode(band, i)
    f, half_width, record = state.frf.frequency, mode.damping_ratio * mode.frequency, state.record_length
    distance = np.abs(f - mode.frequency)
    figures = replace(
        mode,
        coherence=mean_coherence(state.frf, distance <= max(half_width, distance.min())),
        misfit=misfit,
        misfit_share=share,
        edge_distance=float(min(mode.frequency - f[0], f[-1] - mode.frequency) / half_width),
        remaining_decay=None if record is None else float(np.exp(-2 * np.pi * half_width * record)),
        half_power_damping=_half_power_damping(band, mode),
    )
    mode = with_truncation_error(figures)
    word = band.edits[i] if band.edits else ""
    held = "frequency and zeta fixed by the operator, without uncertainty"
    text = held if word == FIXED_MODE else f"mode {word} by the operator"
    by_hand = (mode_remark(mode, "by-hand", text),) if word else ()
    of_value = *_value_remarks(band, i, mode), *_error_remarks(mode)
    return replace(mode, remarks=(*by_hand, *_position_remarks(state, band, i, mode), *of_value))


def _half_power_damping(band: FittedBand, mode: Mode) -> float | None:
    reach = mode.damping_ratio * mode.frequency
    near = [r for r in band.resonances if abs(r.frequency - mode.frequency) < max(reach, r.half_width)]
    widths = [r.half_width / r.frequency for r in near]
    return min(widths, key=lambda width: abs(width - mode.damping_ratio), default=None)


def _position_remarks(state: Extraction, band: FittedBand, i: int, mode: Mode) -> Iterator[Remark]:
    f, half_width = state.frf.frequency, mode.damping_ratio * mode.frequency
    if mode.edge_distance is not None and mode.edge_distance < 1:
        text = f"peak cut off at the edge of the fitted band ({f[0]:.0f}..{f[-1]:.0f} Hz)"
        yield mode_remark(mode, "cut-by-edge", text, "Widen the band")
    error = 0.0 if mode.best_covariance is None else float(mode.standard_error[2] / abs(mode.stiffness))
    reported = np.clip(error, MIN_REMAINING_DECAY, REPORTED_REMAINING_DECAY)
    if mode.remaining_decay is not None and mode.remaining_decay > reported:
        text = f"vibration is still {100 * mode.remaining_decay:.0f} % of the initial vibration when the record ends"
        yield mode_remark(mode, "still-ringing", text, "Use a longer record")
    for other in np.delete(band.fit.frequency, np.argmin(np.abs(band.fit.frequency - mode.frequency))):
        if abs(other - mode.frequency) < 2 * half_width:
            yield mode_remark(mode, "overlaps", f"overlaps with the mode at {other:.1f} Hz")
    if _has_unfitted_neighbour(state, band, i):
        text = "a much stronger neighbouring mode distorts the fit: zeta and stiffness K are less certain than stated"
        yield mode_remark(mode, "bent-by-neighbour", text)
    pair = band.merged_pair(i)
    if pair is not None:
        text = f"uneven peak, fitted as one mode instead of two at {pair.low:.6g} and {pair.high:.6g} Hz"
        cure = "Check for drift and loose clamping, and for a window or smoothing in the analyser"
        yield mode_remark(mode, "uneven-peak", text, cure)
    if any(abs(suspect - mode.frequency) < half_width for suspect in band.close_frequencies):
        where = " and ".join(f"{suspect:.6g}" for suspect in band.close_frequencies)
        text = f"may be several modes near {where} Hz, too noisy to separate (stiffness K then combines all of them)"
        yield mode_remark(mode, "several-modes", text, _averages_remedy(mode))


def _averages_remedy(mode: Mode) -> str:
    return "Average more hits" if mode.n_hits else "Measure again with more averages"


def _has_unfitted_neighbour(state: Extraction, band: FittedBand, i: int) -> bool:
    """Return whether an unfitted mode beyond the lines, or a non-linear strong mode, distorts mode i."""
    at_edge = band.lines.start == 0 or band.lines.stop >= state.frf.frequency.size
    if at_edge and band.terms > MIN_RESIDUAL_TERMS:
        return True
    own, frequency = band.fit.mobility_peak[i], band.fit.frequency[i]
    peak = np.concatenate([other.fit.mobility_peak for other in state.bands])
    poles = np.hstack([other.fit.poles for other in state.bands])
    is_near = peak * np.prod(poles, axis=0) > own * np.abs(poles[0] - frequency)
    return bool(np.any((peak > DOMINANT_NEIGHBOUR_RATIO * own) & is_near))


def _value_remarks(band: FittedBand, i: int, mode: Mode) -> Iterator[Remark]:
    width, share = mode.half_power_damping, mode.misfit_share or 0.0
    if not mode.is_driving_point:
        cure = "Mount the sensor at the hit point. If the sensor is there, change the sign of one channel"
        text = "stiffness K is negative: sensor and hammer move in opposite phase"
        yield mode_remark(mode, "not-driving-point", text, cure)
    error = band.fit.size_error[0, i]
    if error > MAX_PEAK_FIT_ERROR:
        text = f"mode hardly moves at the driving point, standard error of stiffness K {100 * error:.0f} %"
        yield mode_remark(mode, "near-node", text, "Tap at a point with more motion")
    elif relative_error(mode) > REPORTED_MODE_ERROR or "uncertain" in dict(trust_rules(mode)):
        text = f"standard error of zeta or stiffness K is {100 * relative_error(mode):.0f} %"
        yield mode_remark(mode, "uncertain", text, _averages_remedy(mode))
    if mode.misfit is not None and mode.misfit > MAX_MISFIT_RATIO and share > MIN_MISFIT_SHARE:
        text = f"fit residual is {mode.misfit:.1f} times the noise and {100 * share:.0f} % of the peak"
        yield mode_remark(mode, "misfit", text)
    is_near = np.abs(band.data.frequency - mode.frequency) < mode.damping_ratio * mode.frequency
    is_wide = np.sum(is_near) >= MIN_HALF_POWER_LINES
    differs = width is not None and abs(width / mode.damping_ratio - 1) > MAX_HALF_POWER_DIFFERENCE
    if width is not None and differs and is_wide and band.height.size == 1:
        text = f"half-power width gives zeta {100 * width:.2g} % instead of {100 * mode.damping_ratio:.2g} %"
        yield mode_remark(mode, "half-power-width", text)


def _error_remarks(mode: Mode) -> Iterator[Remark]:
    if "heavy-damping" in dict(trust_rules(mode)):
        text = f"zeta {100 * mode.damping_ratio:.0f} % without a clear peak: probably a sum of several modes"
        yield mode_remark(mode, "heavy-damping", text)
    if mode.coherence is not None and mode.coherence < MIN_GOOD_COHERENCE:
        text = f"coherence {mode.coherence:.2f} at the peak is below {MIN_GOOD_COHERENCE:g}: the hits differ in FRF"
        yield mode_remark(mode, "low-coherence", text, "Hit the same point in the same direction each time")
    scatter = 0.0 if mode.jackknife is None else np.max(ratio_or_zero(mode.standard_error, mode.fit_error))
    if scatter > MAX_HIT_SCATTER_RATIO:
        text = f"scatter from hit to hit is {scatter:.1f} times the standard error of the fit"
        yield mode_remark(mode, "scatter", text, "Hit the same point in the same direction with the same force")


def add_phase_remarks(modes: Sequence[Mode]) -> list[Mode]:
    """Add a remark to the modes of an FRF whose modal constants are far from real."""
    delay = common_delay(modes)
    return [_add_phase_remark(mode, 0.0 if delay is None else delay.phase_deg(mode.frequency)) for mode in modes]


def _add_phase_remark(mode: Mode, expected: float) -> Mode:
    if abs(mode.phase_deg - expected) <= max(MAX_CONSTANT_PHASE_DEG, 3 * mode.phase_deg_std):
        return mode
    phase = f"{mode.phase_deg:+.0f} ± {mode.phase_deg_std:.1g}°"
    text = f"phase of the modal constant is {phase} (± standard error) instead of 0°"
    cure = "Check the clamping, close modes, and the delay between the channels"
    return add_remark(mode, "complex-mode", text, cure)


def add_smoothing_remarks(state: Extraction, modes: Sequence[Mode], *, has_hits: bool = False) -> list[Mode]:
    """Add a remark to narrow modes if the lines were smoothed, and an error of zeta under a Hann window.

    has_hits: the FRF was averaged from hits, which no window has changed.
    """
    frf, step = state.frf, float(np.mean(np.diff(state.frf.frequency)))
    lines = [mode.damping_ratio * mode.frequency / step for mode in modes]
    if min(lines, default=np.inf) >= MIN_SMOOTHED_HALF_WIDTH_LINES:
        return [*modes]
    resonances = [resonance for band in state.bands for resonance in band.resonances]
    has_window = not has_hits and has_hann_shape(frf, resonances)
    if not has_window and not is_smoothed(frf):
        return [*modes]
    cause = "a record under a Hann window" if has_window else "a smoothed FRF"
    effect = "zeta is a few percent too large, stiffness K too small"
    text = f"half-width of the peak is below {MIN_SMOOTHED_HALF_WIDTH_LINES:g} lines of {cause}: {effect}"
    return [
        _smoothed_mode(mode, half_width if has_window else np.inf, text)
        if half_width < MIN_SMOOTHED_HALF_WIDTH_LINES
        else mode
        for mode, half_width in zip(modes, lines, strict=True)
    ]


SMOOTHING_ERROR = 2 / 3
"""Standard error of zeta by a Hann window, over zeta, times the square of the half-width (lines).

The lines H/2 + (H(f - d) + H(f + d))/4 are H + d^2 H''/4 to second order: a fit finds zeta too large by 0.65 of it.
"""


def _smoothed_mode(mode: Mode, half_width: float, text: str) -> Mode:
    """Return a narrow mode with the remark and the error of zeta by a window; half_width in lines, infinite without."""
    off = np.diag([0.0, SMOOTHING_ERROR * mode.damping_ratio / half_width**2, 0.0])
    wider = change_covariances(mode, lambda own: own + off**2)
    return add_remark(wider, "smoothed-lines", text, "Export the FRF again without smoothing or window")
