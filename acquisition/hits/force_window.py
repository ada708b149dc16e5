"""Window the force around all touches of the hammer."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from acquisition.arrays import Floats, find_median
from acquisition.hit import Hit
from acquisition.hits.pulse import Pulse, count_pre_hit_samples, extract_baseline, require_pulse
from acquisition.hits.touches import Touch, find_touches

LEVEL_WIDTHS = 8
"""Pulse widths beside a touch over which the level there is a median (chosen)."""
MAX_GAP_WIDTHS = 3
"""Pulse widths between two touches below which there is no level between them (chosen)."""
LEVEL_SIGNIFICANCE = 4.0
"""Standard errors by which such a level must differ from the baseline to be used instead of it (chosen)."""
MEDIAN_ERROR = 1.2533
"""Standard error of a median over that of a mean, sqrt(pi/2)."""


@dataclass(frozen=True, eq=False)
class WindowedForce:
    """Tapered samples around the touches of a hit; all others count as zero."""

    samples: NDArray[np.intp]
    """Their places in the hit, rising, shape (m,)."""
    force: Floats
    """Force without its baseline times the window (N), shape (m,)."""
    window: Floats
    """Weight of each sample, 0 to 1, shape (m,)."""
    noise: float
    """Rms of the baseline (N)."""
    mean_noise: float
    """Standard error of the baseline's mean (N)."""
    pulse: Pulse
    """Main pulse."""
    touches: Sequence[Touch]
    """Further touches."""


def window_force(hit: Hit) -> WindowedForce:
    """Return all touches with one pulse width on either side, tapered to zero over one more (raised cosine).

    A tight window matters: noise inside it is alike at neighbouring lines, and shifts the mode. Every touch must be
    inside, because the response to it is in the record. The result is cached per hit. Raises ValueError for a hit
    without a pulse.
    """
    if hit not in _windowed_forces:
        _windowed_forces[hit] = _compute_windowed_force(hit)
    return _windowed_forces[hit]


_windowed_forces: WeakKeyDictionary[Hit, WindowedForce] = WeakKeyDictionary()


def _compute_windowed_force(hit: Hit) -> WindowedForce:
    pulse = require_pulse(hit)
    touches, width = find_touches(pulse), pulse.width
    contacts = sorted([(pulse.start, pulse.end), *((touch.start, touch.end) for touch in touches)])
    inside = np.zeros(hit.force.size, bool)
    for start, end in contacts:
        inside[max(start - 2 * width, 0) : max(end + 2 * width, 0)] = True
    samples = inside.nonzero()[0]
    away = np.minimum.reduce([np.maximum(start - samples, samples - end) for start, end in contacts])
    window = 0.5 + 0.5 * np.cos(np.pi * np.minimum(np.maximum(away / width - 1, 0.0), 1.0))
    force = (hit.force[samples] - _follow_baseline(pulse, contacts, samples)) * window
    quiet = extract_baseline(hit.force, count_pre_hit_samples(hit))
    mean_noise = pulse.baseline_rms / math.sqrt(quiet.size)
    return WindowedForce(samples, force, window, pulse.baseline_rms, mean_noise, pulse, touches)


def _follow_baseline(pulse: Pulse, contacts: Sequence[tuple[int, int]], samples: NDArray[np.intp]) -> Floats:
    """Return the force at these samples without the touches (N).

    Before the first touch it is the mean of the baseline. A high pass lets it sink during a touch and recover after it,
    so it is a straight line under a touch, between the medians on either side.
    """
    groups: list[tuple[int, int]] = []
    for start, end in contacts:
        if groups and start - groups[-1][1] < MAX_GAP_WIDTHS * pulse.width:
            start, end = groups[-1][0], max(end, groups.pop()[1])
        groups.append((start, end))
    half, far = pulse.width // 2, LEVEL_WIDTHS * pulse.width
    times, levels = [], []
    for i, (start, end) in enumerate(groups):
        before = _measure_level(pulse, max(start - far, groups[i - 1][1] + half), start - half) if i else pulse.offset
        stop = groups[i + 1][0] - half if i + 1 < len(groups) else pulse.recorded.size
        times += [start, end]
        levels += [before, _measure_level(pulse, end + half, min(end + far, stop))]
    return np.interp(samples, times, levels)


def _measure_level(pulse: Pulse, start: int, end: int) -> float:
    """Return the median of these samples (N), or the baseline where it does not differ by more than noise."""
    rest = pulse.recorded[start:end]
    if rest.size < pulse.width:
        return pulse.offset
    level, error = find_median(rest), MEDIAN_ERROR * pulse.baseline_rms / math.sqrt(rest.size)
    return level if abs(level - pulse.offset) > LEVEL_SIGNIFICANCE * error else pulse.offset
