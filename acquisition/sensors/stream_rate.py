"""Measure the sample rate of a stream while it is read."""

import time
from collections.abc import Callable

from acquisition.channel import Block
from acquisition.sensors.daq_timing import MAX_RATE_STD, MIN_RATE_BLOCKS, RATE_TOLERANCE, MeasuredRate, fit_rate

ARRIVAL_INTERVAL = 0.1
"""Time of which only the least delayed block is kept (s), chosen: an hour of a stream takes 36 000 of them."""
RATE_STD_FACTOR = 3.0
"""Standard errors by which a rate must be off beyond the tolerance: 0.3 % of honest stretches at the limit itself."""
BUFFER_TIME = 5e-3
"""Time by which a buffer between converter and computer may fill or empty during the stream (s), chosen: a period of a
sound card. The standard error does not show it.
"""
RECENT_TIME = 5.0
"""Length of the newest stretch (s), which shows a rate that changes during the stream: as long as `measure_rate`."""


class StreamRate:
    """Sample rate of a stream against the clock of the computer.

    Parameters
    ----------
    sample_rate
        Rate in use (Hz).
    clock
        Function that returns the time (s).

    Examples
    --------
    >>> ticks = iter(0.05 * np.arange(200))  # s: a block of 500 scans every 50 ms
    >>> stream = StreamRate(8000.0, clock=lambda: next(ticks))
    >>> for first in range(0, 100_000, 500):
    ...     stream.add(Block(first, np.zeros((2, 500), dtype=np.int32)))
    >>> round(stream.measure().rate), round(stream.find_deviation().rate)
    (10000, 10000)
    """

    def __init__(self, sample_rate: float, clock: Callable[[], float] = time.monotonic) -> None:
        self.sample_rate = sample_rate
        """Rate in use (Hz)."""
        self._clock = clock
        self._scans: list[int] = []
        self._arrived: list[float] = []
        self._interval_end = -float("inf")

    def add(self, block: Block) -> None:
        """Note the arrival of a block.

        Parameters
        ----------
        block
            Block that has just been read.
        """
        now, scans = self._clock(), block.first_scan + block.codes.shape[1]
        if self._scans and scans <= self._scans[-1]:
            return
        if now >= self._interval_end:
            self._interval_end = now + ARRIVAL_INTERVAL
        elif now - self._arrived[-1] < (scans - self._scans[-1]) / self.sample_rate:  # less delayed
            del self._arrived[-1], self._scans[-1]
        else:
            return
        self._arrived.append(now)
        self._scans.append(scans)

    def measure(self, seconds: float = float("inf")) -> MeasuredRate | None:
        """Measure the rate of the newest stretch.

        Parameters
        ----------
        seconds
            Length of the stretch (s).

        Returns
        -------
        MeasuredRate or None
            Rate and its standard error, None for fewer than 10 arrivals.
        """
        begin = sum(self._arrived[-1] - arrived > seconds for arrived in self._arrived)
        if len(self._arrived) - begin < MIN_RATE_BLOCKS:
            return None
        return fit_rate(self._scans[begin:], self._arrived[begin:])

    def find_deviation(self) -> MeasuredRate | None:
        """Return the measured rate if it is off the rate in use by more than 0.2 %, 3 standard errors and 5 ms.

        The whole stream and its newest 5 s are measured. A rate with a standard error above 0.2 % shows nothing.

        Returns
        -------
        MeasuredRate or None
            Measured rate of the stretch that is off, None if none is.
        """
        measured = filter(None, (self.measure(), self.measure(RECENT_TIME)))
        return next((rate for rate in measured if self._is_off(rate)), None)

    @property
    def is_verified(self) -> bool:
        """True if the stream was long and even enough to show or to exclude a deviation of more than 0.2 %."""
        measured = self.measure()
        if measured is None:
            return False
        is_right = self._deviation(measured) + _uncertainty(measured) <= RATE_TOLERANCE
        return is_right or self.find_deviation() is not None

    @property
    def seconds(self) -> float:
        """Length of the stream (s)."""
        return self._arrived[-1] - self._arrived[0] if self._arrived else 0.0

    def _is_off(self, measured: MeasuredRate) -> bool:
        if measured.std > MAX_RATE_STD * measured.rate:
            return False
        return self._deviation(measured) > RATE_TOLERANCE + _uncertainty(measured)

    def _deviation(self, measured: MeasuredRate) -> float:
        """Return the relative deviation of a measured rate from that in use."""
        return abs(measured.rate / self.sample_rate - 1)


def _uncertainty(measured: MeasuredRate) -> float:
    """Return the largest relative error of a measured rate."""
    return RATE_STD_FACTOR * measured.std / measured.rate + BUFFER_TIME / measured.seconds
