"""The drivers that lobewatch brings with it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from acquisition.devices.driver import DeviceSettings, Driver, SensorPlace, on_no_serial_port

if TYPE_CHECKING:
    from acquisition.emulation import Bench, EmulatorThread
    from acquisition.ports import SerialLink
    from acquisition.source import Device, DeviceAddress, DeviceIdentity

LINES_RATE = 10_000.0
"""Of an emulated board that prints lines (Hz)."""
CLOCK = 1000.0
"""Of an emulated generator (Hz)."""


def _open_taps(port: str, settings: DeviceSettings) -> Device:
    from acquisition.taps import TapsSource

    return TapsSource(port, settings.sample_rate)


def _probe_taps(link: SerialLink) -> DeviceIdentity | None:
    from acquisition.taps import probe_taps

    return probe_taps(link)


def _check_taps(settings: DeviceSettings) -> None:
    if not settings.loss_detection:
        raise ValueError("loss_detection=false: a TAPS/1 device always numbers its scans; leave the key out")
    if settings.digital_clock:
        raise ValueError("digital_clock=true: a TAPS/1 device numbers its scans and needs no clock; leave the key out")


def _emulate_taps(bench: Bench) -> EmulatorThread:
    from acquisition.taps import TapsEmulator

    channels = tuple(sensor.channel for sensor in bench.inputs)
    signal = bench.signal_at(bench.sample_rate)
    return TapsEmulator(signal, channels, bench.sample_rate, realtime=bench.realtime, tcp=bench.tcp)


def _open_dataq(port: str, settings: DeviceSettings) -> Device:
    from acquisition.dataq import DataqSource

    return DataqSource(
        port, settings.inputs, settings.sample_rate, settings.loss_detection, digital_clock=settings.digital_clock
    )


def _probe_dataq(link: SerialLink) -> DeviceIdentity | None:
    from acquisition.dataq import probe_dataq

    return probe_dataq(link)


def _check_dataq(settings: DeviceSettings) -> None:
    from acquisition.dataq import check_inputs

    check_inputs(settings.inputs)
    if settings.digital_clock and not settings.loss_detection:
        raise ValueError("digital_clock=true: the clock stands in the digital word; leave out loss_detection=false")


def _emulate_dataq(bench: Bench) -> EmulatorThread:
    """Where a skew is given for an input, the device converts its inputs one after the other."""
    from acquisition.dataq import DataqEmulator, DataqTraits

    skewed = any(sensor.channel.skew for sensor in bench.inputs)
    traits = DataqTraits(scanned=skewed, clock_hz=CLOCK if bench.digital_clock else None)
    return DataqEmulator(bench.signal_at, bench.inputs, realtime=bench.realtime, tcp=bench.tcp, traits=traits)


def _open_lines(port: str, settings: DeviceSettings) -> Device:
    from acquisition.lines import LinesSource

    return LinesSource(port, settings.inputs, settings.sample_rate, settings.printing)


def _probe_lines(link: SerialLink) -> DeviceIdentity | None:
    from acquisition.lines import probe_lines

    return probe_lines(link)


def _check_lines(settings: DeviceSettings) -> None:
    from acquisition.lines import check_lines

    check_lines(settings.inputs, settings.sample_rate)


def _emulate_lines(bench: Bench) -> EmulatorThread:
    from acquisition.lines import LinesEmulator

    channels = [sensor.channel for sensor in bench.inputs]
    sensitivities = tuple(channel.sensitivity for channel in channels)
    rate, full_scale = min(bench.sample_rate, LINES_RATE), channels[0].full_scale
    return LinesEmulator(bench.signal_at(rate), sensitivities, full_scale, rate, realtime=bench.realtime, tcp=bench.tcp)


def _by_library(name: str, title: str, extra: str) -> Driver:
    """A kind of device that a library of its maker reads."""

    def open_device(port: str, settings: DeviceSettings) -> Device:
        from acquisition import makers

        opened: Device = getattr(makers, f"open_{name}")(port, settings.inputs, settings.sample_rate)
        return opened

    def search() -> Sequence[DeviceAddress]:
        from acquisition import makers

        listed: Sequence[DeviceAddress] = getattr(makers, f"search_{name}")()
        return listed

    return Driver(name, title, open_device, on_no_serial_port, search=search, is_tried=False, extra=extra)


BUILT_IN = (
    Driver(
        "taps",
        "a TAPS/1 device",
        _open_taps,
        _probe_taps,
        _check_taps,
        SensorPlace("the device's own channel data (INFO)", "sens_V_per_EU", "skew_s"),
        emulate=_emulate_taps,
        emulates_fast=True,
    ),
    Driver(
        "dataq",
        "a DATAQ DI-1120, 2108, 2108-P, 4108, 4208 or 4718B",
        _open_dataq,
        _probe_dataq,
        _check_dataq,
        vendors=frozenset({0x0683}),
        emulate=_emulate_dataq,
    ),
    Driver(
        "lines",
        "a board that prints lines of numbers",
        _open_lines,
        _probe_lines,
        _check_lines,
        emulate=_emulate_lines,
        prints=True,
        is_tried=False,
    ),
    _by_library("audio", "a sound device with two inputs, such as The Modal Shop 485B39", "audio"),
    _by_library("nidaqmx", "an NI device, such as an NI 9234 or 9230", "nidaqmx"),
    _by_library("mcc172", "an MCC 172 on a Raspberry Pi", "mcc172"),
    _by_library("uldaq", "a Measurement Computing USB device", "uldaq"),
    _by_library("ljm", "a LabJack T7 or T8", "ljm"),
)
"""In the order in which they are asked for."""
