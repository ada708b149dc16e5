"""Names of the files in a machine folder, without heavy imports.

A file under another name may be the copy that a sync program has put next to a file changed on two computers.
"""

import os
import re
from itertools import chain, count
from pathlib import Path

from acquisition.file_io import make_folder, rename

JOURNAL_NAME = "journal.jsonl"
JOURNAL_COPY_NAME = "journal.copy.jsonl"
DAMAGED_FOLDER_NAME, CONFLICTS_FOLDER_NAME = "damaged", "sync-conflicts"
"""Folders for damaged files, and for joined files of other computers."""
LOBEWATCH_FILES = {JOURNAL_NAME, JOURNAL_COPY_NAME, "machine.toml", "taps", "cuts", "spool"}
LOBEWATCH_FILES |= {"history.rows", "daq.json", "standing.json", "told.json", "unsent.json"}
"""Files and folders in a machine folder that are verified, or made again if they are deleted."""
_OWN_NAMES = LOBEWATCH_FILES | {"report.html", "history.h5", DAMAGED_FOLDER_NAME, CONFLICTS_FOLDER_NAME}
_OTHER_OWN_NAME = re.compile(
    r"\.lock(\.holder)?|\..*\.[0-9a-f]{8}\.tmp|journal(\.copy)?\.jsonl\.\d+\.(torn|damaged)", re.DOTALL
)
"""Lock, half-written files, and files that lobewatch has set aside."""
_OWN_NAMES_BELOW = {"taps": re.compile(r"\..*|.*\.(h5|tmp)", re.DOTALL), "cuts": re.compile(r"\..*|c\d+\.h5|.*\.tmp")}


def format_path(path: Path | str) -> str:
    """Return a path as valid UTF-8, with invalid bytes escaped."""
    return str(path).encode("utf-8", "backslashreplace").decode()


def list_foreign_names(folder: Path | str) -> list[str]:
    """Return the names in a machine folder that lobewatch does not use, sorted; empty if it cannot be listed."""
    return [name for name in _list_names(folder) if name not in _OWN_NAMES and not _OTHER_OWN_NAME.fullmatch(name)]


def list_foreign_files(folder: Path | str) -> list[str]:
    """Return the paths in a machine folder, taps/ and cuts/ that lobewatch does not use, relative to the folder."""
    below = (
        f"{part}/{name}"
        for part, own in _OWN_NAMES_BELOW.items()
        for name in _list_names(f"{folder}/{part}")
        if not own.fullmatch(name)
    )
    return [*list_foreign_names(folder), *below]


def _list_names(folder: Path | str) -> list[str]:
    try:
        return sorted(os.listdir(folder))  # noqa: PTH208 - of hundreds of machines at every look
    except OSError:
        return []


def move_aside(folder: Path, path: Path, aside_name: str) -> Path:
    """Move a file to a folder in the machine folder under an unused name, and return its new path."""
    make_folder(folder / aside_name)
    names = chain([path.name], (f"{path.name}.{number}" for number in count(1)))
    asides = (folder / aside_name / name for name in names)
    return rename(path, next(aside for aside in asides if not aside.exists()))
