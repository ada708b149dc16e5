"""The part of the force that counts in an averaged FRF."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from acquisition.hit import Hit
from acquisition.hits.pulse import baseline, find_pulse, samples_before


@dataclass(frozen=True, eq=False)
class WindowedForce:
    """The samples about the pulse of a hit, tapered; all others are taken as zero."""

    samples: slice
    """Place in the hit."""
    force: NDArray[np.float64]
    """Baseline's mean taken off, times window (N), shape (m,)."""
    window: NDArray[np.float64]
    """Weight of each sample, 0 to 1, shape (m,)."""
    noise: float
    """rms of the baseline (N)."""
    mean_noise: float
    """Standard error of the baseline's mean (N)."""


def windowed_force(hit: Hit) -> WindowedForce:
    """The pulse with one of its widths on either side kept whole, then tapered to zero over one more (raised cosine).

    A tight window matters: noise inside it is alike at neighbouring lines, and so passes for a shift of the mode.
    Each hit is looked at once. Raises ValueError for a hit without a pulse.
    """
    if hit not in _known:
        _known[hit] = _windowed(hit)
    return _known[hit]


_known: WeakKeyDictionary[Hit, WindowedForce] = WeakKeyDictionary()


def _windowed(hit: Hit) -> WindowedForce:
    pulse = find_pulse(hit)
    if pulse is None:
        raise ValueError("a hit has no force pulse; check hits with check_hit before averaging")
    width = max(pulse.end - pulse.start, 8)
    corners = np.array([pulse.start - 2 * width, pulse.start - width, pulse.end + width, pulse.end + 2 * width])
    samples = slice(max(int(corners[0]), 0), min(int(corners[3]), hit.force.size))
    beyond = np.interp(np.arange(samples.start, samples.stop), corners, [1.0, 0.0, 0.0, 1.0])
    window = 0.5 + 0.5 * np.cos(np.pi * beyond)
    quiet = baseline(hit.force, samples_before(hit))
    noise = pulse.baseline_rms
    force = (hit.force[samples] - pulse.offset) * window
    return WindowedForce(samples, force, window, noise, noise / np.sqrt(quiet.size))
