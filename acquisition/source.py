"""Protocols of a data source and a device, and the events of a device."""

from __future__ import annotations

import enum
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Protocol, Self

if TYPE_CHECKING:
    from acquisition.channel import Block, Channel


class EventKind(enum.IntEnum):
    """What has happened."""

    BUTTON = 1
    """A button at the device was pressed: it undoes the last hit."""
    CABLE = 2
    """The cable of a channel is not plugged in."""
    SENSOR_BIAS = 3
    """A sensor has no supply, or does not take it: its bias voltage is out of range."""


@dataclass(frozen=True)
class Event:
    """One thing that a device has told."""

    kind: int
    """An EventKind; unknown ones are passed on."""
    begins: bool = True
    """Pressed, or a fault has come; False: released, or the fault has gone."""
    channel: int | None = None
    """Channel of the cable or sensor; None for none."""
    scan: int = 0
    """Time of the event, in scans taken since the start of the stream."""


class ClosedOnExit:
    """Context manager that closes itself at the end."""

    def close(self) -> None:
        """Close it."""

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()


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


@dataclass(frozen=True)
class DeviceIdentity:
    """Who a device is, in its own words."""

    model: str
    """Model."""
    serial: str = ""
    """Serial number; empty where it has none."""
    firmware: str = ""
    """Version; empty where it has none."""


@dataclass(frozen=True)
class DeviceAddress:
    """Where a device is that is no serial port, and who it is."""

    address: str
    """Address as `[daq] port` and --port take it: the name of the driver, a colon, and what the driver knows it by."""
    identity: DeviceIdentity
    """Model, serial number and firmware, as far as they are known before it is opened."""
    description: str = ""
    """Description in the words of the system."""


class Device(Source, Protocol):
    """A connected source that says who it is and how it fares, and can be given back. A context manager."""

    sample_rate: float
    """Scans a second (Hz); set to the measured rate where that is accepted."""

    @property
    def identity(self) -> DeviceIdentity:
        """Who it is."""
        ...

    @property
    def follows_clock(self) -> bool:
        """Whether its scans follow the clock, so that their rate can be measured."""
        ...

    @property
    def loss_detection(self) -> str:
        """How lost scans are found, in two words; empty where none can be lost."""
        ...

    @property
    def events(self) -> deque[Event]:
        """What has happened at it, oldest first: take with popleft(), in any thread (IndexError: empty)."""
        ...

    @property
    def fault(self) -> str:
        """One sentence on what is wrong with it while that lasts; empty where all is well."""
        ...

    def close(self) -> None:
        """Stop, and give the port back."""
        ...

    def __enter__(self) -> Self:
        """The device itself."""
        ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""
        ...
