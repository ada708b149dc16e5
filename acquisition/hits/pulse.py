"""Find the force pulse of a hit and window the force around it."""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from acquisition.arrays import Floats, find_median
from acquisition.hit import Hit

PULSE_END_SHARE = 0.05
"""Share of the peak below which a pulse ends, unless the noise is larger."""
BASELINE_NOISE_RATIO = 3.0
"""Level of the noise over the rms of the baseline, below which a pulse ends."""
SEARCH_BLOCK_SIZE = 1024
"""Number of samples searched at once."""


@dataclass(frozen=True, eq=False)
class Pulse:
    """Main force pulse of a hit."""

    recorded: Floats
    """Recorded force (N), shape (n,)."""
    offset: float
    """Mean of the baseline (N)."""
    peak_index: int
    """Sample of the largest force."""
    peak: float
    """Largest force above the baseline (N)."""
    start: int
    """First sample above 5 % of the peak and the noise."""
    end: int
    """First sample below 5 % of the peak or in the noise after it."""
    baseline_rms: float
    """Rms of the force before the pulse, or after it where nothing was recorded before (N)."""

    @property
    def force(self) -> Floats:
        """Force without its offset (N), shape (n,)."""
        return self.recorded - self.offset


def find_pulse(hit: Hit) -> Pulse | None:
    """Find the highest force pulse; None if it is below 6 times the rms of the baseline, or without a force."""
    if not hit.has_force:
        return None
    top = int(np.argmax(hit.force))
    quiet = extract_baseline(hit.force, count_pre_hit_samples(hit))
    offset = float(np.mean(quiet))
    rms = float(np.sqrt(np.mean((quiet - offset) ** 2)))
    peak = float(hit.force[top]) - offset
    if peak <= 6 * rms or peak <= 0:
        return None
    foot = offset + max(PULSE_END_SHARE * peak, BASELINE_NOISE_RATIO * rms)
    start = top - _count_above(foot, hit.force[top::-1]) + 1
    end = top + _count_above(foot, hit.force[top:])
    return Pulse(hit.force, offset, top, peak, start, end, rms)


def require_pulse(hit: Hit) -> Pulse:
    """Return the highest force pulse; raise ValueError if there is none."""
    pulse = find_pulse(hit)
    if pulse is None:
        raise ValueError("a hit has no force pulse. Check all hits with check_hit first.")
    return pulse


def _count_above(foot: float, signal: Floats) -> int:
    """Count the samples before the first one below the foot, block by block because pulses are short."""
    for at in range(0, signal.size, SEARCH_BLOCK_SIZE):
        below = np.flatnonzero(signal[at : at + SEARCH_BLOCK_SIZE] < foot)
        if below.size:
            return at + int(below[0])
    return signal.size


def count_pre_hit_samples(hit: Hit) -> int:
    """Count the samples before the hit: the pre-trigger, else those before the force last rises above 5 % of its peak.

    Without a force the response is used. The count is cached per hit.
    """
    if hit.pre_trigger:
        return hit.pre_trigger
    if hit not in _pre_hit_counts:
        _pre_hit_counts[hit] = _find_rise(hit)
    return _pre_hit_counts[hit]


def _find_rise(hit: Hit) -> int:
    if not hit.has_force:
        size = np.abs(hit.acceleration - find_median(hit.acceleration))
        return int(np.argmax(size > PULSE_END_SHARE * np.max(size)))
    above = hit.force[: int(np.argmax(hit.force)) + 1] - find_median(hit.force)
    low = np.flatnonzero(above < PULSE_END_SHARE * above[-1])
    return int(low[-1]) + 1 if low.size else 0


_pre_hit_counts: WeakKeyDictionary[Hit, int] = WeakKeyDictionary()


def extract_baseline(signal: Floats, before: int) -> Floats:
    """Return the first four fifths of the `before` samples ahead of the pulse, else the last tenth of the record."""
    quiet = signal[: int(0.8 * before)]
    return quiet if quiet.size >= 8 else signal[-max(signal.size // 10, 8) :]


@dataclass(frozen=True, eq=False)
class WindowedForce:
    """Tapered samples around the pulse of a hit; all others count as zero."""

    samples: slice
    """Place in the hit."""
    force: Floats
    """Force without its offset times the window (N), shape (m,)."""
    window: Floats
    """Weight of each sample, 0 to 1, shape (m,)."""
    noise: float
    """Rms of the baseline (N)."""
    mean_noise: float
    """Standard error of the baseline's mean (N)."""


def window_force(hit: Hit) -> WindowedForce:
    """Return the pulse with one pulse width on either side, tapered to zero over one more (raised cosine).

    A tight window matters: noise inside it is alike at neighbouring lines, and shifts the mode. The result is cached
    per hit. Raises ValueError for a hit without a pulse.
    """
    if hit not in _windowed_forces:
        _windowed_forces[hit] = _compute_windowed_force(hit)
    return _windowed_forces[hit]


_windowed_forces: WeakKeyDictionary[Hit, WindowedForce] = WeakKeyDictionary()


def _compute_windowed_force(hit: Hit) -> WindowedForce:
    pulse = require_pulse(hit)
    width = max(pulse.end - pulse.start, 8)
    corners = np.array([pulse.start - 2 * width, pulse.start - width, pulse.end + width, pulse.end + 2 * width])
    samples = slice(max(int(corners[0]), 0), min(int(corners[3]), hit.force.size))
    beyond = np.interp(np.arange(samples.start, samples.stop), corners, [1.0, 0.0, 0.0, 1.0])
    window = 0.5 + 0.5 * np.cos(np.pi * beyond)
    quiet = extract_baseline(hit.force, count_pre_hit_samples(hit))
    noise = pulse.baseline_rms
    force = (hit.force[samples] - pulse.offset) * window
    return WindowedForce(samples, force, window, noise, noise / np.sqrt(quiet.size))
