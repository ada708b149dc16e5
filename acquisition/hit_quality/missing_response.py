"""Detect a response that does not answer the hit: noise, hum, drift, or a signal at the limit of its range."""

import numpy as np

from acquisition.arrays import Floats, find_median
from acquisition.hit import Hit
from acquisition.hits.pulse import count_pre_hit_samples

TENTHS = 10
"""Number of parts of a record whose levels are compared."""
SMOOTH_STEP_RATIO = 0.5
"""Largest rms of the steps from sample to sample over the rms of a signal that is hum or drift, chosen.

White noise has 1.41, a tone of a twelfth of the sample rate 0.52.
"""
MAX_STEADY_STEP_RATIO = 1.3
"""Largest level of the second differences in a tenth over their median level without a hit, chosen: that of white noise
is below 1.16 from 512 samples on.
"""
MAX_STEADY_LEVEL_RATIO = 4.0
"""Largest level of a tenth over the median level in a record without a hit, chosen. A random walk stays below 3.9 in 99
of 100 records, a hit that has decayed to 2 % at the end of the record reaches 7.
"""
MIN_LEVEL_BEFORE = 0.1
"""Smallest rms about the median before the hit over that of the last fifth in hum or drift, chosen: 2 ms at a zero of
hum at 50 Hz have 0.25.
"""
RAIL_SHARE = 0.5
"""Share of the samples before the hit at the limit of the range from which the signal is not of this hit, chosen."""


def measure_levels(response: Floats) -> Floats:
    """Return the standard deviation of each tenth."""
    return np.array([np.std(tenth) for tenth in np.array_split(response, TENTHS)])


def is_steady(response: Floats, before: int) -> bool:
    """Return whether a response is hum or drift that goes on through the hit without an answer to it.

    Its last fifth must be smooth, and not much stronger than the `before` samples ahead of the hit. Second differences
    nearly remove hum and drift, but no response: without one their level is the same everywhere. A slow response, which
    they remove too, decays.
    """
    tail = response[-max(response.size // 5, 2) :]
    quiet = response[:before] - find_median(response)
    is_smooth = np.std(np.diff(tail)) <= SMOOTH_STEP_RATIO * np.std(tail)
    if not (is_smooth and quiet.size and np.sqrt(np.mean(quiet**2)) >= MIN_LEVEL_BEFORE * np.std(tail)):
        return False
    steps = measure_levels(np.diff(response, 2))
    levels = measure_levels(response)
    is_even = np.max(steps) <= MAX_STEADY_STEP_RATIO * np.median(steps)
    return bool(is_even and np.max(levels) <= MAX_STEADY_LEVEL_RATIO * np.median(levels))


def is_saturated(hit: Hit) -> bool:
    """Return whether the response is at the limit of its range already before the hit."""
    before = hit.acceleration[: int(0.8 * count_pre_hit_samples(hit))]
    if not before.size or hit.codes is None or hit.channels is None:
        return False
    codes = hit.codes[-1]
    low, high = hit.channels[-1].effective_rails(codes)
    return bool(np.mean((codes[: before.size] <= low) | (codes[: before.size] >= high)) > RAIL_SHARE)
