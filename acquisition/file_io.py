"""Write, rename and delete files safely, and read regular files of bounded size."""

import contextlib
import errno
import os
import re
import secrets
import shutil
import stat
import time
from collections.abc import Callable
from functools import partial
from io import FileIO
from pathlib import Path
from typing import TypeVar

Result = TypeVar("Result")

SYNC_UNSUPPORTED_ERRNOS = (errno.EINVAL, errno.EOPNOTSUPP, errno.ENOSYS)
"""Error numbers of file systems, mostly network drives, that cannot sync a folder."""


WINDOWS_IN_USE_ERRORS = (5, 32, 33)
"""Windows errors access denied, sharing violation and lock violation: a virus scanner or a sync client has the file."""
RETRY_TIME, RETRY_INTERVAL = 2.0, 0.05
"""Time for which a file in use is tried again, and time between two attempts (s); chosen."""
WINDOWS_RESERVED_PATTERN = re.compile(
    r"""[<>:"|?*\\/\x00-\x1f] | [. ]$ | ^(?:con|prn|aux|nul|conin\$|conout\$|(?:com|lpt)[0-9¹²³])[ ]*(?:\.|$)""",
    re.IGNORECASE | re.VERBOSE,
)
"""File name that Windows cannot store ("Naming Files, Paths, and Namespaces" of the Win32 documentation)."""


def retry_while_in_use(action: Callable[[], Result]) -> Result:
    """Repeat a file operation for RETRY_TIME while Windows reports that another program uses the file."""
    deadline = time.monotonic() + RETRY_TIME
    while True:
        try:
            return action()
        except OSError as error:
            if getattr(error, "winerror", None) not in WINDOWS_IN_USE_ERRORS or time.monotonic() >= deadline:
                raise
        time.sleep(RETRY_INTERVAL)


def rename(old: Path, new: Path) -> Path:
    """Rename a file, also over an existing one, and return the new path."""
    return retry_while_in_use(partial(old.replace, new))


def delete(path: Path, *, missing_ok: bool = False) -> None:
    """Delete a file."""
    retry_while_in_use(partial(path.unlink, missing_ok=missing_ok))


def delete_folder(folder: Path) -> None:
    """Delete a folder with its files, as far as possible."""
    with contextlib.suppress(OSError):
        retry_while_in_use(partial(shutil.rmtree, folder))
    shutil.rmtree(folder, ignore_errors=True)


def check_file_name(path: Path) -> None:
    """Raise ValueError if Windows cannot store the name of a new file or folder: a folder may be copied to Windows."""
    if path.name not in ("", "..") and WINDOWS_RESERVED_PATTERN.search(path.name):
        cure = 'Choose a name without <>:"|?* or a final dot or space, and not CON, PRN, AUX, NUL, COM1 or LPT1.'
        raise ValueError(f"{path}: Windows cannot store the name {path.name!r}. {cure}")


def atomic_write(path: Path, content: bytes, *, lasting: bool = True) -> None:
    """Write a file completely or not at all: temporary name, fsync, rename, and fsync of the folder.

    On failure an old file stays as it was. A new one keeps its mode.

    Parameters
    ----------
    path
        File to write.
    content
        Bytes of the file.
    lasting
        False where the file may be torn or gone after a power cut because its reader notices that. Nothing is synced
        then.

    Raises
    ------
    OSError
        With the name of the file.
    ValueError
        If Windows cannot store the name.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     atomic_write(Path(folder) / "table.csv", b"1,2")
    ...     (Path(folder) / "table.csv").read_bytes()
    b'1,2'
    """
    check_file_name(path)
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        with temporary.open("xb") as file:
            with contextlib.suppress(OSError):  # there is no old file, or its drive has no modes
                temporary.chmod(stat.S_IMODE(path.stat().st_mode))
            file.write(content)
            file.flush()
            if lasting:
                os.fsync(file.fileno())
        rename(temporary, path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        delete(temporary, missing_ok=True)
    if lasting:
        sync_folder(path.parent)


def make_folder(folder: Path) -> None:
    """Make a folder and its missing parents so that they outlast a power cut.

    Raises ValueError, and makes none, if Windows cannot store one of the names.
    """
    missing = [parent for parent in (folder, *folder.parents) if not parent.is_dir()]
    for parent in missing:
        check_file_name(parent)
    for parent in reversed(missing):
        parent.mkdir(exist_ok=True)
        sync_folder(parent.parent)


def sync_folder(folder: Path) -> None:
    """Sync a folder so that a rename in it outlasts a power cut; do nothing where folders cannot be synced.

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
"""Largest file that is read as a whole (bytes), some hundred times a tap test."""
MAX_SETTINGS_FILE_SIZE = 10_000_000
"""Largest file of settings or of a summary (bytes), some hundred times one of a busy machine."""
_OPEN_FLAGS = os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)


class IrregularFileError(OSError):
    """Raised if a path is not a regular file or is too large."""


def open_regular_file(path: Path | str, largest: float = MAX_FILE_SIZE) -> FileIO:
    """Open a regular file for reading without waiting, with at most `largest` bytes.

    Raises IrregularFileError with the name of the file for a pipe, a device, a folder or a larger file.
    """
    handle = os.open(path, _OPEN_FLAGS)
    try:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode):
            kind = "directory" if stat.S_ISDIR(status.st_mode) else "pipe or a device"
            raise IrregularFileError(errno.EINVAL, f"this is a {kind}, not a file", str(path))
        if status.st_size > largest:
            sizes = f"{status.st_size / 1e6:.4g} MB is too large (limit {largest / 1e6:g} MB)"
            raise IrregularFileError(errno.EFBIG, f"{sizes}. Restore the file from a backup, or delete it.", str(path))
        return FileIO(handle)
    except BaseException:
        os.close(handle)
        raise


def read_regular_file(path: Path | str, largest: float = MAX_FILE_SIZE) -> bytes:
    """Read a regular file of at most `largest` bytes; see `open_regular_file` for errors."""
    with open_regular_file(path, largest) as file:
        return file.read()
