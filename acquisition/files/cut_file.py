"""Recorded cuts as HDF5 files, written whole with a checksum, never rewritten."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquisition.arrays import Codes, Flags, Floats
from acquisition.channel import Channel
from acquisition.errors import DataError
from acquisition.file_io import atomic_write, read_regular_file
from acquisition.files import hdf5_file, raw_hits

if TYPE_CHECKING:
    import h5py

CUT_FORMAT_NAME = "lobewatch-cut"
CUT_FORMAT_VERSION = 1


@dataclass(frozen=True, eq=False)
class CutSignal:
    """Signal of an accelerometer or a microphone during a cut."""

    acceleration: Floats
    """Acceleration (m/s^2; of a microphone Pa or shares of its full scale), shape (n,) or (responses, n)."""
    sample_rate: float
    """Sample rate (Hz)."""
    codes: Codes | None = None
    """ADC codes, shape (n,) or (responses, n); None if a recording of another program holds values."""
    channel: Channel | None = None
    """Channel that turns codes of the first response into m/s^2; None without codes."""
    lost_scans: int = 0
    """Number of missing scans."""
    overload: bool = False
    """True if the device reported an overload."""
    sensor: str = "accelerometer"
    """Kind of sensor: accelerometer or microphone."""
    speed_rpm: Floats | None = None
    """Spindle speed by a tachometer at each sample (rpm), NaN if unknown, shape (n,); None without one."""
    more_channels: tuple[Channel, ...] = ()
    """Channels of the codes of further responses."""
    overload_spans: tuple[tuple[int, int], ...] = ()
    """First sample of each reported overload, and the one after its last; empty if unknown."""

    @property
    def duration(self) -> float:
        """Duration (s)."""
        return float(self.acceleration.shape[-1] / self.sample_rate)

    @property
    def clipped(self) -> Flags:
        """True for each clipped sample, shape (n,).

        A sample is clipped at a rail of its converter, or in three equal extreme values in a row where there are no
        codes. So are those of a reported overload, all of them if its place is unknown. With several responses, any
        of them counts.
        """
        is_everywhere = self.overload and not self.overload_spans
        if is_everywhere or not self.acceleration.size:
            return np.full(self.acceleration.shape[-1], is_everywhere)
        found = self._find_clipped()
        for first, last in self.overload_spans:
            found[first:last] = True
        return found

    def _find_clipped(self) -> Flags:
        """Return where any response is at its limits, shape (n,)."""
        if self.codes is not None and self.channel is not None:
            rows = zip(np.atleast_2d(self.codes), (self.channel, *self.more_channels), strict=True)
            limits = [(codes, *channel.effective_rails(codes)) for codes, channel in rows]
            return np.asarray(np.any([(codes <= low) | (codes >= high) for codes, low, high in limits], axis=0))
        return np.asarray(np.any([_find_extremes(axis) for axis in np.atleast_2d(self.acceleration)], axis=0))

    def slice_time(self, begin: float, end: float) -> CutSignal:
        """Return the part from one time to another (s)."""
        inside = slice(max(round(begin * self.sample_rate), 0), max(round(end * self.sample_rate), 0))
        codes = None if self.codes is None else self.codes[..., inside]
        speed = None if self.speed_rpm is None else self.speed_rpm[inside]
        part = replace(self, acceleration=self.acceleration[..., inside], codes=codes, speed_rpm=speed)
        if not self.overload_spans:
            return part
        shifted = [(max(a - inside.start, 0), min(b, inside.stop) - inside.start) for a, b in self.overload_spans]
        spans = tuple((first, last) for first, last in shifted if first < last)
        return replace(part, overload_spans=spans, overload=bool(spans))


def _find_extremes(values: Floats) -> Flags:
    """Return where a response is three times in a row at its extreme value; nowhere where it is constant."""
    top, bottom = np.max(values), np.min(values)
    if top == bottom:
        return np.zeros(values.size, dtype=np.bool_)
    return _find_runs_of_three(values == top) | _find_runs_of_three(values == bottom)


def _find_runs_of_three(extreme: Flags) -> Flags:
    """Return where three or more in a row are true."""
    padded = np.pad(extreme, 2)
    three = padded[2:] & padded[1:-1] & padded[:-2]
    return np.asarray(three[:-2] | three[1:-1] | three[2:])


def is_cut_file(path: Path) -> bool:
    """Return whether a file is a recorded cut of lobewatch, even a damaged one."""
    content = read_regular_file(path)
    return content.startswith(hdf5_file.HDF5_SIGNATURE) and CUT_FORMAT_NAME.encode() in content


def write_cut_signal(path: Path, signal: CutSignal, about: Mapping[str, Any]) -> bytes:
    """Write a recorded cut with its description (JSON); return the bytes, which are then on the disk."""
    memory = io.BytesIO()
    with hdf5_file.open_hdf5(memory, "w") as file:
        file.attrs.update(format=CUT_FORMAT_NAME, version=CUT_FORMAT_VERSION, sample_rate_hz=signal.sample_rate)
        file.attrs.update(lost_scans=signal.lost_scans, overload=signal.overload, sensor=signal.sensor)
        file["about"] = json.dumps(about)
        if signal.codes is not None and signal.channel is not None:
            channels = signal.channel, *signal.more_channels
            for name, row, channel in zip(
                _code_names(len(channels)), np.atleast_2d(signal.codes), channels, strict=True
            ):
                _write_compressed(file, name, row.astype(raw_hits.choose_code_type([channel])), "ADC code")
                raw_hits.write_channel(file[name].attrs, channel)
        else:
            _write_compressed(file, "acceleration", signal.acceleration, "m/s^2")
        if signal.overload_spans:
            _write_compressed(file, "overload_spans", np.array(signal.overload_spans, dtype=np.int64), "sample")
        if signal.speed_rpm is not None:
            _write_compressed(file, "speed", signal.speed_rpm, "rpm")
    content = hdf5_file.append_checksum(memory.getvalue())
    atomic_write(path, content)
    return content


def read_cut_signal(path: Path) -> tuple[CutSignal, dict[str, Any]]:
    """Read a file of `write_cut_signal`; raise DataError for another or a damaged file."""
    content = read_regular_file(path)
    if not hdf5_file.has_valid_checksum(content):  # HDF5 could hang on it
        raise DataError(f"{path}: content changed after writing (SHA-256 differs). Restore the file from a backup.")
    try:
        with hdf5_file.open_hdf5(io.BytesIO(content), "r") as file:
            if file.attrs.get("format") != CUT_FORMAT_NAME or int(file.attrs["version"]) > CUT_FORMAT_VERSION:
                raise DataError(f"{path}: not a recorded cut of this version of lobewatch. Update lobewatch.")
            hdf5_file.check_unpacked_size(file, len(content), path)
            return _read_signal(file), json.loads(file["about"][()])
    except (OSError, KeyError) as error:
        raise DataError(f"{path}: unreadable recorded cut ({error}). Restore the file from a backup.") from error


def _read_signal(file: h5py.File) -> CutSignal:
    rate, lost = float(file.attrs["sample_rate_hz"]), int(file.attrs["lost_scans"])
    overload = bool(file.attrs["overload"])
    if "acceleration" in file:
        sensor = str(file.attrs.get("sensor", "accelerometer"))
        speed = file["speed"][()] if "speed" in file else None
        return CutSignal(file["acceleration"][()], rate, None, None, lost, overload, sensor, speed)
    names = [name for name in _code_names(len(file)) if name in file]
    channel, *more = (raw_hits.read_channel(file[name].attrs) for name in names)
    rows = np.stack([file[name][()].astype(np.int32) for name in names])
    values = rows * np.array([[one.scale] for one in (channel, *more)])
    codes, values = (rows, values) if more else (rows[0], values[0])
    spans = tuple((int(a), int(b)) for a, b in file["overload_spans"][()]) if "overload_spans" in file else ()
    return CutSignal(values, rate, codes, channel, lost, overload, more_channels=tuple(more), overload_spans=spans)


def _code_names(count: int) -> list[str]:
    """Return the names of the codes of so many responses; older versions read the first only."""
    return ["codes", *(f"codes_{number}" for number in range(2, count + 1))]


def _write_compressed(file: h5py.File, name: str, values: NDArray[Any], unit: str) -> None:
    options = raw_hits.HDF5_COMPRESSION | {"chunks": True} if values.size else {}
    raw_hits.write_dataset(file, name, values, unit, **options)
