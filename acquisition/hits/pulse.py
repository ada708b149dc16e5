"""Find the force pulse of a hit and window the force around it."""

import math
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from acquisition.arrays import Floats, find_median
from acquisition.hit import Hit

PULSE_END_SHARE = 0.05
"""Share of the peak below which a pulse ends, unless the noise is larger."""
BASELINE_NOISE_RATIO = 3.0
"""Level of the noise over the rms of the baseline, below which a pulse ends."""
MIN_TOUCH_SHARE = 0.003
"""Smallest height of a touch over that of the main pulse: one that is left out changes the FRF by its share (chosen).
"""
TOUCH_DEVIATION = 4.0
"""Largest force of a baseline over its rms above which a touch is searched in it (chosen)."""
TOUCH_SPREAD = 6.0
"""Robust standard deviations from the median above which samples of a baseline are those of a touch (chosen)."""
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
    def width(self) -> int:
        """Length between these (samples), at least 8."""
        return max(self.end - self.start, 8)

    @property
    def force(self) -> Floats:
        """Force without its offset (N), shape (n,)."""
        return self.recorded - self.offset


def find_pulse(hit: Hit) -> Pulse | None:
    """Find the highest force pulse; None if it is below 6 times the rms of the baseline, or without a force."""
    if not hit.has_force:
        return None
    top = int(hit.force.argmax())
    quiet = extract_baseline(hit.force, count_pre_hit_samples(hit))
    offset, rms = _measure_mean_and_rms(quiet)
    if float(quiet.max()) > offset + TOUCH_DEVIATION * rms:
        offset, rms = _measure_mean_and_rms(_drop_touches(quiet, float(hit.force[top])))
    peak = float(hit.force[top]) - offset
    if peak <= 6 * rms or peak <= 0:
        return None
    foot = offset + max(PULSE_END_SHARE * peak, BASELINE_NOISE_RATIO * rms)
    start = top - _count_above(foot, hit.force[top::-1]) + 1
    end = top + _count_above(foot, hit.force[top:])
    return Pulse(hit.force, offset, top, peak, start, end, rms)


def _measure_mean_and_rms(values: Floats) -> tuple[float, float]:
    """Return the mean and the rms about it."""
    mean = float(values.sum()) / values.size
    apart = values - mean
    return mean, math.sqrt(float(apart @ apart) / values.size)


def _drop_touches(quiet: Floats, top: float) -> Floats:
    """Return the samples of a baseline without those of a touch before the main pulse."""
    middle = find_median(quiet)
    spread = 1.4826 * find_median(np.abs(quiet - middle))
    return quiet[np.abs(quiet - middle) <= max(TOUCH_SPREAD * spread, MIN_TOUCH_SHARE * (top - middle))]


def require_pulse(hit: Hit) -> Pulse:
    """Return the highest force pulse; raise ValueError if there is none."""
    pulse = find_pulse(hit)
    if pulse is None:
        raise ValueError("a hit has no force pulse. Check all hits with check_hit first.")
    return pulse


def _count_above(foot: float, signal: Floats) -> int:
    """Count the samples before the first one below the foot, block by block because pulses are short."""
    for at in range(0, signal.size, SEARCH_BLOCK_SIZE):
        below = signal[at : at + SEARCH_BLOCK_SIZE] < foot
        first = int(below.argmax())
        if below[first]:
            return at + first
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
    top, offset = int(hit.force.argmax()), find_median(hit.force)
    foot = offset + PULSE_END_SHARE * (float(hit.force[top]) - offset)
    return top - _count_above(foot, hit.force[top::-1]) + 1


_pre_hit_counts: WeakKeyDictionary[Hit, int] = WeakKeyDictionary()


def extract_baseline(signal: Floats, before: int) -> Floats:
    """Return the first four fifths of the `before` samples ahead of the pulse, else the last tenth of the record."""
    quiet = signal[: int(0.8 * before)]
    return quiet if quiet.size >= 8 else signal[-max(signal.size // 10, 8) :]
