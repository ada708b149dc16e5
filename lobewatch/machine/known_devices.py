"""DAQs whose sample rate was measured once: MACHINE/daq.json."""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any, Protocol, TypeGuard, runtime_checkable

import msgspec

from acquisition import DataError, DeviceError, MeasuredRate, Source, atomic_write, check_rate, measure_rate
from lobewatch.machine.folder import MachineFolder


@runtime_checkable
class Device(Source, Protocol):
    """A source that says who it is."""

    info: dict[str, Any]
    """With "model" and "serial"."""
    sample_rate: float
    """Scans a second (Hz); set to the measured rate where that is accepted."""


class KnownDevice(msgspec.Struct, frozen=True):
    """One device at one rate, as it stands in daq.json."""

    model: str
    serial: str
    nominal_rate_hz: float
    measured_rate_hz: float
    measured_rate_hz_std: float
    n_scans: int
    seconds: float
    measured: str
    """When (ISO 8601, UTC)."""


def checked_rate(
    folder: MachineFolder, source: Source, seconds: float = 5.0, clock: Callable[[], float] = time.monotonic
) -> float:
    """The rate of a connected source that is not started (Hz), measured where this machine does not know it yet.

    Call it once after every connect, before source.start(), with the folder locked. The first time, for a model,
    serial number and nominal rate that are not in daq.json, it starts the source, listens for `seconds` and stops it
    again; later it returns at once (`known_rate` tells beforehand which). Within 0.2 % of source.sample_rate nothing
    changes and that rate is returned. Further off: DeviceError, one sentence with the measured rate; or, with
    accept_measured_rate = true in [daq], source.sample_rate is set to the measured rate and that is returned, so that
    every Hit of capture_hits(source, ...) has it: make the Trigger from the returned rate. A refused rate is not kept
    and is measured again the next time.

    A source without an identity (no `info`, no model or serial number in it) is not a device: its rate is returned
    unchecked. So is that of a source whose info has clock_ppm = None: it says that its scans do not follow the clock.
    """
    if not has_clock(source):
        return source.sample_rate
    return use_rate(folder, source, known_rate(folder, source) or measure_rate(source, seconds, clock))


def has_clock(source: Source) -> TypeGuard[Device]:
    """Whether a source is a device with an identity, whose scans follow the clock."""
    if not isinstance(source, Device) or not (source.info.get("model") and source.info.get("serial")):
        return False
    return source.info.get("clock_ppm", 0) is not None


def known_rate(folder: MachineFolder, source: Device) -> MeasuredRate | None:
    """What was measured of this device at this nominal rate; None where it is not known."""
    for device in _read(folder):
        if _same(device, source):
            return MeasuredRate(device.measured_rate_hz, device.measured_rate_hz_std, device.n_scans, device.seconds)
    return None


def use_rate(folder: MachineFolder, source: Device, measured: MeasuredRate) -> float:
    """Check a measured rate, accept it where [daq] says so, keep it in daq.json, and return the rate to use (Hz)."""
    try:
        check_rate(measured, source.sample_rate)
        rate = source.sample_rate
    except DeviceError as error:
        if not folder.machine.daq.accept_measured_rate:
            cure = f"{error.cure} (accept_measured_rate = true in [daq] of {folder.toml})"
            raise DeviceError(error.text, cure) from None
        rate = measured.rate
    if measured != known_rate(folder, source):
        _remember(folder, source, measured)
    source.sample_rate = rate
    return rate


def _same(device: KnownDevice, source: Device) -> bool:
    """The nominal rate may have been replaced by the measured one already."""
    identity = (str(source.info["model"]), str(source.info["serial"]))
    rates = (device.nominal_rate_hz, device.measured_rate_hz)
    return (device.model, device.serial) == identity and source.sample_rate in rates


def _read(folder: MachineFolder) -> list[KnownDevice]:
    path = folder.path / "daq.json"
    try:
        return msgspec.json.decode(path.read_bytes(), type=list[KnownDevice])
    except FileNotFoundError:
        return []
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: {error}; delete this file, the DAQ's rate is then measured anew") from error


def _remember(folder: MachineFolder, source: Device, measured: MeasuredRate) -> None:
    others = [device for device in _read(folder) if not _same(device, source)]
    now = datetime.now(UTC).isoformat(timespec="seconds")
    new = KnownDevice(
        str(source.info["model"]),
        str(source.info["serial"]),
        source.sample_rate,
        measured.rate,
        measured.std,
        measured.n_scans,
        measured.seconds,
        now,
    )
    content = msgspec.json.format(msgspec.json.encode([*others, new]), indent=2)
    atomic_write(folder.path / "daq.json", content + b"\n")
