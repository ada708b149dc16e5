"""What is known of one kind of device: how it is opened, recognised and emulated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from acquisition.channel import SensorInput
    from acquisition.emulation import Bench, EmulatorThread
    from acquisition.lines import Printing
    from acquisition.ports import SerialLink
    from acquisition.source import Device, DeviceAddress, DeviceIdentity


@dataclass(frozen=True)
class DeviceSettings:
    """What is asked of a device: [daq] of machine.toml, in SI units."""

    sample_rate: float | None = None
    """Scans a second (Hz); None leaves it to the driver."""
    inputs: tuple[SensorInput, ...] = ()
    """The sensors of a device that does not describe them itself."""
    loss_detection: bool = True
    """Whether lost scans are to be found."""
    digital_clock: bool = False
    """Whether a square wave on digital input 0 shows the loss of whole scans."""
    printing: Printing | None = None
    """What a board prints; None for volts in lines."""


@dataclass(frozen=True)
class SensorPlace:
    """Where a device keeps the data of its sensors, in the words by which a person finds them there."""

    place: str
    """The place, e.g. "the device's own channel data (INFO)"."""
    sensitivity: str
    """Name of a sensitivity there."""
    skew: str
    """Name of a skew (s) there."""


def anything_goes(settings: DeviceSettings) -> None:
    """Take all settings."""


def on_no_serial_port(_link: SerialLink) -> DeviceIdentity | None:
    """Answer of a device that is on no serial port: nobody."""
    return None


@dataclass(frozen=True)
class Driver:
    """One kind of device. Its functions import what they need when they are called: a list of drivers costs nothing."""

    name: str
    """Name, as in [daq] driver of machine.toml and in `lobewatch emulate NAME`."""
    title: str
    """Words for a device of this kind, e.g. "a TAPS/1 device"."""
    open: Callable[[str, DeviceSettings], Device]
    """Function that connects to a device on a port; DeviceError where none is there, ValueError for settings that it
    does not have."""
    probe: Callable[[SerialLink], DeviceIdentity | None]
    """Function that asks once who answers on an open link; None where no device of this kind does. `on_no_serial_port`
    for devices that are on none."""
    check: Callable[[DeviceSettings], None] = anything_goes
    """Function that raises ValueError for settings that no device of this kind has; its sensors are checked already."""
    sensors: SensorPlace | None = None
    """Place of the data of its sensors in the device; None: it has none, [[daq.channel]] must name them."""
    vendors: frozenset[int] = frozenset()
    """USB vendors of such devices, to which no other question is put; none where they may be of any vendor, or of one
    whose boards others build on too."""
    emulate: Callable[[Bench], EmulatorThread] | None = None
    """Function that makes a device of this kind of software."""
    emulates_fast: bool = False
    """Whether the emulated device can tell the host that its scans do not follow the clock."""
    search: Callable[[], Sequence[DeviceAddress]] | None = None
    """Function that lists devices of this kind that are on no serial port; none where its library is not installed."""
    prints: bool = False
    """Whether such a device prints its samples, as [daq.printing] says."""
    is_tried: bool = True
    """Whether somebody has reported that it works on hardware."""
    extra: str = ""
    """Name of the extra of lobewatch that brings the library it needs; empty where it needs none."""
