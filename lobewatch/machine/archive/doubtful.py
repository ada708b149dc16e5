"""Tap files that no journal vouches for: read where damage can do no harm.

A file with a seal that fits is read here. HDF5 may crash or hang on any other that is damaged, so that is read by a
program of its own, which is ended after a while.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from acquisition import read_tap
from acquisition.files.seal import is_broken, is_sealed
from lobewatch.machine.archive.tap_entry import TapEntry

PATIENCE = 60.0
"""Time that reading one file may take (s)."""


def read_doubtful(path: Path) -> TapEntry | None:
    """The tap test in a file; None where it is no whole one."""
    content = path.read_bytes()
    if is_broken(content):
        return None
    return _read(path) if is_sealed(content) else _read_apart(path)


def _read(path: Path) -> TapEntry | None:
    try:
        return TapEntry.of(read_tap(path), path.read_bytes())
    except (ValueError, KeyError, TypeError, RuntimeError, OSError):
        return None


def _read_apart(path: Path) -> TapEntry | None:
    command = [sys.executable, "-m", __name__, str(path)]
    try:
        said = subprocess.run(command, capture_output=True, timeout=PATIENCE, check=True)
        return TapEntry.from_line(json.loads(said.stdout))
    except (subprocess.SubprocessError, ValueError, TypeError):
        return None


def main() -> None:
    """Print the tap test in the file that is named, as JSON."""
    found = _read(Path(sys.argv[1]))
    sys.stdout.write("null" if found is None else json.dumps(found.line))


if __name__ == "__main__":
    main()
