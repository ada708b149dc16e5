"""The journal compared with taps/: which tap tests there are, and which of them cannot be used."""

from __future__ import annotations

import errno
import hashlib
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from acquisition import Remark
from lobewatch.machine.journal.doubtful import read_doubtful
from lobewatch.machine.journal.event import MaintenanceEvent, events_of
from lobewatch.machine.journal.exclusion import reasons_of
from lobewatch.machine.journal.heard_cut import HeardCut, RecordedAs, cuts_of
from lobewatch.machine.journal.journal import JOURNAL, Reading, command, journal_damage
from lobewatch.machine.journal.tap_entry import TapEntry, tap_entries

PROVED_BYTES, PROVED_FILES = 10_000_000, 50
"""Tap files whose SHA-256 is compared whenever a machine is looked at, the newest first, as long as they are neither
more bytes nor more files; lobewatch verify takes all."""


@dataclass(frozen=True)
class FolderContents:
    """What a folder holds."""

    taps: tuple[TapEntry, ...]
    """Tap tests whose files are as they were committed, oldest first by their time."""
    lost: tuple[TapEntry, ...]
    """Committed ones that cannot be used, likewise."""
    remarks: tuple[Remark, ...]
    """What is wrong."""
    events: tuple[MaintenanceEvent, ...] = ()
    """What was done to the machine, oldest first."""
    lines: int = 0
    """Of the journal."""
    cuts: tuple[HeardCut, ...] = ()
    """Test cuts, oldest first, those that a person has taken out too."""

    def with_one_more(self, entry: TapEntry) -> FolderContents:
        """The same with a tap test that was just committed, and nothing else since."""
        is_newest = not self.taps or _time(self.taps[-1]) <= _time(entry)
        taps = (*self.taps, entry) if is_newest else _oldest_first([*self.taps, entry])
        return replace(self, taps=taps, lines=self.lines + 1)

    @property
    def baselines(self) -> list[datetime]:
        """When all comparing began anew, oldest first."""
        return [event.time for event in self.events if event.new_baseline]


def contents_of(folder: Path, reading: Reading) -> FolderContents:
    """What the journal and taps/ say together; reading: of the journal."""
    committed = listed(reading)
    remarks, taps, lost = [*reading.damage], list[TapEntry](), list[TapEntry]()
    events = events_of(reading.others)
    sizes, without, proved = _sizes(folder), given_up(reading), 0
    for count, entry in enumerate(reversed(_oldest_first(committed.values()))):
        proved += entry.size
        is_old = proved > PROVED_BYTES or count >= PROVED_FILES
        wrong = "" if is_old and sizes.get(entry.id) == entry.size else fault_of(folder, entry)
        (lost if wrong else taps).append(entry)
        if wrong:
            remarks.append(about_lost(folder, entry, wrong, entry.id in without))
    taps.reverse()
    extra = [folder / "taps" / f"{name}.h5" for name in sorted(sizes.keys() - committed.keys())]
    missing = not reading.lines and not reading.damage and any(_is_unexplained(folder, path) for path in extra)
    if missing:
        remarks.append(no_journal(folder, len(extra)))
    if reading.damage or missing:
        found = [(path, read_doubtful(path)) for path in extra]
        found_too = [entry for path, entry in found if entry is not None and entry.id == path.stem]
        taps = [*_oldest_first([*taps, *found_too])]
    else:
        cure = f"{command('verify', folder)} says what it is and what to do"
        remarks += [unlisted(path, "not in the journal, does not count", cure) for path in extra]
    return FolderContents(tuple(taps), _oldest_first(lost), tuple(remarks), events, len(reading.lines), heard(reading))


def heard(reading: Reading) -> tuple[HeardCut, ...]:
    """The test cuts of the journal, oldest first."""
    return cuts_of(reading.others, reasons_of(reading.others))


def listed(reading: Reading) -> dict[str, TapEntry]:
    """The tap tests of the journal by identity."""
    accepted: dict[str, tuple[str, ...]] = {}
    excluded = reasons_of(reading.others)
    for line in reading.others:
        if line["kind"] == "accept":
            accepted[line["tap"]] = (*accepted.get(line["tap"], ()), line["code"])
    found = {entry.id: entry for entry in tap_entries(reading.taps, accepted, excluded)}
    for line in reading.others:
        if line["kind"] == "tap":
            found[line["id"]] = TapEntry.from_line(line, accepted.get(line["id"], ()), excluded.get(line["id"], ""))
    return found


def _sizes(folder: Path) -> dict[str, int]:
    """Sizes (bytes) of the files in taps/ that could be tap tests, by identity."""
    if not (folder / "taps").is_dir():
        return {}
    with os.scandir(folder / "taps") as found:
        files = [one for one in found if one.name.endswith(".h5") and not one.name.startswith(".")]
        return {one.name[:-3]: one.stat().st_size for one in files}


def tap_files(folder: Path) -> Mapping[str, Path]:
    """The files in taps/ that could be tap tests, by identity."""
    found = folder / "taps"
    files = sorted(found.glob("*.h5")) if found.is_dir() else []
    return {path.stem: path for path in files if not path.name.startswith(".")}


def fault_of(folder: Path, entry: TapEntry | RecordedAs) -> str:
    """What is wrong with the file of a tap test or of a cut; empty where nothing is.

    OSError where this program can open no more files.
    """
    try:
        with open(f"{folder}/{entry.file}", "rb", buffering=0) as file:  # noqa: PTH123 - of dozens at every look
            size = os.fstat(file.fileno()).st_size
            if size != entry.size:
                return f"{size} bytes, not {entry.size} as when it was written"
            found = hashlib.sha256(file.read()).hexdigest()
        if found != entry.sha256:
            return "altered since it was written (SHA-256 differs)"
    except FileNotFoundError:
        return "named in the journal but missing"
    except OSError as error:
        if error.errno in (errno.EMFILE, errno.ENFILE):  # nothing is said of this file
            raise
        return f"cannot be read ({os.strerror(error.errno or 0)})"
    return ""


def about_lost(folder: Path, entry: TapEntry, wrong: str, is_given_up: bool = False) -> Remark:
    """That a tap test cannot be used."""
    told = f"{wrong}; results are those of the other tap tests"
    if is_given_up:
        return Remark("tap-lost", entry.file, told)
    cure = f"put it back from a backup; without one, {command('rebuild', folder)} goes on without it"
    return Remark("tap-damaged", entry.file, told, cure)


def no_journal(folder: Path, count: int) -> Remark:
    """That tap files lie there alone."""
    return journal_damage(folder / JOURNAL, f"is missing beside {count} tap file{'s' if count > 1 else ''}")


def is_explained(folder: Path, entry: TapEntry) -> bool:
    """Whether a tap file without a line is what an ended program leaves: its hits or its recording are still there."""
    return bool(entry.source_sha256) or (folder / "spool" / entry.id).is_dir()


def _is_unexplained(folder: Path, path: Path) -> bool:
    if (folder / "spool" / path.stem).is_dir():
        return False
    entry = read_doubtful(path)
    return entry is None or not is_explained(folder, entry)


def unlisted(path: Path, text: str, cure: str) -> Remark:
    """That a file in taps/ is in no journal."""
    return Remark("tap-unlisted", f"taps/{path.name}", text, cure)


def given_up(reading: Reading) -> set[str]:
    """Tap tests that `lobewatch rebuild` went on without."""
    return {line["tap"] for line in reading.others if line["kind"] == "lost"}


def _oldest_first(entries: Iterable[TapEntry]) -> tuple[TapEntry, ...]:
    return tuple(sorted(entries, key=_time))


def _time(entry: TapEntry) -> datetime:
    return datetime.fromisoformat(entry.time)
