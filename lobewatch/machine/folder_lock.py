"""The lock of a machine folder: one program writes there at a time, and says beside the lock which one it is."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Self

import msgspec
from filelock import lock_descriptor

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


class _Thread(threading.local):
    """What a thread holds."""

    holds = False


class FolderLock:
    """Of one folder; whoever has this object may hold it several times over in one thread."""

    def __init__(self, folder: Path) -> None:
        """Not held yet."""
        self._folder, self._thread = folder, _Thread()

    @contextlib.contextmanager
    def held(self, patience: float) -> Iterator[None]:
        """Keep other programs from writing here; BusyError where one does for longer than `patience` (s).

        OSError where this folder is not there, can only be read, or nothing can be locked there.
        """
        if self._thread.holds:
            yield
            return
        with contextlib.ExitStack() as stack:
            self._acquire(patience, stack)
            with contextlib.suppress(OSError):  # the lock holds without it
                atomic_write(self._holder, msgspec.json.encode(Holder.current()), lasting=False)
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
            handle = os.open(self._folder / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
            stack.callback(os.close, handle)
            self._wait(handle, patience)
        except (FileNotFoundError, NotADirectoryError) as error:
            raise type(error)(error.errno, error.strerror, str(self._folder)) from error
        except OSError as error:
            cure = READ_ONLY if error.errno in NOT_ALLOWED else NO_LOCKS
            raise OSError(error.errno, f"{error.strerror}: {cure}", str(self._folder)) from error

    def _wait(self, handle: int, patience: float) -> None:
        deadline = time.monotonic() + patience
        while not lock_descriptor(handle, blocking=False):
            if time.monotonic() >= deadline:
                holder = self._read_holder() or "another lobewatch"
                raise BusyError(f"{self._folder}: {holder} is writing here; wait until it is done")
            time.sleep(POLL_TIME)

    @property
    def _holder(self) -> Path:
        return self._folder / HOLDER

    def _read_holder(self) -> Holder | None:
        """What the program that holds the lock says of itself; None where it has not said it yet."""
        try:
            return msgspec.json.decode(read_regular(self._holder, SMALL), type=Holder)
        except (OSError, msgspec.MsgspecError):
            return None
