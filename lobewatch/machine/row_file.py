"""File of rows with checksums that is appended to.

The file begins with a line that names its format. Each row is its length and its CRC-32 (4 bytes each, little endian)
and its bytes. The rest of a row after a crash is ignored, and the next row overwrites it.
"""

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
    """Contents of a row file."""

    rows: tuple[bytes, ...]
    """Sound rows from the first one on."""
    sound_bytes: int
    """Size up to the end of the last sound row (bytes)."""
    file_bytes: int
    """Size of the file (bytes)."""
    is_damaged: bool
    """True if the rows are followed by more than a crash leaves."""


def read_rows(path: Path) -> RowFile:
    """Read the sound rows of a file; FileNotFoundError without one."""
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
    """Write the whole file atomically and return its size (bytes)."""
    content = ROW_FILE_HEADER + _pack_rows(rows)
    atomic_write(path, content)
    return len(content)


def append_rows(path: Path, size: int, rows: Sequence[bytes]) -> int:
    """Append rows after the sound bytes of a file and return the new size (bytes).

    Call it under the lock. It does not wait for the disk: rows can be computed again.
    """
    content = _pack_rows(rows)
    with path.open("r+b", buffering=0) as file:
        file.truncate(size)
        file.seek(size)
        file.write(content)
    return size + len(content)


def _pack_rows(rows: Iterable[bytes]) -> bytes:
    return b"".join(part for row in rows for part in (_ROW_HEADER.pack(len(row), zlib.crc32(row)), row))
