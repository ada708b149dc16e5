"""Recorded files of other programs and our own, told apart by their content."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from acquisition.errors import DataError
from acquisition.files.read_csv import frf_of, hit_of, is_frf, read_table
from acquisition.files.read_lvm import MAGIC, lvm_time, read_lvm
from acquisition.files.tap_file import read_tap, read_tap_hits
from acquisition.frf import Frf
from acquisition.hit import Hit, HitFlags
from acquisition.tap import Circumstances
from acquisition.verdicts.average_good import average_good

_HDF5 = b"\x89HDF\r\n\x1a\n"


def read_hits(path: Path | str) -> list[Hit]:
    """The hits in a tap file (HDF5), an LVM file or a text table; DataError where there are none."""
    recording = read_recording(path)
    if isinstance(recording, Frf):
        raise DataError(f"{path}: holds an FRF, not the hits it was made from")
    return recording


def read_frf(path: Path | str) -> Frf:
    """The FRF in a tap file or a text table, or estimated (H1) from the good hits of a time-history file."""
    if _magic(Path(path)) == _HDF5:
        return read_tap(path).frf
    recording = read_recording(path)
    if isinstance(recording, Frf):
        return recording
    try:
        return average_good(recording)[0]
    except DataError as error:
        raise DataError(f"{path}: {error}") from error


def _magic(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(len(_HDF5))


_BEYOND_THE_SIGNALS = HitFlags.UNDONE | HitFlags.INCONSISTENT | HitFlags.NARROW_BAND


def read_recording(path: Path | str) -> list[Hit] | Frf:
    """Hits where the file holds time histories, an FRF where it holds only that; left out are those that their
    own time signals do not speak against: taken back, of another spot, of a force that does not reach far enough."""
    path = Path(path)
    magic = _magic(path)
    if not magic:
        raise DataError(f"{path}: the file is empty")
    if magic == _HDF5:
        hits, _, flags = read_tap_hits(path)
        kept = [hit for hit, flag in zip(hits, flags, strict=True) if not flag & _BEYOND_THE_SIGNALS]
        return kept or read_tap(path).frf
    if MAGIC.encode().startswith(magic):
        return read_lvm(path)
    if b"\x00" in path.read_bytes()[:4096]:
        raise DataError(f"{path}: neither HDF5 nor LVM nor a text table; export it as one of these")
    table = read_table(path)
    return frf_of(path, table) if is_frf(table) else [hit_of(path, table)]


def recorded_as(path: Path | str) -> Circumstances:
    """What a recording says of itself: all of it in our own files, else only when it was made.

    The time is that in the file, or that of its modification where there is none.
    """
    path = Path(path)
    magic = _magic(path)
    if magic == _HDF5:
        return read_tap_hits(path)[1]
    written = lvm_time(path) if magic and MAGIC.encode().startswith(magic) else None
    return Circumstances("", written or datetime.fromtimestamp(path.stat().st_mtime).astimezone())
