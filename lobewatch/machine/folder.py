"""Machine folder: machine.toml, taps/, journal.jsonl, spool/ and history.rows."""

import shutil
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import msgspec

from acquisition import DataError, Remark, TapTest, read_tap, write_tap
from acquisition.file_io import make_folder, sync_folder
from lobewatch.machine import folder_contents
from lobewatch.machine.folder_files import compute_change_mark, format_path, to_folder_path
from lobewatch.machine.folder_lock import LOCK_TIMEOUT, FolderLock
from lobewatch.machine.journal.journal import Journal, JournalReading, format_command, make_entry
from lobewatch.machine.journal.tap_entry import DamagedTapError, TapEntry
from lobewatch.machine.settings.machine_file import Machine, read_machine_file
from lobewatch.machine.settings.toml import read_toml_text


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
            If this is no machine folder, or its name is no UTF-8.
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
            raise DataError(f"{format_path(path)}: the name of the folder is no UTF-8; rename it")
        if not self.toml.exists() and folder_contents.list_tap_files(self.path):
            mend = f"{format_command('rebuild', self.path)} takes the copy in the newest of them"
            raise DataError(f"{self.toml}: is missing beside tap tests; put it back from a backup; without one, {mend}")
        if not self.toml.exists():
            cure = f"make a machine folder with: folder_files.make_machine_folder {self.path}"
            raise DataError(f"{self.path}: no machine.toml in it; {cure}")

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

    def contents(self) -> folder_contents.FolderContents:
        """Read the committed tap tests and the state of their files."""
        return folder_contents.read_folder_contents(self.path, self.journal.read())

    def taps(self) -> list[TapEntry]:
        """Return the usable tap tests, oldest first."""
        return list(self.contents().taps)

    @property
    def committed_ids(self) -> set[str]:
        """Identities of all tap tests in the journal."""
        return set(folder_contents.read_committed_taps(self.journal.read()))

    def refuse_damage(self) -> JournalReading:
        """Read the journal; DataError if it must be repaired before writing."""
        reading = self.journal.read()
        self.journal.refuse_damage(reading)
        if not reading.lines and any(remark.code == "journal-damaged" for remark in self.contents().remarks):
            missing = folder_contents.missing_journal_remark(self.path, len(folder_contents.list_tap_files(self.path)))
            self.journal.refuse_damage(replace(reading, damage=(missing,)))
        return reading

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
        fault = folder_contents.find_file_fault(self.path, entry)
        if fault:
            raise DamagedTapError(folder_contents.tap_damage_remark(self.path, entry, fault), entry, self.path)
        path = self.path / entry.file
        try:
            return read_tap(path)
        except DataError as error:
            text = str(error).removeprefix(f"{path}: ")
            raise DamagedTapError(Remark("tap-unreadable", entry.file, text), entry, self.path) from error

    def commit(self, tap: TapTest, asked: Sequence[str] = ()) -> TapEntry:
        """Write the tap file, then its journal line, which lasts on return.

        Parameters
        ----------
        tap
            Tap test.
        asked
            Codes of the questions about its time.

        Raises
        ------
        DataError
            If the journal is damaged; nothing is written then.
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
        """Move finished tap files to taps/ and commit them together; call it under the lock.

        Parameters
        ----------
        files
            Entries by temporary path on the same disk, already synchronized.
        """
        reading = self.refuse_damage()
        for temporary, entry in files.items():
            temporary.replace(self.path / entry.file)
        sync_folder(self.path / "taps")
        self.journal.append(*(entry.line for entry in files.values()), reading=reading)

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
