"""Find the further touches of the hammer in the force of a hit."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from acquisition.arrays import Floats
from acquisition.hits.pulse import Pulse

MIN_TOUCH_SHARE = 0.003
"""Smallest height of a touch, over that of the main pulse: left out, it biases the FRF by that share (chosen)."""
FALSE_TOUCH_RATE = 0.05
"""Number of times per hit that noise passes for a touch, each of which adds most of a window of noise (chosen)."""
BINS_PER_WIDTH = 8
"""Number of averaged samples per pulse width; fewer where it was recorded with fewer."""
LEVEL_WIDTHS = 8
"""Pulse widths over which the level under the touches is a median: they may fill half of them (chosen)."""
SQUARED_SINE_CORE = 0.818
"""Mean of a squared sine over the middle half of its foot, over its peak."""


@dataclass(frozen=True)
class Touch:
    """Further touch of the hammer."""

    start: int
    """First sample."""
    end: int
    """First sample after it."""
    height: float
    """Peak above the force beside it (N)."""
    peak_index: float
    """Sample of the peak."""


def find_touches(pulse: Pulse) -> list[Touch]:
    """Find the touches besides the main pulse, in the order of time."""
    step = max(1, pulse.width // BINS_PER_WIDTH)
    force = _remove_main_pulse(pulse)
    force = force[: force.size // step * step].reshape(-1, step).mean(axis=1)
    floor = MIN_TOUCH_SHARE * pulse.peak
    if np.ptp(force) < floor:
        return []
    force = force - _measure_slow_level(force, LEVEL_WIDTHS * pulse.width // step)
    limit = NormalDist().inv_cdf(1 - FALSE_TOUCH_RATE / (2 * force.size))
    above = np.zeros(force.size, dtype=bool)
    for core in (pulse.width // (2 * step), pulse.width // step):
        smooth = _average(force, core)
        noise = 1.4826 * float(np.median(np.abs(smooth[::core])))
        above |= smooth > max(limit * noise, SQUARED_SINE_CORE * floor)
    edges = np.flatnonzero(np.diff(above, prepend=False, append=False)).reshape(-1, 2)
    touches = []
    for first, last in edges:
        top = first + int(np.argmax(force[first:last]))
        touches.append(Touch(first * step, last * step, float(force[top]), (top + 0.5) * step))
    low, high = pulse.start - pulse.width, pulse.end + pulse.width
    return [touch for touch in touches if touch.start < low or touch.end > high]


def _remove_main_pulse(pulse: Pulse) -> Floats:
    """Replace the main pulse and half its width on either side by a straight line."""
    half = pulse.width // 2
    low, high = max(pulse.start - half, 0), min(pulse.end + half, pulse.recorded.size)
    force = pulse.force
    before, after = force[max(low - half, 0) : low], force[high : high + half]
    ends = [float(np.mean(side)) if side.size else None for side in (before, after)]
    left, right = (end if end is not None else opposite or 0.0 for end, opposite in (ends, ends[::-1]))
    force[low:high] = np.linspace(left, right, high - low)
    return force


def _measure_slow_level(force: Floats, length: int) -> Floats:
    """Return the medians of pieces, joined by straight lines."""
    count = max(force.size // length, 1)
    pieces = force[: count * length].reshape(count, -1)
    return np.interp(np.arange(force.size), (np.arange(count) + 0.5) * pieces.shape[1], np.median(pieces, axis=1))


def _average(force: Floats, count: int) -> Floats:
    """Return the mean over so many samples around each."""
    padded = np.pad(force, (count // 2, count - 1 - count // 2), mode="edge")
    sums = np.cumsum(np.concatenate(([0.0], padded)))
    return (sums[count:] - sums[:-count]) / count
