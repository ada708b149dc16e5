"""What was heard of a cut as an HDF5 file: written whole, sealed, never rewritten."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquisition.arrays import Codes, Flags, Floats
from acquisition.channel import Channel
from acquisition.errors import DataError
from acquisition.file_io import atomic_write, read_regular_file
from acquisition.files.hdf5_file import (
    HDF5_SIGNATURE,
    append_checksum,
    check_unpacked_size,
    has_valid_checksum,
    open_hdf5,
)

if TYPE_CHECKING:
    import h5py

CUT_FORMAT_NAME = "lobewatch-cut"
CUT_FORMAT_VERSION = 1
CUT_COMPRESSION = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "fletcher32": True, "chunks": True}


@dataclass(frozen=True, eq=False)
class CutSignal:
    """The accelerometer or the microphone during a cut."""

    acceleration: Floats
    """Acceleration (m/s^2; of a microphone Pa or shares of its full scale), shape (n,) or (responses, n)."""
    sample_rate: float
    """Samples a second (Hz)."""
    codes: Codes | None = None
    """Codes of the converter, shape (n,); None where a recording of another program holds values."""
    channel: Channel | None = None
    """Channel that turns codes into m/s^2; None where there are no codes."""
    lost_scans: int = 0
    """Number of scans that are missing in it."""
    overload: bool = False
    """Whether the device has told that its input was overloaded."""
    sensor: str = "accelerometer"
    """Kind of sensor: accelerometer or microphone."""
    speed_rpm: Floats | None = None
    """Spindle speed by a tachometer at each sample (rpm), NaN where it gave none, shape (n,); None without one."""

    @property
    def duration(self) -> float:
        """How long it is."""
        return float(self.acceleration.shape[-1] / self.sample_rate)

    @property
    def clipped(self) -> Flags:
        """Where it stands at a rail of its converter, or without codes three times in a row at its extreme value.

        Everywhere where the device has told of an overload; of several responses in any of them. Shape (n,).
        """
        if self.overload or not self.acceleration.size:
            return np.full(self.acceleration.shape[-1], self.overload)
        if self.codes is not None and self.channel is not None:
            low, high = self.channel.effective_rails(self.codes)
            return np.asarray((self.codes <= low) | (self.codes >= high))
        return np.asarray(np.any([_find_extremes(axis) for axis in np.atleast_2d(self.acceleration)], axis=0))

    def slice_time(self, begin: float, end: float) -> CutSignal:
        """From one time to another (s)."""
        inside = slice(max(round(begin * self.sample_rate), 0), max(round(end * self.sample_rate), 0))
        codes = None if self.codes is None else self.codes[inside]
        speed = None if self.speed_rpm is None else self.speed_rpm[inside]
        return replace(self, acceleration=self.acceleration[..., inside], codes=codes, speed_rpm=speed)


def _find_extremes(values: Floats) -> Flags:
    """Where one response stands three times in a row at its extreme value; nowhere where it has one value only."""
    top, bottom = np.max(values), np.min(values)
    if top == bottom:
        return np.zeros(values.size, dtype=np.bool_)
    return _find_runs_of_three(values == top) | _find_runs_of_three(values == bottom)


def _find_runs_of_three(extreme: Flags) -> Flags:
    """Where three or more stand beside each other."""
    padded = np.pad(extreme, 2)
    three = padded[2:] & padded[1:-1] & padded[:-2]
    return np.asarray(three[:-2] | three[1:-1] | three[2:])


def is_cut_file(path: Path) -> bool:
    """Whether it is a recording of ours, be it a damaged one."""
    content = read_regular_file(path)
    return content.startswith(HDF5_SIGNATURE) and CUT_FORMAT_NAME.encode() in content


def write_cut_signal(path: Path, signal: CutSignal, about: Mapping[str, Any]) -> bytes:
    """Write it with what is known of the cut (JSON); the bytes of the file, on the disk when this returns."""
    memory = io.BytesIO()
    with open_hdf5(memory, "w") as file:
        file.attrs.update(format=CUT_FORMAT_NAME, version=CUT_FORMAT_VERSION, sample_rate_hz=signal.sample_rate)
        file.attrs.update(lost_scans=signal.lost_scans, overload=signal.overload, sensor=signal.sensor)
        file["about"] = json.dumps(about)
        if signal.codes is not None and signal.channel is not None:
            word = np.int16 if signal.channel.adc_bits <= 16 else np.int32
            _write_dataset(file, "codes", signal.codes.astype(word), "ADC code")
            settings = {field.name: getattr(signal.channel, field.name) for field in fields(Channel)}
            file["codes"].attrs.update(settings)
        else:
            _write_dataset(file, "acceleration", signal.acceleration, "m/s^2")
        if signal.speed_rpm is not None:
            _write_dataset(file, "speed", signal.speed_rpm, "rpm")
    content = append_checksum(memory.getvalue())
    atomic_write(path, content)
    return content


def read_cut_signal(path: Path) -> tuple[CutSignal, dict[str, Any]]:
    """What `write_cut_signal` has written; DataError where it is no such file, or a damaged one."""
    content = read_regular_file(path)
    if not has_valid_checksum(content):  # HDF5 could hang on it
        raise DataError(f"{path}: altered since it was written (SHA-256 differs); take it again from a backup")
    try:
        with open_hdf5(io.BytesIO(content), "r") as file:
            if file.attrs.get("format") != CUT_FORMAT_NAME or int(file.attrs["version"]) > CUT_FORMAT_VERSION:
                raise DataError(f"{path}: no recording of a cut that this lobewatch reads")
            check_unpacked_size(file, len(content), path)
            return _read_signal(file), json.loads(file["about"][()])
    except (OSError, KeyError) as error:
        raise DataError(f"{path}: no readable recording of a cut ({error}); take it again from a backup") from error


def _read_signal(file: h5py.File) -> CutSignal:
    rate, lost = float(file.attrs["sample_rate_hz"]), int(file.attrs["lost_scans"])
    overload = bool(file.attrs["overload"])
    if "acceleration" in file:
        sensor = str(file.attrs.get("sensor", "accelerometer"))
        speed = file["speed"][()] if "speed" in file else None
        signal = CutSignal(file["acceleration"][()], rate, lost_scans=lost, overload=overload, sensor=sensor)
        return replace(signal, speed_rpm=speed)
    codes = file["codes"]
    settings = {name: codes.attrs[name] for name in (field.name for field in fields(Channel))}
    channel = Channel(
        **{name: value.item() if isinstance(value, np.generic) else value for name, value in settings.items()}
    )
    values = codes[()].astype(np.int32)
    return CutSignal(values * channel.scale, rate, values, channel, lost, overload)


def _write_dataset(file: h5py.File, name: str, values: NDArray[Any], unit: str) -> None:
    file.create_dataset(name, data=values, **CUT_COMPRESSION if values.size else {}).attrs["units"] = unit
