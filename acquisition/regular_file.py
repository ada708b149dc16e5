"""Files that anybody may have put where they lie: opened without waiting, and none that the memory cannot hold."""

from __future__ import annotations

import errno
import os
import stat
from io import FileIO
from pathlib import Path

LARGEST = 1_000_000_000
"""Bytes of a file that is read as a whole; chosen, some hundred times a tap test."""
SMALL = 10_000_000
"""Bytes of a file that holds settings or a summary; chosen, some hundred times one of a busy machine."""
_FLAGS = os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)


class IrregularFileError(OSError):
    """What lies there is no file, or none that anything here has written."""


def open_regular(path: Path | str, largest: float = LARGEST) -> FileIO:
    """A file opened for reading, at its start.

    largest: bytes that it may have. IrregularFileError with the name of the file where it is a pipe, a device or a
    folder, or larger; OSError where it cannot be opened.
    """
    handle = os.open(path, _FLAGS)
    try:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode):
            kind = "directory" if stat.S_ISDIR(status.st_mode) else "pipe or a device"
            raise IrregularFileError(errno.EINVAL, f"is a {kind}, not a file", str(path))
        if status.st_size > largest:
            sizes = f"has {status.st_size / 1e6:.4g} MB, at most {largest / 1e6:g} MB are read"
            raise IrregularFileError(errno.EFBIG, f"{sizes}; put it back from a backup, or take it away", str(path))
        return FileIO(handle)
    except BaseException:
        os.close(handle)
        raise


def read_regular(path: Path | str, largest: float = LARGEST) -> bytes:
    """The bytes of a file; what `open_regular` raises."""
    with open_regular(path, largest) as file:
        return file.read()
