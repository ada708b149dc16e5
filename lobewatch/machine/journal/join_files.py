"""Join the journals that other computers wrote in a synced machine folder, and set the conflict files aside."""

import hashlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from acquisition import read_tap, write_tap
from acquisition.errors import join_sentences
from acquisition.file_io import read_regular_file
from lobewatch.machine.journal.file_names import CONFLICTS_FOLDER_NAME, format_path, move_aside
from lobewatch.machine.journal.join_lines import compute_fact_mark, join_lines
from lobewatch.machine.journal.journal import Journal, JournalEntry, JournalReading
from lobewatch.machine.journal.sync_conflicts import ConflictFile, find_conflict_files


def join_conflict_files(folder: Path, journal: Journal) -> Iterator[str]:
    """Join the journals of other computers, set conflict files aside, and report it in sentences.

    Call it under the lock with a journal that is not damaged. Tap files and recordings stay where they are.

    Parameters
    ----------
    folder
        Machine folder.
    journal
        Its journal.
    """
    for file in find_conflict_files(folder, journal.read()):
        if file.kind == "journal":
            yield from _join_journal(folder, journal, file)
        elif file.kind == "settings":
            yield f"{format_path(file.name)}: {file.finding}"
            yield _set_conflict_aside(folder, file)


def _join_journal(folder: Path, journal: Journal, file: ConflictFile) -> Iterator[str]:
    own, other, name = journal.read().entries, JournalReading(file.lines, ()), format_path(file.name)
    known = {compute_fact_mark(entry) for entry in own}
    faults = [fault for fault in other.faults if compute_fact_mark(other.entries[fault.number - 1]) not in known]
    for fault in (fault for fault in faults if fault.is_newer):
        yield join_sentences(f"{name}: not joined, because {fault}", "Update lobewatch, then run rebuild again")
        return
    unusable = {fault.number for fault in faults if not fault.is_used}
    usable = [entry for number, entry in enumerate(other.entries, 1) if number not in unusable]
    joined = join_lines(own, usable, name)
    entries = [_rename_tap(folder, entry, {*joined.renumbered.values()}) for entry in joined.entries]
    if entries:
        journal.append(*entries)
    yield f"{name}: {joined.n_new} new line{'' if joined.n_new == 1 else 's'} joined to the journal"
    yield from (f"{name}: {fault}, so it is not joined" for fault in faults)
    yield from (f"{name}: its {old} is now {new}" for old, new in joined.renumbered.items())
    yield _set_conflict_aside(folder, file)


def _set_conflict_aside(folder: Path, file: ConflictFile) -> str:
    aside = move_aside(folder, folder / file.name, CONFLICTS_FOLDER_NAME)
    return f"{format_path(file.name)}: moved to {format_path(aside.relative_to(folder).as_posix())}"


def _rename_tap(folder: Path, entry: JournalEntry, new_names: set[str]) -> JournalEntry:
    """Write the file of a tap test again under its new identity if the file is here, and return its line."""
    if entry["kind"] != "tap" or entry["id"] not in new_names:
        return entry
    for path in sorted((folder / "taps").glob("*")):
        if path.is_file() and hashlib.sha256(read_regular_file(path)).hexdigest() == entry["sha256"]:
            content = write_tap(folder / "taps" / f"{entry['id']}.h5", replace(read_tap(path), id=entry["id"]))
            return entry | {"sha256": hashlib.sha256(content).hexdigest(), "size": len(content)}
    return entry
