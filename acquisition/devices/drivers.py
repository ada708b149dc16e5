"""Device drivers: the driver record and the built-in drivers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

from acquisition.errors import DeviceError

if TYPE_CHECKING:
    from acquisition.channel import SensorInput
    from acquisition.emulation import EmulationSetup, EmulatorThread
    from acquisition.ports import SerialLink
    from acquisition.source import Device, DeviceAddress, DeviceIdentity
    from acquisition.text_boards.decoders import OutputFormat


@dataclass(frozen=True)
class DeviceSettings:
    """Settings of a device: [daq] of machine.toml in SI units."""

    sample_rate: float | None = None
    """Sample rate (Hz), None for the default of the driver."""
    inputs: tuple[SensorInput, ...] = ()
    """Sensors of a device that does not describe them itself."""
    loss_detection: bool = True
    """True to detect lost scans."""
    digital_clock: bool = False
    """True if a square wave on digital input 0 shows the loss of whole scans."""
    printing: OutputFormat | None = None
    """Output format of a board, None for volts in lines."""


@dataclass(frozen=True)
class SensorDataLocation:
    """Location of the sensor data in a device, for people."""

    place: str
    """Location, e.g. "the device's own channel data (INFO)"."""
    sensitivity: str
    """Name of a sensitivity there."""
    skew: str
    """Name of a skew (s) there."""


def skip_serial_probe(_link: SerialLink) -> DeviceIdentity | None:
    """Probe no serial port: for a driver whose devices are on none.

    Parameters
    ----------
    _link
        Open serial link, not used.

    Returns
    -------
    None
        No device of this kind is on a serial port.
    """
    return None


@dataclass(frozen=True)
class Driver:
    """One kind of device. Its functions import what they need when called, so that a list of drivers costs nothing."""

    name: str
    """Name, as in [daq] driver of machine.toml."""
    title: str
    """Noun phrase for a device of this kind, e.g. "a TAPS/1 device"."""
    open: Callable[[str, DeviceSettings], Device]
    """Function that connects to a device on a port. DeviceError if there is none, ValueError for settings it does
    not support.
    """
    probe: Callable[[SerialLink], DeviceIdentity | None]
    """Function that asks once who answers on an open link, None if no device of this kind does.
    `skip_serial_probe` for devices on no serial port.
    """
    check: Callable[[DeviceSettings], None] = lambda _: None
    """Function that raises ValueError for settings that no device of this kind supports. Its sensors are checked
    already.
    """
    sensor_data: SensorDataLocation | None = None
    """Location of the sensor data in the device, None if [[daq.channel]] must name the sensors."""
    usb_vendors: frozenset[int] = frozenset()
    """USB vendor ids that only such devices have. Only this driver probes them. Empty if any vendor is
    possible, or the vendor also makes boards for others.
    """
    emulate: Callable[[EmulationSetup], EmulatorThread] | None = None
    """Function that emulates a device of this kind."""
    emulates_fast: bool = False
    """True if the emulated device can tell the host that its scans do not follow the clock."""
    search: Callable[[], Sequence[DeviceAddress]] | None = None
    """Function that lists devices of this kind that are on no serial port, none if its library is not installed."""
    prints_samples: bool = False
    """True if such a device prints its samples, as [daq.printing] says."""
    is_hardware_tested: bool = True
    """True if a user has reported that it works on hardware."""
    extra: str = ""
    """Name of the lobewatch extra that installs its library, empty if it needs none."""


EMULATED_BOARD_RATE = 10_000.0
"""Sample rate of an emulated board that prints lines (Hz)."""
EMULATED_CLOCK_FREQUENCY = 1000.0
"""Frequency of an emulated clock generator (Hz)."""


def _check_taps(settings: DeviceSettings) -> None:
    if not settings.loss_detection:
        raise ValueError("loss_detection=false is not possible with a TAPS/1 device. Remove loss_detection from [daq].")
    if settings.digital_clock:
        raise ValueError("digital_clock=true is not possible with a TAPS/1 device. Remove digital_clock from [daq].")


def _emulate_taps(setup: EmulationSetup) -> EmulatorThread:
    from acquisition.taps.emulator import TapsEmulator

    channels = tuple(sensor.channel for sensor in setup.inputs)
    signal = setup.signal_at(setup.sample_rate)
    rate, realtime = setup.sample_rate, setup.realtime
    return TapsEmulator(signal, channels, rate, realtime=realtime, tcp=setup.tcp, clock=setup.clock, knows_sensors=True)


def _open_dataq(port: str, settings: DeviceSettings) -> Device:
    from acquisition.dataq.source import DataqSource

    rate, clock = settings.sample_rate, settings.digital_clock
    return DataqSource(port, settings.inputs, rate, settings.loss_detection, digital_clock=clock)


def _check_dataq(settings: DeviceSettings) -> None:
    _import("dataq.protocol").check_inputs(settings.inputs)
    if settings.digital_clock and not settings.loss_detection:
        raise ValueError("digital_clock=true needs loss detection. Remove loss_detection=false from [daq].")


def _emulate_dataq(setup: EmulationSetup) -> EmulatorThread:
    """Emulate a DATAQ device. If an input has a skew, the device converts its inputs one after the other."""
    from acquisition.dataq.emulator import DataqEmulator, DataqTraits

    skewed = any(sensor.channel.skew for sensor in setup.inputs)
    traits = DataqTraits(is_multiplexed=skewed, clock_hz=EMULATED_CLOCK_FREQUENCY if setup.digital_clock else None)
    signal, realtime = setup.signal_at, setup.realtime
    return DataqEmulator(signal, setup.inputs, realtime=realtime, tcp=setup.tcp, traits=traits, clock=setup.clock)


def _emulate_text_board(setup: EmulationSetup) -> EmulatorThread:
    from acquisition.text_boards.source import TextBoardEmulator

    volts = tuple(sensor.channel.sensitivity for sensor in setup.inputs)
    rate, full_scale = min(setup.sample_rate, EMULATED_BOARD_RATE), setup.inputs[0].channel.full_scale
    signal, true_rate = setup.signal_at(rate), (1 + setup.clock_error) * rate
    return TextBoardEmulator(signal, volts, full_scale, true_rate, realtime=setup.realtime, tcp=setup.tcp)


def _import(module: str) -> Any:
    return import_module(f"acquisition.{module}")


def _make_library_driver(name: str, title: str, module: str) -> Driver:
    """Make the driver of a device that a vendor library reads. The extra that installs it has the driver's name."""

    def call(verb: str, *arguments: Any) -> Any:
        return getattr(_import(f"vendor_drivers.{module}"), f"{verb}_{name}")(*arguments)

    def open_device(port: str, settings: DeviceSettings) -> Any:
        return call("open", port, settings.inputs, settings.sample_rate)

    def search() -> Any:
        try:
            return call("search")
        except DeviceError:  # its library is not installed
            return []

    return Driver(name, title, open_device, skip_serial_probe, search=search, is_hardware_tested=False, extra=name)


BUILT_IN_DRIVERS = (
    Driver(
        "taps",
        "a TAPS/1 device",
        lambda port, settings: _import("taps.source").TapsSource(port, settings.sample_rate),
        lambda link: _import("taps.source").probe_taps(link),
        _check_taps,
        SensorDataLocation("the device's own channel data (INFO)", "sens_V_per_EU", "skew_s"),
        emulate=_emulate_taps,
        emulates_fast=True,
    ),
    Driver(
        "dataq",
        "a DATAQ DI-1120, 2108, 2108-P, 4108, 4208 or 4718B",
        _open_dataq,
        lambda link: _import("dataq.protocol").probe_dataq(link),
        _check_dataq,
        usb_vendors=frozenset({0x0683}),
        emulate=_emulate_dataq,
    ),
    Driver(
        "lines",
        "a text-output board that prints lines of numbers",
        lambda port, settings: _import("text_boards.source").TextBoardSource(
            port, settings.inputs, settings.sample_rate, settings.printing
        ),
        lambda link: _import("text_boards.source").probe_text_board(link),
        lambda settings: _import("text_boards.source").check_text_board(settings.inputs, settings.sample_rate),
        emulate=_emulate_text_board,
        prints_samples=True,
        is_hardware_tested=False,
    ),
    _make_library_driver("audio", "a sound device with two inputs, such as The Modal Shop 485B39", "audio"),
    _make_library_driver("nidaqmx", "an NI device, such as an NI 9234 or 9230", "nidaqmx"),
    _make_library_driver("mcc172", "an MCC 172 on a Raspberry Pi", "measurement_computing"),
    _make_library_driver("uldaq", "a Measurement Computing USB device", "measurement_computing"),
    _make_library_driver("ljm", "a LabJack T7 or T8", "labjack"),
)
"""Built-in drivers, in the order in which they probe."""
