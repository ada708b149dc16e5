"""Every file of a machine against what was written: what is altered, missing, extra, swapped, renamed, cut short."""

from __future__ import annotations

import contextlib
import difflib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from acquisition import DataError, Remark
from acquisition.errors import failure_text
from lobewatch.machine.archive.cut_recordings import verify_cuts
from lobewatch.machine.archive.verify_spool import damaged_file, file_set_aside, verify_spool
from lobewatch.machine.contents import (
    committed_cuts,
    committed_taps,
    fault_of,
    ids_given_up,
    is_explained,
    missing_journal,
    sha256_of,
    tap_damage,
    tap_files,
    unlisted_file,
)
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_lock import HOLDER, LOCK
from lobewatch.machine.journal.doubtful import read_doubtful
from lobewatch.machine.journal.journal import COPY, JOURNAL, Journal, Reading, command
from lobewatch.machine.journal.tap_entry import TapEntry
from lobewatch.machine.known_devices import read_known_devices
from lobewatch.machine.rows import read_rows

DAMAGE = ("journal-damaged", "tap-damaged", "tap-unlisted", "file-damaged", "cut-damaged", "cut-unlisted")
"""Codes of remarks that are damage; those of all others are for information."""
OURS = (
    JOURNAL,
    COPY,
    "machine.toml",
    "history.rows",
    "daq.json",
    "standing.json",
    "told.json",
    "unsent.json",
    "report.html",
    LOCK,
    HOLDER,
    "taps",
    "cuts",
    "spool",
)
"""Names in the folder of a machine that lobewatch gives."""


@dataclass(frozen=True)
class Verification:
    """State of the files of a machine."""

    remarks: tuple[Remark, ...]
    """Remarks on all files, damage and information."""
    adopted: tuple[str, ...]
    """Tap files that an ended program had not entered in the journal; they are now."""
    n_taps: int
    """Tap files that are as they were committed."""

    @property
    def damage(self) -> tuple[Remark, ...]:
        """Remarks on what is not as it was written."""
        return tuple(remark for remark in self.remarks if remark.code in DAMAGE)


def verify(path: Path) -> Verification:
    """Look at every byte; a whole tap file that its spool or its recording explains is entered in the journal.

    DataError where this is no machine folder.
    """
    if not (path / "machine.toml").is_file() and tap_files(path):
        cure = (
            f"put it back from a backup; without one, {command('rebuild', path)} takes the copy in the newest tap test"
        )
        missing = damaged_file("machine.toml", "is missing beside tap tests", cure)
        return Verification((missing,), (), 0)
    folder = MachineFolder(path)
    journal = folder.journal
    adopted = enter_explained(folder)
    reading = journal.read()
    committed = committed_taps(reading)
    faults = {name: fault for name, entry in committed.items() if (fault := fault_of(path, entry))}
    remarks = [
        *reading.damage,
        *_verify_taps(path, reading, committed, faults),
        *verify_cuts(path, committed_cuts(reading), ids_given_up(reading), command("rebuild", path)),
        *_verify_machine_file(folder, [entry for name, entry in committed.items() if name not in faults]),
        *_verify_history(folder),
        *_verify_devices(folder),
        *verify_spool(path, committed.keys() - faults.keys()),
        *_verify_names(path),
    ]
    return Verification(tuple(remarks), tuple(adopted), len(committed) - len(faults))


def enter_explained(folder: MachineFolder) -> list[str]:
    """Enter in the journal what an ended program has stored and not entered; the files entered.

    Nothing where another program writes, the journal is damaged, or the folder cannot be written.
    """
    journal, adopted = folder.journal, list[str]()
    try:
        with folder.locked(patience=0):
            committed = set(committed_taps(journal.read()))
            for name, path in tap_files(folder.path).items():
                entry = read_doubtful(path) if name not in committed else None
                if entry is not None and entry.id == name and is_explained(folder.path, entry):
                    journal.append(entry.line)
                    adopted.append(entry.file)
    except (DataError, OSError):
        return adopted
    return adopted


def _verify_taps(
    folder: Path, reading: Reading, committed: dict[str, TapEntry], faults: dict[str, str]
) -> Iterator[Remark]:
    by_content, given_up = {entry.sha256: entry for entry in committed.values()}, ids_given_up(reading)
    files = tap_files(folder)
    late = committed_taps(Journal(folder).read())  # what another program has committed meanwhile
    extra = [path for name, path in files.items() if name not in committed and name not in late]
    if not reading.lines and not reading.damage and extra:
        yield missing_journal(folder, len(extra))
    for name, fault in faults.items():
        entry, path = committed[name], folder / committed[name].file
        namesake = by_content.get(sha256_of(path))
        text = f"it is {namesake.file} under another name" if namesake else fault
        yield tap_damage(folder, entry, text, name in given_up and not path.exists())
    for path in extra:
        original = by_content.get(sha256_of(path))
        yield _extra_file(folder, path, original, original is not None and original.id in faults)


def _extra_file(folder: Path, path: Path, original: TapEntry | None, is_needed: bool) -> Remark:
    """Remark on a tap file without a line; original: the committed tap test with the same content."""
    mend = command("rebuild", folder)
    if original is not None and is_needed:
        return unlisted_file(path, f"it is {original.file} under another name", f"{mend} gives it its name back")
    if original is not None:
        return unlisted_file(path, f"a copy of {original.file}", f"{mend} puts it out of the way")
    entry = read_doubtful(path)
    if entry is None:
        return unlisted_file(path, "no whole tap file, and not in the journal", f"{mend} puts it out of the way")
    if entry.id != path.stem:
        return unlisted_file(path, f"it is tap test {entry.id}", f"{mend} gives it its name and takes it in")
    if is_explained(folder, entry):
        cure = f"{command('verify', folder)} enters it where nobody else writes"
        return Remark(
            "not-entered", f"taps/{path.name}", "not entered in the journal by the program that wrote it", cure
        )
    cure = f"take it out of taps/ where it does not belong here, else {mend} takes it in"
    return unlisted_file(path, "a whole tap file that is not in the journal", cure)


def _verify_machine_file(folder: MachineFolder, sound: list[TapEntry]) -> Iterator[Remark]:
    """Remarks on machine.toml, compared with the copy in the newest tap test."""
    try:
        _ = folder.machine
    except (ValueError, OSError) as error:
        cure = (
            "correct it; without a way to, move it away: lobewatch rebuild then takes the copy in the newest tap test"
        )
        yield damaged_file("machine.toml", failure_text(error), cure)
        return
    newest = max(sound, key=lambda entry: entry.time, default=None)
    copy = ""
    with contextlib.suppress(DataError):  # a newer lobewatch has written it
        copy = folder.read(newest).circumstances.machine_toml if newest else ""
    text = folder.toml_text
    if newest is not None and copy and text != copy:
        differences = list(difflib.unified_diff(copy.splitlines(), text.splitlines(), n=0, lineterm=""))[2:]
        changed = [f"{line[0]} {line[1:]}" for line in differences if line[0] in "+-"]
        first = changed[0] if changed else "line ends"
        differing = f"{len(changed)} lines differ from the copy in {newest.file}, first: {first}"
        yield Remark("machine-file-edited", "machine.toml", differing)


def _verify_history(folder: MachineFolder) -> Iterator[Remark]:
    fault = ""
    try:
        if folder.history.exists() and read_rows(folder.history).is_damaged:
            fault = "altered since it was written"
    except OSError as error:
        fault = failure_text(error).removeprefix(f"{folder.history}: ")
    if fault:
        cure = f"{command('rebuild', folder.path)} makes it anew, and so does any command that reads it"
        yield damaged_file(folder.history.name, fault, cure)


def _verify_devices(folder: MachineFolder) -> Iterator[Remark]:
    try:
        read_known_devices(folder)
    except (DataError, OSError) as error:
        yield damaged_file("daq.json", failure_text(error).removeprefix(f"{folder.path / 'daq.json'}: "))


def _verify_names(folder: Path) -> Iterator[Remark]:
    for path in sorted(folder.iterdir()):
        if path.suffix in (".tmp", ".torn", ".damaged") or path.name == "damaged":
            yield file_set_aside(path.name, "left over or set aside", "delete it when you do not need it")
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
    taps, files = folder / "taps", {*tap_files(folder).values()}
    for path in sorted(taps.iterdir()) if taps.is_dir() else []:
        if path not in files:
            yield Remark("not-verified", f"taps/{path.name}", "no tap file, does not count", "take it out of taps/")
