"""Lock of a machine folder, and disk space reserved in it."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import sys
import threading
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Self

import msgspec
from filelock import lock_descriptor

from acquisition import DataError
from acquisition.errors import PERMISSION_ERRNOS
from acquisition.file_io import MAX_SETTINGS_FILE_SIZE, atomic_write, make_folder, read_regular_file

LOCK_NAME, LOCK_HOLDER_NAME = ".lock", ".lock.holder"
"""Names of the file that is locked, and of that which says who holds it: a locked file cannot be read everywhere."""
LOCK_TIMEOUT = 5.0
"""Time for which another program is waited for (s); as SQLite does by default in Python."""
LOCK_POLL_INTERVAL = 0.01
"""Time between two looks whether it is done (s)."""

READ_ONLY_HINT = "it can be read, not written; copy it to where you may write"
NO_LOCKS_HINT = (
    "it can be read, but not locked for writing; mount that drive with locks, or copy the folder to another one"
)


class BusyError(DataError):
    """Another program writes to the folder."""


class LockHolder(msgspec.Struct, frozen=True):
    """The program that holds the lock."""

    command: str
    """Command that a person has given, without what it is about."""
    process: int
    """Number of its process."""
    since: datetime
    """Time from which on it holds the lock."""

    @classmethod
    def current(cls) -> Self:
        """This program, from now on."""
        program, *arguments = sys.argv or [""]
        name = "python" if program in ("", "-", "-c") else Path(program).stem
        words = [name, *[word for word in arguments if not word.startswith("-")][:1]]
        return cls(" ".join(words), os.getpid(), datetime.now(UTC))

    def __str__(self) -> str:
        """For people."""
        return f"`{self.command}` (process {self.process}, since {self.since.astimezone():%H:%M})"


class _ThreadState(threading.local):
    """What a thread holds."""

    holds = False


class FolderLock:
    """Of one folder; whoever has this object may hold it several times over in one thread."""

    def __init__(self, folder: Path) -> None:
        """Not held yet."""
        self._folder, self._thread = folder, _ThreadState()

    @contextlib.contextmanager
    def hold(self, patience: float) -> Iterator[None]:
        """Keep other programs from writing here; BusyError where one does for longer than `patience` (s).

        OSError where this folder is not there, can only be read, or nothing can be locked there.
        """
        if self._thread.holds:
            yield
            return
        with contextlib.ExitStack() as stack:
            self._acquire(patience, stack)
            with contextlib.suppress(OSError):  # the lock holds without it
                atomic_write(self._holder, msgspec.json.encode(LockHolder.current()), lasting=False)
            self._thread.holds = True
            try:
                yield
            finally:
                self._thread.holds = False
                with contextlib.suppress(OSError):
                    self._holder.unlink(missing_ok=True)

    def _acquire(self, patience: float, stack: contextlib.ExitStack) -> None:
        """Until the stack is closed. A folder that is away, below a drive say, is not made again."""
        try:
            handle = os.open(self._folder / LOCK_NAME, os.O_RDWR | os.O_CREAT, 0o644)
            stack.callback(os.close, handle)
            self._wait(handle, patience)
        except (FileNotFoundError, NotADirectoryError) as error:
            raise type(error)(error.errno, error.strerror, str(self._folder)) from error
        except OSError as error:
            cure = READ_ONLY_HINT if error.errno in PERMISSION_ERRNOS else NO_LOCKS_HINT
            raise OSError(error.errno, f"{error.strerror}: {cure}", str(self._folder)) from error

    def _wait(self, handle: int, patience: float) -> None:
        deadline = time.monotonic() + patience
        while not lock_descriptor(handle, blocking=False):
            if time.monotonic() >= deadline:
                holder = self._read_holder() or "another lobewatch"
                raise BusyError(f"{self._folder}: {holder} is writing here; wait until it is done")
            time.sleep(LOCK_POLL_INTERVAL)

    @property
    def _holder(self) -> Path:
        return self._folder / LOCK_HOLDER_NAME

    def _read_holder(self) -> LockHolder | None:
        """What the program that holds the lock says of itself; None where it has not said it yet."""
        try:
            return msgspec.json.decode(read_regular_file(self._holder, MAX_SETTINGS_FILE_SIZE), type=LockHolder)
        except (OSError, msgspec.MsgspecError):
            return None


RESERVE_BYTES = 50_000_000
"""Room that a tap test needs."""
UNSUPPORTED_ERRNOS = (errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS)
"""Errors of file systems that hold no room for a file."""


class DiskReserve:
    """Held between __enter__ and __exit__; where a system cannot hold room, it is only looked whether there is enough.

    A program that was killed leaves the file; the next one takes it over.
    """

    def __init__(self, folder: Path) -> None:
        """folder: of the machine."""
        self._folder, self._file = folder, folder / "spool" / ".reserve"

    def __enter__(self) -> Self:
        """Hold the room; DataError where there is not so much."""
        self.release()
        if shutil.disk_usage(self._folder).free < RESERVE_BYTES:
            raise self._full()
        if hasattr(os, "posix_fallocate"):
            make_folder(self._file.parent)
            self._allocate()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give it up."""
        self.release()

    def release(self) -> bool:
        """Give it up; whether there was any that could be given up: what stays is taken over by the next test."""
        try:
            self._file.unlink()
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
        return DataError(f"{self._folder}: {free / 1e6:.0f} MB free on this disk; {needed}: make room")
