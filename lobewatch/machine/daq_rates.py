"""Measured sample rates of the DAQs of a machine (daq.json)."""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable
from datetime import UTC, datetime

import msgspec

from acquisition import (
    DataError,
    Device,
    DeviceError,
    MeasuredRate,
    Remark,
    atomic_write,
    check_rate,
    measure_rate,
    rate_remark,
)
from acquisition.file_io import MAX_SETTINGS_FILE_SIZE, read_regular_file
from lobewatch.machine.folder import MachineFolder

MAX_RATE_MEASUREMENTS = 3
"""Measurements of a rate at most, where the computer is too busy for a sure one."""


class StoredDevice(msgspec.Struct, frozen=True):
    """One device at one rate, as it stands in daq.json."""

    model: str
    serial: str
    nominal_rate_hz: float
    measured_rate_hz: float
    measured_rate_hz_std: float
    n_scans: int
    seconds: float
    measured: str
    """Time of the measurement (ISO 8601, UTC)."""
    crc: int = 0
    """CRC-32 of all other fields; 0 in the first files."""

    @property
    def is_altered(self) -> bool:
        """Whether it is not as it was written."""
        return self.crc not in (0, self.computed_crc)

    @property
    def computed_crc(self) -> int:
        """CRC-32 of all but the CRC."""
        return zlib.crc32(msgspec.json.encode(msgspec.structs.replace(self, crc=0)))


def check_device_rate(
    folder: MachineFolder,
    device: Device,
    seconds: float = 5.0,
    clock: Callable[[], float] = time.monotonic,
    remarks: list[Remark] | None = None,
) -> float:
    """Rate of a connected device that is not started (Hz), measured where this machine does not know it yet.

    Call it once after every connect, before device.start(), with the folder locked. The first time, for a model,
    serial number and nominal rate that are not in daq.json, it starts the device, listens for `seconds` and stops it
    again; later it returns at once (`find_stored_rate` tells beforehand which). Within 0.2 % of device.sample_rate nothing
    changes and that rate is returned. Further off: DeviceError, one sentence with the measured rate; or, with
    accept_measured_rate = true in [daq], device.sample_rate is set to the measured rate and that is returned, so that
    every Hit of capture_hits(device, ...) has it: make the Trigger from the returned rate. A refused rate is not kept
    and is measured again the next time. One that is not sure, in the best of three tries, is not kept either; a remark
    on it is added to `remarks`. The rate of a device whose scans do not follow the clock is not checked.
    """
    if not has_clock(device):
        return device.sample_rate
    measured = find_stored_rate(folder, device) or _measure_rate(device, seconds, clock)
    doubt = rate_remark(measured)
    if doubt is not None and remarks is not None:
        remarks.append(doubt)
    return apply_measured_rate(folder, device, measured)


def _measure_rate(device: Device, seconds: float, clock: Callable[[], float]) -> MeasuredRate:
    """The first of several tries that is sure, else the surest."""
    tries = [measure_rate(device, seconds, clock)]
    while not tries[-1].is_accurate and len(tries) < MAX_RATE_MEASUREMENTS:
        tries.append(measure_rate(device, seconds, clock))
    return min(tries, key=lambda measured: measured.std / measured.rate)


def has_clock(device: Device) -> bool:
    """Whether the scans of a device follow the clock, and it says who it is: its rate is kept by that."""
    return device.follows_clock and bool(device.identity.model and device.identity.serial)


def find_stored_rate(folder: MachineFolder, device: Device) -> MeasuredRate | None:
    """Rate measured of this device at this nominal rate; None where it is not known."""
    for entry in read_stored_devices(folder):
        if _is_same_device(entry, device):
            return MeasuredRate(entry.measured_rate_hz, entry.measured_rate_hz_std, entry.n_scans, entry.seconds)
    return None


def apply_measured_rate(folder: MachineFolder, device: Device, measured: MeasuredRate) -> float:
    """Rate to use (Hz): a measured one is checked, accepted where [daq] says so, kept in daq.json where it is sure."""
    try:
        check_rate(measured, device.sample_rate)
        rate = device.sample_rate
    except DeviceError as error:
        if not measured.is_accurate:
            raise
        if not folder.machine.daq.accept_measured_rate:
            cure = f"{error.cure} (accept_measured_rate = true in [daq] of {folder.toml})"
            raise DeviceError(error.text, cure) from None
        rate = measured.rate
    if measured.is_accurate and measured != find_stored_rate(folder, device):
        _store_rate(folder, device, measured)
    device.sample_rate = rate
    return rate


def _is_same_device(entry: StoredDevice, device: Device) -> bool:
    """Whether an entry is of this device, whose nominal rate may have been replaced by the measured one already."""
    rates = (entry.nominal_rate_hz, entry.measured_rate_hz)
    identity = device.identity
    return (entry.model, entry.serial) == (identity.model, identity.serial) and device.sample_rate in rates


def read_stored_devices(folder: MachineFolder) -> list[StoredDevice]:
    """Devices in daq.json; DataError where that is damaged."""
    path = folder.path / "daq.json"
    try:
        entries = msgspec.json.decode(read_regular_file(path, MAX_SETTINGS_FILE_SIZE), type=list[StoredDevice])
    except FileNotFoundError:
        return []
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: {error}; delete this file, the DAQ's rate is then measured anew") from error
    if any(entry.is_altered for entry in entries):
        raise DataError(f"{path}: altered since it was written; delete this file, the DAQ's rate is then measured anew")
    return entries


def _store_rate(folder: MachineFolder, device: Device, measured: MeasuredRate) -> None:
    kept = [entry for entry in read_stored_devices(folder) if not _is_same_device(entry, device)]
    now = datetime.now(UTC).isoformat(timespec="seconds")
    new = StoredDevice(
        device.identity.model,
        device.identity.serial,
        device.sample_rate,
        measured.rate,
        measured.std,
        measured.n_scans,
        measured.seconds,
        now,
    )
    content = msgspec.json.format(
        msgspec.json.encode([*kept, msgspec.structs.replace(new, crc=new.computed_crc)]), indent=2
    )
    atomic_write(folder.path / "daq.json", content + b"\n")
