"""Protocols of a data source and a device, and the events of a device."""

from __future__ import annotations

import enum
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from types import TracebackType
from typing import TYPE_CHECKING, Protocol, Self

if TYPE_CHECKING:
    from acquisition.channel import Block, Channel


class EventKind(enum.IntEnum):
    """Kind of an event at a device."""

    BUTTON = 1
    """Button at the device was pressed: it undoes the last hit."""
    CABLE = 2
    """Cable of a channel is not plugged in."""
    SENSOR_BIAS = 3
    """Sensor has no supply or draws none: its bias voltage is out of range."""


@dataclass(frozen=True)
class Event:
    """One event that a device reports."""

    kind: int
    """Kind of the event, an EventKind; unknown kinds are passed on."""
    begins: bool = True
    """True if a button is pressed or a fault begins; False if it ends."""
    channel: int | None = None
    """Index of the channel of the cable or sensor; None without one."""
    scan: int = 0
    """Time of the event, in scans since the start of the stream."""


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
        """Sensor on each input."""

    @property
    def sample_rate(self) -> float:
        """Sample rate (Hz)."""

    def start(self) -> None:
        """Start sampling; scan 0 is the next one."""

    def stop(self) -> None:
        """End the stream; blocks() then ends too."""

    def blocks(self) -> Iterator[Block]:
        """Yield blocks as they arrive; raise DeviceError where the device goes away or falls silent."""


EMULATED_SERIAL = "EMULATED"
"""Serial number of an emulated device."""
EMULATED_SERIALS = (EMULATED_SERIAL, "EMU-1")
"""Serial numbers of emulated devices, with that of the TAPS/1 emulator."""


RECORDING_MODEL_PREFIX = "replay of "
"""Beginning of the model of a recording that is read like a device."""


@dataclass(frozen=True)
class DeviceIdentity:
    """Identity that a device reports."""

    model: str
    """Model."""
    serial: str = ""
    """Serial number; empty if it has none."""
    firmware: str = ""
    """Version; empty if it has none."""
    knows_sensors: bool = field(default=False, compare=False, kw_only=True)
    """True if it is emulated and says that its sensitivities are the true ones of its signals."""

    @property
    def is_emulated(self) -> bool:
        """True if the device says that it is emulated."""
        return self.serial in EMULATED_SERIALS

    @property
    def is_recording(self) -> bool:
        """True if it is a recording that is read like a device."""
        return self.model.startswith(RECORDING_MODEL_PREFIX)


@dataclass(frozen=True)
class DeviceAddress:
    """Address and identity of a device that is not a serial port."""

    address: str
    """Address as `[daq] port` takes it: name of the driver, a colon, and the driver's own address."""
    identity: DeviceIdentity
    """Model, serial number and firmware, as far as known before the device is opened."""
    description: str = ""
    """Description by the operating system."""


class Device(Source, Protocol):
    """Connected source that reports its identity and state. A context manager."""

    sample_rate: float
    """Sample rate (Hz); set to the measured rate where that is accepted."""

    @property
    def identity(self) -> DeviceIdentity:
        """Model, serial number and firmware."""

    @property
    def follows_clock(self) -> bool:
        """True if scans follow the clock, so that their rate can be measured."""

    @property
    def loss_detection(self) -> str:
        """Method of detecting lost scans, in two words; empty if none can be lost."""

    @property
    def events(self) -> deque[Event]:
        """Events, oldest first: take with popleft(), in any thread (IndexError: empty)."""

    @property
    def fault(self) -> str:
        """Present fault and its remedy in sentences; empty without one."""

    def close(self) -> None:
        """Stop, and release the port."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
