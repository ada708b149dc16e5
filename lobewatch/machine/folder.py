"""The folder of one machine: machine.toml, taps/, journal.jsonl, spool/ and history.rows."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path

import msgspec

from acquisition import DataError, Remark, TapTest, read_tap, write_tap
from acquisition.file_io import make_folder, sync_folder
from lobewatch.machine.folder_contents import (
    FolderContents,
    find_file_fault,
    list_tap_files,
    missing_journal_remark,
    read_committed_taps,
    read_folder_contents,
    tap_damage_remark,
)
from lobewatch.machine.folder_files import compute_change_mark, format_path, to_folder_path
from lobewatch.machine.folder_lock import LOCK_TIMEOUT, FolderLock
from lobewatch.machine.journal.journal import Journal, JournalReading, format_command
from lobewatch.machine.journal.tap_entry import DamagedTapError, TapEntry
from lobewatch.machine.settings.machine_file import Machine, read_machine_file
from lobewatch.machine.settings.toml_text import read_toml_text


class MachineFolder:
    """The folder of one machine, and the one way to add to it."""

    def __init__(self, path: Path | str) -> None:
        """DataError where this is no machine folder, or one whose name no file or page could hold."""
        self.path = to_folder_path(path)
        """Path of the folder."""
        if format_path(path) != str(path):
            raise DataError(f"{format_path(path)}: the name of the folder is no UTF-8; rename it")
        if not self.toml.exists() and list_tap_files(self.path):
            raise DataError(
                f"{self.toml}: is missing beside tap tests; put it back from a backup; without one, "
                f"{format_command('rebuild', self.path)} takes the copy in the newest of them"
            )
        if not self.toml.exists():
            raise DataError(
                f"{self.path}: no machine.toml in it; make a machine folder with: lobewatch init {self.path}"
            )

    @property
    def toml(self) -> Path:
        """The machine file."""
        return self.path / "machine.toml"

    @property
    def toml_text(self) -> str:
        """The text of the machine file as it is now; what `read_toml_text` of the machine file raises."""
        return read_toml_text(self.toml)

    @property
    def history_path(self) -> Path:
        """File of what was worked out of the tap tests, a cache."""
        return self.path / "history.rows"

    @property
    def spool(self) -> Path:
        """Folder of the hits of tests in progress."""
        return self.path / "spool"

    @cached_property
    def journal(self) -> Journal:
        """Record of what was committed."""
        return Journal(self.path)

    @cached_property
    def machine(self) -> Machine:
        """The machine file as it was when first asked for."""
        return read_machine_file(self.toml)

    @property
    def change_mark(self) -> tuple[int, ...]:
        """Changes with machine.toml, the journal, and the names in taps/."""
        return compute_change_mark(self.path)

    @cached_property
    def _lock(self) -> FolderLock:
        return FolderLock(self.path)

    def locked(self, patience: float = LOCK_TIMEOUT) -> AbstractContextManager[None]:
        """Keep other programs from writing here, once or several times over; BusyError where one still does after
        `patience` (s). 0 is for what can be left undone: a person who has asked for something waits.

        OSError where this folder can only be read.
        """
        return self._lock.hold(patience)

    def contents(self) -> FolderContents:
        """The committed tap tests and their files: which can be used, which cannot, and why."""
        return read_folder_contents(self.path, self.journal.read())

    def taps(self) -> list[TapEntry]:
        """The committed tap tests that can be used, oldest first by their time."""
        return list(self.contents().taps)

    @property
    def committed_ids(self) -> set[str]:
        """Identities of all tap tests in the journal, whatever has become of their files."""
        return set(read_committed_taps(self.journal.read()))

    def refuse_damage(self) -> JournalReading:
        """The journal; DataError where it has to be mended before anything is written here."""
        reading = self.journal.read()
        self.journal.refuse_damage(reading)
        if not reading.lines and any(remark.code == "journal-damaged" for remark in self.contents().remarks):
            self.journal.refuse_damage(
                replace(reading, damage=(missing_journal_remark(self.path, len(list_tap_files(self.path))),))
            )
        return reading

    def read(self, entry: TapEntry) -> TapTest:
        """A tap test, its file checked against the journal before HDF5 sees it; DamagedTapError where it is not so."""
        fault = find_file_fault(self.path, entry)
        if fault:
            raise DamagedTapError(tap_damage_remark(self.path, entry, fault), entry, self.path)
        path = self.path / entry.file
        try:
            return read_tap(path)
        except DataError as error:
            text = str(error).removeprefix(f"{path}: ")
            raise DamagedTapError(Remark("tap-unreadable", entry.file, text), entry, self.path) from error

    def commit(self, tap: TapTest, asked: Sequence[str] = ()) -> TapEntry:
        """Write the tap file, then its journal line; saved for good when this returns.

        asked: what is asked about its time, by code.
        DataError, and nothing is written, where the journal is damaged.
        """
        reading = self.refuse_damage()
        path = self.path / "taps" / f"{tap.id}.h5"
        make_folder(path.parent)
        content = write_tap(path, tap)
        entry = msgspec.structs.replace(TapEntry.of(tap, content), asked=tuple(asked))
        self.journal.append(entry.line, reading=reading)
        shutil.rmtree(self.spool / tap.id, ignore_errors=True)
        return entry

    def commit_files(self, files: Mapping[Path, TapEntry]) -> None:
        """Give finished tap files their names in taps/, then enter them together; saved for good when this returns.

        files: where they lie under temporary names, already made to outlast a power cut, on the same disk. To be called
        under the lock.
        """
        reading = self.refuse_damage()
        for temporary, entry in files.items():
            temporary.replace(self.path / entry.file)
        sync_folder(self.path / "taps")
        self.journal.append(*(entry.line for entry in files.values()), reading=reading)

    def accept(self, tap_id: str, code: str) -> None:
        """Write down that a person has accepted what was asked of a tap test; saved for good when this returns."""
        with self.locked():
            self.journal.append({"kind": "accept", "tap": tap_id, "code": code, "time": datetime.now(UTC).isoformat()})
