"""Every file of a machine against what was written: what is altered, missing, extra, swapped, renamed, cut short."""

from __future__ import annotations

import contextlib
import difflib
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from acquisition import DataError, Remark
from lobewatch.machine.archive.told import damaged, set_aside
from lobewatch.machine.archive.verify_cuts import about_cuts
from lobewatch.machine.archive.verify_spool import about_spool
from lobewatch.machine.contents import (
    about_lost,
    fault_of,
    given_up,
    heard,
    is_explained,
    listed,
    no_journal,
    tap_files,
    unlisted,
)
from lobewatch.machine.folder import BusyError, MachineFolder
from lobewatch.machine.journal.doubtful import read_doubtful
from lobewatch.machine.journal.journal import COPY, JOURNAL, Journal, Reading, command
from lobewatch.machine.journal.tap_entry import TapEntry
from lobewatch.machine.known_devices import read_known_devices
from lobewatch.machine.rows import read_rows

DAMAGE = ("journal-damaged", "tap-damaged", "tap-unlisted", "file-damaged", "cut-damaged", "cut-unlisted")
"""Codes of remarks that are damage; all others are to be known."""
OURS = (
    JOURNAL,
    COPY,
    "machine.toml",
    "history.rows",
    "daq.json",
    "standing.json",
    "unsent.json",
    "report.html",
    ".lock",
    "taps",
    "cuts",
    "spool",
)


@dataclass(frozen=True)
class Verification:
    """What was found."""

    remarks: tuple[Remark, ...]
    """All that is to be said."""
    adopted: tuple[str, ...]
    """Tap files that an ended program had not entered in the journal; they are now."""
    n_taps: int
    """Tap files that are as they were committed."""

    @property
    def damage(self) -> tuple[Remark, ...]:
        """What is not as it was written."""
        return tuple(remark for remark in self.remarks if remark.code in DAMAGE)


def verify(path: Path) -> Verification:
    """Look at every byte; a whole tap file that its spool or its recording explains is entered in the journal.

    DataError where this is no machine folder.
    """
    if not (path / "machine.toml").is_file() and tap_files(path):
        cure = (
            f"put it back from a backup; without one, {command('rebuild', path)} takes the copy in the newest tap test"
        )
        return Verification((damaged("machine.toml", "is missing beside tap tests", cure),), (), 0)
    folder = MachineFolder(path)
    journal = folder.journal
    adopted = enter_explained(folder)
    reading = journal.read()
    committed = listed(reading)
    wrong = {name: fault for name, entry in committed.items() if (fault := fault_of(path, entry))}
    remarks = [
        *reading.damage,
        *_about_taps(path, reading, committed, wrong),
        *about_cuts(path, heard(reading), given_up(reading), command("rebuild", path)),
        *_about_machine_file(folder, [entry for name, entry in committed.items() if name not in wrong]),
        *_about_history(folder),
        *_about_devices(folder),
        *about_spool(path, committed.keys() - wrong.keys()),
        *_about_others(path),
    ]
    return Verification(tuple(remarks), tuple(adopted), len(committed) - len(wrong))


def enter_explained(folder: MachineFolder) -> list[str]:
    """Enter in the journal what an ended program has stored and not entered: its files.

    Nothing where another program writes, the journal is damaged, or the folder cannot be written.
    """
    journal, adopted = folder.journal, list[str]()
    try:
        with folder.locked():
            committed = set(listed(journal.read()))
            for name, path in tap_files(folder.path).items():
                entry = read_doubtful(path) if name not in committed else None
                if entry is not None and entry.id == name and is_explained(folder.path, entry):
                    journal.append(entry.line)
                    adopted.append(entry.file)
    except (BusyError, DataError, OSError):
        return adopted
    return adopted


def _about_taps(
    folder: Path, reading: Reading, committed: dict[str, TapEntry], wrong: dict[str, str]
) -> Iterator[Remark]:
    contents, without = {entry.sha256: entry for entry in committed.values()}, given_up(reading)
    files = tap_files(folder)
    late = listed(Journal(folder).read())  # what another program has committed meanwhile
    extra = [path for name, path in files.items() if name not in committed and name not in late]
    if not reading.lines and not reading.damage and extra:
        yield no_journal(folder, len(extra))
    for name, fault in wrong.items():
        entry, path = committed[name], folder / committed[name].file
        other = contents.get(_sha256(path)) if path.is_file() else None
        told = f"it is {other.file} under another name" if other else fault
        yield about_lost(folder, entry, told, name in without and not path.exists())
    for path in extra:
        other = contents.get(_sha256(path))
        yield _about_extra(folder, path, other, other is not None and other.id in wrong)


def _about_extra(folder: Path, path: Path, other: TapEntry | None, is_needed: bool) -> Remark:
    mend = command("rebuild", folder)
    if other is not None and is_needed:
        return unlisted(path, f"it is {other.file} under another name", f"{mend} gives it its name back")
    if other is not None:
        return unlisted(path, f"a copy of {other.file}", f"{mend} puts it out of the way")
    entry = read_doubtful(path)
    if entry is None:
        return unlisted(path, "no whole tap file, and not in the journal", f"{mend} puts it out of the way")
    if entry.id != path.stem:
        return unlisted(path, f"it is tap test {entry.id}", f"{mend} gives it its name and takes it in")
    if is_explained(folder, entry):
        cure = f"{command('verify', folder)} enters it where nobody else writes"
        return Remark(
            "not-entered", f"taps/{path.name}", "not entered in the journal by the program that wrote it", cure
        )
    cure = f"take it out of taps/ where it does not belong here, else {mend} takes it in"
    return unlisted(path, "a whole tap file that is not in the journal", cure)


def _about_machine_file(folder: MachineFolder, sound: list[TapEntry]) -> Iterator[Remark]:
    """Compared with the copy in the newest tap test."""
    try:
        _ = folder.machine
    except (ValueError, OSError) as error:
        cure = (
            "correct it; without a way to, move it away: lobewatch rebuild then takes the copy in the newest tap test"
        )
        yield damaged("machine.toml", str(error), cure)
        return
    newest = max(sound, key=lambda entry: entry.time, default=None)
    then = ""
    with contextlib.suppress(DataError):  # a newer lobewatch has written it
        then = folder.read(newest).circumstances.machine_toml if newest else ""
    now = folder.toml.read_text("utf-8")
    if newest is not None and then and now != then:
        changed = [line for line in difflib.ndiff(then.splitlines(), now.splitlines()) if line[:2] in ("+ ", "- ")]
        first = changed[0] if changed else "line ends"
        text = f"{len(changed)} lines differ from the copy in {newest.file}, first: {first}"
        yield Remark("machine-file-edited", "machine.toml", text)


def _about_history(folder: MachineFolder) -> Iterator[Remark]:
    if folder.history.exists() and read_rows(folder.history).is_damaged:
        cure = f"{command('rebuild', folder.path)} makes it anew, and so does any command that reads it"
        yield damaged(folder.history.name, "altered since it was written", cure)


def _about_devices(folder: MachineFolder) -> Iterator[Remark]:
    try:
        read_known_devices(folder)
    except DataError as error:
        yield damaged("daq.json", str(error).removeprefix(f"{folder.path / 'daq.json'}: "))


def _about_others(folder: Path) -> Iterator[Remark]:
    for path in sorted(folder.iterdir()):
        if path.suffix in (".tmp", ".torn", ".damaged") or path.name == "damaged":
            yield set_aside(path.name, "left over or set aside", "delete it when you do not need it")
        elif path.name == "report.html":
            yield Remark(
                "not-verified", path.name, "a report is not verified", command("report", folder) + " writes it anew"
            )
        elif path.name == "history.h5":
            yield Remark(
                "not-verified", path.name, "no cache any more, or an export", "delete it when you do not need it"
            )
        elif path.name not in OURS:
            yield Remark("not-verified", path.name, "no file of lobewatch")
    taps = folder / "taps"
    for path in sorted(taps.iterdir()) if taps.is_dir() else []:
        if path.name not in {file.name for file in tap_files(folder).values()}:
            yield Remark("not-verified", f"taps/{path.name}", "no tap file, does not count", "take it out of taps/")


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
