"""Window the force around all touches of the hammer."""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from acquisition.arrays import Floats
from acquisition.hit import Hit
from acquisition.hits.pulse import count_pre_hit_samples, extract_baseline, require_pulse
from acquisition.hits.touches import find_touches


@dataclass(frozen=True, eq=False)
class WindowedForce:
    """Tapered samples around the pulse of a hit; all others count as zero."""

    samples: NDArray[np.intp]
    """Indices in the record of the hit, shape (m,)."""
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


REST_WIDTHS = 8
"""Pulse widths over which the level beside a touch is taken (chosen)."""
LEVEL_SIGNIFICANCE = 4.0
"""Standard errors by which such a level must differ from the baseline before the hit, to be used instead (chosen)."""


def _compute_windowed_force(hit: Hit) -> WindowedForce:
    pulse = require_pulse(hit)
    width = pulse.width
    spans = [(pulse.start - width, pulse.end + width), *((touch.start - width, touch.end + width) for touch in find_touches(pulse))]
    samples = np.unique(np.concatenate([np.arange(start - width, end + width) for start, end in spans]))
    samples = samples[(samples >= 0) & (samples < hit.force.size)]
    beyond = np.min([np.maximum(start - samples, samples - end) for start, end in spans], axis=0) / width
    window = 0.5 + 0.5 * np.cos(np.pi * np.clip(beyond, 0.0, 1.0))
    quiet = extract_baseline(hit.force, count_pre_hit_samples(hit))
    noise = pulse.baseline_rms
    force = (hit.force[samples] - _follow_baseline(pulse, width, spans)(samples)) * window
    return WindowedForce(samples, force, window, noise, noise / np.sqrt(quiet.size))


def _follow_baseline(pulse, width, spans):
    parts = [(pulse.start, pulse.end), *spans[1:]]
    groups = []
    for start, end in sorted(parts):
        if groups and start - width < groups[-1][1] + width:
            groups[-1][1] = max(end, groups[-1][1])
        else:
            groups.append([start, end])
    bounds = [0, *(edge for group in groups for edge in group), pulse.recorded.size]
    knots, levels = [], []
    for i, (start, end) in enumerate(groups):
        before, after = bounds[2 * i], bounds[2 * i + 3]
        knots += [start, end]
        levels += [pulse.offset if i == 0 else _level(pulse, max(start - REST_WIDTHS * width, before + width), start)]
        levels += [_level(pulse, end + width//2, min(end + REST_WIDTHS * width, after - width))]
    return lambda at: np.interp(at, knots, levels)


def _level(pulse, start, end):
    rest = pulse.recorded[max(start, 0) : max(end, 0)]
    if rest.size < 8:
        return pulse.offset
    level = float(np.median(rest))
    error = LEVEL_SIGNIFICANCE * 1.25 * pulse.baseline_rms / np.sqrt(rest.size)
    return level if abs(level - pulse.offset) > error else pulse.offset
