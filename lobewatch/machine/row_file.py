"""File of checksummed rows that can be appended to.

The file begins with a line that names its make; then come rows, each its length and its CRC-32 (4 bytes each, little
endian) and its bytes. What a crash leaves of a row counts for nothing and is written over by the next.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from acquisition.file_io import atomic_write, read_regular_file

ROW_FILE_HEADER = b"lobewatch rows 1\n"
_ROW_HEADER = struct.Struct("<II")


@dataclass(frozen=True)
class RowFile:
    """Contents of a file of rows."""

    rows: tuple[bytes, ...]
    """Rows from the first on, as far as they are sound."""
    sound_bytes: int
    """Bytes of the file up to the end of the last of them."""
    file_bytes: int
    """Bytes of the whole file."""
    is_damaged: bool
    """Whether something is behind them that no crash has left."""


def read_rows(path: Path) -> RowFile:
    """The sound rows of a file; FileNotFoundError where there is none."""
    content = read_regular_file(path)
    if not content.startswith(ROW_FILE_HEADER):
        return RowFile((), 0, len(content), not ROW_FILE_HEADER.startswith(content))
    rows, at, is_damaged = list[bytes](), len(ROW_FILE_HEADER), False
    begin, last, crc_of = _ROW_HEADER.size, len(content) - _ROW_HEADER.size, zlib.crc32
    while at <= last:
        length, crc = _ROW_HEADER.unpack_from(content, at)
        end = at + begin + length
        row = content[at + begin : end]
        if len(row) < length:  # torn
            break
        is_damaged = not length or crc_of(row) != crc
        if is_damaged:
            break
        rows.append(row)
        at = end
    return RowFile(tuple(rows), at, len(content), is_damaged)


def write_rows(path: Path, rows: Iterable[bytes]) -> int:
    """Write the whole file anew, complete under its name or the old one as it was; returns its size (bytes)."""
    content = ROW_FILE_HEADER + _pack_rows(rows)
    atomic_write(path, content)
    return len(content)


def append_rows(path: Path, size: int, rows: Sequence[bytes]) -> int:
    """Write rows behind the first bytes of a file, as many as `read_rows` said; returns the new size (bytes).

    To be called under a lock. Not made to outlast a power cut: what is worked out can be worked out again.
    """
    content = _pack_rows(rows)
    with path.open("r+b", buffering=0) as file:
        file.truncate(size)
        file.seek(size)
        file.write(content)
    return size + len(content)


def _pack_rows(rows: Iterable[bytes]) -> bytes:
    return b"".join(part for row in rows for part in (_ROW_HEADER.pack(len(row), zlib.crc32(row)), row))
