"""Rebuild a damaged machine folder from its sound files."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from operator import attrgetter
from pathlib import Path
from typing import Any

from acquisition import DataError, Remark, read_tap
from acquisition.errors import join_sentences
from acquisition.file_io import IrregularFileError, atomic_write, delete, read_regular_file, rename
from acquisition.files.cut_file import read_cut_signal
from lobewatch.machine import folder as contents
from lobewatch.machine.daq_rates import read_stored_devices
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_lock import LOCK_TIMEOUT, FolderLock
from lobewatch.machine.journal import read_entries as journal_entries
from lobewatch.machine.journal.entries import CutEntry, RecordingFile, parse_cut_line
from lobewatch.machine.journal.file_names import DAMAGED_FOLDER_NAME, JOURNAL_NAME, move_aside
from lobewatch.machine.journal.join_files import join_conflict_files
from lobewatch.machine.journal.journal import Journal, JournalReading, format_command, make_entry
from lobewatch.machine.journal.sync_conflicts import is_hdf5_file, read_given_up_lines
from lobewatch.machine.journal.tap_entry import TapEntry
from lobewatch.machine.journal.unverified_tap import read_unverified_tap
from lobewatch.machine.settings.toml import write_toml_text

LOST_ENTRIES_ADVICE = (
    "Enter lost decisions on hits, events, exclusions, accepted questions and cuts judged by ear again "
)
LOST_ENTRIES_ADVICE += "(Logbook.decide_hits, folder_updates.add_event, exclude_entry, MachineFolder.accept, "
LOST_ENTRIES_ADVICE += "folder_updates.store_cut)."
"""Advice on entries that no copy of the journal has."""


def verify_cut_recordings(folder: Path, reading: JournalReading) -> Iterator[Remark]:
    """Yield remarks on recordings that are altered, missing or unlisted."""
    cuts, given_up = journal_entries.read_committed_cuts(reading), journal_entries.read_given_up_ids(reading)
    mend = format_command("rebuild", folder)
    for recording, fault in _find_damaged_recordings(folder, cuts):
        text = f"{fault}, but the stored result of the cut is used"
        if recording.id in given_up:
            yield Remark("cut-lost", recording.file, text)
        else:
            cure = f"Restore the file from a backup, or run {mend} to continue without it"
            yield Remark("cut-damaged", recording.file, text, cure)
    for path in _list_unlisted_cuts(folder, cuts):
        cure = f"Run {mend} to enter the recording in the journal or to set it aside"
        yield Remark("cut-unlisted", f"cuts/{path.name}", "not in the journal, so this file is not used", cure)


def _repair_cut_recordings(folder: Path, journal: Journal) -> Iterator[str]:
    """Enter sound recordings without a line, set others aside, and report it in sentences.

    The result of a lost recording is in its journal line and stays valid.
    """
    cuts = journal_entries.read_committed_cuts(journal.read())
    if damaged := [recording for recording, _ in _find_damaged_recordings(folder, cuts)]:
        yield from _restore_misplaced(folder, damaged, _list_h5_files(folder, "cuts"))
    for path in _list_unlisted_cuts(folder, cuts):
        cut = _read_unlisted_cut(path)
        if cut is None or cut.id in {entered.id for entered in journal_entries.read_committed_cuts(journal.read())}:
            yield _set_aside(folder, path)
            continue
        content = read_regular_file(path)
        recording = RecordingFile(cut.id, hashlib.sha256(content).hexdigest(), len(content))
        journal.append(replace(cut, recording=recording).line | {"time": datetime.now(UTC).isoformat()})
        yield f"cuts/{path.name}: entered in the journal"
    reading = journal.read()
    for lost, _ in _find_damaged_recordings(folder, journal_entries.read_committed_cuts(reading)):
        if (folder / lost.file).exists():
            _move_to_damaged(folder, folder / lost.file)
        if lost.id not in journal_entries.read_given_up_ids(reading):
            journal.append(make_entry("lost", tap=lost.id))
            yield f"{lost.file}: lost, but the stored result of the cut is used"


def _find_damaged_recordings(folder: Path, cuts: Sequence[CutEntry]) -> list[tuple[RecordingFile, str]]:
    """Return the damaged recordings of test cuts with their faults."""
    recordings = [cut.recording for cut in cuts if cut.recording is not None]
    return [(file, fault) for file in recordings if (fault := contents.find_file_fault(folder, file))]


def _list_unlisted_cuts(folder: Path, cuts: Sequence[CutEntry]) -> list[Path]:
    """Return the finished files in cuts/ without a line."""
    listed = {f"{cut.id}.h5" for cut in cuts if cut.recording is not None}
    files = sorted((folder / "cuts").glob("*")) if (folder / "cuts").is_dir() else []
    return [path for path in files if path.name not in listed and not path.name.startswith(".")]


def _read_unlisted_cut(path: Path) -> CutEntry | None:
    """Return the test cut of a recording without a line; None if it is damaged or misnamed."""
    try:
        _, about = read_cut_signal(path)
        cut = parse_cut_line(about)
    except (DataError, OSError, LookupError, TypeError, ValueError):
        return None
    return cut if f"{cut.id}.h5" == path.name else None


def rebuild_files(path: Path) -> list[str]:
    """Repair machine.toml, taps/, the journal and daq.json, and report it in sentences.

    Damaged files are moved away, never deleted. Raises DataError if this is no machine folder, BusyError if another
    program writes.
    """
    if not (path / "machine.toml").is_file() and not contents.list_tap_files(path):
        MachineFolder(path)
    with FolderLock(path).hold(LOCK_TIMEOUT):
        journal = Journal(path)
        journal.separate_copies()
        reading = journal.read()
        if reading.damage:
            journal.rewrite(reading)
        report = [*join_conflict_files(path, journal)]
        committed = journal_entries.read_committed_taps(journal.read())
        report += _restore_misplaced(path, [*committed.values()], _list_h5_files(path, "taps"))
        fresh = _enter_unlisted_taps(path, committed, report)
        if fresh:
            journal.append(*(entry.line for entry in fresh))
        if reading.damage or (fresh and not reading.lines):
            report.append(f"{JOURNAL_NAME}: rewritten with {len(reading.entries) + len(fresh)} lines")
            report += _report_missing_lines(reading.entries, len(fresh))
        report += [f"{entry.file}: entered in the journal" for entry in fresh]
        report += [*_exclude_repeated_recordings(journal), *_give_up_lines(journal)]
        report += _record_lost_taps(path, journal)
        report += _repair_cut_recordings(path, journal)
        report += [*_restore_machine_file(path), *_repair_devices_file(path)]
    return report


def _list_h5_files(folder: Path, place: str) -> list[Path]:
    """List the files in taps/ or cuts/ that may hold a tap test or a recording, under any name."""
    paths = sorted((folder / place).iterdir()) if (folder / place).is_dir() else []
    named = (path for path in paths if path.is_file() and not path.name.startswith("."))
    return [path for path in named if path.suffix == ".h5" or is_hdf5_file(path)]


def _exclude_repeated_recordings(journal: Journal) -> Iterator[str]:
    """Exclude tap tests of recordings that two computers replayed, all but the first by identity, and report them."""
    kept = dict[tuple[str, str], str]()
    taps = journal_entries.read_committed_taps(journal.read()).values()
    replayed = (tap for tap in taps if tap.source_sha256 and not tap.excluded)
    for tap in sorted(replayed, key=attrgetter("id")):
        first = kept.setdefault((tap.source_sha256, tap.direction), tap.id)
        if first != tap.id:
            reason = f"same recording as {first}"
            journal.append(make_entry("exclude", tap=tap.id, reason=reason))
            yield f"{tap.file}: excluded, {reason}"


def _give_up_lines(journal: Journal) -> Iterator[str]:
    """Enter which damaged lines are given up, and report them."""
    reading = journal.read()
    given_up = read_given_up_lines(reading)
    for fault in reading.faults:
        if not fault.is_newer and fault.number not in given_up:
            journal.append(make_entry("lost", line=fault.number))
            yield join_sentences(f"{JOURNAL_NAME}: {fault}", LOST_ENTRIES_ADVICE)


def _report_missing_lines(entries: Sequence[Mapping[str, Any]], n_fresh: int) -> Iterator[str]:
    """Yield lines that no copy of the journal has; n_fresh: newly entered tap tests in their place."""
    if not entries:
        yield f"{JOURNAL_NAME}: file and copy are unreadable. {LOST_ENTRIES_ADVICE}"
        return
    numbers = {entry["number"] for entry in entries if isinstance(entry.get("number"), int)}
    first = sum("number" not in entry for entry in entries) + 1  # lines of old versions
    missing = sorted(set(range(first, max(numbers, default=0))) - numbers)
    if len(missing) > n_fresh:
        lines = f"line{'s' if len(missing) > 1 else ''} {', '.join(map(str, missing))}"
        yield f"{JOURNAL_NAME}: {lines} damaged in both copies. {LOST_ENTRIES_ADVICE}"


def _restore_misplaced(
    folder: Path, committed: Sequence[TapEntry] | Sequence[RecordingFile], files: Sequence[Path]
) -> Iterator[str]:
    """Rename swapped files back where the right file is damaged, else set them aside."""
    by_content = {entry.sha256: entry for entry in committed}
    owners = {path: by_content.get(contents.hash_file(path)) for path in files}
    misplaced = [(path, entry) for path, entry in owners.items() if entry is not None and path != folder / entry.file]
    asides = {_move_to_damaged(folder, path): entry for path, entry in misplaced}
    for aside, entry in asides.items():
        if contents.find_file_fault(folder, entry):
            if (folder / entry.file).exists():
                _move_to_damaged(folder, folder / entry.file)
            atomic_write(folder / entry.file, aside.read_bytes())
            delete(aside)
            yield f"{entry.file}: file restored under its own name"
        else:
            yield f"{aside.relative_to(folder).as_posix()}: set aside as a copy of {entry.file}"


def _enter_unlisted_taps(folder: Path, committed: dict[str, TapEntry], report: list[str]) -> list[TapEntry]:
    """Return the entries of sound tap files without a line, renamed if necessary; set all others aside."""
    entries = []
    for path in _list_h5_files(folder, "taps"):
        name = path.name.removesuffix(".h5")
        if name in committed and path.suffix == ".h5":
            continue
        entry = read_unverified_tap(path)
        taken = entry is not None and path.name != f"{entry.id}.h5" and (folder / entry.file).exists()
        if entry is None or taken or entry.id in committed:
            report.append(_set_aside(folder, path))
            continue
        if path.name != f"{entry.id}.h5":
            rename(path, folder / entry.file)
        entries.append(entry)
    return entries


def _record_lost_taps(folder: Path, journal: Journal) -> Iterator[str]:
    """Write to the journal which tap tests are lost."""
    reading = journal.read()
    for name, entry in journal_entries.read_committed_taps(reading).items():
        if not contents.find_file_fault(folder, entry):
            continue
        if (folder / entry.file).exists() and not _is_temporarily_unreadable(folder / entry.file):
            _move_to_damaged(folder, folder / entry.file)
        if name not in journal_entries.read_given_up_ids(reading):
            journal.append(make_entry("lost", tap=name))
            yield f"{entry.file}: lost and no longer used. Restore the file from a backup to use it again."


def _is_temporarily_unreadable(path: Path) -> bool:
    """Tell whether a file cannot be read at the moment; it stays where it is."""
    try:
        read_regular_file(path)
    except OSError as error:
        return not isinstance(error, IrregularFileError)
    return False


def _restore_machine_file(folder: Path) -> Iterator[str]:
    """Restore a missing machine.toml from the newest tap test with a copy."""
    toml = folder / "machine.toml"
    if toml.exists():
        return
    committed = journal_entries.read_committed_taps(Journal(folder).read()).values()
    sound = [entry for entry in committed if not contents.find_file_fault(folder, entry)]
    for entry in sorted(sound, key=lambda entry: entry.time, reverse=True):
        text = read_tap(folder / entry.file).circumstances.machine_toml
        if text:
            write_toml_text(toml, text)
            yield f"machine.toml: restored from the copy in {entry.file}"
            return
    raise DataError(f"{toml}: missing, and no tap test has a copy. Restore this file from a backup.")


def _repair_devices_file(folder: Path) -> Iterator[str]:
    machine = MachineFolder(folder)
    try:
        read_stored_devices(machine)
    except DataError:
        yield join_sentences(_set_aside(folder, folder / "daq.json"), "lobewatch measures the DAQ sample rates again")


def _set_aside(folder: Path, path: Path) -> str:
    """Move a file to the folder for damaged files, and report it."""
    aside = _move_to_damaged(folder, path)
    return f"{path.relative_to(folder).as_posix()}: moved to {aside.relative_to(folder).as_posix()}"


def _move_to_damaged(folder: Path, path: Path) -> Path:
    return move_aside(folder, path, DAMAGED_FOLDER_NAME)
