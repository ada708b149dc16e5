"""Journal of a machine: one line per commit, in two files that verify each other.

A line is JSON with the SHA-256 of the line before it (`previous`), its number (`number`) and a CRC-32 (`crc`). It is
written to journal.jsonl, which is the commit, then to journal.copy.jsonl: after a crash the copy may be one line
short, never longer.
"""

import contextlib
import errno
import hashlib
import json
import os
import shlex
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from itertools import count, pairwise
from pathlib import Path
from typing import Any

import msgspec

from acquisition import DataError, Remark, parse_machine_name, sanitize_id_part
from acquisition.errors import join_sentences
from acquisition.file_io import atomic_write, read_regular_file, rename, sync_folder
from lobewatch.machine.journal.file_names import JOURNAL_COPY_NAME, JOURNAL_NAME
from lobewatch.machine.journal.line_formats import (
    BATCH_KEY,
    FORMAT_KEY,
    JOURNAL_FORMAT,
    LineFault,
    find_line_faults,
)
from lobewatch.machine.journal.tap_entry import TAP_LINE_PREFIX
from lobewatch.machine.settings.toml import parse_toml_tables, read_toml_text

JournalEntry = dict[str, Any]
PREVIOUS_DIGEST_KEY = b'"previous": "'
"""Bytes of a line before the SHA-256 of the previous line."""
MAX_JOURNAL_BYTES = 200_000_000
"""Largest size of a journal (bytes); chosen, ten times that of 20 000 tap tests."""


@dataclass(frozen=True)
class JournalFileState:
    """State of one journal file on the disk."""

    exists: bool
    """True if the file exists."""
    chain: tuple[bytes, ...] = ()
    """Lines from the first one on, each proved by the next, without line ends."""
    chain_bytes: bytes = b""
    """Bytes of these lines with their line ends."""
    first_broken_line: int = 0
    """Number of the first line that does not continue the chain; 0 without one."""
    line_ending: bytes = b"\n"
    """Line end of the last line of the chain."""
    torn: bytes = b""
    """Rest of a line after a crash."""
    unchained_lines: tuple[bytes, ...] = ()
    """Sound lines after a broken one."""


def scan_journal_file(path: Path, before: JournalFileState) -> JournalFileState:
    """Read a journal file line by line, from the part that was read before on."""
    if not path.exists():
        return JournalFileState(exists=False)
    content = read_regular_file(path, MAX_JOURNAL_BYTES)
    begun = before if content.startswith(before.chain_bytes) else JournalFileState(exists=False)
    content = content[len(begun.chain_bytes) :]
    if begun.exists and not (content or before.first_broken_line or before.torn) and before.line_ending == b"\n":
        return before
    *lines, end = content.split(b"\n")
    chain, broken, loose = list(begun.chain), 0, list[bytes]()
    if _continue_chain(chain, lines):
        chain, lines = chain + lines, []
    for number, line in enumerate(lines, len(chain) + 1):
        if not broken and _continues_chain(chain, line):
            chain.append(line)
        else:
            broken = broken or number
            loose += [line] if _parse_line(line) else []
    for part in (end, end[:-1]):
        if part.endswith(b"}") and not broken and _continues_chain(chain, part):
            return JournalFileState(True, (*chain, part), line_ending=end[len(part) :])
    loose += [part for part in (end, end[:-1]) if broken and _parse_line(part)][:1]
    whole = begun.chain_bytes + b"".join(line + b"\n" for line in chain[len(begun.chain) :])
    return JournalFileState(True, tuple(chain), whole, broken, torn=end, unchained_lines=tuple(loose))


def _continue_chain(chain: list[bytes], lines: list[bytes]) -> bool:
    """Tell whether all lines continue the chain; the digest in a line proves the line before it."""
    if len(lines) < 2 or not (_continues_chain(chain, lines[0]) and _continues_chain(lines[:-1], lines[-1])):
        return False
    pairs = ((hashlib.sha256(before).hexdigest(), line) for before, line in pairwise(lines))
    return all(_read_previous_digest(line) == digest.encode() for digest, line in pairs)


def _read_previous_digest(line: bytes) -> bytes:
    """Return the SHA-256 of the previous line as stated in a line; garbage if it is damaged."""
    begin = line.rfind(PREVIOUS_DIGEST_KEY) + len(PREVIOUS_DIGEST_KEY)
    return line[begin : begin + 64]


def _continues_chain(chain: list[bytes], line: bytes) -> bool:
    entry = _parse_line(line)
    return entry is not None and entry["previous"] == (hashlib.sha256(chain[-1]).hexdigest() if chain else "")


def _parse_line(line: bytes) -> JournalEntry | None:
    """Return a sound line as a JSON object, else None."""
    try:
        entry: JournalEntry = json.loads(line)
        crc = entry.pop("crc")
        return entry if crc == compute_crc(entry) and isinstance(entry["previous"], str) and "kind" in entry else None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def compute_crc(entry: JournalEntry) -> int:
    """Return the CRC-32 of an entry without its crc."""
    return zlib.crc32(json.dumps(entry, sort_keys=True).encode())


@dataclass(frozen=True)
class JournalReading:
    """Lines that the two files prove together."""

    lines: tuple[bytes, ...]
    """All sound lines, oldest first, without line ends."""
    damage: tuple[Remark, ...]
    """Damage of the files; until it is repaired nothing is written."""
    torn: bytes = b""
    """Rest of a line in journal.jsonl after a crash."""
    is_clean: bool = False
    """True if both files contain exactly these lines."""

    @cached_property
    def entries(self) -> list[JournalEntry]:
        """Lines as JSON objects, also those that this version does not understand."""
        return [json.loads(line) for line in self.lines]

    @cached_property
    def other_entries(self) -> list[JournalEntry]:
        """Understood lines of other kinds as JSON objects, with tap tests of older versions."""
        lines = _leave_out(self.lines, self._other_faults)
        others = (line for line in lines if not line.startswith(TAP_LINE_PREFIX))
        return msgspec.json.decode(b"[" + b",".join(others) + b"]", type=list[JournalEntry])

    @property
    def tap_lines(self) -> list[bytes]:
        """Understood lines of tap tests that begin with `TAP_LINE_PREFIX`."""
        return [line for line in _leave_out(self.lines, self._tap_faults) if line.startswith(TAP_LINE_PREFIX)]

    @property
    def faults(self) -> list[LineFault]:
        """Lines that this version does not understand, oldest first."""
        return sorted([*self._tap_faults, *self._other_faults])

    @cached_property
    def _tap_faults(self) -> tuple[LineFault, ...]:
        return find_line_faults(self.lines, of_taps=True)

    @cached_property
    def _other_faults(self) -> tuple[LineFault, ...]:
        return find_line_faults(self.lines, of_taps=False)


def _leave_out(lines: Sequence[bytes], faults: Iterable[LineFault]) -> Sequence[bytes]:
    unusable = {fault.number for fault in faults if not fault.is_used}
    return [line for number, line in enumerate(lines, 1) if number not in unusable] if unusable else lines


class Journal:
    """The two journal files of a machine folder."""

    def __init__(self, folder: Path) -> None:
        self.path, self.copy_path = folder / JOURNAL_NAME, folder / JOURNAL_COPY_NAME
        self.line_count = 0
        """Number of lines once this had appended its newest."""
        self._text = JournalFileState(exists=False)

    def read(self) -> JournalReading:
        """Read all sound lines of both files and their damage; the files may be missing."""
        journal = scan_journal_file(self.path, self._text)
        copy = scan_journal_file(self.copy_path, journal)
        self._text = journal
        longer, shorter = sorted((journal.chain, copy.chain), key=len, reverse=True)
        if longer[: len(shorter)] != shorter:
            longer = journal.chain
        damage = [*self._find_journal_damage(journal, copy), *self._find_copy_damage(journal, copy)]
        loose = (*journal.chain, *copy.chain, *journal.unchained_lines, *copy.unchained_lines) if damage else ()
        lines = tuple(dict.fromkeys((*longer, *loose))) if loose else longer
        foreign = find_foreign_journal(self.path.parent, lines)
        if foreign:
            return JournalReading((), (journal_damage_remark(self.path, foreign),))
        tidy = copy.exists and copy.chain_bytes == journal.chain_bytes and not (damage or journal.torn or copy.torn)
        return JournalReading(lines, tuple(damage), journal.torn, tidy)

    def append(self, *entries: JournalEntry, reading: JournalReading | None = None) -> None:
        """Append entries with one write and one fsync; they are committed on return.

        reading: fresh reading if no other program can have written since. Raises DataError, and writes nothing, for a
        damaged journal.
        """
        reading = reading or self.read()
        self.refuse_damage(reading)
        if not reading.is_clean:
            self._repair(reading)
        first = len(reading.lines) + 1
        batch = {BATCH_KEY: first} if len(entries) > 1 else {}
        last = reading.lines[-1] if reading.lines else b""
        written = {FORMAT_KEY: JOURNAL_FORMAT, **batch}
        lines = _encode_lines((entry | written for entry in entries), first, last)
        _append_lines(self.path, lines)
        self.line_count = len(reading.lines) + len(entries)
        with contextlib.suppress(OSError):  # it is committed; the copy is brought up at the next line
            _append_lines(self.copy_path, lines)

    def refuse_damage(self, reading: JournalReading) -> None:
        """Raise DataError if the journal is damaged."""
        if reading.damage:
            findings = ", ".join(remark.finding for remark in reading.damage)
            raise DataError(
                join_sentences(f"{self.path.parent}: nothing written, because of {findings}", reading.damage[0].cure)
            )

    def separate_copies(self) -> Path | None:
        """Write the copy again if two computers continued the two files differently, and return the old copy.

        The old copy gets a name of its own, and None is returned if the files belong together.
        """
        journal, copy = (
            scan_journal_file(path, JournalFileState(exists=False)) for path in (self.path, self.copy_path)
        )
        both = min(len(journal.chain), len(copy.chain))
        is_broken = journal.first_broken_line or copy.first_broken_line or not journal.chain_bytes
        if is_broken or journal.chain[:both] == copy.chain[:both]:
            return None
        names = (self.copy_path.with_name(f"{JOURNAL_COPY_NAME}.{number}.other") for number in count(1))
        other = rename(self.copy_path, next(path for path in names if not path.exists()))
        atomic_write(self.copy_path, journal.chain_bytes)
        return other

    def rewrite(self, reading: JournalReading) -> None:
        """Write both files with the sound lines in a new chain, and keep the old files.

        Raises DataError, and writes nothing, if a newer version of lobewatch wrote one of the lines.
        """
        for fault in (fault for fault in reading.faults if fault.is_newer):
            raise DataError(f"{self.path}: not rewritten, because {fault}. Update lobewatch on this computer.")
        for path in (self.path, self.copy_path):
            if path.exists():
                _back_up_bytes(path, read_regular_file(path), "damaged")
        content = b"".join(line + b"\n" for line in _encode_lines(reading.entries))
        atomic_write(self.path, content)
        atomic_write(self.copy_path, content)

    def _repair(self, reading: JournalReading) -> None:
        """Repair the files after a crash: move a torn end to a file of its own, and update the copy."""
        whole = b"".join(line + b"\n" for line in reading.lines)
        if reading.torn:
            _back_up_bytes(self.path, reading.torn, "torn")
        for path in (self.path, self.copy_path):
            if (read_regular_file(path) if path.exists() else b"") != whole:
                atomic_write(path, whole)

    def _find_journal_damage(self, journal: JournalFileState, copy: JournalFileState) -> Iterator[Remark]:
        missing = len(copy.chain) - len(journal.chain)
        if not journal.exists and copy.exists:
            yield journal_damage_remark(self.path, "missing, but its copy exists")
        elif journal.first_broken_line:
            yield journal_damage_remark(self.path, f"line {journal.first_broken_line} is damaged")
        elif missing > 0:
            lines = "last line" if missing == 1 else f"last {missing} lines"
            yield journal_damage_remark(self.path, f"{lines} missing")
        elif journal.line_ending != b"\n" and (missing == 0 or journal.line_ending):
            yield journal_damage_remark(self.path, f"end of line {len(journal.chain)} is damaged")
        elif copy.chain != journal.chain[: len(copy.chain)]:
            yield journal_damage_remark(self.path, f"contents do not match {JOURNAL_COPY_NAME}")

    def _find_copy_damage(self, journal: JournalFileState, copy: JournalFileState) -> Iterator[Remark]:
        behind = len(journal.chain) - len(copy.chain)
        if copy.first_broken_line:
            yield journal_damage_remark(self.copy_path, f"line {copy.first_broken_line} is damaged")
        elif copy.line_ending != b"\n" and (behind == 0 or copy.line_ending):
            yield journal_damage_remark(self.copy_path, f"end of line {len(copy.chain)} is damaged")
        elif _are_one_batch(journal.chain[len(copy.chain) :]):
            return
        elif not copy.exists and behind > 1 and any("number" in json.loads(line) for line in journal.chain[:-1]):
            yield journal_damage_remark(self.copy_path, "missing")
        elif copy.exists and behind > 1:
            yield journal_damage_remark(self.copy_path, f"last {behind} lines missing")


def find_foreign_journal(folder: Path, lines: Sequence[bytes]) -> str:
    """Return the fault of a journal whose tap tests are all missing and of another machine, else "".

    Such a folder was mixed up. The search ends at the first existing tap file.
    """
    missing = []
    entries = (entry for entry in map(json.loads, lines) if entry["kind"] == "tap")
    for tap_id in (entry["id"] for entry in entries if isinstance(entry.get("id"), str)):
        if os.path.exists(folder / "taps" / f"{tap_id}.h5"):  # noqa: PTH110 - of a name that is too long, it is False
            return ""
        missing.append(tap_id)
    machine = _read_machine_name(folder) if missing else ""
    files = [path.stem for path in (folder / "taps").glob("*.h5")] if machine else []
    taps_here = [tap_id for tap_id in files if parse_machine_name(tap_id) == sanitize_id_part(machine)]
    names = sorted(set(map(parse_machine_name, missing)))
    if not taps_here or sanitize_id_part(machine) in names:
        return ""
    lists = f"lists {len(missing)} tap test{'s' if len(missing) > 1 else ''} of {', '.join(names)}"
    return f"belongs to another machine, because this journal {lists}, but taps/ holds {len(taps_here)} of {machine}"


def _read_machine_name(folder: Path) -> str:
    try:
        return str(parse_toml_tables(read_toml_text(folder / "machine.toml"))["machine"]["name"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def _are_one_batch(lines: Sequence[bytes]) -> bool:
    """Tell whether a crash can have kept all of these lines from the copy."""
    written = {str(json.loads(line).get(BATCH_KEY, -number)) for number, line in enumerate(lines)}
    return len(written) < 2


def make_entry(kind: str, now: datetime | None = None, /, **fields: object) -> JournalEntry:
    """Make an entry of a kind; now: time of writing, by default that of the clock."""
    return {"kind": kind, **fields, "time": (now or datetime.now(UTC)).isoformat()}


def _encode_lines(entries: Iterable[JournalEntry], first: int = 1, last: bytes = b"") -> list[bytes]:
    """Encode entries without line ends; first: number of the first one; last: line before it, without its line end."""
    lines = []
    for number, entry in enumerate(entries, first):
        fields = {name: value for name, value in entry.items() if name != "crc"}
        fields |= {"number": number, "previous": hashlib.sha256(last).hexdigest() if last else ""}
        last = json.dumps(fields | {"crc": compute_crc(fields)}).encode()
        lines.append(last)
    return lines


def _back_up_bytes(path: Path, content: bytes, why: str) -> None:
    """Write bytes to a new file PATH.1.REASON, PATH.2.REASON, ... before they are overwritten."""
    asides = (path.with_name(f"{path.name}.{number}.{why}") for number in count(1))
    atomic_write(next(aside for aside in asides if not aside.exists()), content)


def journal_damage_remark(path: Path, fault: str) -> Remark:
    """Return the remark on a damaged journal file."""
    cure = f"Run {format_command('rebuild', path.parent)} to repair the journal"
    return Remark("journal-damaged", path.name, fault, cure)


def format_command(name: str, folder: Path) -> str:
    """Return a command of lobewatch for a machine, ready to copy."""
    return shlex.join(["lobewatch", name, str(folder)])


def _append_lines(path: Path, lines: Sequence[bytes]) -> None:
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
