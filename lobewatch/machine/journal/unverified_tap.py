"""Read tap files that the journal does not list, in a subprocess where HDF5 may crash.

A file with a valid checksum is read here. HDF5 may crash or hang on any other damaged file, so a subprocess with a
time limit reads it.
"""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from acquisition import read_tap, read_tap_hits
from acquisition.file_io import IrregularFileError, read_regular_file
from acquisition.files.hdf5_file import HDF5_SIGNATURE, has_valid_checksum, has_wrong_checksum
from acquisition.subprocess_guard import run_in_subprocess
from lobewatch.machine.journal.tap_entry import TapEntry


def read_unverified_tap(path: Path) -> TapEntry | None:
    """Return the entry of the tap test in a file; None if the file is damaged."""
    try:
        content = read_regular_file(path)
    except IrregularFileError:
        return None
    if has_wrong_checksum(content) or not content.startswith(HDF5_SIGNATURE):
        return None
    if has_valid_checksum(content):
        return _read_tap_entry(path)
    line = _run_in_subprocess("tap", path)
    return None if line is None else TapEntry.from_line(line)


def _read_tap_entry(path: Path) -> TapEntry | None:
    try:
        return TapEntry.of(replace(read_tap(path), decisions=()), read_regular_file(path))
    except (ValueError, KeyError, TypeError, RuntimeError, OSError):
        return None


def has_readable_hits(path: Path) -> bool:
    """Tell whether the hits of a file without a checksum can be read."""
    return not has_wrong_checksum(read_regular_file(path)) and _run_in_subprocess("hits", path) is not None


def _run_in_subprocess(part: str, path: Path) -> dict[str, Any] | None:
    """Return the output of this module as a program; None if it fails or takes too long."""
    try:
        output: dict[str, Any] | None = json.loads(run_in_subprocess(__name__, part, str(path)))
        return output
    except (subprocess.SubprocessError, ValueError):
        return None


def main() -> None:
    """Print a part of a file as JSON: the line of a "tap", or {} for readable "hits"."""
    _, part, name = sys.argv
    if part == "hits":
        read_tap_hits(name)
        sys.stdout.write("{}")
        return
    entry = _read_tap_entry(Path(name))
    sys.stdout.write("null" if entry is None else json.dumps(entry.line))


if __name__ == "__main__":
    main()
