"""Sample rate of the kept hits of a tap test that was refused because its rate in use was wrong."""

import json
import zlib
from dataclasses import asdict, replace
from pathlib import Path

from acquisition import DataError, DeviceError, Hit, MeasuredRate, atomic_write, check_rate
from acquisition.file_io import MAX_SETTINGS_FILE_SIZE, IrregularFileError, make_folder, read_regular_file
from lobewatch.machine.settings.setup_tables import DaqTable

RATE_FILE_NAME = "rate.json"
"""File in the spool of such a test."""


def write_rate(folder: Path, measured: MeasuredRate | None) -> None:
    """Store the rate of all hits of a test, None if it is unknown. It is on the disk when this returns."""
    fields = {} if measured is None or (folder / RATE_FILE_NAME).exists() else asdict(measured)
    make_folder(folder)
    atomic_write(folder / RATE_FILE_NAME, json.dumps(fields | {"crc": _compute_crc(fields)}).encode())


def find_kept_rate(daq: DaqTable, test: Path) -> float | None:
    """Return the rate (Hz) of the hits of an interrupted test whose rate in use was wrong, None if it was right.

    It is that of machine.toml if this agrees with the measured one, else the measured one, if [daq] accepts it.
    DataError if neither is possible.
    """
    try:
        fields = json.loads(read_regular_file(test / RATE_FILE_NAME, MAX_SETTINGS_FILE_SIZE))
        if fields.pop("crc") != _compute_crc(fields):
            raise ValueError("altered")
        measured = MeasuredRate(**fields)
    except FileNotFoundError:
        return None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, IrregularFileError) as error:
        raise DataError("its sample rate is unknown") from error
    if daq.sample_rate_hz is not None and agrees_with(measured, daq.sample_rate_hz):
        return daq.sample_rate_hz
    if not (daq.accept_measured_rate and measured.is_accurate):
        raise DataError(f"its sample rate was {measured.rate:.2f} Hz")
    return measured.rate


def correct_rate(hit: Hit, rate: float | None) -> Hit:
    """Return a hit with another sample rate (Hz), None for its own."""
    if rate is None:
        return hit
    return replace(hit, sample_rate=rate, cross_hit=hit.cross_hit and replace(hit.cross_hit, sample_rate=rate))


def agrees_with(measured: MeasuredRate, rate: float) -> bool:
    """Tell whether a measured rate confirms a rate (Hz) to 0.2 %."""
    try:
        check_rate(measured, rate)
    except DeviceError:
        return False
    return True


def _compute_crc(fields: object) -> int:
    return zlib.crc32(json.dumps(fields, sort_keys=True).encode())
