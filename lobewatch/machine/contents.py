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
from acquisition.regular_file import open_regular, read_regular
from lobewatch.machine.journal.acknowledgement import Acknowledgement, acknowledgements_of
from lobewatch.machine.journal.doubtful import read_doubtful
from lobewatch.machine.journal.event import MaintenanceEvent, events_of
from lobewatch.machine.journal.exclusion import exclusion_reasons
from lobewatch.machine.journal.heard_cut import HeardCut, RecordingFile, cuts_of
from lobewatch.machine.journal.journal import JOURNAL, Reading, command, journal_damage
from lobewatch.machine.journal.known_scatter import KnownScatter, known_scatters_of
from lobewatch.machine.journal.mode_choice import mode_choices
from lobewatch.machine.journal.tap_entry import BY_FIT, TapEntry, tap_entries

PROVED_BYTES, PROVED_FILES = 10_000_000, 50
"""Tap files whose SHA-256 is compared whenever a machine is looked at, the newest first, as long as they are neither
more bytes nor more files; lobewatch verify takes all."""
NAMED = 20
"""Files without a line that are named one by one; chosen."""


@dataclass(frozen=True)
class FolderContents:
    """Tap tests, test cuts and events of a machine folder."""

    taps: tuple[TapEntry, ...]
    """Tap tests whose files are as they were committed, oldest first by their time."""
    lost: tuple[TapEntry, ...]
    """Committed tap tests that cannot be used, likewise."""
    remarks: tuple[Remark, ...]
    """Remarks on what is wrong."""
    events: tuple[MaintenanceEvent, ...] = ()
    """Maintenance of the machine, oldest first."""
    lines: int = 0
    """Number of lines of the journal."""
    cuts: tuple[HeardCut, ...] = ()
    """Test cuts, oldest first, those that a person has taken out too."""
    acknowledgements: tuple[Acknowledgement, ...] = ()
    """What a person has acknowledged, oldest first."""
    scatters: tuple[KnownScatter, ...] = ()
    """What the other machines told of its scatter, oldest first."""

    def with_one_more(self, entry: TapEntry) -> FolderContents:
        """Contents with a tap test that was just committed, and nothing else since."""
        is_newest = not self.taps or _time(self.taps[-1]) <= _time(entry)
        taps = (*self.taps, entry) if is_newest else _oldest_first([*self.taps, entry])
        return replace(self, taps=taps, lines=self.lines + 1)

    @property
    def baselines(self) -> list[datetime]:
        """Times at which all comparing began anew, oldest first."""
        return [event.time for event in self.events if event.new_baseline]


def contents_of(folder: Path, reading: Reading) -> FolderContents:
    """Contents that the journal and taps/ prove together; reading: of the journal."""
    committed = committed_taps(reading)
    remarks, taps, lost = [*reading.damage], list[TapEntry](), list[TapEntry]()
    events = events_of(reading.others)
    sizes, given_up, proved = _sizes(folder), ids_given_up(reading), 0
    for count, entry in enumerate(reversed(_oldest_first(committed.values()))):
        proved += entry.size
        is_old = proved > PROVED_BYTES or count >= PROVED_FILES
        fault = "" if is_old and sizes.get(entry.id) == entry.size else fault_of(folder, entry)
        (lost if fault else taps).append(entry)
        if fault:
            remarks.append(tap_damage(folder, entry, fault, entry.id in given_up))
    taps.reverse()
    extra = [folder / "taps" / f"{name}.h5" for name in sorted(sizes.keys() - committed.keys())]
    missing = not reading.lines and not reading.damage and any(_is_unexplained(folder, path) for path in extra)
    if missing:
        remarks.append(missing_journal(folder, len(extra)))
    if reading.damage or missing:
        doubtful = [(path, read_doubtful(path)) for path in extra]
        whole = [entry for path, entry in doubtful if entry is not None and entry.id == path.stem]
        taps = [*_oldest_first([*taps, *whole])]
    else:
        cure = f"{command('verify', folder)} says what it is and what to do"
        remarks += [unlisted_file(path, "not in the journal, does not count", cure) for path in extra[:NAMED]]
        if extra[NAMED:]:
            text = f"{len(extra) - NAMED} more files that are not in the journal, they do not count"
            remarks.append(Remark("tap-unlisted", "taps", text, cure))
    cuts = committed_cuts(reading)
    words = acknowledgements_of(reading.others), known_scatters_of(reading.others)
    return FolderContents(tuple(taps), _oldest_first(lost), tuple(remarks), events, len(reading.lines), cuts, *words)


def committed_cuts(reading: Reading) -> tuple[HeardCut, ...]:
    """Test cuts of the journal, oldest first."""
    return cuts_of(reading.others, exclusion_reasons(reading.others))


def committed_taps(reading: Reading) -> dict[str, TapEntry]:
    """Tap tests of the journal by identity."""
    accepted: dict[str, tuple[str, ...]] = {}
    for line in reading.others:
        if line["kind"] == "accept":
            accepted[line["tap"]] = (*accepted.get(line["tap"], ()), line["code"])
    excluded, by_hand = exclusion_reasons(reading.others), mode_choices(reading.others)
    entries = {entry.id: entry for entry in tap_entries(reading.taps, accepted, excluded, by_hand)}
    for line in reading.others:
        if line["kind"] == "tap":
            name = line["id"]
            later = accepted.get(name, ()), excluded.get(name, ""), by_hand.get(name, BY_FIT)
            entries[name] = TapEntry.from_line(line, *later)
    return entries


def _sizes(folder: Path) -> dict[str, int]:
    """Sizes (bytes) of the files in taps/ that could be tap tests, by identity."""
    if not (folder / "taps").is_dir():
        return {}
    with os.scandir(folder / "taps") as listing:
        files = [file for file in listing if file.name.endswith(".h5") and not file.name.startswith(".")]
        return {file.name[:-3]: file.stat().st_size for file in files}


def tap_files(folder: Path) -> Mapping[str, Path]:
    """Files in taps/ that could be tap tests, by identity."""
    taps = folder / "taps"
    files = sorted(taps.glob("*.h5")) if taps.is_dir() else []
    return {path.stem: path for path in files if not path.name.startswith(".")}


def fault_of(folder: Path, entry: TapEntry | RecordingFile) -> str:
    """Fault of the file of a tap test or of a cut; empty where it is as it was written.

    OSError where this program can open no more files.
    """
    try:
        with open_regular(f"{folder}/{entry.file}") as file:
            size = os.fstat(file.fileno()).st_size
            if size != entry.size:
                return f"{size} bytes, not {entry.size} as when it was written"
            digest = hashlib.sha256(file.read()).hexdigest()
        if digest != entry.sha256:
            return "altered since it was written (SHA-256 differs)"
    except FileNotFoundError:
        return "named in the journal but missing"
    except OSError as error:
        if error.errno in (errno.EMFILE, errno.ENFILE):  # nothing is said of this file
            raise
        return f"cannot be read ({error.strerror})"
    return ""


def sha256_of(path: Path) -> str:
    """SHA-256 of a file; empty where it cannot be read."""
    try:
        return hashlib.sha256(read_regular(path)).hexdigest()
    except OSError:
        return ""


def tap_damage(folder: Path, entry: TapEntry, fault: str, is_given_up: bool = False) -> Remark:
    """Remark on a tap test that cannot be used."""
    text = f"{fault}; results are those of the other tap tests"
    if is_given_up:
        return Remark("tap-lost", entry.file, text)
    cure = f"put it back from a backup; without one, {command('rebuild', folder)} goes on without it"
    return Remark("tap-damaged", entry.file, text, cure)


def missing_journal(folder: Path, count: int) -> Remark:
    """Remark on tap files that lie there alone."""
    return journal_damage(folder / JOURNAL, f"is missing beside {count} tap file{'s' if count > 1 else ''}")


def is_explained(folder: Path, entry: TapEntry) -> bool:
    """Whether a tap file without a line is what an ended program leaves: its hits or its recording are still there."""
    return bool(entry.source_sha256) or (folder / "spool" / entry.id).is_dir()


def _is_unexplained(folder: Path, path: Path) -> bool:
    if (folder / "spool" / path.stem).is_dir():
        return False
    entry = read_doubtful(path)
    return entry is None or not is_explained(folder, entry)


def unlisted_file(path: Path, text: str, cure: str) -> Remark:
    """Remark on a file in taps/ that is in no journal."""
    return Remark("tap-unlisted", f"taps/{path.name}", text, cure)


def ids_given_up(reading: Reading) -> set[str]:
    """Identities of the tap tests and recordings that `lobewatch rebuild` went on without."""
    return {line["tap"] for line in reading.others if line["kind"] == "lost"}


def _oldest_first(entries: Iterable[TapEntry]) -> tuple[TapEntry, ...]:
    return tuple(sorted(entries, key=_time))


def _time(entry: TapEntry) -> datetime:
    return datetime.fromisoformat(entry.time)
