"""Find measured peaks that the modes used for lobes do not explain."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy

from acquisition import Frf, stiffness_remark
from modal.arrays import Flags, Floats
from modal.bands.find_resonances import Resonance, check_line_count, find_resonances, mobility_noise
from modal.bands.frf_lines import remove_drift, usable_lines
from modal.modes.mode import Mode, change_covariances, synthesize_frf

LOWEST_FREQUENCY_SHARE, MIN_LOW_PEAK_LINES = 0.5, 4.0
"""Frequency over the lowest natural frequency below which the half-width of a peak must span these lines; chosen.

Drift, hum and suspensions are narrower: 0.5 to 2.8 lines in nine measured FRFs."""
PEAK_HALF_WIDTHS = 2.5
"""Half-widths around a peak in which the most negative real part is searched; a single mode has it at one."""
SMOOTHED_HALF_WIDTHS = 0.5
"""Half-widths over which both real parts are averaged: lowers the extreme of a single mode by 1 %."""
MIN_LIMITING_SHARE = 0.1
"""Most negative real part near a peak over that of all peaks from which it may limit a cut; chosen.

A cut in the best pocket of one mode is up to ten times as deep as its lowest limit.
"""
HIGHEST_TOOTH_FREQUENCY = 2000.0
"""Highest tooth frequency of a cut (Hz); chosen: 60 000 rpm with two teeth.

The fastest lobe of a mode has chatter at half the tooth frequency or above. Far above the mode its receptance is small.
"""
LOWEST_LIMIT_TOOTH_RATIO = 4 / 3
"""Tooth frequency over the natural frequency at the lowest limit of the fastest lobe (phase of 3/4 turn)."""
MIN_MOBILITY_SHARE = 0.01
"""Mobility of a peak over the largest in the band, below which it is not searched; chosen to save time."""
MAX_UNEXPLAINED_SHARE = 0.15
"""Share of the most negative real part that the modes may miss; chosen.

The default scatter between tap tests changes it by 13 %.
"""
NOISE_QUANTILE = 2.0
"""Standard errors of the noise that a measured real part may be too low by."""
STEP_SHARE = 1e-3
"""Steps of the values of a mode for its slopes, relative to its damping ratio and stiffness; in degrees."""
MAX_PEAK_DAMPING = 0.3
"""Largest damping ratio of the mode that stands for a peak."""


class UnexplainedPeak(NamedTuple):
    """Measured peak that is worse than the modes explain."""

    frequency: float
    """Frequency of the peak (Hz)."""
    measured: float
    """Most negative real part of the measured receptance near it (m/N)."""
    explained: float
    """Most negative real part there of the modes (m/N)."""
    is_within_errors: bool
    """True if the modes explain it within their 95 % errors."""
    missing: Mode
    """Real mode that explains the rest: with it the sum of the modes is as negative as the measured FRF."""


def find_unexplained_peaks(
    frf: Frf, modes: Sequence[Mode], band: tuple[float, float] | None = None
) -> tuple[UnexplainedPeak, ...]:
    """Find the measured peaks whose most negative real part the modes do not explain.

    The limiting depth of a cut is inversely proportional to the most negative real part of the receptance. Compared
    are the lines of the usable band whose noise is below their receptance. A peak counts if the modes miss more of its
    real part than noise explains, if it is deep enough to limit a cut, and if a machine may be so
    soft. Below half the lowest natural frequency it counts only if its width is resolved.

    Parameters
    ----------
    frf : Frf
        Measured FRF.
    modes : sequence of Mode
        Modes used for lobes, with stiffness; may be empty.
    band : tuple of float, optional
        Band of the modes (Hz): peaks inside are compared with one another only. None for all lines.

    Returns
    -------
    tuple of UnexplainedPeak
        Peaks by rising frequency; empty if the modes cover the measurement without help of their errors.

    Raises
    ------
    ValueError
        As `fit_modes`, also for fewer than 8 lines.

    References
    ----------
    Altintas & Budak (1995), CIRP Annals 44, 357 (limit and real part).

    Examples
    --------
    >>> modes = [Mode(500.0, 0.02, 2e7), Mode(900.0, 0.03, 5e7)]
    >>> frf = synthesize_frf(modes, np.arange(1.0, 1501.0))
    >>> find_unexplained_peaks(frf, modes)
    ()
    >>> (peak,) = find_unexplained_peaks(frf, modes[:1])
    >>> f"{peak.frequency:.0f} Hz: {peak.measured * 1e6:.2f} instead of {peak.explained * 1e6:.2f} um/N"
    '902 Hz: -0.18 instead of -0.02 um/N'
    """
    lines = usable_lines(frf, None)
    check_line_count(lines)
    lines = replace(remove_drift(lines), coherence=None)  # low where hits differ, too
    of_mobility = mobility_noise(lines)
    noise = of_mobility / (2 * np.pi * lines.frequency)
    counted = noise < np.abs(lines.receptance)
    model = synthesize_frf(modes, lines.frequency).receptance.real
    lowest = LOWEST_FREQUENCY_SHARE * min((mode.frequency for mode in modes), default=0.0)
    compared = _Comparison(lowest, lines.frequency, lines.receptance.real, noise, counted, model, modes)
    resonances = find_resonances(lines, MIN_MOBILITY_SHARE * _mobility_share(lines, band), noise=of_mobility)
    measured = [(peak.frequency, *compared.measure(peak)) for peak in resonances]
    found = list[UnexplainedPeak]()
    for frequency, depth, peak in measured:
        beside = [(f, other) for f, other, _ in measured if _is_inside(f, band) or not _is_inside(frequency, band)]
        if peak is not None and depth < least_limiting_depth(frequency, beside, compared.real_at):
            found.append(peak._replace(missing=_with_errors_of_nearest(peak.missing, modes)))
    return tuple(found)


def _is_inside(frequency: float, band: tuple[float, float] | None) -> bool:
    return band is None or band[0] <= frequency <= band[1]


def _mobility_share(lines: Frf, band: tuple[float, float] | None) -> float:
    """Return the largest mobility in a band over that of all lines; 1 without lines in it."""
    size, (low, high) = np.abs(lines.mobility), band or (0.0, np.inf)
    inside = size[(lines.frequency >= low) & (lines.frequency <= high)]
    return float(np.max(inside) / np.max(size)) if inside.size and np.any(size) else 1.0


def least_limiting_depth(
    frequency: float, peaks: Sequence[tuple[float, float]], real_at: Callable[[float], float]
) -> float:
    """Return the real part (m/N) below which a peak may limit a cut.

    A tenth of the deepest peak, or less if that peak is far below: in a fast cut it hardly limits. peaks: frequency
    (Hz) and real part (m/N) of all; real_at: real part at a frequency.
    """
    tooth = min(LOWEST_LIMIT_TOOTH_RATIO * frequency, HIGHEST_TOOTH_FREQUENCY)
    deepest = min((depth for _, depth in peaks), default=0.0)
    above = min((depth for f, depth in peaks if f >= tooth / 2), default=0.0)
    return max(MIN_LIMITING_SHARE * deepest, min(MIN_LIMITING_SHARE * above, real_at(tooth / 2)))


def _with_errors_of_nearest(missing: Mode, modes: Sequence[Mode]) -> Mode:
    """Return a mode with the relative errors of the nearest mode; unchanged without any."""
    if not modes:
        return missing
    nearest = min(modes, key=lambda mode: abs(mode.frequency - missing.frequency))
    scale = np.array(
        [getattr(missing, name) / getattr(nearest, name) for name in ("frequency", "damping_ratio", "stiffness")]
    )
    taken = change_covariances(nearest, lambda covariance: covariance * np.outer(scale, scale))
    names = ("covariance", "degrees_of_freedom", "jackknife", "n_hits", "scatter_freedom", "phase_deg_std")
    errors: dict[str, Any] = {name: getattr(taken, name) for name in (*names, "phase_correlation")}
    return replace(missing, **errors)


def _model_error(frequency: Floats, modes: Sequence[Mode]) -> Floats:
    """Return the 95 % error of the real part of the sum of modes at these frequencies (m/N), to first order.

    That of the frequency is left out: it moves a peak within the half-width that is searched, and deepens none.
    """
    squares = np.zeros(frequency.size)
    for mode in modes:
        slopes = np.array(list(_slopes(mode, frequency)))
        covariance = np.nan_to_num(mode.joint_covariance)[1:, 1:]
        squares += mode.quantile() ** 2 * np.einsum("in,ij,jn->n", slopes, covariance, slopes)
    return np.sqrt(np.maximum(squares, 0.0))


def _slopes(mode: Mode, frequency: Floats) -> Iterator[Floats]:
    """Yield the slopes of the real part of a mode by damping ratio, stiffness and phase (degrees)."""
    sizes = {
        "damping_ratio": mode.damping_ratio,
        "stiffness": mode.stiffness,
        "phase_deg": -1.0 if mode.phase_deg > 0 else 1.0,
    }
    start = mode.receptance(frequency).real
    for name, size in sizes.items():
        step = STEP_SHARE * size
        yield (replace(mode, **{name: getattr(mode, name) + step}).receptance(frequency).real - start) / step


@dataclass(frozen=True, eq=False)
class _Comparison:
    """Real parts of the measured receptance and of the modes (m/N) on the same lines, shape (n,) each array."""

    lowest: float
    """Frequency below which only resolved peaks count (Hz)."""
    frequency: Floats
    """Frequencies (Hz)."""
    measured: Floats
    """Measured real part."""
    noise: Floats
    """Noise rms of the measured receptance."""
    counted: Flags
    """True for the lines that are compared."""
    explained: Floats
    """Real part of the modes."""
    modes: Sequence[Mode]
    """Modes."""

    @cached_property
    def spacing(self) -> float:
        """Least distance of two lines (Hz)."""
        return float(np.min(np.diff(self.frequency)))

    def real_at(self, frequency: float) -> float:
        """Return the measured real part (m/N) at a frequency (Hz)."""
        return float(np.interp(frequency, self.frequency, self.measured))

    def measure(self, peak: Resonance) -> tuple[float, UnexplainedPeak | None]:
        """Return the most negative real part near a peak (m/N), 0 without one, and the peak if it is unexplained."""
        f, spacing = self.frequency, self.spacing
        if peak.frequency < self.lowest and peak.half_width < MIN_LOW_PEAK_LINES * spacing:
            return 0.0, None
        near = self.counted & (np.abs(f - peak.frequency) <= PEAK_HALF_WIDTHS * peak.half_width)
        length = 1 + int(SMOOTHED_HALF_WIDTHS * peak.half_width / spacing)
        measured, explained = (_running_mean(part, length) for part in (self.measured, self.explained))
        line = int(np.argmin(np.where(near, measured, 0.0)))
        deepest = float(measured[line])
        if not near[line] or deepest >= 0 or stiffness_remark(_mode_of(peak, f[line], deepest).stiffness) is not None:
            return 0.0, None
        around = np.abs(f - f[line]) <= peak.half_width
        least = float(np.min(explained[around]))
        surely = (1 - MAX_UNEXPLAINED_SHARE) * (deepest + NOISE_QUANTILE * self.noise[line] / np.sqrt(2 * length))
        if surely >= least:
            return deepest, None
        missing = _mode_of(peak, float(f[line]), deepest - float(explained[line]))
        is_within = bool(surely >= np.min(explained[around] - _model_error(f[around], self.modes)))
        return deepest, UnexplainedPeak(peak.frequency, deepest, least, is_within, missing)


def _running_mean(values: Floats, length: int) -> Floats:
    return np.asarray(scipy.ndimage.uniform_filter1d(values, length))


def _mode_of(peak: Resonance, frequency: float, real: float) -> Mode:
    """Return the mode of the width of a peak with its most negative real part (m/N) at a frequency (Hz).

    It is -1 / (4 K zeta (1 + zeta)) at f_n sqrt(1 + 2 zeta).
    """
    zeta = min(peak.half_width / peak.frequency, MAX_PEAK_DAMPING)
    stiffness = -1 / (4 * zeta * (1 + zeta) * real)
    return Mode(frequency / math.sqrt(1 + 2 * zeta), zeta, stiffness, method="measured peak")
