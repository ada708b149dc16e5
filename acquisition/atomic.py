"""Files that are either there whole or not at all."""

from __future__ import annotations

import errno
import os
import secrets
from pathlib import Path

NOT_SYNCED = (errno.EINVAL, errno.EOPNOTSUPP, errno.ENOSYS)
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
        if error.errno not in NOT_SYNCED:
            raise OSError(error.errno, error.strerror, str(folder)) from error
    finally:
        os.close(handle)
