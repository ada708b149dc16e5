"""Newest signal of the accelerometers of a device, with the places of its faults."""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from acquisition import Block, Channel
from acquisition.arrays import Codes
from acquisition.files.cut_file import CutSignal
from lobewatch.arrays import Floats
from lobewatch.tap.device_connection import get_newest_codes

KEPT_SIGNAL_SECONDS = 20.0
"""Length of the newest signal that is kept (s)."""
MAX_LEVEL_BLOCKS = 64
"""Largest number of blocks of which the level is taken; chosen."""
MAX_OVERLOAD_SPANS = 100
"""Largest number of overloads of a recording whose places are stored; with more, all of it counts as overloaded."""


@dataclass
class SignalBuffer:
    """Newest signal of all acceleration channels. Samples and times count from the beginning of the stream."""

    channels: list[Channel]
    """Acceleration channels of the device."""
    rows: list[int]
    """Their rows in each block."""
    rate: float
    """Sample rate (Hz)."""
    codes: deque[Codes] = field(default_factory=deque)
    """Blocks that are kept, each of shape (channels, n)."""
    lost: deque[tuple[int, int]] = field(default_factory=deque)
    """Place and number of lost scans."""
    overloads: deque[tuple[int, int]] = field(default_factory=deque)
    """First sample and the one after the last of each block with an overload."""
    first: int = 0
    """First sample that is kept."""
    received: int = 0
    """Number of samples so far."""

    @property
    def seconds(self) -> float:
        """Length of the stream so far (s)."""
        return self.received / self.rate

    def add(self, block: Block) -> Floats:
        """Keep a block, drop what is too old, and return its accelerations (m/s^2), shape (channels, n)."""
        codes = block.codes[self.rows]
        begin, self.received = self.received, self.received + codes.shape[1]
        if block.lost_before:
            self.lost.append((begin, block.lost_before))
        if any(block.overload >> row & 1 for row in self.rows):
            joined = self.overloads.pop()[0] if self.overloads and self.overloads[-1][1] == begin else begin
            self.overloads.append((joined, self.received))
        self.codes.append(codes)
        self.forget(self.seconds - KEPT_SIGNAL_SECONDS)
        return np.asarray(codes * self._scales, np.float64)

    @property
    def _scales(self) -> Floats:
        return np.array([[channel.scale] for channel in self.channels])

    def forget(self, before: float) -> None:
        """Drop whole blocks before a time (s), and the marks of their faults."""
        while len(self.codes) > 1 and self.first + self.codes[0].shape[1] <= before * self.rate:
            self.first += self.codes.popleft().shape[1]
        while self.lost and self.lost[0][0] <= self.first:
            self.lost.popleft()
        while self.overloads and self.overloads[0][1] <= self.first:
            self.overloads.popleft()

    def take(self, begin: float, end: float) -> CutSignal:
        """Return the signal from one time to another (s), as far as it is kept."""
        first, last = max(round(begin * self.rate), self.first), min(round(end * self.rate), self.received)
        codes = np.concatenate(self.codes, axis=1)[:, first - self.first : last - self.first]
        values = np.asarray(codes * self._scales, np.float64)
        spans = tuple(
            (max(a, first) - first, min(b, last) - first) for a, b in self.overloads if a < last and b > first
        )
        if len(self.channels) == 1:
            codes, values = codes[0], values[0]
        channel, *more = self.channels
        return CutSignal(
            values,
            self.rate,
            codes,
            channel,
            sum(count for place, count in self.lost if first < place < last),
            bool(spans),
            more_channels=tuple(more),
            overload_spans=spans if len(spans) <= MAX_OVERLOAD_SPANS else (),
        )

    @property
    def newest(self) -> Codes:
        """Codes of the newest 50 ms of the first channel."""
        return get_newest_codes([codes[0] for codes in list(self.codes)[-MAX_LEVEL_BLOCKS:]], self.rate)

    @property
    def level(self) -> float:
        """RMS about the mean over the newest 50 ms of the first channel (m/s^2)."""
        return float(np.std(self.newest) * abs(self.channels[0].scale))
