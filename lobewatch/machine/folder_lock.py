"""The lock of a machine folder: one program writes there at a time, and says beside the lock which one it is."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Self

import msgspec
from filelock import FileLock, Timeout

from acquisition import DataError
from acquisition.atomic import atomic_write
from acquisition.errors import NOT_ALLOWED
from acquisition.regular_file import SMALL, read_regular

LOCK, HOLDER = ".lock", ".lock.holder"
"""Names of the file that is locked, and of that which says who holds it: a locked file cannot be read everywhere."""
PATIENCE = 5.0
"""Time for which another program is waited for (s); as SQLite does by default in Python."""
POLL_TIME = 0.01
"""Time between two looks whether it is done (s)."""

READ_ONLY = "it can be read, not written; copy it to where you may write"
NO_LOCKS = "it can be read, but not locked for writing; mount that drive with locks, or copy the folder to another one"


class BusyError(DataError):
    """Another program writes to the folder."""


class Holder(msgspec.Struct, frozen=True):
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


class FolderLock:
    """Of one folder; whoever has this object may hold it several times over in one thread."""

    def __init__(self, folder: Path) -> None:
        """Not held yet."""
        self._folder, self._lock = folder, FileLock(folder / LOCK, fallback_to_soft=False)

    @contextlib.contextmanager
    def held(self, patience: float) -> Iterator[None]:
        """Keep other programs from writing here; BusyError where one does for longer than `patience` (s).

        OSError where this folder is not there, can only be read, or nothing can be locked there.
        """
        self._acquire(patience)
        try:
            yield
        finally:
            if self._lock.lock_counter == 1:
                with contextlib.suppress(OSError):
                    self._holder.unlink(missing_ok=True)
            self._lock.release()

    def _acquire(self, patience: float) -> None:
        if not self._folder.is_dir():  # FileLock would make it: below a drive that is away, say
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(self._folder))
        try:
            self._lock.acquire(patience, POLL_TIME)
        except Timeout as error:
            holder = self._read_holder() or "another lobewatch"
            raise BusyError(f"{self._folder}: {holder} is writing here; wait until it is done") from error
        except OSError as error:
            cure = READ_ONLY if error.errno in NOT_ALLOWED else NO_LOCKS
            raise OSError(error.errno, f"{error.strerror}: {cure}", str(self._folder)) from error
        if self._lock.lock_counter == 1:
            with contextlib.suppress(OSError):  # the lock holds without it
                atomic_write(self._holder, msgspec.json.encode(Holder.current()), lasting=False)

    @property
    def _holder(self) -> Path:
        return self._folder / HOLDER

    def _read_holder(self) -> Holder | None:
        """What the program that holds the lock says of itself; None where it has not said it yet."""
        try:
            return msgspec.json.decode(read_regular(self._holder, SMALL), type=Holder)
        except (OSError, msgspec.MsgspecError):
            return None
