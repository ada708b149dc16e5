"""What every data source offers; nothing downstream can tell one from another."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from acquisition.channel import Block, Channel


class Source(Protocol):
    """A stream of scans from one device, one file or one simulation."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What is on each input."""
        ...

    @property
    def sample_rate(self) -> float:
        """Scans a second (Hz)."""
        ...

    def start(self) -> None:
        """Begin to sample; scan 0 is the first one after this."""
        ...

    def stop(self) -> None:
        """End the stream; blocks() then ends too."""
        ...

    def blocks(self) -> Iterator[Block]:
        """Blocks as they arrive; DeviceError where the device goes away or falls silent."""
        ...
