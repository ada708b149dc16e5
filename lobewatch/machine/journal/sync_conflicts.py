"""Copies that a sync program has put next to files changed on two computers, found by their content.

Dropbox, OneDrive, Syncthing and others keep one side of a file and put the other side next to it, under a name in any
language. Names are only listed. A file is read if its name is not one of lobewatch.
"""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from acquisition import Remark
from acquisition.file_io import open_regular_file
from acquisition.files.hdf5_file import HDF5_SIGNATURE
from lobewatch.machine.journal.file_names import CONFLICTS_FOLDER_NAME, JOURNAL_NAME, format_path, list_foreign_files
from lobewatch.machine.journal.join_lines import compute_fact_mark, find_open_contradictions
from lobewatch.machine.journal.journal import (
    PREVIOUS_DIGEST_KEY,
    JournalFileState,
    JournalReading,
    find_foreign_journal,
    format_command,
    scan_journal_file,
)
from lobewatch.machine.settings.machine_file import read_machine_file
from lobewatch.machine.settings.toml import parse_toml_tables, read_toml_text

HEAD_BYTES = 65_536
"""Size of the first part of a file that tells its kind (bytes); chosen, some hundred lines of a journal."""
MAX_LISTED, MAX_NAMED_VALUES = 20, 3
"""Largest number of remarks of a kind, and of values named in a remark; chosen."""
MACHINE_TABLE = re.compile(rb"^\s*\[machine\]", re.MULTILINE)
"""Table that every machine.toml has."""


FileKind = Literal["journal", "settings", "HDF5"]
"""Kind of a file by its content."""


@dataclass(frozen=True)
class ConflictFile:
    """Copy of a file of lobewatch under another name."""

    name: str
    """Path in the machine folder."""
    kind: FileKind
    """Kind of its content."""
    finding: str
    """Content that the file of lobewatch lacks."""
    lines: tuple[bytes, ...] = ()
    """Sound lines of a journal."""


def find_conflict_files(folder: Path, reading: JournalReading) -> list[ConflictFile]:
    """Find the copies of journal, machine.toml, tap files and recordings under other names.

    Parameters
    ----------
    folder
        Machine folder.
    reading
        Reading of its journal.
    """
    names = list_foreign_files(folder)
    return [file for name in names if (file := _inspect(folder, name, reading)) is not None]


def list_sync_remarks(folder: Path, reading: JournalReading) -> list[Remark]:
    """List the remarks on conflict files, on contradictions and on lines that this version does not understand.

    Parameters
    ----------
    folder
        Machine folder.
    reading
        Reading of its journal.
    """
    conflicts = [conflict_remark(folder, file.name, file.finding) for file in find_conflict_files(folder, reading)]
    return [*conflicts, *_list_contradictions(folder, reading), *_list_faults(folder, reading)]


def conflict_remark(folder: Path, name: str, finding: str) -> Remark:
    """Return the remark on a conflict file.

    Parameters
    ----------
    folder
        Machine folder.
    name
        Path of the file in the folder.
    finding
        Content that the file of lobewatch lacks.
    """
    cure = f"Run {format_command('rebuild', folder)} to join the files of both computers"
    return Remark("sync-conflict", format_path(name), finding, cure)


def _inspect(folder: Path, name: str, reading: JournalReading) -> ConflictFile | None:
    kind = _find_kind(folder / name)
    try:
        if kind == "journal":
            return _inspect_journal(folder, name, reading)
        if kind == "settings":
            return _inspect_settings(folder, name)
    except (OSError, ValueError, LookupError, AttributeError):
        return None
    place, is_below, _ = name.rpartition("/")
    return ConflictFile(name, "HDF5", f"file of {place}/ under another name") if kind == "HDF5" and is_below else None


def is_hdf5_file(path: Path) -> bool:
    """Tell whether a file begins as HDF5 does.

    Parameters
    ----------
    path
        File, of any kind.
    """
    return _find_kind(path) == "HDF5"


def _find_kind(path: Path) -> FileKind | None:
    """Find the kind of a file by its first bytes; None for any other or unreadable file."""
    try:
        with open_regular_file(path) as file:
            head = file.read(HEAD_BYTES)
    except OSError:
        return None
    if PREVIOUS_DIGEST_KEY in head:
        return "journal"
    if head.startswith(HDF5_SIGNATURE):
        return "HDF5"
    return "settings" if MACHINE_TABLE.search(head) else None


def _inspect_journal(folder: Path, name: str, reading: JournalReading) -> ConflictFile | None:
    state = scan_journal_file(folder / name, JournalFileState(exists=False))
    lines = (*state.chain, *state.unchained_lines)
    own = {compute_fact_mark(entry) for entry in reading.entries}
    new = [entry for entry in map(json.loads, lines) if compute_fact_mark(entry) not in own]
    is_ours = len(new) < len(lines) or not find_foreign_journal(folder, lines)
    if not lines or not is_ours:
        return None
    kinds = ", ".join(sorted({str(entry["kind"]) for entry in new}))
    count = f"{len(new)} line{'' if len(new) == 1 else 's'}"
    finding = f"{count} missing in journal.jsonl ({kinds})" if new else "no line missing in journal.jsonl"
    return ConflictFile(name, "journal", f"journal of another computer, {finding}", lines)


def _inspect_settings(folder: Path, name: str) -> ConflictFile | None:
    machine, other = _read_settings(folder / "machine.toml")["machine"].get("name"), read_machine_file(folder / name)
    if machine != other.machine.name and "machine" not in Path(name).name.casefold():
        return None
    found = list_setting_differences(folder, name)
    named = [*found[:MAX_NAMED_VALUES], *([f"{len(found) - MAX_NAMED_VALUES} more"] * bool(found[MAX_NAMED_VALUES:]))]
    text = f"with {len(found)} other values: {', '.join(named)}" if found else "with the same values"
    return ConflictFile(name, "settings", f"settings of another computer, {text}")


def list_setting_differences(folder: Path, name: str) -> list[str]:
    """List the keys with other values in a copy of machine.toml, with both values.

    Parameters
    ----------
    folder
        Machine folder.
    name
        Path of the copy in the folder.

    Raises
    ------
    OSError, ValueError, LookupError
        If one of the files cannot be read.
    """
    own, other = (_read_settings(folder / file) for file in ("machine.toml", name))
    return [f"{key} {_show(here)} (there {_show(there)})" for key, here, there in _compare(own, other)]


def _read_settings(path: Path) -> dict[str, Any]:
    return parse_toml_tables(read_toml_text(path))


def _compare(own: Mapping[str, Any], other: Mapping[str, Any], place: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield keys with other values, and both values; None for a missing one."""
    for key in dict.fromkeys([*own, *other]):
        here, there = (_by_name(tables.get(key)) for tables in (own, other))
        if isinstance(here, Mapping) and isinstance(there, Mapping):
            yield from _compare(here, there, f"{place}{key}.")
        elif here != there:
            yield f"{place}{key}", here, there


def _by_name(value: Any) -> Any:
    """Return a list of tables as a table by their names, or by their numbers without names."""
    if isinstance(value, list) and value and all(isinstance(table, dict) for table in value):
        return {str(table.get("name", number)): table for number, table in enumerate(value, 1)}
    return value


def _show(value: object) -> str:
    return "missing" if value is None else json.dumps(value, ensure_ascii=False, default=str)


def _list_settings_aside(folder: Path) -> list[str]:
    """List the copies of machine.toml that were set aside, relative to the folder."""
    aside = folder / CONFLICTS_FOLDER_NAME
    paths = sorted(aside.iterdir()) if aside.is_dir() else []
    return [f"{CONFLICTS_FOLDER_NAME}/{path.name}" for path in paths if _find_kind(path) == "settings"]


def _list_contradictions(folder: Path, reading: JournalReading) -> Iterator[Remark]:
    """Yield remarks on entries and settings of two computers that contradict each other until a person answers."""
    for found in find_open_contradictions(reading.other_entries):
        text = (
            f"{_describe(found.kept)} on one computer, {_describe(found.other)} on another one. The newer entry counts"
        )
        cure = f"Run {format_command(COMMANDS_BY_KIND[found.kept['kind']], folder)} with the right entry to confirm it"
        yield Remark("sync-contradiction", found.about, text, cure)
    for name in _list_settings_aside(folder):
        try:
            differences = list_setting_differences(folder, name)
        except (OSError, ValueError, LookupError, AttributeError):
            continue
        cure = f"Correct machine.toml, or delete {format_path(name)} to keep machine.toml"
        yield from (Remark("sync-contradiction", format_path(name), text, cure) for text in differences)


COMMANDS_BY_KIND = {"exclude": "exclude", "include": "include", "modes": "modes", "hit": "modes", "ack": "ack"}
"""Commands that write the entries on a subject, by kind of line."""


def _describe(entry: Mapping[str, Any]) -> str:
    """Describe an entry with a subject, and its time."""
    words = {
        "exclude": f"excluded ({entry.get('reason')!r})",
        "include": "included",
        "modes": f"modes added {entry.get('add')}, dropped {entry.get('drop')}, fixed {entry.get('fix')}",
        "hit": f"hit {entry.get('hit')} {entry.get('decision')}",
        "ack": f"acknowledged by {entry.get('operator') or 'unknown'} ({entry.get('note')!r})",
    }
    return f"{words[entry['kind']]} {str(entry.get('time'))[:16]}"


def _list_faults(folder: Path, reading: JournalReading) -> Iterator[Remark]:
    """Yield remarks on lines that this version does not understand."""
    given_up = read_given_up_lines(reading)
    yield from (Remark("line-lost", JOURNAL_NAME, str(fault)) for fault in reading.faults if fault.number in given_up)
    faults = [fault for fault in reading.faults if fault.number not in given_up]
    for fault in faults[:MAX_LISTED]:
        if fault.is_newer:
            cure = "Update lobewatch on this computer, because the results are incomplete without this line"
            yield Remark("journal-newer", JOURNAL_NAME, str(fault), cure)
        else:
            cure = f"Enter its fact again, then run {format_command('rebuild', folder)} to give up the line"
            yield Remark("line-damaged", JOURNAL_NAME, str(fault), cure)
    if faults[MAX_LISTED:]:
        is_newer = any(fault.is_newer for fault in faults[MAX_LISTED:])
        text = f"{len(faults) - MAX_LISTED} more lines are not understood"
        yield Remark("journal-newer" if is_newer else "line-damaged", JOURNAL_NAME, text)


def read_given_up_lines(reading: JournalReading) -> set[int]:
    """Return the numbers of damaged lines that were given up.

    Parameters
    ----------
    reading
        Reading of the journal.
    """
    return {line["line"] for line in reading.other_entries if line["kind"] == "lost" and "line" in line}
