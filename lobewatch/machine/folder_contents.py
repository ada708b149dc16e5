"""Compare the journal with taps/: usable, damaged and unlisted tap tests."""

from __future__ import annotations

import errno
import hashlib
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from operator import attrgetter
from pathlib import Path

import msgspec

from acquisition import Remark
from acquisition.file_io import open_regular_file, read_regular_file
from lobewatch.machine.journal import entries as journal_entries
from lobewatch.machine.journal.alarm_entries import Acknowledgement, FleetScatter
from lobewatch.machine.journal.cut_entry import CUT_LINE_KIND, CutEntry, RecordingFile, parse_cut_line
from lobewatch.machine.journal.journal import JOURNAL_NAME, JournalReading, format_command, journal_damage_remark
from lobewatch.machine.journal.tap_entry import FIELDS_OF_OTHER_LINES, NO_MODE_EDITS, TapEntry, decode_tap_entries
from lobewatch.machine.journal.unverified_tap import read_unverified_tap
from modal import ModeEdits

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

    def with_tap(self, entry: TapEntry) -> FolderContents:
        """Return the contents with a newly committed tap test."""
        is_newest = not self.taps or self.taps[-1].created <= entry.created
        taps = (*self.taps, entry) if is_newest else _sort_by_time([*self.taps, entry])
        return replace(self, taps=taps, line_count=self.line_count + 1)

    @property
    def baselines(self) -> list[datetime]:
        """Times of new baselines, oldest first."""
        return [event.time for event in self.events if event.new_baseline]


def read_folder_contents(folder: Path, reading: JournalReading) -> FolderContents:
    """Read the contents that the journal and taps/ prove together."""
    committed = read_committed_taps(reading)
    remarks, taps, lost = [*reading.damage], list[TapEntry](), list[TapEntry]()
    sizes, given_up, proved = _list_tap_sizes(folder), read_given_up_ids(reading), 0
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
        whole = [entry for path in extra if (entry := read_unverified_tap(path)) and entry.id == path.stem]
        taps = [*_sort_by_time([*taps, *whole])]
    else:
        cure = f"{format_command('verify', folder)} says what it is and what to do"
        text = "not in the journal, does not count"
        remarks += [unlisted_file_remark(path, text, cure) for path in extra[:MAX_LISTED_FILES]]
        if extra[MAX_LISTED_FILES:]:
            text = f"{len(extra) - MAX_LISTED_FILES} more files that are not in the journal, they do not count"
            remarks.append(Remark("tap-unlisted", "taps", text, cure))
    lines = reading.other_entries
    acknowledged = tuple(msgspec.convert(line, Acknowledgement) for line in lines if line["kind"] == "ack")
    scatters = tuple(msgspec.convert(line, FleetScatter) for line in lines if line["kind"] == "scatter")
    others = len(reading.lines), read_committed_cuts(reading), acknowledged, scatters
    tests = tuple(taps), _sort_by_time(lost), tuple(remarks)
    return FolderContents(*tests, journal_entries.read_events(lines), *others)


def read_committed_cuts(reading: JournalReading) -> tuple[CutEntry, ...]:
    """Read the test cuts of the journal, oldest first."""
    excluded = journal_entries.read_exclusion_reasons(reading.other_entries)
    lines = {line["id"]: line for line in reading.other_entries if line["kind"] == CUT_LINE_KIND}
    cuts = [parse_cut_line(line, excluded.get(name, "")) for name, line in lines.items()]
    return tuple(sorted(cuts, key=attrgetter("at")))


def read_committed_taps(reading: JournalReading) -> dict[str, TapEntry]:
    """Read the tap tests of the journal by identity."""
    accepted, lines = dict[str, tuple[str, ...]](), reading.other_entries
    for line in lines:
        if line["kind"] == "accept":
            accepted[line["tap"]] = (*accepted.get(line["tap"], ()), line["code"])
    excluded = journal_entries.read_exclusion_reasons(lines)
    by_hand = {line["tap"]: msgspec.convert(line, ModeEdits) for line in lines if line["kind"] == "modes"}
    old = (TapEntry.from_line(line) for line in lines if line["kind"] == "tap")
    entries = {entry.id: entry for entry in (*decode_tap_entries(reading.tap_lines), *old)}
    for name in entries.keys() & (accepted.keys() | excluded.keys() | by_hand.keys()):
        later = accepted.get(name, ()), excluded.get(name, ""), by_hand.get(name, NO_MODE_EDITS)
        changes = dict(zip(FIELDS_OF_OTHER_LINES, later, strict=True))
        entries[name] = msgspec.structs.replace(entries[name], **changes)
    return entries


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


def hash_file(path: Path) -> str:
    """Return the SHA-256 of a file; empty if it cannot be read."""
    try:
        return hashlib.sha256(read_regular_file(path)).hexdigest()
    except OSError:
        return ""


def tap_damage_remark(folder: Path, entry: TapEntry, fault: str, is_given_up: bool = False) -> Remark:
    """Return the remark on a tap test with a damaged file."""
    text = f"{fault}; results are those of the other tap tests"
    if is_given_up:
        return Remark("tap-lost", entry.file, text)
    cure = f"put it back from a backup; without one, {format_command('rebuild', folder)} goes on without it"
    return Remark("tap-damaged", entry.file, text, cure)


def missing_journal_remark(folder: Path, count: int) -> Remark:
    """Return the remark on tap files without a journal."""
    return journal_damage_remark(folder / JOURNAL_NAME, f"is missing beside {count} tap file{'s' if count > 1 else ''}")


def has_known_origin(folder: Path, entry: TapEntry) -> bool:
    """Tell whether a tap file without a line comes from an interrupted program whose hits or recording exist."""
    return bool(entry.source_sha256) or (folder / "spool" / entry.id).is_dir()


def _lacks_known_origin(folder: Path, path: Path) -> bool:
    if (folder / "spool" / path.stem).is_dir():
        return False
    entry = read_unverified_tap(path)
    return entry is None or not has_known_origin(folder, entry)


def unlisted_file_remark(path: Path, text: str, cure: str) -> Remark:
    """Return the remark on a file in taps/ without a line."""
    return Remark("tap-unlisted", f"taps/{path.name}", text, cure)


def read_given_up_ids(reading: JournalReading) -> set[str]:
    """Return the identities of lost tap tests and recordings."""
    return {line["tap"] for line in reading.other_entries if line["kind"] == "lost"}


def _sort_by_time(entries: Iterable[TapEntry]) -> tuple[TapEntry, ...]:
    return tuple(sorted(entries, key=attrgetter("created")))
