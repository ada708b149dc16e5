"""Find the further touches of the hammer in the force of a hit."""

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from acquisition.arrays import Floats, find_median
from acquisition.hits.pulse import MIN_TOUCH_SHARE, Pulse

FALSE_TOUCH_RATE = 0.001
"""Number of touches per hit that are noise. Each has some 6 times the noise power of the main pulse's window (chosen).
"""
BINS_PER_WIDTH = 4
"""Number of averaged samples per pulse width; fewer where it was recorded with fewer."""
LEVEL_WIDTHS = 8
"""Pulse widths over which the level under a touch is a median: touches may fill half of them (chosen)."""
CORE_SHARE = 0.818
"""Mean of a squared sine over the middle half of its foot, over its peak: (1/2 + 1/pi)."""


@dataclass(frozen=True)
class Touch:
    """Further touch of the hammer."""

    start: int
    """First sample in which it is above the noise."""
    end: int
    """First sample after it."""
    height: float
    """Peak above the force beside it (N)."""
    peak_index: float
    """Sample of the peak."""


def find_touches(pulse: Pulse) -> list[Touch]:
    """Find the touches other than the main pulse, in the order of time.

    The force is averaged over half a pulse width and over a whole one. A touch is where an average is above the median
    of its surroundings by more than noise and by 0.3 % of the main pulse. The median follows offset, drift, hum, and a
    force that sinks below zero behind a high pass and recovers. Noise is the median absolute deviation in the record,
    or that of differences before the pulse: some recorders leave zeros after it.
    """
    step = max(1, pulse.width // BINS_PER_WIDTH)
    force = _remove_main_pulse(pulse)
    force = force[: force.size // step * step].reshape(-1, step) @ np.full(step, 1 / step)
    floor = MIN_TOUCH_SHARE * pulse.peak
    if force.max() - force.min() < floor:
        return []
    white = _estimate_noise(np.diff(force[: max(pulse.start, 0) // step])) / np.sqrt(2)
    force = np.nan_to_num(force - _measure_level(force, LEVEL_WIDTHS * pulse.width // step))
    limit = NormalDist().inv_cdf(1 - FALSE_TOUCH_RATE / (2 * force.size))
    above = np.zeros(force.size, dtype=bool)
    for count in (pulse.width // (2 * step), pulse.width // step):
        smooth = _average(force, count)
        noise = max(_estimate_noise(smooth[::count]), white / np.sqrt(count))
        above |= smooth > max(limit * noise, CORE_SHARE * floor)
    edges = np.flatnonzero(np.diff(above, prepend=False, append=False)).reshape(-1, 2)
    touches = [_measure_touch(force, first, last, step) for first, last in edges]
    low, high = pulse.start - pulse.width, pulse.end + pulse.width
    return [touch for touch in touches if touch.start < low or touch.end > high]


def _estimate_noise(values: Floats) -> float:
    return 1.4826 * find_median(np.abs(values)) if values.size else 0.0


def _measure_touch(force: Floats, first: int, last: int, step: int) -> Touch:
    top = first + int(np.argmax(force[first:last]))
    return Touch(first * step, last * step, float(force[top]), (top + 0.5) * step)


def _remove_main_pulse(pulse: Pulse) -> Floats:
    """Replace the main pulse and half its width on either side by a straight line."""
    half = pulse.width // 2
    low, high = max(pulse.start - half, 0), min(pulse.end + half, pulse.recorded.size)
    force = pulse.force
    before, after = force[max(low - half, 0) : low], force[high : high + half]
    ends = [float(side.sum()) / side.size if side.size else None for side in (before, after)]
    left, right = (end if end is not None else opposite or 0.0 for end, opposite in (ends, ends[::-1]))
    force[low:high] = left + (right - left) / max(high - low - 1, 1) * np.arange(high - low)
    return force


def _measure_level(force: Floats, length: int) -> Floats:
    """Return the medians of pieces of this length, joined by straight lines; 0 at the begin, NaN after the last one."""
    count = force.size // length
    pieces = force[force.size - count * length :].reshape(count, length)
    medians = np.partition(pieces, length // 2, axis=1)[:, length // 2]  # np.median takes 8 times as long
    middles = force.size + (np.arange(-count, 0) + 0.5) * length
    levels = np.concatenate([[0.0], medians])
    found = np.interp(np.arange(force.size), np.concatenate([[0.0], middles]), levels, right=np.nan)
    return np.asarray(found)


def _average(force: Floats, count: int) -> Floats:
    """Return the mean over so many values around each."""
    sums = np.zeros(force.size + count)
    np.cumsum(force, out=sums[count // 2 + 1 : count // 2 + 1 + force.size])
    sums[count // 2 + 1 + force.size :] = sums[count // 2 + force.size]
    return np.asarray((sums[count:] - sums[:-count]) / count)
