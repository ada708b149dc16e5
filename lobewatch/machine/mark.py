"""Whether anything in the folder of a machine is other than it was: a look at four names, nothing is read."""

from __future__ import annotations

import os
from pathlib import Path

WATCHED = ("machine.toml", "journal.jsonl", "journal.copy.jsonl", "taps")


def mark_of(folder: Path, file: str = "") -> tuple[int, ...]:
    """Changes with machine.toml, the journal, the names in taps/, and a file in the folder where one is named."""
    found = []
    for name in (*WATCHED, file) if file else WATCHED:
        try:
            found.append(os.stat(f"{folder}/{name}"))  # noqa: PTH116 - of hundreds of machines at every look
        except OSError:
            continue
    return tuple(number for one in found for number in (one.st_mtime_ns, one.st_size, one.st_ino))
