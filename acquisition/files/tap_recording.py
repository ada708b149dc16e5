"""Our own tap files, as recordings like any other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from acquisition.files.readers.format import Format
from acquisition.files.readers.hdf5_in import HDF5
from acquisition.files.tap_file import read_tap, read_tap_hits
from acquisition.frf import Frf
from acquisition.hit import Hit, HitFlags
from acquisition.regular_file import read_regular
from acquisition.tap import Circumstances

_BEYOND_THE_SIGNALS = HitFlags.UNDONE | HitFlags.INCONSISTENT | HitFlags.NARROW_BAND | HitFlags.NOT_JUDGED


def read_tap_recording(path: Path) -> list[Hit] | Frf:
    """The hits of a tap file but for those that their own time signals do not speak against and that were refused all
    the same: taken back, of another spot, of a force that does not reach far enough, not judged. The FRF where none is
    left."""
    hits, _, flags = read_tap_hits(path)
    kept = [hit for hit, flag in zip(hits, flags, strict=True) if not flag & _BEYOND_THE_SIGNALS]
    return kept or read_tap(path).known_frf


def is_all_in(path: Path, hits: Sequence[Hit]) -> bool:
    """Whether a file is a live tap test of ours, and hits read from it are all of its hits: no signal is lost without
    the file."""
    if not hits or not read_regular(path).startswith(HDF5):
        return False
    tap = read_tap(path)
    return tap.source is None and len(tap.hits) == len(hits)


def _is_ours(head: bytes, path: Path) -> bool:
    """Whether an HDF5 file is one of lobewatch, though perhaps not a tap file: told from its bytes, as damage is."""
    return head.startswith(HDF5) and b"lobewatch" in read_regular(path)


def _circumstances(path: Path) -> Circumstances:
    return read_tap_hits(path)[1]


def _frf(path: Path) -> Frf:
    return read_tap(path).known_frf


TAP_FILE = Format(
    "tap-file", "tap file of lobewatch", (".h5",), _is_ours, read_tap_recording, _circumstances, read_frf=_frf
)
