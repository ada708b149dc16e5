"""Write files atomically and read regular files of bounded size."""

from __future__ import annotations

import errno
import os
import secrets
import stat
from io import FileIO
from pathlib import Path

SYNC_UNSUPPORTED_ERRNOS = (errno.EINVAL, errno.EOPNOTSUPP, errno.ENOSYS)
"""Errors of file systems, network drives mostly, that have nothing to sync in a folder."""


def atomic_write(path: Path, content: bytes, *, lasting: bool = True) -> None:
    """Write by temporary name, fsync, rename and fsync of the folder; on failure the old file stays as it was.

    lasting: False where it may be torn or gone after a power cut, for its reader tells that and can make it anew;
    nothing is waited for then. Raises OSError with the name of the file to be.

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     atomic_write(Path(folder) / "table.csv", b"1,2")
    ...     (Path(folder) / "table.csv").read_bytes()
    b'1,2'
    """
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        with temporary.open("xb") as file:
            file.write(content)
            file.flush()
            if lasting:
                os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        temporary.unlink(missing_ok=True)
    if lasting:
        sync_folder(path.parent)


def make_folder(folder: Path) -> None:
    """Make a folder, and those above it that are missing; they outlast a power cut when this returns."""
    missing = [parent for parent in (folder, *folder.parents) if not parent.is_dir()]
    for parent in reversed(missing):
        parent.mkdir(exist_ok=True)
        sync_folder(parent.parent)


def sync_folder(folder: Path) -> None:
    """Make a rename in this folder outlast a power cut (a no-op where folders cannot be opened or synced).

    Raises OSError with the name of the folder.
    """
    if os.name == "nt":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in SYNC_UNSUPPORTED_ERRNOS:
            raise OSError(error.errno, error.strerror, str(folder)) from error
    finally:
        os.close(handle)


MAX_FILE_SIZE = 1_000_000_000
"""Bytes of a file that is read as a whole; chosen, some hundred times a tap test."""
MAX_SETTINGS_FILE_SIZE = 10_000_000
"""Bytes of a file that holds settings or a summary; chosen, some hundred times one of a busy machine."""
_OPEN_FLAGS = os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)


class IrregularFileError(OSError):
    """What lies there is no file, or none that anything here has written."""


def open_regular_file(path: Path | str, largest: float = MAX_FILE_SIZE) -> FileIO:
    """A file opened for reading, at its start.

    largest: bytes that it may have. IrregularFileError with the name of the file where it is a pipe, a device or a
    folder, or larger; OSError where it cannot be opened.
    """
    handle = os.open(path, _OPEN_FLAGS)
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


def read_regular_file(path: Path | str, largest: float = MAX_FILE_SIZE) -> bytes:
    """The bytes of a file; what `open_regular_file` raises."""
    with open_regular_file(path, largest) as file:
        return file.read()
