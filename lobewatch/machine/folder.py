"""Machine folder: machine.toml, taps/, journal.jsonl, spool/ and history.rows, and what journal and taps/ prove."""

import errno
import hashlib
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import Self

import msgspec

from acquisition import DataError, HitDecision, Remark, TapTest, read_tap, write_tap
from acquisition.file_io import delete_folder, make_folder, open_regular_file, read_regular_file, rename, sync_folder
from acquisition.hit_quality.decide_hits import decide_stored_hits
from lobewatch.machine.folder_files import compute_change_mark, to_folder_path
from lobewatch.machine.folder_lock import LOCK_TIMEOUT, FolderLock
from lobewatch.machine.journal import read_entries as journal_entries
from lobewatch.machine.journal.alarm_entries import Acknowledgement, FleetScatter
from lobewatch.machine.journal.entries import CutEntry, RecordingFile
from lobewatch.machine.journal.file_names import format_path
from lobewatch.machine.journal.journal import Journal, JournalReading, format_command, journal_damage_remark, make_entry
from lobewatch.machine.journal.mass_checks import MassCheckEntry
from lobewatch.machine.journal.sync_conflicts import conflict_remark, list_sync_remarks
from lobewatch.machine.journal.tap_entry import DamagedTapError, TapEntry
from lobewatch.machine.journal.unverified_tap import read_unverified_tap
from lobewatch.machine.settings.machine_file import Machine, read_machine_file
from lobewatch.machine.settings.toml import read_toml_text
from lobewatch.step_times import time_step

MAX_HASHED_BYTES, MAX_HASHED_FILES = 10_000_000, 50
"""Limits of the newest tap files whose SHA-256 is checked at every reading; lobewatch verify checks all."""
MAX_LISTED_FILES = 20
"""Largest number of unlisted files that are listed one by one; chosen."""


@dataclass(frozen=True)
class FolderContents:
    """Tap tests, test cuts and events of a machine folder."""

    taps: tuple[TapEntry, ...]
    """Usable tap tests, oldest first."""
    lost: tuple[TapEntry, ...]
    """Committed tap tests with damaged files, oldest first."""
    remarks: tuple[Remark, ...]
    """Remarks on damage."""
    events: tuple[journal_entries.MaintenanceEvent, ...] = ()
    """Maintenance of the machine, oldest first."""
    line_count: int = 0
    """Number of lines of the journal."""
    cuts: tuple[CutEntry, ...] = ()
    """Test cuts, oldest first, excluded ones included."""
    acknowledgements: tuple[Acknowledgement, ...] = ()
    """Acknowledgements of alarms, oldest first."""
    fleet_scatters: tuple[FleetScatter, ...] = ()
    """Scatter of the other machines of the fleet, oldest first."""
    mass_checks: tuple[MassCheckEntry, ...] = ()
    """Checks with a known mass, oldest first."""

    def with_tap(self, entry: TapEntry) -> Self:
        """Return the contents with a newly committed tap test."""
        entry = entry.with_mass_checks(self.mass_checks)
        is_newest = not self.taps or self.taps[-1].created <= entry.created
        taps = (*self.taps, entry) if is_newest else _sort_by_time([*self.taps, entry])
        return replace(self, taps=taps, line_count=self.line_count + 1)

    @property
    def baselines(self) -> list[datetime]:
        """Times of new baselines, oldest first."""
        return [event.time for event in self.events if event.new_baseline]


def read_folder_contents(folder: Path, reading: JournalReading) -> FolderContents:
    """Read the contents that the journal and taps/ prove together."""
    committed = journal_entries.read_committed_taps(reading)
    remarks, taps, lost = [*reading.damage, *list_sync_remarks(folder, reading)], list[TapEntry](), list[TapEntry]()
    sizes, given_up, proved = _list_tap_sizes(folder), journal_entries.read_given_up_ids(reading), 0
    for count, entry in enumerate(reversed(_sort_by_time(committed.values()))):
        proved += entry.size
        is_old = proved > MAX_HASHED_BYTES or count >= MAX_HASHED_FILES
        fault = "" if is_old and sizes.get(entry.id) == entry.size else find_file_fault(folder, entry)
        (lost if fault else taps).append(entry)
        if fault:
            remarks.append(tap_damage_remark(folder, entry, fault, entry.id in given_up))
    taps.reverse()
    extra = [folder / "taps" / f"{name}.h5" for name in sorted(sizes.keys() - committed.keys())]
    missing = not reading.lines and not reading.damage and any(_lacks_known_origin(folder, path) for path in extra)
    if missing:
        remarks.append(missing_journal_remark(folder, len(extra)))
    if reading.damage or missing:
        whole = [tap for path in extra if (tap := read_unverified_tap(path)) and tap.id == path.stem]
        taps = [*_sort_by_time([*taps, *whole])]
    else:
        cure = f"Run {format_command('verify', folder)} for details"
        text = "not in the journal, so this file is not used"
        remarks += [unlisted_file_remark(path, text, cure, committed) for path in extra[:MAX_LISTED_FILES]]
        if extra[MAX_LISTED_FILES:]:
            text = f"{len(extra) - MAX_LISTED_FILES} more files, not in the journal and not used"
            remarks.append(Remark("tap-unlisted", "taps", text, cure))
    lines = reading.other_entries
    acknowledged = tuple(msgspec.convert(line, Acknowledgement) for line in lines if line["kind"] == "ack")
    scatters = tuple(msgspec.convert(line, FleetScatter) for line in lines if line["kind"] == "scatter")
    cuts, events = journal_entries.read_committed_cuts(reading), journal_entries.read_events(lines)
    checks = journal_entries.read_mass_checks(lines)
    tests = tuple(tap.with_mass_checks(checks) for tap in taps), _sort_by_time(lost), tuple(remarks)
    return FolderContents(*tests, events, len(reading.lines), cuts, acknowledged, scatters, checks)


def _list_tap_sizes(folder: Path) -> dict[str, int]:
    """Return the sizes (bytes) of the files in taps/ by identity."""
    if not (folder / "taps").is_dir():
        return {}
    with os.scandir(folder / "taps") as listing:
        files = [file for file in listing if file.name.endswith(".h5") and not file.name.startswith(".")]
        return {file.name[:-3]: file.stat().st_size for file in files}


def list_tap_files(folder: Path) -> Mapping[str, Path]:
    """Return the tap files in taps/ by identity."""
    taps = folder / "taps"
    files = sorted(taps.glob("*.h5")) if taps.is_dir() else []
    return {path.stem: path for path in files if not path.name.startswith(".")}


def find_file_fault(folder: Path, entry: TapEntry | RecordingFile) -> str:
    """Return the fault of a committed file; empty if it has the committed content.

    Raises OSError if this program can open no more files.
    """
    try:
        with open_regular_file(f"{folder}/{entry.file}") as file:
            size = os.fstat(file.fileno()).st_size
            if size != entry.size:
                return f"the file has {size} bytes instead of {entry.size} bytes"
            digest = hashlib.sha256(file.read()).hexdigest()
        if digest != entry.sha256:
            return "the file changed since lobewatch wrote it (SHA-256 differs)"
    except FileNotFoundError:
        return "missing, but listed in the journal"
    except OSError as error:
        if error.errno in (errno.EMFILE, errno.ENFILE):  # not a fault of this file
            raise
        return f"unreadable ({error.strerror})"
    return ""


def hash_file(path: Path) -> str:
    """Return the SHA-256 of a file; empty if it cannot be read."""
    try:
        return hashlib.sha256(read_regular_file(path)).hexdigest()
    except OSError:
        return ""


def tap_damage_remark(folder: Path, entry: TapEntry, fault: str, is_given_up: bool = False) -> Remark:
    """Return the remark on a tap test with a damaged file."""
    text = f"{fault}, so this tap test is not used"
    if is_given_up:
        return Remark("tap-lost", entry.file, text)
    cure = f"Restore the file from a backup, or run {format_command('rebuild', folder)} to continue without it"
    return Remark("tap-damaged", entry.file, text, cure)


def missing_journal_remark(folder: Path, count: int) -> Remark:
    """Return the remark on tap files without a journal."""
    fault = f"missing although taps/ has {count} tap file{'s' if count > 1 else ''}"
    return journal_damage_remark(Journal(folder).path, fault)


def restore_toml_advice(folder: Path) -> str:
    """Return the remedy for a missing machine.toml next to tap tests."""
    rebuild = format_command("rebuild", folder)
    return f"Restore machine.toml from a backup, or run {rebuild} to use the copy in the newest tap test"


def has_known_origin(folder: Path, entry: TapEntry) -> bool:
    """Tell whether a tap file without a line comes from an interrupted program whose hits or recording exist."""
    return bool(entry.source_sha256) or (folder / "spool" / entry.id).is_dir()


def _lacks_known_origin(folder: Path, path: Path) -> bool:
    if (folder / "spool" / path.stem).is_dir():
        return False
    entry = read_unverified_tap(path)
    return entry is None or not has_known_origin(folder, entry)


def unlisted_file_remark(path: Path, text: str, cure: str, committed: Iterable[str]) -> Remark:
    """Return the remark on a file in taps/ without a line; committed: identities of the tap tests with one."""
    if any(path.name.startswith(tap_id) for tap_id in committed):
        return conflict_remark(path.parents[1], f"taps/{path.name}", text)
    return Remark("tap-unlisted", f"taps/{path.name}", text, cure)


def _sort_by_time(entries: Iterable[TapEntry]) -> tuple[TapEntry, ...]:
    return tuple(sorted(entries, key=attrgetter("created")))


class MachineFolder:
    """Folder of one machine, and the only way to add to it."""

    def __init__(self, path: Path | str) -> None:
        """Open a machine folder.

        Parameters
        ----------
        path
            Folder with a machine.toml.

        Raises
        ------
        DataError
            If this is no machine folder, or its name is not UTF-8.
        """
        self.path = to_folder_path(path)
        """Path of the folder."""
        self.toml = self.path / "machine.toml"
        """Path of the machine file."""
        self.history_path = self.path / "history.rows"
        """Path of the cached history."""
        self.spool = self.path / "spool"
        """Folder of the hits of tests in progress."""
        if format_path(path) != str(path):
            raise DataError(f"{format_path(path)}: the folder name is not UTF-8. Rename the folder.")
        if not self.toml.exists() and list_tap_files(self.path):
            raise DataError(f"{self.toml}: missing, but the folder has tap tests. {restore_toml_advice(self.path)}.")
        if not self.toml.exists():
            cure = f"Run folder_files.make_machine_folder {self.path} to create a machine folder."
            raise DataError(f"{self.path}: no machine.toml. {cure}")

    @property
    def toml_text(self) -> str:
        """Present text of the machine file."""
        return read_toml_text(self.toml)

    @cached_property
    def journal(self) -> Journal:
        """Journal of the machine."""
        return Journal(self.path)

    @cached_property
    def machine(self) -> Machine:
        """Machine file as first read."""
        return read_machine_file(self.toml)

    @property
    def change_mark(self) -> tuple[int, ...]:
        """Mark that changes with machine.toml, the journal, or the names in taps/."""
        return compute_change_mark(self.path)

    @cached_property
    def _lock(self) -> FolderLock:
        return FolderLock(self.path)

    def locked(self, patience: float = LOCK_TIMEOUT) -> AbstractContextManager[None]:
        """Return a context that keeps other programs from writing here; it may be nested.

        Parameters
        ----------
        patience
            Time to wait for another program (s); 0 for optional work.

        Raises
        ------
        BusyError
            If another program still writes.
        OSError
            If the folder cannot be written.
        """
        return self._lock.hold(patience)

    @property
    def sync_remarks(self) -> list[Remark]:
        """Remarks on files and entries of other computers, and on lines that this version does not understand."""
        return list_sync_remarks(self.path, self.journal.read())

    @time_step("reading")
    def contents(self) -> FolderContents:
        """Read the committed tap tests and the state of their files."""
        return read_folder_contents(self.path, self.journal.read())

    def taps(self) -> list[TapEntry]:
        """Return the usable tap tests, oldest first."""
        return list(self.contents().taps)

    @property
    def committed_ids(self) -> set[str]:
        """Identities of all tap tests in the journal."""
        return set(journal_entries.read_committed_taps(self.journal.read()))

    def refuse_damage(self) -> JournalReading:
        """Read the journal; DataError if it must be repaired before writing."""
        reading = self.journal.read()
        self.journal.refuse_damage(reading)
        if not reading.lines and any(remark.code == "journal-damaged" for remark in self.contents().remarks):
            missing = missing_journal_remark(self.path, len(list_tap_files(self.path)))
            self.journal.refuse_damage(replace(reading, damage=(missing,)))
        return reading

    @time_step("reading")
    def read(self, entry: TapEntry) -> TapTest:
        """Read a tap test, after its file is checked against the journal.

        Parameters
        ----------
        entry
            Journal entry of the tap test.

        Raises
        ------
        DamagedTapError
            If the file is not the committed one.
        """
        fault = find_file_fault(self.path, entry)
        if fault:
            raise DamagedTapError(tap_damage_remark(self.path, entry, fault), entry, self.path)
        path = self.path / entry.file
        try:
            return decide_stored_hits(read_tap(path), entry.hit_decisions)
        except ValueError as error:
            text = str(error).removeprefix(f"{path}: ")
            raise DamagedTapError(Remark("tap-unreadable", entry.file, text), entry, self.path) from error

    def commit(self, tap: TapTest, asked: Sequence[str] = (), answered: Sequence[str] = ()) -> TapEntry:
        """Write the tap file, then its journal line, which lasts on return.

        Parameters
        ----------
        tap
            Tap test.
        asked
            Codes of the questions about its time and device.
        answered
            Codes of the questions that a person has answered before its first hit.

        Raises
        ------
        DataError
            If the journal is damaged; nothing is written then.
        """
        reading = self.refuse_damage()
        path = self.path / "taps" / f"{tap.id}.h5"
        make_folder(path.parent)
        content = write_tap(path, tap)
        entry = TapEntry.of(tap, content)
        entry = msgspec.structs.replace(
            entry,
            asked=(*entry.asked, *asked),
            asked_live=tuple(answered),
            accepted=tuple(answered),
        )
        known = journal_entries.read_hit_decisions(reading.other_entries).get(tap.id, ())
        counting = {decision.hit for decision in tap.decisions}
        changes = [HitDecision(decision.hit, "undo") for decision in known if decision.hit not in counting]
        changes += [decision for decision in tap.decisions if decision not in known]
        hit_entries = journal_entries.make_hit_entries(tap.id, changes)
        answers = [make_entry("accept", tap=tap.id, code=code) for code in answered]
        self.journal.append(*hit_entries, entry.line, *answers, reading=reading)
        delete_folder(self.spool / tap.id)
        return entry

    def commit_files(self, files: Mapping[Path, TapEntry]) -> None:
        """Move finished tap files to taps/ and commit them together; call it under the lock.

        Parameters
        ----------
        files
            Entries by temporary path on the same disk, already synchronized.
        """
        reading = self.refuse_damage()
        for temporary, entry in files.items():
            rename(temporary, self.path / entry.file)
        sync_folder(self.path / "taps")
        lines = (
            [*journal_entries.make_hit_entries(entry.id, entry.hit_decisions), entry.line] for entry in files.values()
        )
        self.journal.append(*chain.from_iterable(lines), reading=reading)

    def accept(self, tap_id: str, code: str) -> None:
        """Write to the journal that a person accepted a question about a tap test.

        Parameters
        ----------
        tap_id
            Identity of the tap test.
        code
            Code of the question.
        """
        with self.locked():
            self.journal.append(make_entry("accept", tap=tap_id, code=code))
