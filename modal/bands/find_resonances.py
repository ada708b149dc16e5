"""Find the resonances of an FRF: mobility peaks above the noise whose phase turns as that of a mode."""

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import Frf
from modal.arrays import Complexes, Flags, Floats, Indices
from modal.bands.frf_lines import incoherent_noise, mean_coherence, measured_over_receptance, remove_drift

MIN_FRF_LINES = 8
"""Fewest lines of an FRF: one mode and its residual terms have seven unknowns."""
SMOOTHING_LENGTHS = 4 ** np.arange(10)
"""Lengths of the running means (lines), up to a sixteenth of the FRF."""
MIN_PEAK_PROMINENCE_DB = 1.0
"""Least height of a peak above its saddles (dB of mobility)."""
MIN_PEAK_TO_NOISE = 8.0
"""Least height of a peak above its saddles over the noise rms; no ripple among a million lines reaches it."""
NOISE_MEDIAN_LINES = 65
"""Lines of the running median that the noise of each line is taken from."""
MAX_SMOOTHING_LOSS = 4.0
"""Height that a peak may owe to noise on its highest line (rms of the noise)."""
MIN_PHASE_TURN = 0.5
"""Least angle between the chords of the mobility from the lower side to the peak and on to the upper side (rad).

On the circle of a mode, between the half-power points, the angle is -pi/2 whatever the neighbours add.
"""
MAX_PHASE_TURN = 2.6
"""Largest visible angle (rad): for a mode narrower than the line spacing the sense of rotation is lost."""
MIN_RESONANCE_COHERENCE = 0.3
"""Least mean coherence over a peak; hum at random phase has one over the number of hits."""
MIN_RESIDUAL_PEAK_DISTANCE = 2.0
"""Least distance of a residual peak from known resonances, over the sum of the half-widths."""
MIN_RESIDUAL_PEAK_SHARE = 0.02
"""Least height of a residual peak over that of its neighbour; real peaks are linear modes to about 1 %."""


class ConjugateError(ValueError):
    """Raised for an FRF with rising phase at its resonances: the complex conjugate of response over force."""


@dataclass(frozen=True)
class Resonance:
    """Peak of the mobility."""

    frequency: float
    """Frequency of the highest line (Hz)."""
    half_width: float
    """Distance from the peak to the nearer half-power point (Hz), roughly zeta f_n."""
    height: float
    """Height of the mobility (m/s/N)."""
    noise: float = 0.0
    """Noise rms of the highest line (m/s/N)."""
    turn: float = 0.0
    """Angle between the chords of the mobility from the lower side to the peak and on to the upper side (rad)."""
    coherence: float | None = None
    """Mean coherence over the peak; None if unknown."""

    def overlaps(self, other: Self) -> bool:
        """Return whether one resonance is within the half-width of the other."""
        return abs(self.frequency - other.frequency) < max(self.half_width, other.half_width)


def check_line_count(frf: Frf) -> None:
    """Raise ValueError for too few lines to find a mode."""
    n = frf.frequency.size
    if n < MIN_FRF_LINES:
        raise ValueError(
            f"{n} lines of the FRF are too few to find a mode. Widen the band to at least {MIN_FRF_LINES} lines."
        )


def find_resonances(frf: Frf, least_share: float = 0.0, *, noise: Floats | None = None) -> list[Resonance]:
    """Find the resonances over all lines of an FRF that starts above 0 Hz, by rising frequency.

    The mobility of a mode peaks at its natural frequency whatever its damping, and is 1/sqrt(2) of that where
    r - 1/r = -+ 2 zeta. Peaks are searched line by line and then in ever longer running means of the complex
    mobility, which reveals a wide mode that noise hides from single lines. Two modes with no dip between
    them are one peak. A mode much narrower than the line spacing is not found. Peaks below a share of the highest
    mobility are ignored, which saves time.

    noise: noise rms of the mobility (m/s/N), shape (n,), of an FRF without drift whose modes were fitted before. A
    rising phase is then that of a disturbance.

    Raises ValueError for fewer than 8 lines, an FRF of zeros, one without phase, and one without any coherence;
    ConjugateError.
    """
    check_line_count(frf)
    if not np.any(frf.receptance):
        raise ValueError("the FRF is zero on every line, so no response was measured. Check the sensor and its cable.")
    if frf.coherence is not None and not np.any(frf.coherence):
        found = "the coherence is 0 on every line, so the response does not come from the hammer"
        raise ValueError(f"{found}. Check the cables of hammer and sensor.")
    is_checked = noise is not None
    frf = frf if is_checked else remove_drift(frf)
    noise = mobility_noise(frf) if noise is None else noise
    peaks = _find_peaks_at_all_scales(frf, noise, least_share * float(np.max(np.abs(frf.mobility))))
    if peaks and not np.any(frf.receptance.imag):
        raise ValueError(
            "the FRF is real on every line, so the phase is missing. "
            "Export real and imaginary part, or magnitude and phase."
        )
    if not is_checked:
        _check_phase(frf, peaks)
    turning = (peak for peak in peaks if peak.turn < -MIN_PHASE_TURN or peak.turn > MAX_PHASE_TURN)
    return sorted(turning, key=lambda r: r.frequency)


def add_residual_resonances(known: Sequence[Resonance], residual: Frf) -> list[Resonance]:
    """Add resonances that exceed the residual of a fit to the known ones, by rising frequency.

    residual: the measured FRF less all that was fitted. Residual peaks at known resonances and single lines (hum)
    are ignored.
    """
    if not known:
        return []
    least = MIN_RESIDUAL_PEAK_SHARE * min(r.height for r in known)
    peaks = _find_peaks_at_all_scales(residual, mobility_noise(residual), least)
    turning = [peak for peak in peaks if -MAX_PHASE_TURN < peak.turn < -MIN_PHASE_TURN]
    return sorted([*known, *(new for new in turning if _is_separate_resonance(known, new))], key=lambda r: r.frequency)


def _is_separate_resonance(known: Sequence[Resonance], new: Resonance) -> bool:
    """Return whether a resonance is apart from all known ones and high enough against the highest tail there."""
    distance = np.array([abs(new.frequency - old.frequency) for old in known])
    apart = MIN_RESIDUAL_PEAK_DISTANCE * np.array([new.half_width + old.half_width for old in known])
    if np.any(distance <= apart):
        return False
    tail = np.array([old.height * old.half_width for old in known]) / distance
    return new.height > MIN_RESIDUAL_PEAK_SHARE * known[int(np.argmax(tail))].height


def _check_phase(frf: Frf, peaks: list[Resonance]) -> None:
    """Reject a conjugated FRF: the peaks of its accelerance turn the wrong way, and so do all lines together.

    The mobility would not do: the drift near 0 Hz would decide.
    """
    falling = sum(p.frequency * p.height for p in peaks if p.turn < -MIN_PHASE_TURN)
    rising = sum(p.frequency * p.height for p in peaks if MIN_PHASE_TURN < p.turn < MAX_PHASE_TURN)
    phase_step = np.imag(frf.accelerance[1:] * frf.accelerance[:-1].conj())
    if rising > falling and np.sum(phase_step) > 0:
        raise ConjugateError(
            "the phase rises through the resonances, so the FRF is the complex conjugate of response over force. "
            "Conjugate the FRF (numpy.conj)."
        )


def _find_peaks_at_all_scales(frf: Frf, noise: Floats, least: float) -> list[Resonance]:
    """Find the peaks of all running means, each from the longest mean that costs no more height than noise explains.

    noise: noise rms of the mobility (m/s/N). least: height of the mobility below which peaks are ignored (m/s/N).
    """
    mobility = frf.mobility
    peaks: list[Resonance] = []
    longest = max(1, frf.frequency.size // 16)
    for length in SMOOTHING_LENGTHS[longest >= SMOOTHING_LENGTHS]:
        mean = _running_mean(mobility, length)
        gain = (2 * length**2 + 1) / (3 * length**3)
        rms = np.sqrt(gain * np.maximum(_running_mean(noise**2, length), 0.0))
        for new in _find_peaks(frf, mean, rms, least):
            same = [old for old in peaks if new.overlaps(old)]
            if not same:
                peaks.append(new)
            elif len(same) == 1 and same[0].height - new.height < MAX_SMOOTHING_LOSS * same[0].noise:
                peaks[peaks.index(same[0])] = new
    return [p for p in peaks if p.coherence is None or p.coherence >= MIN_RESONANCE_COHERENCE]


def _running_mean(values: NDArray[Any], length: int) -> NDArray[Any]:
    """Apply a box mean over this many lines twice."""
    mean = scipy.ndimage.uniform_filter1d
    return values if length == 1 else np.asarray(mean(mean(values, length), length))


def _find_peaks(frf: Frf, mobility: Complexes, noise: Floats, least: float) -> list[Resonance]:
    size = np.abs(mobility)
    faintest = 1e-12 * size.max()
    floor = np.maximum(MIN_PEAK_TO_NOISE * noise, max(least, faintest))
    tops = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:]) & (size[1:-1] >= floor[1:-1])) + 1
    tops = tops[_has_deep_valleys(size, tops)]
    height = size[tops]
    limit = np.minimum(height * 10 ** (-MIN_PEAK_PROMINENCE_DB / 20), height - MIN_PEAK_TO_NOISE * noise[tops])
    high = tops[_has_low_saddles(size, tops, limit)]
    return [_measure_peak(frf, mobility, size, int(top), float(noise[top])) for top in high]


def _has_deep_valleys(size: Floats, tops: Indices) -> Flags:
    """Return for each peak whether the valley before a higher neighbour is deep enough."""
    if tops.size < 2:
        return np.ones(tops.size, dtype=bool)
    height = size[tops]
    limit = np.minimum(height[1:], height[:-1]) * 10 ** (-MIN_PEAK_PROMINENCE_DB / 20)
    valley = np.minimum.reduceat(size, tops)[:-1] > limit
    shallow = np.zeros(tops.size, dtype=bool)
    shallow[1:] |= valley & (height[:-1] > height[1:])
    shallow[:-1] |= valley & (height[1:] > height[:-1])
    return ~shallow


NEAR_LINES = 32
"""Number of lines behind a peak that are searched for a higher value before all: of most peaks it is near."""


SEARCHED_LINES = (512, 4096, None)
"""Numbers of lines that are searched then, the last one all."""


def _has_low_saddles(size: Floats, tops: Indices, limit: Floats) -> Flags:
    """Return for each peak whether both saddles before higher values are below its limit.

    Without a higher value the saddle is the lowest value of all.
    """
    sides = [(size, tops), (size[::-1], size.size - 1 - tops)]
    near = [_lowest_near(*side) for side in sides]
    low: Flags = np.all([is_open | (lowest < limit) for lowest, is_open in near], axis=0)
    for (values, places), (_, is_open) in zip(sides, near, strict=True):
        for i in np.flatnonzero(low & is_open).tolist():
            low[i] = _lowest_before_higher_value(values, int(places[i])) < limit[i]
    return low


def _lowest_near(size: Floats, tops: Indices) -> tuple[Floats, Flags]:
    """Return for each peak the lowest value before a higher one among the next lines, and whether none is higher."""
    near = np.append(size, np.full(NEAR_LINES, -np.inf))[tops[:, np.newaxis] + np.arange(NEAR_LINES + 1)]
    higher = (near > near[:, :1]).argmax(axis=1)
    lowest = np.minimum.accumulate(near, axis=1)[np.arange(tops.size), np.maximum(higher - 1, 0)]
    return lowest, higher == 0


def _lowest_before_higher_value(size: Floats, top: int) -> float:
    """Return the lowest value from a peak to the next higher value, or the lowest of all if none is higher."""
    side = size[top:]
    end = next((end for n in SEARCHED_LINES if (end := int((side[:n] > side[0]).argmax()))), 0)
    return float(side[:end].min() if end else size.min())


def _measure_peak(frf: Frf, mobility: Complexes, size: Floats, top: int, noise: float) -> Resonance:
    f = frf.frequency
    below, above = _lines_to_half_power(size[top::-1]), _lines_to_half_power(size[top:])
    low, high = top - math.ceil(below), top + math.ceil(above)
    lower, upper = np.interp([top - below, top + above], np.arange(low, high + 1), f[low : high + 1])
    half_width = float(min(f[top] - lower, upper - f[top]))
    turn = cmath.phase((mobility[high] - mobility[top]) / (mobility[top] - mobility[low]))
    coherence = mean_coherence(frf, slice(low, high + 1))
    return Resonance(float(f[top]), half_width, float(size[top]), noise, turn, coherence)


def _lines_to_half_power(size: Floats) -> float:
    """Count the lines from the peak size[0] to its half-power point, or to the saddle before a higher peak."""
    level = size[0] / math.sqrt(2)
    for searched in SEARCHED_LINES:
        side = size[:searched]
        ends = (side < level) | (side > size[0])
        end = int(ends.argmax())
        if ends[end]:
            break
    if ends[end] and size[end] < level:
        return float(end - (level - size[end]) / (size[end - 1] - size[end]))
    side = size[:end] if ends[end] else size
    return float(max(int(np.argmin(side)), 1))


def mobility_noise(frf: Frf) -> Floats:
    """Estimate the noise rms on each line of the mobility (m/s/N), shape (n,).

    The larger of two estimates: third differences and coherence. Third differences do not see noise that is alike
    on neighbouring lines, as that of an overloaded sensor is.
    """
    factor = measured_over_receptance(frf)
    rough = np.abs(np.diff(frf.receptance * factor, 3)) / np.sqrt(20)
    scatter = scipy.ndimage.median_filter(rough, size=NOISE_MEDIAN_LINES) / np.sqrt(np.log(2))
    scatter = np.pad(scatter, (1, 2), mode="edge")
    if frf.coherence is not None:
        scatter = np.maximum(scatter, scipy.ndimage.median_filter(incoherent_noise(frf), size=NOISE_MEDIAN_LINES))
    return np.asarray(scatter * 2 * np.pi * frf.frequency / factor)
