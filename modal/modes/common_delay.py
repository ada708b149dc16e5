"""A delay between the channels, told apart from complex modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modal.modes.mode import Mode

REAL_WITHIN = 2.0
"""Phases of the modes of a lightly damped structure scatter about 0 by this (degrees)."""
CLEAR = 5.0
"""A delay counts from this phase on, at the highest mode (degrees) ..."""
FEWEST = 3
"""... where so many modes agree ..."""
REST = 4.0
"""... and it leaves a sum of squares (in their errors) below this many times the number of modes less one ..."""
SHARE = 0.1
"""... and below this share of what there was without it."""


@dataclass(frozen=True)
class CommonDelay:
    """A delay that explains the phases of all modes."""

    skew: float
    """The response is sampled so much later than the force (s); the value for `Channel.skew`."""
    skew_std: float
    """Standard error (s)."""

    def phase_deg(self, frequency: float) -> float:
        """The phase that it gives a real mode at this frequency (Hz)."""
        return 360 * frequency * self.skew


def common_delay(modes: Sequence[Mode]) -> CommonDelay | None:
    """The delay whose phase, linear in frequency, is that of all modal constants; None where they have none in common.

    A response that is sampled later than the force leads by 2 pi f skew on every line; complex modes follow no such
    line. Three modes at least.

    >>> late = 20e-6  # s: a converter that takes its channels one after the other
    >>> modes = [Mode(f, 0.02, 2e7, phase_deg=360.0 * f * late) for f in (500.0, 900.0, 1300.0)]
    >>> round(common_delay(modes).skew * 1e6, 2)  # us
    20.0
    """
    if len(modes) < FEWEST:
        return None
    frequency = np.array([mode.frequency for mode in modes])
    error = np.hypot([mode.phase_deg_std for mode in modes], REAL_WITHIN)
    turn, phase = 360 * frequency / error, np.array([mode.phase_deg for mode in modes]) / error
    skew, std = float(turn @ phase / (turn @ turn)), float(1 / np.linalg.norm(turn))
    left = float(np.sum((phase - turn * skew) ** 2))
    explains = left < REST * (len(modes) - 1) and left < SHARE * float(phase @ phase)
    is_clear = abs(360 * skew) * frequency.max() > CLEAR and abs(skew) > 3 * std
    return CommonDelay(skew, std) if explains and is_clear else None
