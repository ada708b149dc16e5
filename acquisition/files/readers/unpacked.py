"""How large the data sets of an HDF5 file are once unpacked: a small file can hold more than the memory does."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from acquisition.errors import DataError

if TYPE_CHECKING:
    import h5py

HARMLESS = 100_000_000
"""Bytes that may be unpacked from any file."""
RATIO = 20
"""What is larger may be so many times as large as the file: real signals shrink to a half or a quarter."""


def check_unpacked(file: h5py.File, packed: int, path: Path) -> None:
    """DataError for a file of `packed` bytes whose data sets are out of proportion; none of them is read."""
    import h5py  # here already: the file is open

    sizes: list[int] = []
    try:
        file.visititems(lambda _, node: sizes.append(_size(node)) if isinstance(node, h5py.Dataset) else None)
    except (OSError, RuntimeError, TypeError, ValueError) as error:
        raise DataError(f"{path}: no readable HDF5 file ({error}); take it again from a backup") from error
    if sum(sizes) > max(HARMLESS, RATIO * packed):
        raise DataError(
            f"{path}: {packed / 1e6:.3g} MB that unpack to {sum(sizes) / 1e6:.4g} MB; at most {HARMLESS / 1e6:g} MB or "
            f"{RATIO} times the file are read; no tap test is like that: take it again from where it was recorded"
        )


def _size(data: h5py.Dataset) -> int:
    """Bytes in memory, in whole chunks, as they are unpacked."""
    if data.shape is None:
        return 0
    chunks = data.chunks or (1,) * len(data.shape)
    length = math.prod(math.ceil(n / chunk) * chunk for n, chunk in zip(data.shape, chunks, strict=True))
    return int(length * data.dtype.itemsize)
