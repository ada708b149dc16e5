"""Rows with checksums, one after the other in a file: added to without writing the others anew.

The file begins with a line that names its make; then come rows, each its length and its CRC-32 (4 bytes each, little
endian) and its bytes. What a crash leaves of a row counts for nothing and is written over by the next.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from acquisition.atomic import atomic_write
from acquisition.regular_file import read_regular

MAKE = b"lobewatch rows 1\n"
_HEAD = struct.Struct("<II")


@dataclass(frozen=True)
class Rows:
    """Contents of a file of rows."""

    rows: tuple[bytes, ...]
    """Rows from the first on, as far as they are sound."""
    size: int
    """Bytes of the file up to the end of the last of them."""
    length: int
    """Bytes of the whole file."""
    is_damaged: bool
    """Whether something is behind them that no crash has left."""


def read_rows(path: Path) -> Rows:
    """The sound rows of a file; FileNotFoundError where there is none."""
    content = read_regular(path)
    if not content.startswith(MAKE):
        return Rows((), 0, len(content), not MAKE.startswith(content))
    rows, at, is_damaged = list[bytes](), len(MAKE), False
    begin, last, crc_of = _HEAD.size, len(content) - _HEAD.size, zlib.crc32
    while at <= last:
        length, crc = _HEAD.unpack_from(content, at)
        end = at + begin + length
        row = content[at + begin : end]
        if len(row) < length:  # torn
            break
        is_damaged = not length or crc_of(row) != crc
        if is_damaged:
            break
        rows.append(row)
        at = end
    return Rows(tuple(rows), at, len(content), is_damaged)


def write_rows(path: Path, rows: Iterable[bytes]) -> int:
    """Write the whole file anew, complete under its name or the old one as it was; returns its size (bytes)."""
    content = MAKE + _pack(rows)
    atomic_write(path, content)
    return len(content)


def add_rows(path: Path, size: int, rows: Sequence[bytes]) -> int:
    """Write rows behind the first bytes of a file, as many as `read_rows` said; returns the new size (bytes).

    To be called under a lock. Not made to outlast a power cut: what is worked out can be worked out again.
    """
    content = _pack(rows)
    with path.open("r+b", buffering=0) as file:
        file.truncate(size)
        file.seek(size)
        file.write(content)
    return size + len(content)


def _pack(rows: Iterable[bytes]) -> bytes:
    return b"".join(part for row in rows for part in (_HEAD.pack(len(row), zlib.crc32(row)), row))
