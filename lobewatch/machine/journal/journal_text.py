"""One of the two files of a journal as it stands on the disk: which of its lines are sound, and how it ends."""

from __future__ import annotations

import hashlib
import json
import zlib
from dataclasses import dataclass
from io import FileIO
from itertools import pairwise
from pathlib import Path
from typing import Any

from acquisition.regular_file import open_regular

Entry = dict[str, Any]
PREVIOUS = b'"previous": "'
"""Bytes of a line before the SHA-256 of the line before it."""
LARGEST = 200_000_000
"""Bytes of a journal; chosen, some ten times that of 20 000 tap tests."""
PIECE = 1 << 18
"""Bytes that are compared at once."""


@dataclass(frozen=True)
class JournalText:
    """One of the two files as it stands on the disk."""

    exists: bool
    """Whether there is such a file."""
    chain: tuple[bytes, ...] = ()
    """Lines from the first on, each naming the one before, without their ends."""
    whole: bytes = b""
    """The bytes of these lines, with their ends."""
    broken: int = 0
    """Number of the first line that does not continue the chain; 0 where all do."""
    ending: bytes = b"\n"
    """Bytes that end the last line of the chain."""
    torn: bytes = b""
    """Remains of a line after a crash."""
    loose: tuple[bytes, ...] = ()
    """Sound lines behind a broken one."""


def scan(path: Path, before: JournalText) -> JournalText:
    """Read a file of the journal line by line, from where it is as it was read before on."""
    if not path.exists():
        return JournalText(exists=False)
    with open_regular(path, LARGEST) as file:
        begun = before if _begins_with(file, before.whole) else JournalText(exists=False)
        file.seek(len(begun.whole))
        content = file.read()
    if begun.exists and not (content or before.broken or before.torn) and before.ending == b"\n":
        return before
    *lines, end = content.split(b"\n")
    chain, broken, loose = list(begun.chain), 0, list[bytes]()
    if _are_chained(chain, lines):
        chain, lines = chain + lines, []
    for number, line in enumerate(lines, len(chain) + 1):
        if not broken and _continues(chain, line):
            chain.append(line)
        else:
            broken = broken or number
            loose += [line] if _parse(line) else []
    for part in (end, end[:-1]):
        if part.endswith(b"}") and not broken and _continues(chain, part):
            return JournalText(True, (*chain, part), ending=end[len(part) :])
    loose += [part for part in (end, end[:-1]) if broken and _parse(part)][:1]
    whole = begun.whole + b"".join(line + b"\n" for line in chain[len(begun.chain) :])
    return JournalText(True, tuple(chain), whole, broken, torn=end, loose=tuple(loose))


def _begins_with(file: FileIO, start: bytes) -> bool:
    """Whether the first bytes of a file are these; read in pieces, for it is only compared."""
    at = 0
    while at < len(start):
        part = file.read(min(PIECE, len(start) - at))
        if not part or not start.startswith(part, at):
            return False
        at += len(part)
    return True


def _are_chained(chain: list[bytes], lines: list[bytes]) -> bool:
    """Whether all of these continue the chain: each but the last is proved by the SHA-256 in the line behind it."""
    if len(lines) < 2 or not (_continues(chain, lines[0]) and _continues(lines[:-1], lines[-1])):
        return False
    return all(
        _previous_digest(line) == hashlib.sha256(before).hexdigest().encode() for before, line in pairwise(lines)
    )


def _previous_digest(line: bytes) -> bytes:
    """SHA-256 that a line says of the one before it; anything where it is damaged."""
    begin = line.rfind(PREVIOUS) + len(PREVIOUS)
    return line[begin : begin + 64]


def _continues(chain: list[bytes], line: bytes) -> bool:
    entry = _parse(line)
    return entry is not None and entry["previous"] == (hashlib.sha256(chain[-1]).hexdigest() if chain else "")


def _parse(line: bytes) -> Entry | None:
    """A sound line as a JSON object; None for any other."""
    try:
        entry: Entry = json.loads(line)
        crc = entry.pop("crc")
        return entry if crc == crc_of(entry) and isinstance(entry["previous"], str) and "kind" in entry else None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def crc_of(entry: Entry) -> int:
    """CRC-32 of a journal entry without its crc."""
    return zlib.crc32(json.dumps(entry, sort_keys=True).encode())
