"""Recorded files of other programs and our own, told apart by their content."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from acquisition.errors import DataError
from acquisition.files.format import Format
from acquisition.files.formats import broken_formats, format_of
from acquisition.frf import Frf
from acquisition.hit import Hit
from acquisition.tap import Circumstances
from acquisition.verdicts.average_good import average_good


def read_hits(path: Path | str) -> list[Hit]:
    """The hits in a recorded file of any known format; DataError where there are none."""
    recording = read_recording(path)
    if isinstance(recording, Frf):
        raise DataError(f"{path}: holds an FRF, not the hits it was made from")
    return recording


def read_frf(path: Path | str) -> Frf:
    """The FRF that a recorded file holds, or that estimated (H1) from its good hits."""
    path = Path(path)
    found = format_of(path)
    if found.read_frf is not None:
        return found.read_frf(path)
    recording = _read(found, path)
    if isinstance(recording, Frf):
        return recording
    try:
        return average_good(recording)[0]
    except DataError as error:
        raise DataError(f"{path}: {error}") from error


def read_recording(path: Path | str) -> list[Hit] | Frf:
    """Hits where the file holds time histories, an FRF where it holds only that; DataError where it holds neither."""
    return _read(format_of(Path(path)), Path(path))


def recorded_as(path: Path | str) -> Circumstances:
    """What a recording says of itself: all of it in our own files, else mostly only when it was made.

    The time is that in the file, or that of its modification where there is none.
    """
    path = Path(path)
    said = format_of(path).recorded_as(path)
    return said or Circumstances("", datetime.fromtimestamp(path.stat().st_mtime).astimezone())


def _read(found: Format, path: Path) -> list[Hit] | Frf:
    try:
        return found.read(path)
    except DataError as error:
        raise DataError(f"{error}{broken_formats()}") from error
    except OSError:
        raise
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise DataError(f"{path}: cannot be read as {found.title} ({reason}); export it in another format") from error
