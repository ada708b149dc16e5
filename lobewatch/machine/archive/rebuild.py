"""A folder put right as far as its sound files allow; what is damaged is put out of the way, never deleted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from acquisition import DataError, read_tap
from acquisition.atomic import atomic_write, make_folder
from acquisition.regular_file import IrregularFileError, read_regular
from lobewatch.machine.archive.cut_recordings import mend_cuts
from lobewatch.machine.contents import committed_taps, fault_of, ids_given_up, sha256_of, tap_files
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_lock import PATIENCE, FolderLock
from lobewatch.machine.journal.doubtful import read_doubtful
from lobewatch.machine.journal.journal import JOURNAL, Journal
from lobewatch.machine.journal.tap_entry import TapEntry
from lobewatch.machine.known_devices import read_known_devices

ASIDE = "damaged"
"""Name of the folder of what was put out of the way."""
ENTER_AGAIN = (
    "events, exclusions, accepted questions and cuts heard by ear that stood there are lost: enter them again "
    "(lobewatch event, exclude, replay --accept, observe)"
)
"""Advice on corrections that no copy of the journal has."""


def rebuild_files(path: Path) -> list[str]:
    """Mend machine.toml where it is missing, taps/, the journal and daq.json; what was done, a sentence each.

    DataError where this is no machine folder, BusyError where another program writes.
    """
    if not (path / "machine.toml").is_file() and not tap_files(path):
        MachineFolder(path)
    with FolderLock(path).held(PATIENCE):
        journal = Journal(path)
        reading = journal.read()
        committed = committed_taps(reading)
        report = [*_return_misplaced(path, committed)]
        fresh = _take_in_unlisted(path, committed, report)
        if reading.damage or (fresh and not reading.lines):
            journal.rewrite([*reading.entries, *(entry.line for entry in fresh)])
            report.append(f"{JOURNAL}: written anew with {len(reading.entries) + len(fresh)} lines")
            report += _missing_lines(reading.entries, len(fresh))
        else:
            for entry in fresh:
                journal.append(entry.line)
        report += [f"{entry.file}: entered in the journal" for entry in fresh]
        report += _give_up_lost(path, journal)
        report += mend_cuts(path, journal, lambda file: _put_aside(path, file))
        report += [*_restore_machine_file(path), *_mend_devices(path)]
    return report


def _missing_lines(entries: Sequence[Mapping[str, Any]], n_fresh: int) -> Iterator[str]:
    """Lines that no copy of the journal has; n_fresh: tap tests that were entered anew in place of theirs."""
    if not entries:
        yield f"{JOURNAL}: nothing of it or of its copy could be read; {ENTER_AGAIN}"
        return
    numbers = {entry["number"] for entry in entries if "number" in entry}
    first = sum("number" not in entry for entry in entries) + 1  # lines of old versions
    missing = sorted(set(range(first, max(numbers, default=0))) - numbers)
    if len(missing) > n_fresh:
        yield f"{JOURNAL}: of lines {', '.join(map(str, missing))} neither copy is sound; {ENTER_AGAIN}"


def _return_misplaced(folder: Path, committed: dict[str, TapEntry]) -> Iterator[str]:
    """Give files with the content of another tap test back to that where its own is wrong, else put them aside."""
    by_content = {entry.sha256: entry for entry in committed.values()}
    misplaced: dict[Path, TapEntry] = {}
    for path in tap_files(folder).values():
        entry = by_content.get(sha256_of(path))
        if entry is not None and path != folder / entry.file:
            misplaced[path] = entry
    asides = {_put_aside(folder, path): entry for path, entry in misplaced.items()}
    for aside, entry in asides.items():
        if fault_of(folder, entry):
            if (folder / entry.file).exists():
                _put_aside(folder, folder / entry.file)
            atomic_write(folder / entry.file, aside.read_bytes())
            aside.unlink()
            yield f"{entry.file}: given its name back"
        else:
            yield f"{aside.relative_to(folder).as_posix()}: put there, a copy of {entry.file}"


def _take_in_unlisted(folder: Path, committed: dict[str, TapEntry], report: list[str]) -> list[TapEntry]:
    """Give whole tap files without a line their own names and return them; put all others without one aside."""
    entries = []
    for name, path in tap_files(folder).items():
        if name in committed:
            continue
        entry = read_doubtful(path)
        taken = entry is not None and entry.id != name and (folder / entry.file).exists()
        if entry is None or taken or entry.id in committed:
            report.append(f"taps/{path.name}: put into {_put_aside(folder, path).relative_to(folder).as_posix()}")
            continue
        if entry.id != name:
            path.rename(folder / entry.file)
        entries.append(entry)
    return entries


def _give_up_lost(folder: Path, journal: Journal) -> Iterator[str]:
    """Write down that all goes on without the tap tests that cannot be had back."""
    reading = journal.read()
    for name, entry in committed_taps(reading).items():
        if not fault_of(folder, entry):
            continue
        if (folder / entry.file).exists() and not _may_be_sound(folder / entry.file):
            _put_aside(folder, folder / entry.file)
        if name not in ids_given_up(reading):
            journal.append({"kind": "lost", "tap": name, "time": datetime.now(UTC).isoformat()})
            yield f"{entry.file}: lost; all goes on without it, and with it again when it is put back from a backup"


def _may_be_sound(path: Path) -> bool:
    """Whether a file cannot be read just now; it stays where it is."""
    try:
        read_regular(path)
    except IrregularFileError:
        return False
    except OSError:
        return True
    return False


def _restore_machine_file(folder: Path) -> Iterator[str]:
    """Take a missing machine.toml from the newest tap test that has a copy."""
    toml = folder / "machine.toml"
    if toml.exists():
        return
    entries = [entry for entry in committed_taps(Journal(folder).read()).values() if not fault_of(folder, entry)]
    for entry in sorted(entries, key=lambda entry: entry.time, reverse=True):
        text = read_tap(folder / entry.file).circumstances.machine_toml
        if text:
            atomic_write(toml, text.encode())
            yield f"machine.toml: the copy in {entry.file}"
            return
    raise DataError(f"{toml}: is missing, and no tap test has a copy; put it back from a backup")


def _mend_devices(folder: Path) -> Iterator[str]:
    machine = MachineFolder(folder)
    try:
        read_known_devices(machine)
    except DataError:
        aside = _put_aside(folder, folder / "daq.json")
        yield f"daq.json: put into {aside.relative_to(folder).as_posix()}; the rates of DAQs are measured anew"


def _put_aside(folder: Path, path: Path) -> Path:
    """Move a file into the folder of what is damaged, under a name that nothing has there."""
    make_folder(folder / ASIDE)
    aside, number = folder / ASIDE / path.name, 1
    while aside.exists():
        aside, number = folder / ASIDE / f"{path.name}.{number}", number + 1
    return path.replace(aside)
