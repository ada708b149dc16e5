"""The file calls of a program inside one folder: recorded, failing, or fatal.

Every call of os and every opening and writing of a file by Python below the folder is counted; the one with the wished
number does what it is told to. Files of HDF5 are made in memory and written by Python, so nothing passes by.
"""

from __future__ import annotations

import builtins
import errno
import io
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

T = TypeVar("T")
KILLED = 77
"""Exit code of a program that was ended by a fault."""
KILLS = ("killed before", "killed after", "killed half-way")
ERRORS = {"ENOSPC": errno.ENOSPC, "EIO": errno.EIO, "EMFILE": errno.EMFILE}
FAULTS = (*KILLS, *ERRORS)
ROOM = ("create", "append", "write", "mkdir", "rename")
"""Calls that need room on the disk."""


@dataclass(frozen=True)
class Call:
    """One file call that was made."""

    name: str
    """create, append, read, write, truncate, fsync, rename, unlink, mkdir, rmdir; failed for one that
    could not be done; or what was announced."""
    path: str
    """File or folder of the call."""
    data: bytes = b""
    """Data written."""
    to: str = ""
    """The new name."""
    size: int = 0
    """Remaining size (bytes)."""


class FaultyFiles:
    """Recorder of the file calls below a folder from `begin` on, which makes one of them fail."""

    def __init__(self, root: Path, at: int = -1, fault: str = "") -> None:
        """Set the number of the failing call, from 0, and its fault.

        A full disk stays full until reserved space on it is freed.
        """
        self.calls: list[Call] = []
        """Recorded calls, oldest first."""
        self._root, self._at, self._fault, self._count = f"{root}/", at, fault, 0
        self._full = False
        self._opened: dict[int, str] = {}
        self._open, self._io_open, self._write = os.open, io.open, os.write

    def begin(self) -> None:
        """From now on, until the program ends."""
        os.open = self._opening
        os.write = self._writing
        io.open = builtins.open = self._opening_file
        os.fsync = self._about("fsync", os.fsync)
        os.unlink = self._about("unlink", os.unlink)
        os.mkdir = self._about("mkdir", os.mkdir)
        os.rmdir = self._about("rmdir", os.rmdir)
        os.replace = self._renaming(os.replace)
        os.rename = self._renaming(os.rename)

    def write(self, path: str, data: bytes, real: Callable[[bytes], int]) -> int:
        """Write, perhaps half of it."""
        return self._made(Call("write", path, data), lambda: real(data), lambda: real(data[: len(data) // 2]))

    def truncate(self, path: str, size: int, real: Callable[[], int]) -> int:
        """Truncate the file after this number of bytes."""
        return self._made(Call("truncate", path, size=size), real)

    def _made(self, call: Call, real: Callable[[], T], half: Callable[[], object] = lambda: None) -> T:
        """Make the call, or inject its fault."""
        if not call.path.startswith(self._root):
            return real()
        due = self._count == self._at
        full = self._full and call.name in ROOM
        self._count += 1
        self._full &= (call.name, call.path[-8:]) != ("unlink", ".reserve")
        if (due or full) and self._fault in ERRORS:
            self._full = self._fault == "ENOSPC"
            half()
            code = ERRORS[self._fault]
            raise OSError(code, os.strerror(code), call.path)
        if due and self._fault in ("killed before", "killed half-way"):
            if self._fault == "killed half-way":
                half()
            os._exit(KILLED)
        self.calls.append(replace(call, name="failed"))
        done = real()
        self.calls[-1] = call
        if due:
            os._exit(KILLED)
        return done

    def _path(self, path: Any, dir_fd: int | None = None) -> str:
        if isinstance(path, int):
            return self._opened.get(path, "")
        name = os.fspath(path)
        return name if dir_fd is None else str(Path(self._opened.get(dir_fd, ""), name))

    def _opening(self, path: Any, flags: int, mode: int = 0o777, *, dir_fd: int | None = None) -> int:
        name = self._path(path, dir_fd)
        creates = flags & os.O_CREAT and not Path(name).exists()
        kind = "create" if creates else "append" if flags & os.O_APPEND else "read"
        handle = self._made(Call(kind, name), lambda: self._open(path, flags, mode, dir_fd=dir_fd))
        self._opened[handle] = name
        return handle

    def _writing(self, handle: int, data: Any) -> int:
        return self.write(self._path(handle), bytes(data), lambda part: self._write(handle, part))

    def _opening_file(self, file: Any, mode: str = "r", buffering: int = -1, *arguments: Any, **options: Any) -> Any:
        name = self._path(file)
        if not name.startswith(self._root) or not set(mode) & set("wxa+"):
            return self._made(Call("read", name), lambda: self._io_open(file, mode, buffering, *arguments, **options))
        raw = self._made(Call("append" if "r" in mode else "create", name), lambda: _Counted(name, mode, self))
        self._opened[raw.fileno()] = name
        return io.BufferedWriter(raw) if buffering else raw

    def _about(self, name: str, real: Callable[..., T]) -> Callable[..., T]:
        def call(path: Any, *arguments: Any, dir_fd: int | None = None, **options: Any) -> T:
            told = {"dir_fd": dir_fd, **options} if dir_fd is not None else options
            return self._made(Call(name, self._path(path, dir_fd)), lambda: real(path, *arguments, **told))

        return call

    def _renaming(self, real: Callable[..., T]) -> Callable[..., T]:
        def call(old: Any, new: Any, **options: Any) -> T:
            about = Call("rename", os.fspath(old), to=os.fspath(new))
            return self._made(about, lambda: real(old, new, **options))

        return call


class _Counted(io.FileIO):
    """A file whose writing is counted."""

    def __init__(self, name: str, mode: str, files: FaultyFiles) -> None:
        super().__init__(name, mode.replace("b", ""))
        self._name, self._files = name, files

    def write(self, data: Any, /) -> int:
        return self._files.write(self._name, bytes(data), super().write)

    def truncate(self, size: int | None = None, /) -> int:
        end = self.tell() if size is None else size
        return self._files.truncate(self._name, end, lambda: super(_Counted, self).truncate(end))
