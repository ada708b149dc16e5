"""A square wave on digital input 0, by whose periods the loss of whole scans is seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import DeviceError

CLOCK_BIT = 0x0100
"""Of the word of the digital inputs: input 0."""
PERIODS = (6.0, 100.0)
"""Shortest and longest that are followed (scans): an edge is known to one scan, a rate to one percent."""
LEARNT = 16
"""Periods from which their length is taken: what is lost within these is not seen."""
UNEVEN = 1.5
"""Scans by which a period may differ from the length learnt; a packet holds more."""


class DigitalClock:
    """Follows the rising edges."""

    def __init__(self) -> None:
        """Nothing is known of the period."""
        self._learning: list[int] = []
        self._period = 0.0
        self.begin()

    def begin(self) -> None:
        """The scans that follow do not join on to those before."""
        self._high = True
        self._edge: int | None = None
        self._waited = 0

    def until_gap(self, high: NDArray[np.bool_]) -> tuple[int, int]:
        """How many of these scans come before the next that is missing, and how many are missing there (0: none).

        high: the input in consecutive scans, shape (n,), n >= 1. The place is that of the next edge, at most a period
        late; the number is the smallest that fits, right but for whole periods and two scans. A wave that jumps up at
        the gap may do so within UNEVEN scans of a regular edge; up to UNEVEN scans more are then not counted.
        DeviceError where there is no wave.
        """
        before = np.concatenate(([self._high], high[:-1]))
        for at in map(int, np.flatnonzero(high & ~before)):
            missing = 0 if self._edge is None else self._missing(at - self._edge)
            if missing:
                self.begin()
                self._high = False
                return at, missing
            self._edge, self._waited = at, -at
        self._go_on(high)
        return high.size, 0

    def _missing(self, scans: int) -> int:
        """How many are missing between two edges so far apart."""
        if not self._period:
            self._learn(scans)
            return 0
        if abs(scans - self._period) <= UNEVEN:
            return 0
        missing = -scans % self._period
        return round(missing if missing > UNEVEN else missing + self._period)

    def _learn(self, scans: int) -> None:
        self._learning.append(scans)
        if len(self._learning) < LEARNT:
            return
        even = [length for length in self._learning if abs(length - np.median(self._learning)) <= UNEVEN]
        self._period = float(np.mean(even))
        if len(even) < LEARNT - 2 or not PERIODS[0] <= self._period <= PERIODS[1]:
            raise no_clock()

    def _go_on(self, high: NDArray[np.bool_]) -> None:
        self._high = bool(high[-1])
        self._waited += high.size
        if self._edge is not None:
            self._edge -= high.size
        if self._waited > 3 * PERIODS[1]:
            raise no_clock()


def no_clock() -> DeviceError:
    """Digital input 0 has no wave that can be followed."""
    low, high = PERIODS
    return DeviceError(
        f"digital input 0 of the DAQ has no even square wave with a period of {low:g} to {high:g} scans",
        "connect the generator again, or take digital_clock out of [daq]",
    )
