"""Detect swapped cables of hammer and accelerometer."""

import numpy as np

from acquisition.arrays import Floats, find_median
from acquisition.hit import Hit
from acquisition.hits.pulse import extract_baseline

MAX_HAMMER_SWING = 0.3
"""Largest swing of a hammer against its pulse over the pulse, as it rings by itself; chosen."""


def is_swapped(hit: Hit) -> bool:
    """Return whether the response is short pulses of one sign while the force swings through both signs."""
    noise = float(np.std(extract_baseline(hit.acceleration, hit.pre_trigger)))
    smaller, larger = measure_swings(hit.acceleration)
    if smaller >= max(MAX_HAMMER_SWING * larger, 6 * noise):
        return False
    small = max(0.1 * larger, 6 * noise)
    smaller, larger = measure_swings(hit.force)
    if smaller <= MAX_HAMMER_SWING * larger:
        return False
    force, response = (signal - find_median(signal) for signal in (hit.force, hit.acceleration))
    pulse = np.where(np.abs(response) < small, 0.0, response)
    length = min(_measure_energy_duration(pulse), int(np.count_nonzero(pulse)))  # the latter of a double hit
    return _measure_energy_duration(force) > 3 * length


def measure_swings(signal: Floats) -> tuple[float, float]:
    """Return the smaller and the larger of the greatest distances from the median to either side."""
    middle = find_median(signal)
    smaller, larger = sorted((float(signal.max()) - middle, middle - float(signal.min())))
    return smaller, larger


def _measure_energy_duration(signal: Floats) -> int:
    """Count the samples that hold the central 90 % of the energy."""
    energy = np.cumsum(signal**2)
    low, high = np.searchsorted(energy, [0.05 * energy[-1], 0.95 * energy[-1]])
    return int(high - low) + 1
