"""Remark on a sensor that is read faster than it samples."""

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from acquisition import Hit, Remark
from dsm import format_rounded
from lobewatch.arrays import Flags, Floats

REPEAT_WINDOW = 16
"""Samples around a pair that must change, so that the pair cannot be equal by chance."""
MIN_STEPS_IN_WINDOW = 256
"""Smallest change within the window (resolution steps). Then at most 4 % of the pairs of a smooth signal are equal."""
MIN_REPEATED_SHARE = 0.1
"""Share of equal pairs from which samples repeat, chosen: over twice that by chance."""
MIN_PAIRS = 100
"""Fewest pairs of samples that are evaluated, chosen."""


def repeated_samples_remarks(hits: Sequence[Hit]) -> list[Remark]:
    """Return the remark on a response whose samples repeat, none if they do not.

    A polled MEMS sensor gives its last value again until it has a new one.
    """
    pairs = [compare_neighbours(hit.acceleration) for hit in hits]
    is_equal = np.concatenate(pairs) if pairs else np.empty(0, bool)
    share = float(np.mean(is_equal)) if is_equal.size >= MIN_PAIRS else 0.0
    if share < MIN_REPEATED_SHARE:
        return []
    rate = hits[0].sample_rate
    new = format_rounded(rate * (1 - share), digits=2)
    text = f"{100 * share:.0f} % of the acceleration samples repeat the sample before"
    true = f"the sensor has about {new} new values per second, but is read {rate:g} times"
    cure = "Read the sensor once per new value (data-ready signal), and correct sample_rate_hz"
    return [Remark("repeated-samples", "", f"{text}, so {true}", cure)]


def compare_neighbours(signal: Floats) -> Flags:
    """Return for each pair of neighbours in changing parts of a signal whether both are equal.

    Pairs at the largest and smallest value are left out: an overloaded input stays there.
    """
    changes = np.abs(np.diff(signal))
    if signal.size < 2 * REPEAT_WINDOW or not changes.any():
        return np.empty(0, bool)
    step = np.min(changes[changes > 0])
    windows = sliding_window_view(signal, REPEAT_WINDOW)
    is_moving = np.ptp(windows, axis=1) >= MIN_STEPS_IN_WINDOW * step
    first = slice(REPEAT_WINDOW // 2 - 1, REPEAT_WINDOW // 2 - 1 + len(windows))
    values = signal[first]
    counts: Flags = is_moving & (values != signal.max()) & (values != signal.min())
    return np.equal(changes[first], 0.0)[counts]
