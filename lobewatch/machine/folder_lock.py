"""Lock of a machine folder, and disk space reserved in it."""

import contextlib
import errno
import os
import shutil
import sys
import threading
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Self

import msgspec
from filelock import lock_descriptor

from acquisition import DataError
from acquisition.errors import PERMISSION_ERRNOS, join_sentences
from acquisition.file_io import (
    MAX_SETTINGS_FILE_SIZE,
    atomic_write,
    delete,
    make_folder,
    read_regular_file,
    retry_while_in_use,
)

LOCK_NAME, LOCK_HOLDER_NAME = ".lock", ".lock.holder"
"""Names of the locked file, and of the file that tells who holds the lock: some systems cannot read a locked file."""
LOCK_TIMEOUT = 5.0
"""Time to wait for another program (s), as SQLite in Python."""
LOCK_POLL_INTERVAL = 0.01
"""Time between two attempts (s)."""
MIN_LEFTOVER_AGE = 3600.0
"""Age from which a half-written file belongs to a killed program (s); chosen."""


class BusyError(DataError):
    """Raised when another program writes to the folder."""


class LockHolder(msgspec.Struct, frozen=True):
    """Program that holds the lock."""

    command: str
    """Command without its arguments."""
    process: int
    """Process identifier."""
    since: datetime
    """Time since which it holds the lock."""

    @classmethod
    def current(cls) -> Self:
        """Return this program."""
        program, *arguments = sys.argv or [""]
        name = "python" if program in ("", "-", "-c") else Path(program).stem
        words = [name, *[word for word in arguments if not word.startswith("-")][:1]]
        return cls(" ".join(words), os.getpid(), datetime.now(UTC))

    def __str__(self) -> str:
        return f"`{self.command}` (process {self.process}, since {self.since.astimezone():%H:%M})"


class FolderLock:
    """Lock of one folder; a thread may hold it several times over."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._holder, self._thread = folder, folder / LOCK_HOLDER_NAME, threading.local()

    @contextlib.contextmanager
    def hold(self, patience: float) -> Iterator[None]:
        """Keep other programs from writing here; BusyError if one does for longer than `patience` (s).

        Raises OSError if the folder is missing, cannot be written, or its file system has no locks.
        """
        if getattr(self._thread, "holds", False):
            yield
            return
        with contextlib.ExitStack() as stack:
            self._acquire(patience, stack)
            self._remove_leftovers()
            with contextlib.suppress(OSError):  # the lock holds without it
                atomic_write(self._holder, msgspec.json.encode(LockHolder.current()), lasting=False)
            self._thread.holds = True
            try:
                yield
            finally:
                self._thread.holds = False
                with contextlib.suppress(OSError):
                    delete(self._holder, missing_ok=True)

    def _remove_leftovers(self) -> None:
        """Remove half-written files of killed programs. Only the owner of the lock writes the name of its holder."""
        for path in self._folder.glob(f".*.{'[0-9a-f]' * 8}.tmp"):
            with contextlib.suppress(OSError):  # another program has removed it
                is_holder = path.name.startswith(f".{LOCK_HOLDER_NAME}.")
                if is_holder or time.time() - path.stat().st_mtime > MIN_LEFTOVER_AGE:
                    path.unlink()

    def _acquire(self, patience: float, stack: contextlib.ExitStack) -> None:
        """Acquire the lock until the stack is closed; a missing folder, for example of a removed drive, is not made."""
        try:
            path = self._folder / LOCK_NAME
            handle = retry_while_in_use(partial(os.open, path, os.O_RDWR | os.O_CREAT, 0o644))
            stack.callback(os.close, handle)
            self._wait(handle, patience)
        except (FileNotFoundError, NotADirectoryError) as error:
            raise type(error)(error.errno, error.strerror, str(self._folder)) from error
        except OSError as error:
            cure = "You can only read this folder. Copy the folder to a place with write access"
            if error.errno not in PERMISSION_ERRNOS:
                cure = "This drive cannot lock files. Mount the drive with locks, or copy the folder to another drive"
            raise OSError(error.errno, join_sentences(error.strerror or "", cure), str(self._folder)) from error

    def _wait(self, handle: int, patience: float) -> None:
        deadline = time.monotonic() + patience
        while not retry_while_in_use(partial(lock_descriptor, handle, blocking=False)):
            if time.monotonic() >= deadline:
                holder: object = "another lobewatch"
                with contextlib.suppress(OSError, msgspec.MsgspecError):  # it has not written its name yet
                    content = read_regular_file(self._holder, MAX_SETTINGS_FILE_SIZE)
                    holder = msgspec.json.decode(content, type=LockHolder)
                raise BusyError(f"{self._folder}: {holder} is writing to this folder. Wait until the command ends.")
            time.sleep(LOCK_POLL_INTERVAL)


RESERVE_BYTES = 50_000_000
"""Disk space that a tap test needs (bytes)."""
UNSUPPORTED_ERRNOS = (errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS)
"""Errors of file systems that cannot reserve space."""


class DiskReserve:
    """Disk space reserved for a tap test in a file that is released when the disk is full.

    Systems that cannot reserve space only check the free space. A killed program leaves the file to the next one.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._file = folder, folder / "spool" / ".reserve"

    def __enter__(self) -> Self:
        self.release()
        if shutil.disk_usage(self._folder).free < RESERVE_BYTES:
            raise self._full()
        if hasattr(os, "posix_fallocate"):
            make_folder(self._file.parent)
            self._allocate()
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def release(self) -> bool:
        """Release the space, and tell whether there was any; a file that stays is used by the next test."""
        try:
            delete(self._file)
        except OSError:
            return False
        return True

    def _allocate(self) -> None:
        handle = os.open(self._file, os.O_WRONLY | os.O_CREAT, 0o644)
        try:
            os.posix_fallocate(handle, 0, RESERVE_BYTES)
        except OSError as error:
            self.release()
            if error.errno == errno.ENOSPC:
                raise self._full() from error
            if error.errno not in UNSUPPORTED_ERRNOS:
                raise OSError(error.errno, error.strerror, str(self._file)) from error
        finally:
            os.close(handle)

    def _full(self) -> DataError:
        free = shutil.disk_usage(self._folder).free
        needed = f"a tap test needs {RESERVE_BYTES / 1e6:.0f} MB"
        return DataError(f"{self._folder}: {free / 1e6:.0f} MB free, but {needed}. Make room on this disk.")
