"""A machine folder by its path alone: nothing is read, and nothing heavy imported."""

from __future__ import annotations

import os
from pathlib import Path

WATCHED = ("machine.toml", "journal.jsonl", "journal.copy.jsonl", "taps")
"""Names in the folder of a machine whose change is a change of what is known of it."""


def named_folder(name: Path | str) -> Path:
    """Path of the folder that a person names; FileNotFoundError for an empty name.

    Python takes that for the current folder: mostly a slip.
    """
    if not str(name):
        raise FileNotFoundError("the name of the folder is empty; give the machine folder, or . for the current one")
    return Path(name)


def path_text(path: Path | str) -> str:
    """Path as a text that every file and page can hold: what of it is no UTF-8 stands there as escaped."""
    return str(path).encode("utf-8", "backslashreplace").decode()


def mark_of(folder: Path, file: str = "") -> tuple[int, ...]:
    """Changes with machine.toml, the journal, the names in taps/, and a file in the folder where one is named."""
    stats = []
    for name in (*WATCHED, file) if file else WATCHED:
        try:
            stats.append(os.stat(f"{folder}/{name}"))  # noqa: PTH116 - of hundreds of machines at every look
        except OSError:
            continue
    return tuple(number for stat in stats for number in (stat.st_mtime_ns, stat.st_size, stat.st_ino))
