"""Measured sample rates of the DAQs of a machine (daq.json)."""

import time
import zlib
from collections.abc import Callable
from datetime import UTC, datetime

import msgspec

import acquisition
from acquisition import DataError, Device, DeviceError, MeasuredRate, Remark
from acquisition.file_io import MAX_SETTINGS_FILE_SIZE, read_regular_file
from lobewatch.machine.folder import MachineFolder

MAX_RATE_MEASUREMENTS = 3
"""Largest number of measurements of a rate until one is certain."""


class StoredDevice(msgspec.Struct, frozen=True):
    """Measured rate of a device in daq.json."""

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
    def computed_crc(self) -> int:
        """CRC-32 of all other fields."""
        return zlib.crc32(msgspec.json.encode(msgspec.structs.replace(self, crc=0)))


def check_device_rate(
    folder: MachineFolder,
    device: Device,
    seconds: float = 5.0,
    clock: Callable[[], float] = time.monotonic,
    remarks: list[Remark] | None = None,
) -> float:
    """Return the sample rate of a device, measured once per device and machine.

    Call it after every connect, before device.start(), with the folder locked. A rate within 0.2 % of the nominal one
    is accepted as nominal. A larger difference is an error, or with accept_measured_rate = true in [daq] the device
    gets the measured rate: make the Trigger from the returned rate. Only a certain rate is stored in daq.json; an
    uncertain one, the best of three, adds a remark. Devices without a clock are not checked.

    Parameters
    ----------
    folder
        Machine folder, locked.
    device
        Connected device that is not started.
    seconds
        Duration of the measurement (s).
    clock
        Clock of the computer (s).
    remarks
        List that gets the remark on an uncertain rate.

    Returns
    -------
    float
        Sample rate (Hz).

    Raises
    ------
    DeviceError
        If the measured rate differs from the nominal one and is not accepted.
    """
    if not has_clock(device):
        return device.sample_rate
    measured = find_stored_rate(folder, device) or _measure_rate(device, seconds, clock)
    doubt = acquisition.rate_remark(measured)
    if doubt is not None and remarks is not None:
        remarks.append(doubt)
    return apply_measured_rate(folder, device, measured)


def _measure_rate(device: Device, seconds: float, clock: Callable[[], float]) -> MeasuredRate:
    """Measure until a rate is certain, and return the most certain one."""
    tries = list[MeasuredRate]()
    while not (tries and tries[-1].is_accurate) and len(tries) < MAX_RATE_MEASUREMENTS:
        tries.append(acquisition.measure_rate(device, seconds, clock))
    return min(tries, key=lambda measured: measured.std / measured.rate)


def has_clock(device: Device) -> bool:
    """Tell whether a device has a sample clock and identifies itself, so that its rate can be stored.

    Parameters
    ----------
    device
        Connected device.

    Returns
    -------
    bool
        Whether its rate can be checked.
    """
    return device.follows_clock and bool(device.identity.model and device.identity.serial)


def find_stored_rate(folder: MachineFolder, device: Device) -> MeasuredRate | None:
    """Return the measured rate of a device at its nominal rate.

    Parameters
    ----------
    folder
        Machine folder.
    device
        Connected device.

    Returns
    -------
    MeasuredRate or None
        Rate in daq.json; None without one.
    """
    same = (entry for entry in read_stored_devices(folder) if _is_same_device(entry, device))
    rates = (MeasuredRate(old.measured_rate_hz, old.measured_rate_hz_std, old.n_scans, old.seconds) for old in same)
    return next(rates, None)


def apply_measured_rate(folder: MachineFolder, device: Device, measured: MeasuredRate) -> float:
    """Check a measured rate, set it if [daq] accepts it, and store it if it is certain.

    Parameters
    ----------
    folder
        Machine folder, locked.
    device
        Connected device, which gets the rate.
    measured
        Measured rate.

    Returns
    -------
    float
        Sample rate to use (Hz).

    Raises
    ------
    DeviceError
        If the measured rate differs from the nominal one and is not accepted.
    """
    try:
        acquisition.check_rate(measured, device.sample_rate)
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
    """Tell whether an entry is of a device with its nominal or its measured rate."""
    rates = (entry.nominal_rate_hz, entry.measured_rate_hz)
    identity = device.identity
    return (entry.model, entry.serial) == (identity.model, identity.serial) and device.sample_rate in rates


def read_stored_devices(folder: MachineFolder) -> list[StoredDevice]:
    """Read the devices in daq.json; DataError if the file is damaged."""
    path = folder.path / "daq.json"
    try:
        entries = msgspec.json.decode(read_regular_file(path, MAX_SETTINGS_FILE_SIZE), type=list[StoredDevice])
        if any(entry.crc not in (0, entry.computed_crc) for entry in entries):
            raise ValueError("changed since lobewatch wrote this file")
        return entries
    except FileNotFoundError:
        return []
    except ValueError as error:
        raise DataError(f"{path}: {error}. Delete this file, then lobewatch measures the sample rate again.") from error


def replace_stored_rate(folder: MachineFolder, device: Device, measured: MeasuredRate) -> None:
    """Replace the stored rate of a device by one measured during a test. An uncertain one only removes the old one.

    Parameters
    ----------
    folder
        Machine folder, locked.
    device
        Connected device.
    measured
        Measured rate.
    """
    if has_clock(device):
        _store_rate(folder, device, measured)


def _store_rate(folder: MachineFolder, device: Device, measured: MeasuredRate) -> None:
    kept = [entry for entry in read_stored_devices(folder) if not _is_same_device(entry, device)]
    now = datetime.now(UTC).isoformat(timespec="seconds")
    identity, numbers = device.identity, (measured.rate, measured.std, measured.n_scans, measured.seconds)
    new = StoredDevice(identity.model, identity.serial, device.sample_rate, *numbers, now)
    new = msgspec.structs.replace(new, crc=new.computed_crc)
    entries = [*kept, new] if measured.is_accurate else kept
    content = msgspec.json.format(msgspec.json.encode(entries), indent=2)
    acquisition.atomic_write(folder.path / "daq.json", content + b"\n")
