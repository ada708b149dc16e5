"""Verify every file of a machine folder against its checksums."""

import contextlib
import difflib
import json
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from acquisition import DataError, Remark, Trigger
from acquisition.credentials import hide_passwords
from acquisition.errors import format_error
from acquisition.file_io import MAX_SETTINGS_FILE_SIZE, read_regular_file
from acquisition.files.hdf5_file import has_valid_checksum
from lobewatch.machine import folder as contents
from lobewatch.machine.daq_rates import read_stored_devices
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_lock import LOCK_HOLDER_NAME, LOCK_NAME
from lobewatch.machine.journal import journal
from lobewatch.machine.journal import read_entries as journal_entries
from lobewatch.machine.journal.file_names import (
    CONFLICTS_FOLDER_NAME,
    DAMAGED_FOLDER_NAME,
    LOBEWATCH_FILES,
    format_path,
)
from lobewatch.machine.journal.journal import Journal, JournalReading, format_command
from lobewatch.machine.journal.sync_conflicts import list_sync_remarks
from lobewatch.machine.journal.tap_entry import TapEntry
from lobewatch.machine.journal.unverified_tap import read_unverified_tap
from lobewatch.machine.rebuild_files import verify_cut_recordings
from lobewatch.machine.row_file import read_rows

DAMAGE_CODES = (
    *("journal-damaged", "tap-damaged", "tap-unlisted", "file-damaged", "cut-damaged", "cut-unlisted"),
    *("sync-conflict", "sync-contradiction", "journal-newer", "line-damaged"),
)
"""Codes of remarks on damage, conflicts and incomplete results; all others are information."""
DELETION_ADVICE = "Delete this file or folder if you do not need it"
ALTERED_TEXT = "file changed or truncated since lobewatch wrote it"
"""Fault of a file with a wrong checksum."""


def name_problem(code: str) -> str:
    """Name the problem of a remark in `DAMAGE_CODES`: "damaged", "conflicting" or "not understood"."""
    if code.startswith("sync-"):
        return "conflicting"
    return "not understood" if code == "journal-newer" else "damaged"


@dataclass(frozen=True)
class Verification:
    """State of the files of a machine."""

    remarks: tuple[Remark, ...]
    """Remarks on all files, damage and information."""
    entered: tuple[str, ...]
    """Tap files that an interrupted program had not entered in the journal; now they are."""
    n_taps: int
    """Number of tap files with the committed content."""

    @property
    def damage(self) -> tuple[Remark, ...]:
        """Remarks on damage."""
        return tuple(remark for remark in self.remarks if remark.code in DAMAGE_CODES)


def verify(path: Path) -> Verification:
    """Verify every byte of a machine folder.

    A sound tap file of an interrupted program, whose spool or recording explains it, is entered in the journal.

    Parameters
    ----------
    path
        Machine folder.

    Returns
    -------
    Verification
        Remarks on damaged, missing, extra, swapped and renamed files.

    Raises
    ------
    DataError
        If this is no machine folder.
    """
    if not (path / "machine.toml").is_file() and contents.list_tap_files(path):
        advice = contents.restore_toml_advice(path)
        missing = Remark("file-damaged", "machine.toml", "missing, but the folder has tap tests", advice)
        return Verification((missing,), (), 0)
    folder = MachineFolder(path)
    entered = enter_orphaned_taps(folder)
    reading = folder.journal.read()
    committed = journal_entries.read_committed_taps(reading)
    faults = {name: fault for name, entry in committed.items() if (fault := contents.find_file_fault(path, entry))}
    remarks = [*reading.damage, *list_sync_remarks(path, reading)]
    remarks += [*_verify_taps(path, reading, committed, faults), *verify_cut_recordings(path, reading)]
    remarks += _verify_machine_file(folder, [entry for name, entry in committed.items() if name not in faults])
    remarks += [*_verify_history(folder), *_verify_devices(folder)]
    remarks += [*_verify_spool(path, committed.keys() - faults.keys())]
    remarks += _verify_names(path, {remark.about for remark in remarks})
    return Verification(tuple(remarks), tuple(entered), len(committed) - len(faults))


def enter_orphaned_taps(folder: MachineFolder) -> list[str]:
    """Enter tap files of an interrupted program in the journal, and return the files.

    Nothing happens if another program writes, the journal is damaged, or the folder cannot be written.
    """
    entered = list[str]()
    with contextlib.suppress(DataError, OSError), folder.locked(patience=0):
        committed = folder.committed_ids
        for name, path in contents.list_tap_files(folder.path).items():
            entry = read_unverified_tap(path) if name not in committed else None
            if entry is not None and entry.id == name and contents.has_known_origin(folder.path, entry):
                folder.journal.append(entry.line)
                entered.append(entry.file)
    return entered


def _verify_taps(
    folder: Path, reading: JournalReading, committed: dict[str, TapEntry], faults: dict[str, str]
) -> Iterator[Remark]:
    by_content = {entry.sha256: entry for entry in committed.values()}
    given_up, files = journal_entries.read_given_up_ids(reading), contents.list_tap_files(folder)
    late = journal_entries.read_committed_taps(Journal(folder).read())  # what another program has committed meanwhile
    extra = [path for name, path in files.items() if name not in committed and name not in late]
    if not reading.lines and not reading.damage and extra:
        yield contents.missing_journal_remark(folder, len(extra))
    for name, fault in faults.items():
        entry, path = committed[name], folder / committed[name].file
        namesake = by_content.get(contents.hash_file(path))
        text = f"contains {namesake.file}" if namesake else fault
        yield contents.tap_damage_remark(folder, entry, text, name in given_up and not path.exists())
    for path in extra:
        original = by_content.get(contents.hash_file(path))
        is_needed = original is not None and original.id in faults
        yield _unlisted_tap_remark(folder, path, original, is_needed, committed)


def _unlisted_tap_remark(
    folder: Path, path: Path, original: TapEntry | None, is_needed: bool, committed: Collection[str]
) -> Remark:
    """Return the remark on a tap file without a line; original: committed tap test with the same content."""
    mend, entry = format_command("rebuild", folder), read_unverified_tap(path) if original is None else None
    if original is not None and is_needed:
        finding = f"contains tap test {original.file}", f"Run {mend} to rename the file"
    elif original is not None:
        finding = f"copy of {original.file}", f"Run {mend} to set the file aside"
    elif entry is None:
        finding = "incomplete tap file, not in the journal", f"Run {mend} to set the file aside"
    elif entry.id != path.stem:
        finding = f"contains tap test {entry.id}", f"Run {mend} to rename the file and enter the test in the journal"
    elif contents.has_known_origin(folder, entry):
        cure = f"Run {format_command('verify', folder)} again when no other program writes"
        text = "tap file not yet in the journal"
        return Remark("not-entered", f"taps/{path.name}", text, cure)
    else:
        cure = f"Run {mend} to enter the test in the journal, or remove the file if it belongs to another machine"
        finding = "complete tap file, not in the journal", cure
    return contents.unlisted_file_remark(path, *finding, committed)


def _verify_machine_file(folder: MachineFolder, sound: list[TapEntry]) -> Iterator[Remark]:
    """Compare machine.toml with the copy in the newest tap test."""
    try:
        _ = folder.machine
    except (ValueError, OSError) as error:
        mend = format_command("rebuild", folder.path)
        cure = f"Correct machine.toml, or move it away and run {mend} to use the copy in the newest tap test"
        yield Remark("file-damaged", "machine.toml", format_error(error), cure)
        return
    newest = max(sound, key=lambda entry: entry.time, default=None)
    copy = ""
    with contextlib.suppress(DataError):  # a newer lobewatch has written it
        copy = folder.read(newest).circumstances.machine_toml if newest else ""
    text = hide_passwords(folder.toml_text)
    if newest is not None and copy and text != copy:
        differences = list(difflib.unified_diff(copy.splitlines(), text.splitlines(), n=0, lineterm=""))[2:]
        changed = [f"{line[0]} {line[1:]}" for line in differences if line[0] in "+-"]
        first = changed[0] if changed else "line ends"
        differing = f"{len(changed)} lines differ from the copy in {newest.file}, first: {first}"
        yield Remark("machine-file-edited", "machine.toml", differing)


def _verify_history(folder: MachineFolder) -> Iterator[Remark]:
    fault = ""
    try:
        if folder.history_path.exists() and read_rows(folder.history_path).is_damaged:
            fault = "file changed since lobewatch wrote it"
    except OSError as error:
        fault = format_error(error).removeprefix(f"{folder.history_path}: ")
    if fault:
        cure = f"Run {format_command('rebuild', folder.path)} to write the file again"
        yield Remark("file-damaged", folder.history_path.name, fault, cure)


def _verify_devices(folder: MachineFolder) -> Iterator[Remark]:
    try:
        read_stored_devices(folder)
    except (DataError, OSError) as error:
        yield Remark("file-damaged", "daq.json", format_error(error).removeprefix(f"{folder.path / 'daq.json'}: "))


def _verify_names(folder: Path, named: Collection[str]) -> Iterator[Remark]:
    """Yield remarks on files that lobewatch does not verify, except for those named already."""
    known = {
        "report.html": (
            "lobewatch keeps no checksum of reports",
            f"Run {format_command('report', folder)} to write the report again",
        )
    }
    known["history.h5"] = "old cache, or an exported history", DELETION_ADVICE
    for path in sorted(folder.iterdir()):
        if format_path(path.name) in named:
            continue
        if path.suffix in (".tmp", ".torn", ".damaged") or path.name in (DAMAGED_FOLDER_NAME, CONFLICTS_FOLDER_NAME):
            yield Remark("set-aside", path.name, "file left over, or set aside by lobewatch", DELETION_ADVICE)
        elif path.name not in {*LOBEWATCH_FILES, LOCK_NAME, LOCK_HOLDER_NAME}:
            yield Remark("not-verified", path.name, *known.get(path.name, ("not a file of lobewatch",)))
    taps, files = folder / "taps", {*contents.list_tap_files(folder).values()}
    for path in sorted(taps.iterdir()) if taps.is_dir() else []:
        if path not in files and f"taps/{format_path(path.name)}" not in named:
            yield Remark("not-verified", f"taps/{path.name}", "not a tap file", "Remove the file from taps/")


def _verify_spool(folder: Path, saved: Collection[str]) -> Iterator[Remark]:
    """Verify the files of interrupted tests, except those of saved tap tests.

    Files that another program removes meanwhile are left out.
    """
    spool = folder / "spool"
    for path in sorted(spool.rglob("*")) if spool.is_dir() else []:
        if path.relative_to(spool).parts[0] in saved:
            continue
        try:
            yield from _verify_spooled(folder, path)
        except FileNotFoundError:
            continue
        except OSError as error:
            about = path.relative_to(folder).as_posix()
            yield Remark("file-damaged", about, format_error(error).removeprefix(f"{path}: "))


def _verify_spooled(folder: Path, path: Path) -> Iterator[Remark]:
    """Verify a file or the folder of an interrupted test."""
    about, tap = path.relative_to(folder).as_posix(), format_command("tap", folder)
    if path.is_dir():
        cure = f"Restore the hit from a backup, or run {tap} to continue with the other hits. {_deletion_advice(path)}"
        yield from (
            Remark("file-damaged", f"{about}/{name}", "hit file missing", cure) for name in _find_missing_hits(path)
        )
    elif path.suffix == ".h5" and not has_valid_checksum(read_regular_file(path)):
        cure = f"Run {tap} to set the file aside and continue with the other hits. {_deletion_advice(path.parent)}"
        yield Remark("file-damaged", about, ALTERED_TEXT, cure)
    elif path.name == "setup.json" and not _is_valid_setup(path):
        cure = f"Run {tap} to set the file aside and choose the setup again. {_deletion_advice(path.parent)}"
        yield Remark("file-damaged", about, ALTERED_TEXT, cure)
    elif path.suffix == ".tmp":
        yield Remark("set-aside", about, "incomplete file", f"Run {tap} to remove the file")
    elif path.suffix == ".damaged":
        yield Remark("set-aside", about, "damaged file of an interrupted test", DELETION_ADVICE)


def _deletion_advice(test: Path) -> str:
    return f"Delete {test} if the test is older than 12 hours and cannot be continued"


def _is_valid_setup(path: Path) -> bool:
    try:
        settings = json.loads(read_regular_file(path, MAX_SETTINGS_FILE_SIZE))
        crc = settings.pop("crc", None)
        return bool(Trigger(**settings)) and crc in (None, journal.compute_crc(settings))
    except (ValueError, TypeError, AttributeError, RecursionError):
        return False


def _find_missing_hits(test: Path) -> list[str]:
    """Return the names of hits below the highest number that neither exist nor were set aside."""
    numbers = [int(path.stem) for path in test.glob("[0-9]*.h5") if path.stem.isdigit()]
    names = [f"{number:04d}.h5" for number in range(max(numbers, default=0)) if number not in numbers]
    return [name for name in names if not list(test.parent.glob(f"{test.name}-{name}*.damaged"))]
