"""Tap files that no journal vouches for: read where damage can do no harm.

A file with a seal that fits is read here. HDF5 may crash or hang on any other that is damaged, so that is read by a
program of its own, which is ended after a while.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from acquisition import read_tap, read_tap_hits
from acquisition.apart import run_apart
from acquisition.files.readers.hdf5_in import HDF5
from acquisition.files.seal import is_broken, is_sealed
from acquisition.regular_file import IrregularFileError, read_regular
from lobewatch.machine.journal.tap_entry import TapEntry


def read_doubtful(path: Path) -> TapEntry | None:
    """Entry of the tap test in a file; None where it is no whole one."""
    try:
        content = read_regular(path)
    except IrregularFileError:
        return None
    if is_broken(content) or not content.startswith(HDF5):
        return None
    return _read(path) if is_sealed(content) else _read_apart(path)


def _read(path: Path) -> TapEntry | None:
    try:
        return TapEntry.of(read_tap(path), read_regular(path))
    except (ValueError, KeyError, TypeError, RuntimeError, OSError):
        return None


def has_whole_hits(path: Path) -> bool:
    """Whether the hits of a file without a seal can be read."""
    return not is_broken(read_regular(path)) and _run_apart("hits", path) is not None


def _read_apart(path: Path) -> TapEntry | None:
    line = _run_apart("tap", path)
    return None if line is None else TapEntry.from_line(line)


def _run_apart(part: str, path: Path) -> dict[str, Any] | None:
    """Output of this file as a program of its own; None where it failed or took too long."""
    try:
        output: dict[str, Any] | None = json.loads(run_apart(__name__, part, str(path)))
        return output
    except (subprocess.SubprocessError, ValueError):
        return None


def main() -> None:
    """Print as JSON the part of a file that is named: of a "tap" its line, of "hits" that they can be read."""
    _, part, name = sys.argv
    if part == "hits":
        read_tap_hits(name)
        sys.stdout.write("{}")
        return
    entry = _read(Path(name))
    sys.stdout.write("null" if entry is None else json.dumps(entry.line))


if __name__ == "__main__":
    main()
