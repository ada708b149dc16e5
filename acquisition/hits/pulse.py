"""Where the hammer pulse stands in a hit."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from acquisition.hit import Hit

FALLEN = 0.05
"""The pulse ends where the force has first fallen below this share of its peak, or into its noise ..."""
NOISE_RATIO = 3.0
"""... which reaches to this many times the baseline's rms."""
PIECE = 1024
"""Samples looked at together."""


@dataclass(frozen=True, eq=False)
class Pulse:
    """The main force pulse of a hit."""

    recorded: NDArray[np.float64]
    """Force as it was recorded (N), shape (n,)."""
    offset: float
    """Mean of its baseline (N)."""
    top: int
    """Sample of the largest force."""
    peak: float
    """Largest force above the baseline (N)."""
    start: int
    """First sample above 5 % of the peak and the noise."""
    end: int
    """First sample below 5 % of the peak or in the noise after it."""
    baseline_rms: float
    """rms of the force before the pulse, or after it where nothing was recorded before (N)."""

    @property
    def force(self) -> NDArray[np.float64]:
        """Force with the baseline's mean taken off (N), shape (n,)."""
        return self.recorded - self.offset


def find_pulse(hit: Hit) -> Pulse | None:
    """The highest force pulse; None where no sample stands out of the baseline by 6 times its rms, or none is known."""
    if not hit.has_force:
        return None
    top = int(np.argmax(hit.force))
    quiet = baseline(hit.force, samples_before(hit))
    offset, rms = float(np.mean(quiet)), float(np.std(quiet))
    peak = float(hit.force[top]) - offset
    if peak <= 6 * rms or peak <= 0:
        return None
    foot = offset + max(FALLEN * peak, NOISE_RATIO * rms)
    start = top - _length_above(foot, hit.force[top::-1]) + 1
    end = top + _length_above(foot, hit.force[top:])
    return Pulse(hit.force, offset, top, peak, start, end, rms)


def _length_above(foot: float, signal: NDArray[np.float64]) -> int:
    """How many samples stand before the first one below the foot; looked for piece by piece, as pulses are short."""
    for at in range(0, signal.size, PIECE):
        below = np.flatnonzero(signal[at : at + PIECE] < foot)
        if below.size:
            return at + int(below[0])
    return signal.size


def samples_before(hit: Hit) -> int:
    """The pre-trigger, or where it is not known the samples before the force last rises above 5 % of its peak.

    Without a force: before the response first does. Each hit is looked at once.
    """
    if hit.pre_trigger:
        return hit.pre_trigger
    if hit not in _known:
        _known[hit] = _before_force(hit.force) if hit.has_force else _before_response(hit.acceleration)
    return _known[hit]


def _before_force(force: NDArray[np.float64]) -> int:
    above = force[: int(np.argmax(force)) + 1] - np.median(force)
    low = np.flatnonzero(above < FALLEN * above[-1])
    return int(low[-1]) + 1 if low.size else 0


def _before_response(response: NDArray[np.float64]) -> int:
    size = np.abs(response - np.median(response))
    return int(np.argmax(size > FALLEN * np.max(size)))


_known: WeakKeyDictionary[Hit, int] = WeakKeyDictionary()


def baseline(signal: NDArray[np.float64], before: int) -> NDArray[np.float64]:
    """The first four fifths of the `before` samples ahead of the pulse, else the last tenth of the record."""
    quiet = signal[: int(0.8 * before)]
    return quiet if quiet.size >= 8 else signal[-max(signal.size // 10, 8) :]
