"""A source without a device: a signal function, quantised, for unit tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from acquisition.channel import Block, Channel

Signal = Callable[[int, int], NDArray[np.float64]]
"""(first_scan, n_scans) -> values in N and m/s^2, shape (n_channels, n_scans)."""


def quantise(signal: NDArray[np.float64], channels: tuple[Channel, ...]) -> NDArray[np.int32]:
    """ADC codes (n_channels, n) of values in N and m/s^2."""
    return np.stack([channel.encode(values) for channel, values in zip(channels, signal, strict=True)])


class SimulatedSource:
    """Scans of a signal function, as fast as they are asked for."""

    def __init__(
        self,
        signal: Signal,
        channels: tuple[Channel, ...],
        sample_rate: float,
        n_scans: int,
        block: int = 512,
    ) -> None:
        """A stream of n_scans scans, cut into blocks."""
        self.channels = channels
        self.sample_rate = sample_rate
        self._signal, self._n_scans, self._block = signal, n_scans, block

    def start(self) -> None:
        """Nothing to prepare."""

    def stop(self) -> None:
        """End at the next block."""
        self._n_scans = 0

    def blocks(self) -> Iterator[Block]:
        """The blocks."""
        first = 0
        while first < self._n_scans:
            yield Block(first, quantise(self._signal(first, self._block), self.channels))
            first += self._block
