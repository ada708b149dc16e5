"""Find copies of a machine folder: folders whose journals begin with the same tap test."""

import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec

from acquisition import Remark
from acquisition.file_io import open_regular_file
from lobewatch.machine.journal.file_names import format_path
from lobewatch.monitoring.status_rules import FOLDER_COPIED

TAP_LINE_MARK = b'"kind": "tap"'
"""Part of the journal line of a tap test."""
MAX_LISTED_COPIES = 3
"""Largest number of folders that a remark names."""


def read_first_tap(folder: Path | str) -> tuple[str, str]:
    """Read identity and SHA-256 of the first tap test in the journal of a folder; empty texts without one."""
    try:
        with io.BufferedReader(open_regular_file(f"{folder}/journal.jsonl")) as file:
            line = next((line for line in file if TAP_LINE_MARK in line), b"{}")
        entry = msgspec.json.decode(line, type=dict[str, object])
    except (OSError, ValueError):
        return "", ""
    return str(entry.get("id", "")), str(entry.get("sha256", ""))


def find_copies(machines: Mapping[str, Path]) -> dict[str, Remark]:
    """Return a remark for each machine whose first tap test is also that of another one, by name.

    A single machine is compared with the other folders next to it. A link to the same folder is no copy.
    """
    folders = {key: str(path) for key, path in machines.items()}
    if len(machines) == 1:
        (path,) = machines.values()
        place = path.resolve()
        folders |= {name: f"{place.parent}/{name}" for name in _list_neighbors(place)}
    by_first: dict[tuple[str, str], list[str]] = {}
    for key, folder in folders.items():
        by_first.setdefault(read_first_tap(folder), []).append(key)
    by_first.pop(("", ""), None)
    found: dict[str, Remark] = {}
    for names in by_first.values():
        places = {name: os.path.realpath(folders[name]) for name in names}
        copies = {key: [name for name in names if places[name] != places[key]] for key in names if key in machines}
        found |= {key: _copy_remark(others) for key, others in copies.items() if others}
    return found


def _list_neighbors(place: Path) -> list[str]:
    """List the other folders in the parent folder of a machine. place: its absolute path, without links."""
    try:
        with os.scandir(place.parent) as entries:
            return sorted(format_path(entry.name) for entry in entries if entry.name != place.name)
    except OSError:
        return []


def _copy_remark(names: Sequence[str]) -> Remark:
    more = [f"{len(names) - MAX_LISTED_COPIES} more"] if len(names) > MAX_LISTED_COPIES else []
    return FOLDER_COPIED.remark("", folders=", ".join([*names[:MAX_LISTED_COPIES], *more]))
