"""Decode the byte stream of a DATAQ device into scans and detect lost ones.

Each scan ends with the constant word of the digital inputs, whose low byte is always 0. Lost bytes move everything
that follows, so that another word appears in its place. The decoder then resumes where it finds the word again. A loss
of whole scans moves nothing. A square wave on a digital input shows it by a period that is too short.
"""

import numpy as np
from numpy.typing import NDArray

from acquisition.arrays import Codes, Flags
from acquisition.dataq.protocol import OVERFLOW_REPLY, USB_PACKET_BYTES
from acquisition.errors import DeviceError

CLOCK_BIT = 0x0100
"""Bit of digital input 0 in the word of the digital inputs."""
CLOCK_PERIOD_LIMITS = (6.0, 100.0)
"""Shortest and longest clock period (scans). An edge is known to one scan, a rate to one percent."""
CLOCK_TRAINING_PERIODS = 16
"""Periods from which the period length is measured. Losses within them are not detected."""
CLOCK_PERIOD_TOLERANCE = 1.5
"""Allowed deviation of a period from its measured length (scans). A packet holds more."""


class DigitalClock:
    """Square wave on digital input 0 whose periods show the loss of whole scans."""

    def __init__(self) -> None:
        self._measured_periods: list[int] = []
        self._period = 0.0
        self.restart()

    def restart(self) -> None:
        """Restart: the following scans do not join the earlier ones."""
        self._high = True
        self._edge: int | None = None
        self._waited = 0

    def find_gap(self, high: Flags) -> tuple[int, int]:
        """Return how many scans precede the next gap, and how many are missing there (0: none).

        The place is that of the next edge, at most a period late. The number is the smallest that fits, right except
        for whole periods and two scans. If the wave jumps up at the gap within CLOCK_PERIOD_TOLERANCE scans of a
        regular edge, up to that many scans more are not counted. DeviceError if there is no wave.

        Parameters
        ----------
        high
            State of the input in consecutive scans, shape (n,), n >= 1.
        """
        before = np.concatenate(([self._high], high[:-1]))
        for at in map(int, np.flatnonzero(high & ~before)):
            missing = 0 if self._edge is None else self._missing(at - self._edge)
            if missing:
                self.restart()
                self._high = False
                return at, missing
            self._edge, self._waited = at, -at
        self._advance(high)
        return high.size, 0

    def _missing(self, scans: int) -> int:
        """Return the number of scans missing between two edges this far apart."""
        if not self._period:
            self._measure_period(scans)
            return 0
        if abs(scans - self._period) <= CLOCK_PERIOD_TOLERANCE:
            return 0
        missing = -scans % self._period
        return round(missing if missing > CLOCK_PERIOD_TOLERANCE else missing + self._period)

    def _measure_period(self, scans: int) -> None:
        self._measured_periods.append(scans)
        if len(self._measured_periods) < CLOCK_TRAINING_PERIODS:
            return
        periods = np.array(self._measured_periods)
        even = periods[np.abs(periods - np.median(periods)) <= CLOCK_PERIOD_TOLERANCE]
        self._period, (low, high) = float(np.mean(even)), CLOCK_PERIOD_LIMITS
        if even.size < CLOCK_TRAINING_PERIODS - 2 or not low <= self._period <= high:
            raise _make_clock_error()

    def _advance(self, high: Flags) -> None:
        self._high = bool(high[-1])
        self._waited += high.size
        if self._edge is not None:
            self._edge -= high.size
        if self._waited > 3 * CLOCK_PERIOD_LIMITS[1]:
            raise _make_clock_error()


def _make_clock_error() -> DeviceError:
    low, high = CLOCK_PERIOD_LIMITS
    text = f"digital input 0 of the DAQ has no regular square wave with a period of {low:g} to {high:g} samples"
    return DeviceError(text, "Reconnect the clock generator, or remove digital_clock from [daq]")


HELD_BACK_BYTES = 32
"""Bytes held back: the end of an overflowed stream is text, not samples."""
SYNC_WINDOW_SCANS = 32
"""Scans that must agree before a position is accepted as that of the digital word."""

CodeBlock = tuple[Codes, int]
"""Codes, shape (n_channels, n), and the number of scans lost before them."""


class ScanDecoder:
    """Decoder of a byte stream into scans.

    Parameters
    ----------
    n_channels
        Number of analog channels.
    digital_word
        Whether each scan ends with the word of the digital inputs.
    clock
        Whether digital input 0 carries a square wave.
    """

    def __init__(self, n_channels: int, digital_word: bool, clock: bool = False) -> None:
        self._n_channels, self._checked = n_channels, digital_word
        self._clock = DigitalClock() if clock else None
        self._mask = ~CLOCK_BIT if clock else -1
        self._scan_bytes = 2 * (n_channels + digital_word)
        self.begin()

    def begin(self, lost: int = 0) -> None:
        """Begin a stream whose first byte begins a scan. Its first block reports the scans lost before it."""
        self._bytes = b""
        self._word: int | None = None
        self._in_place = False
        self._lost = lost
        self._begin_clock()

    def feed(self, data: bytes) -> list[CodeBlock]:
        """Return the scans that these bytes complete."""
        self._bytes += data
        return list(iter(self._next_block, None))

    def has_overflowed(self) -> bool:
        """Return whether the stream ends with the overflow reply of the device."""
        return OVERFLOW_REPLY in self._bytes[-HELD_BACK_BYTES:]

    def _next_block(self) -> CodeBlock | None:
        """Return the scans up to the next gap, None until more bytes arrive."""
        while (count := (len(self._bytes) - HELD_BACK_BYTES) // self._scan_bytes) > 0:
            intact = self._count_intact(count)
            if intact:
                return self._take(intact)
            if count < SYNC_WINDOW_SCANS + 2:
                return None
            self._find_word()
        return None

    def _count_intact(self, count: int) -> int:
        """Count the next scans that have the digital word in its place."""
        if not self._checked:
            return count
        if not self._in_place:
            return 0
        wrong = np.flatnonzero(self._digital_words(0, count) & self._mask != self._word)
        self._in_place = wrong.size == 0
        return count if self._in_place else int(wrong[0])

    def _take(self, count: int) -> CodeBlock:
        count, missing = self._until_gap(count)
        size = count * self._scan_bytes
        words = np.frombuffer(self._bytes[:size], "<i2").reshape(count, -1)
        self._bytes = self._bytes[size:]
        lost, self._lost = self._lost, missing
        return words[:, : self._n_channels].T.astype(np.int32), lost

    def _until_gap(self, count: int) -> tuple[int, int]:
        """Return how many scans precede a gap that the clock shows, and how many are missing there."""
        if self._clock is None:
            return count, 0
        high = self._digital_words(0, count) & CLOCK_BIT != 0
        until, missing = self._clock.find_gap(high)
        if until:
            return until, missing
        self._lost += missing
        return self._clock.find_gap(high)

    def _find_word(self) -> None:
        """Move the next scan to the head of the buffer. If it cannot be located, drop one scan."""
        shift = self._find_shift()
        if shift is None:
            self._bytes = self._bytes[self._scan_bytes :]
            self._lost += 1
            return
        word = int(self._digital_words(shift, 1)[0]) & self._mask
        if shift or word == self._word:  # not a new word in the old place: the next scan may be made of two
            self._lost += (shift + self._scan_bytes + self._missing_bytes(shift)) // self._scan_bytes
            self._bytes = self._bytes[shift + self._scan_bytes :]
        self._word, self._in_place = word, True
        self._begin_clock()

    def _begin_clock(self) -> None:
        if self._clock:
            self._clock.restart()

    def _find_shift(self) -> int | None:
        """Return the bytes to the next scan: by the known word, else a new one in the old place, else anywhere."""
        words = {shift: self._steady_word(shift) for shift in range(self._scan_bytes)}
        steady = [shift for shift, word in words.items() if word is not None]
        same = [shift for shift in steady if words[shift] == self._word]
        if self._word is not None and not same:
            return 0 if 0 in steady else None
        return next(iter(same or steady), None)

    def _steady_word(self, shift: int) -> int | None:
        words = self._digital_words(shift, SYNC_WINDOW_SCANS) & self._mask
        first = int(words[0])
        return first if first & 0x80FF == 0 and np.all(words == first) else None

    def _digital_words(self, shift: int, count: int) -> NDArray[np.int16]:
        size = self._scan_bytes
        return np.frombuffer(self._bytes[shift : shift + count * size], "<i2").reshape(count, -1)[:, -1]

    def _missing_bytes(self, shift: int) -> int:
        """Return the smallest loss that moves the stream this far, in whole USB packets if possible."""
        if not shift:
            return 0
        packets = (USB_PACKET_BYTES * k for k in range(1, self._scan_bytes))
        return next((n for n in packets if (n + shift) % self._scan_bytes == 0), self._scan_bytes - shift)
