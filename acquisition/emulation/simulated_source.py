"""A device without a cable: a signal function, quantised, for unit tests."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from acquisition.channel import Block, Channel
from acquisition.event import Event
from acquisition.source import DeviceIdentity

Signal = Callable[[int, int], NDArray[np.float64]]
"""(first_scan, n_scans) -> values in N and m/s^2, shape (n_channels, n_scans)."""


def quantise(signal: NDArray[np.float64], channels: tuple[Channel, ...]) -> NDArray[np.int32]:
    """ADC codes (n_channels, n) of values in N and m/s^2."""
    return np.stack([channel.encode(values) for channel, values in zip(channels, signal, strict=True)])


class SimulatedSource:
    """Scans of a signal function, as fast as they are asked for.

    >>> sensors = (Channel("force", 2.25e-3, 5.0),)
    >>> quiet = SimulatedSource(lambda first, n: np.zeros((1, n)), sensors, 10240.0, n_scans=1000)
    >>> [block.codes.shape for block in quiet.blocks()]  # channels, scans
    [(1, 512), (1, 512)]
    """

    identity = DeviceIdentity("simulation")
    """What it says it is."""
    follows_clock = False
    """Its scans come as fast as they are asked for."""
    loss_detection = ""
    """No scans can be lost."""

    def __init__(
        self,
        signal: Signal,
        channels: tuple[Channel, ...],
        sample_rate: float,
        n_scans: int,
        block: int = 512,
    ) -> None:
        """A stream of n_scans scans of (first_scan, n) -> N and m/s^2, shape (n_channels, n), cut into blocks."""
        self.channels = channels
        """What is on each input."""
        self.sample_rate = sample_rate
        """Scans a second (Hz)."""
        self.events: deque[Event] = deque()
        """Put in what shall happen."""
        self._signal, self._n_scans, self._block = signal, n_scans, block

    def __enter__(self) -> Self:
        """The source."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it."""
        self.close()

    @property
    def fault(self) -> str:
        """Nothing is ever wrong."""
        return ""

    def start(self) -> None:
        """Nothing to prepare."""

    def stop(self) -> None:
        """End at the next block."""
        self._n_scans = 0

    def close(self) -> None:
        """End at the next block."""
        self.stop()

    def blocks(self) -> Iterator[Block]:
        """The blocks."""
        first = 0
        while first < self._n_scans:
            yield Block(first, quantise(self._signal(first, self._block), self.channels))
            first += self._block
