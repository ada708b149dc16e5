"""Disk contents after a power cut: data of synced files, names in synced folders.

A disk may keep more than it was made to, in any order. Three ways bound it: nothing more; every name, but of no content
more; nothing more, but what was deleted is gone.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from faulty_files import Call

WAYS = ("nothing more", "names too", "deletions too")


class Disk:
    """Model of a folder on disk and of the files that survive a power cut."""

    def __init__(self, folder: Path) -> None:
        """Start with a folder whose contents survive."""
        self._root = str(folder)
        self._now: dict[str, int | None] = {}
        self._written: list[bytes] = []
        self._synced: list[bytes] = []
        for path in sorted(folder.rglob("*")):
            self._now[str(path)] = None if path.is_dir() else self._new(path.read_bytes())
        self._kept, self._deleted = dict(self._now), set[str]()

    def replay(self, calls: Iterable[Call]) -> None:
        """Do what was done."""
        for call in calls:
            self._do(call)

    def survivor(self, way: str, target: Path) -> None:
        """Write what a power cut would leave now."""
        names = dict(self._now if way == "names too" else self._kept)
        if way == "deletions too":
            names = {name: number for name, number in names.items() if name not in self._deleted}
        target.mkdir()
        for name in sorted(names):
            path, number = target / os.path.relpath(name, self._root), names[name]
            if not path.parent.is_dir():  # its folder did not survive
                continue
            if number is None:
                path.mkdir()
            else:
                path.write_bytes(self._synced[number])

    def _new(self, content: bytes = b"") -> int:
        self._written.append(content)
        self._synced.append(content)
        return len(self._written) - 1

    def _do(self, call: Call) -> None:
        path = call.path
        if call.name == "create":
            self._now[path] = self._new()
            self._deleted.discard(path)
        elif call.name == "mkdir":
            self._now[path] = None
        elif call.name == "write":
            self._written[self._file(path)] += call.data
        elif call.name == "truncate":
            self._written[self._file(path)] = self._written[self._file(path)][: call.size]
        elif call.name == "rename":
            self._now[call.to] = self._now.pop(path)
        elif call.name in ("unlink", "rmdir"):
            self._now.pop(path)
            self._deleted.add(path)
        elif call.name == "fsync":
            self._sync(path)

    def _file(self, path: str) -> int:
        number = self._now[path]
        assert number is not None
        return number

    def _sync(self, path: str) -> None:
        if path != self._root and self._now[path] is not None:
            number = self._file(path)
            self._synced[number] = self._written[number]
            return
        for name in {*self._now, *self._kept}:
            if str(Path(name).parent) == path:
                if name in self._now:
                    self._kept[name] = self._now[name]
                else:
                    self._kept.pop(name, None)
