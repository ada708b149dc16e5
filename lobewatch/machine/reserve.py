"""Room on the disk held for a tap test in a file of its own, which is given up when the disk is full."""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path
from types import TracebackType
from typing import Self

from acquisition import DataError
from acquisition.atomic import make_folder

RESERVE_BYTES = 50_000_000
"""Room that a tap test needs."""
CANNOT_HOLD = (errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS)
"""Errors of file systems that hold no room for a file."""


class Reserve:
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
            if error.errno not in CANNOT_HOLD:
                raise OSError(error.errno, error.strerror, str(self._file)) from error
        finally:
            os.close(handle)

    def _full(self) -> DataError:
        free = shutil.disk_usage(self._folder).free
        needed = f"a tap test needs {RESERVE_BYTES / 1e6:.0f} MB"
        return DataError(f"{self._folder}: {free / 1e6:.0f} MB free on this disk; {needed}: make room")
