"""The journal of a machine: a line for each thing that was committed, in two files, so that each proves the other.

A line is JSON with the SHA-256 of the line before it (`previous`), its number (`number`) and a CRC-32 (`crc`). It is
written to journal.jsonl, which is the commit, then to journal.copy.jsonl: after a crash the copy may be one line short,
never longer.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shlex
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import msgspec

from acquisition import DataError, Remark, machine_of, named_in_id
from acquisition.atomic import atomic_write, sync_folder
from acquisition.regular_file import read_regular
from lobewatch.machine.journal.journal_text import Entry, JournalText, crc_of, scan
from lobewatch.machine.journal.tap_entry import TAP_LINE
from lobewatch.machine.settings.toml_text import toml_tables, toml_text

JOURNAL = "journal.jsonl"
COPY = "journal.copy.jsonl"
BATCH = "batch"
"""Key of the number of the first line that was written together with a line; where it was written alone, none."""


@dataclass(frozen=True)
class Reading:
    """Lines that the two files prove together."""

    lines: tuple[bytes, ...]
    """All sound lines, oldest first, without their ends."""
    damage: tuple[Remark, ...]
    """Remarks on what is wrong with the files; until it is mended nothing is written."""
    torn: bytes = b""
    """Remains of a line in journal.jsonl after a crash; count for nothing."""
    tidy: bool = False
    """Whether both files hold just these lines."""

    @cached_property
    def entries(self) -> list[Entry]:
        """The lines as JSON objects."""
        return _decode(self.lines)

    @cached_property
    def taps(self) -> list[bytes]:
        """Lines that `tap_entries` reads."""
        return [line for line in self.lines if line.startswith(TAP_LINE)]

    @cached_property
    def others(self) -> list[Entry]:
        """All other lines as JSON objects."""
        return _decode(line for line in self.lines if not line.startswith(TAP_LINE))


def _decode(lines: Iterable[bytes]) -> list[Entry]:
    entries: list[Entry] = msgspec.json.decode(b"[" + b",".join(lines) + b"]")
    return entries


class Journal:
    """The two files in the folder of a machine."""

    def __init__(self, folder: Path) -> None:
        """Nothing is read yet."""
        self.path, self.copy = folder / JOURNAL, folder / COPY
        self.length = 0
        """Number of lines once this had appended its newest."""
        self._text = JournalText(exists=False)

    def read(self) -> Reading:
        """Read all sound lines of both files, and what is wrong with these; neither need be there."""
        journal = scan(self.path, self._text)
        copy = scan(self.copy, journal)
        self._text = journal
        longer, shorter = sorted((journal.chain, copy.chain), key=len, reverse=True)
        if longer[: len(shorter)] != shorter:
            longer = journal.chain
        damage = [*self._damage_of_journal(journal, copy), *self._damage_of_copy(journal, copy)]
        loose = (*journal.chain, *copy.chain, *journal.loose, *copy.loose) if damage else ()
        lines = tuple(dict.fromkeys((*longer, *loose))) if loose else longer
        foreign = _foreign_fault(self.path.parent, lines)
        if foreign:
            return Reading((), (journal_damage(self.path, foreign),))
        tidy = copy.exists and copy.whole == journal.whole and not (damage or journal.torn or copy.torn)
        return Reading(lines, tuple(damage), journal.torn, tidy)

    def append(self, *entries: Entry, reading: Reading | None = None) -> None:
        """One write, one fsync: committed when this returns. DataError, and nothing is written, where it is damaged.

        reading: of just now, where there is one and nobody else can have written since.
        """
        reading = reading or self.read()
        self.refuse_damage(reading)
        if not reading.tidy:
            self._put_right(reading)
        first = len(reading.lines) + 1
        batch = {BATCH: first} if len(entries) > 1 else {}
        lines = [reading.lines[-1] if reading.lines else b""]
        for number, entry in enumerate(entries, first):
            lines.append(as_line(entry | batch, number, lines[-1]))
        _add(self.path, lines[1:])
        self.length = len(reading.lines) + len(entries)
        try:
            _add(self.copy, lines[1:])
        except OSError:  # it is committed; the copy is brought up at the next line
            return

    def refuse_damage(self, reading: Reading | None = None) -> None:
        """DataError where something is to be mended before anything is written."""
        damage = (reading or self.read()).damage
        if damage:
            raise DataError(f"{self.path.parent}: {'; '.join(map(str, damage))}; nothing is written before")

    def rewrite(self, entries: list[Entry]) -> None:
        """Write both files anew from these lines, in a chain of their own; what was there is kept beside them."""
        for path in (self.path, self.copy):
            if path.exists():
                keep_aside(path, read_regular(path), "damaged")
        lines: list[bytes] = []
        for number, entry in enumerate(entries, 1):
            lines.append(as_line(entry, number, lines[-1] if lines else b""))
        content = b"".join(line + b"\n" for line in lines)
        atomic_write(self.path, content)
        atomic_write(self.copy, content)

    def _put_right(self, reading: Reading) -> None:
        """Mend the files after a crash: keep the torn end in a file of its own and cut it away, bring up the copy."""
        whole = b"".join(line + b"\n" for line in reading.lines)
        if reading.torn:
            keep_aside(self.path, reading.torn, "torn")
        for path in (self.path, self.copy):
            if (read_regular(path) if path.exists() else b"") != whole:
                atomic_write(path, whole)

    def _damage_of_journal(self, journal: JournalText, copy: JournalText) -> Iterator[Remark]:
        missing = len(copy.chain) - len(journal.chain)
        if not journal.exists and copy.exists:
            yield journal_damage(self.path, "is missing beside its copy")
        elif journal.broken:
            yield journal_damage(self.path, f"line {journal.broken} is damaged")
        elif missing > 0:
            lines = "its last line is" if missing == 1 else f"its last {missing} lines are"
            yield journal_damage(self.path, f"{lines} missing")
        elif journal.ending != b"\n" and (missing == 0 or journal.ending):
            yield journal_damage(self.path, f"the end of its line {len(journal.chain)} is damaged")
        elif copy.chain != journal.chain[: len(copy.chain)]:
            yield journal_damage(self.path, f"it is not the journal that {COPY} is a copy of")

    def _damage_of_copy(self, journal: JournalText, copy: JournalText) -> Iterator[Remark]:
        behind = len(journal.chain) - len(copy.chain)
        if copy.broken:
            yield journal_damage(self.copy, f"line {copy.broken} is damaged")
        elif copy.ending != b"\n" and (behind == 0 or copy.ending):
            yield journal_damage(self.copy, f"the end of its line {len(copy.chain)} is damaged")
        elif _are_of_one_write(journal.chain[len(copy.chain) :]):
            return
        elif not copy.exists and behind > 1 and any("number" in json.loads(line) for line in journal.chain[:-1]):
            yield journal_damage(self.copy, "is missing")
        elif copy.exists and behind > 1:
            yield journal_damage(self.copy, f"its last {behind} lines are missing")


def _foreign_fault(folder: Path, lines: Sequence[bytes]) -> str:
    """Fault of a journal whose tap tests are all missing and of another machine; else empty.

    Such a folder was mixed up. Looks no farther than the first tap file that is there.
    """
    missing = []
    for tap_id in (entry["id"] for entry in map(json.loads, lines) if entry["kind"] == "tap"):
        if (folder / "taps" / f"{tap_id}.h5").exists():
            return ""
        missing.append(tap_id)
    machine = _machine_name(folder) if missing else ""
    files = [path.stem for path in (folder / "taps").glob("*.h5")] if machine else []
    taps_here = [tap_id for tap_id in files if machine_of(tap_id) == named_in_id(machine)]
    names = sorted(set(map(machine_of, missing)))
    if not taps_here or named_in_id(machine) in names:
        return ""
    lists = f"lists {len(missing)} tap test{'s' if len(missing) > 1 else ''} of {', '.join(names)}, none of them here"
    return f"is that of another machine: it {lists}, while taps/ holds {len(taps_here)} of {machine}"


def _machine_name(folder: Path) -> str:
    try:
        return str(toml_tables(toml_text(folder / "machine.toml"))["machine"]["name"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def _are_of_one_write(lines: Sequence[bytes]) -> bool:
    """Whether a crash can have kept all of these from the copy: one line, or lines that were written together."""
    written = {json.loads(line).get(BATCH, -number) for number, line in enumerate(lines)}
    return len(written) < 2


def as_line(entry: Entry, number: int, last: bytes) -> bytes:
    """Line of an entry, without its end; last: the line before, without its end too."""
    fields = {name: value for name, value in entry.items() if name != "crc"}
    fields |= {"number": number, "previous": hashlib.sha256(last).hexdigest() if last else ""}
    return json.dumps(fields | {"crc": crc_of(fields)}).encode()


def keep_aside(path: Path, content: bytes, why: str) -> Path:
    """Keep bytes that are to be cut away or written over in a new file beside: PATH.1.torn, PATH.2.torn, ..."""
    number = 1
    while (aside := path.with_name(f"{path.name}.{number}.{why}")).exists():
        number += 1
    atomic_write(aside, content)
    return aside


def journal_damage(path: Path, fault: str) -> Remark:
    """Remark on a file of the journal."""
    return Remark("journal-damaged", path.name, fault, f"mend it with {command('rebuild', path.parent)}")


def command(name: str, folder: Path) -> str:
    """Command of lobewatch for a machine, to be copied."""
    return shlex.join(["lobewatch", name, str(folder)])


def _add(path: Path, lines: Sequence[bytes]) -> None:
    """Append lines and their ends in one write."""
    new, content = not path.exists(), b"".join(line + b"\n" for line in lines)
    try:
        handle = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        try:
            if os.write(handle, content) < len(content):  # what a full disk does with the last bytes it has
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(handle)
        finally:
            os.close(handle)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    if new:
        sync_folder(path.parent)
