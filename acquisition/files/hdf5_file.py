"""Open HDF5 files in memory, limit their unpacked size and protect them with a checksum."""

from __future__ import annotations

import hashlib
import io
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from acquisition.errors import DataError

if TYPE_CHECKING:
    import h5py

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""First bytes of an HDF5 file."""


def open_hdf5(memory: io.BytesIO, mode: Literal["r", "r+", "w"]) -> h5py.File:
    """Open the HDF5 file that these bytes are or become; raise OSError if they are none."""
    import h5py  # takes longer to import than what a command needs that opens no file

    return h5py.File(memory, mode)


MIN_UNPACKED_LIMIT = 100_000_000
"""Largest unpacked size of any small file (bytes)."""
MAX_UNPACKED_RATIO = 20
"""Largest ratio of unpacked to packed size of larger files; real signals shrink to a half or a quarter."""


def check_unpacked_size(file: h5py.File, packed: int, path: Path) -> None:
    """Raise DataError for a file of `packed` bytes whose data sets are too large; no data set is read."""
    sizes: list[int] = []
    try:
        file.visititems(lambda _, node: sizes.append(_measure_unpacked_size(node)))
    except (OSError, RuntimeError, TypeError, ValueError) as error:
        raise DataError(f"{path}: unreadable HDF5 file ({error}). Restore the file from a backup.") from error
    check_unpacked_total(sum(sizes), packed, path)


def get_unpacked_limit(packed: int) -> int:
    """Return the largest unpacked size of a file (bytes)."""
    return max(MIN_UNPACKED_LIMIT, MAX_UNPACKED_RATIO * packed)


def check_unpacked_total(unpacked: int, packed: int, path: Path) -> None:
    """Raise DataError for a file of `packed` bytes that unpacks to too many bytes."""
    limit = get_unpacked_limit(packed)
    if unpacked > limit:
        sizes = f"{packed / 1e6:.3g} MB unpack to {unpacked / 1e6:.4g} MB (limit {limit / 1e6:.4g} MB)"
        raise DataError(f"{path}: {sizes}. Export the file again.")


def _measure_unpacked_size(data: Any) -> int:
    """Return the size of a data set in memory (bytes), in whole chunks as they are unpacked; 0 of other nodes."""
    if getattr(data, "shape", None) is None:
        return 0
    chunks = data.chunks or (1,) * len(data.shape)
    length = math.prod(math.ceil(n / chunk) * chunk for n, chunk in zip(data.shape, chunks, strict=True))
    return int(length * data.dtype.itemsize)


CHECKSUM_MARK = b"\nlobewatch sha256 "
"""Start of a checksum behind the last byte of a file, where HDF5 does not look."""
CHECKSUM_SIZE = len(CHECKSUM_MARK) + 64 + 1


def append_checksum(content: bytes) -> bytes:
    """Append the SHA-256 of the content."""
    return content + _format_checksum(content)


def has_wrong_checksum(content: bytes) -> bool:
    """Return whether a file has a checksum that differs: one flipped bit can make HDF5 hang or crash."""
    checksum = content[-CHECKSUM_SIZE:]
    return checksum.startswith(CHECKSUM_MARK) and checksum != _format_checksum(content[:-CHECKSUM_SIZE])


def has_valid_checksum(content: bytes) -> bool:
    """Return whether a file has a checksum that agrees."""
    return content[-CHECKSUM_SIZE:] == _format_checksum(content[:-CHECKSUM_SIZE])


def _format_checksum(content: bytes) -> bytes:
    return CHECKSUM_MARK + hashlib.sha256(content).hexdigest().encode() + b"\n"
