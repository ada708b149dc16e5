"""The speed of a spindle from the pulses of its tachometer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

HIGH, LOW = 0.6, 0.4
"""Share of the range of the signal above which a pulse has begun, and below which it is over; chosen."""
EVEN = 1.4
"""Time of a turn over that of most beside it, or its inverse, from which on pulses are missing or too many; chosen."""
LEAST_EVEN = 0.8
"""Share of the turns that must be as long as those beside them; chosen."""
BESIDE = 5
"""Turns on each side that a turn is compared with; chosen."""


def speed_of_pulses(signal: NDArray[np.float64], sample_rate: float, pulses: int = 1) -> NDArray[np.float64]:
    """Spindle speed at each sample (rpm), shape (n,), from a tachometer in any unit, shape (n,); sample_rate in Hz.

    pulses: in a turn; from one turn to the next the speed is constant, NaN before the first, after the last and where
    a pulse is missing. Its mean over time is the number of turns over their time. ValueError for less than two turns,
    for pulses that come at no even times, and pulses < 1.

    Example: a pulse of 2 ms each 20 ms.

    >>> pulse = np.where(np.arange(2000) % 200 < 20, 5.0, 0.0)
    >>> np.unique(speed_of_pulses(pulse, 10e3)[200:1600].round(3)).tolist()
    [3000.0]
    """
    if pulses < 1:
        raise ValueError(f"{pulses} pulses a turn; give 1 or more")
    begins = _rising(signal)
    marks = begins[::pulses]
    if marks.size < 3:
        raise ValueError(
            f"{begins.size} pulses in {signal.size / sample_rate:.3g} s, less than two turns of {pulses}; is the "
            "tachometer connected, and is this its column?"
        )
    turn = np.diff(marks)
    usual = np.array([np.median(turn[max(i - BESIDE, 0) : i + BESIDE + 1]) for i in range(turn.size)])
    is_even = np.maximum(turn / usual, usual / turn) < EVEN
    if np.mean(is_even) < LEAST_EVEN:
        raise ValueError(f"{begins.size} pulses at no even times; is the tachometer connected, and is this its column?")
    speed = np.full(signal.size, np.nan)
    edges = np.ceil(marks).astype(int)
    for first, last, time in zip(edges[:-1][is_even], edges[1:][is_even], turn[is_even], strict=True):
        speed[first:last] = 60 * sample_rate / time
    return speed


def _rising(signal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where pulses begin, in samples and parts of them."""
    low, high = float(np.min(signal)), float(np.max(signal))
    if not high > low:
        return np.empty(0)
    level = (signal - low) / (high - low)
    state = np.where(level > HIGH, 1, np.where(level < LOW, -1, 0))
    known = np.flatnonzero(state)
    rises = (state[known[1:]] > 0) & (state[known[:-1]] < 0)
    after, before = known[1:][rises], known[:-1][rises]
    share = (HIGH - level[before]) / (level[after] - level[before])
    return np.asarray(before + share * (after - before), dtype=np.float64)
