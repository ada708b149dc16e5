"""Read one journal file and find its sound lines."""

from __future__ import annotations

import hashlib
import json
import zlib
from dataclasses import dataclass
from io import FileIO
from itertools import pairwise
from pathlib import Path
from typing import Any

from acquisition.file_io import open_regular_file

JournalEntry = dict[str, Any]
PREVIOUS_DIGEST_KEY = b'"previous": "'
"""Bytes of a line before the SHA-256 of the previous line."""
MAX_JOURNAL_BYTES = 200_000_000
"""Largest size of a journal (bytes); chosen, ten times that of 20 000 tap tests."""
COMPARE_CHUNK_BYTES = 1 << 18
"""Size of a chunk that is compared at once (bytes)."""


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
    with open_regular_file(path, MAX_JOURNAL_BYTES) as file:
        begun = before if _starts_with(file, before.chain_bytes) else JournalFileState(exists=False)
        file.seek(len(begun.chain_bytes))
        content = file.read()
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


def _starts_with(file: FileIO, start: bytes) -> bool:
    """Tell whether a file starts with these bytes."""
    at = 0
    while at < len(start):
        part = file.read(min(COMPARE_CHUNK_BYTES, len(start) - at))
        if not part or not start.startswith(part, at):
            return False
        at += len(part)
    return True


def _continue_chain(chain: list[bytes], lines: list[bytes]) -> bool:
    """Tell whether all lines continue the chain; the digest in a line proves the line before it."""
    if len(lines) < 2 or not (_continues_chain(chain, lines[0]) and _continues_chain(lines[:-1], lines[-1])):
        return False
    return all(
        _read_previous_digest(line) == hashlib.sha256(before).hexdigest().encode() for before, line in pairwise(lines)
    )


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
