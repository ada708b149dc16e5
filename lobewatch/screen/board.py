"""The machines as pages show them, and what of it has changed since a page asked last."""

from __future__ import annotations

import math
import os
import secrets
import threading
import time
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from acquisition import DataError
from lobewatch.machine.folder import MachineFolder
from lobewatch.plant.plant import MachineStanding, Plant, find_machines
from lobewatch.show.plant.plant_rows import plant_row
from lobewatch.tap.spool import interrupted_tests

LOOK_EVERY = 4.0
"""Time between two looks at the files at least (s), whatever the number of pages; chosen."""


class _BoardRow(NamedTuple):
    """The row of one machine."""

    ground: tuple[Any, ...]
    """Ground that it was made on: the same again would give the same row."""
    content: msgspec.Raw
    """Row as JSON."""
    change: int
    """Number of the change that made it so."""


class Board:
    """The rows of all machines of a folder, worst first, each with the number of its last change.

    Machines come and go with their folders. One look at the files serves all pages that ask within LOOK_EVERY.
    """

    def __init__(self, path: Path) -> None:
        """Brings the histories up to date; DataError where there is no machine."""
        self._path = path
        self.plant = Plant(find_machines(path))
        self._start = secrets.token_hex(4)
        self._change = 0
        self._rows: dict[str, _BoardRow] = {}
        self._gone: dict[str, int] = {}
        self._running: Collection[str] = ()
        self._looked = 0.0
        self._lock = threading.Lock()
        self._look()

    def standings(self) -> list[MachineStanding]:
        """Of the machines that are there now."""
        with suppress(DataError):  # none at all: the folder may be away for a while, and each of them says so
            self.plant.know(find_machines(self._path))
        return self.plant.standings()

    def answer(self, known: str, running: Collection[str]) -> dict[str, Any]:
        """What has changed since a known version; all, where it is none of this server.

        running: machines that a test runs on. What has changed are rows, each with its place in the new list, in order
        of these places, and the names of machines that are gone.
        """
        start, _, number = known.partition("-")
        with self._lock:
            if running != self._running or time.monotonic() - self._looked >= LOOK_EVERY:
                self._running = running
                self._look()
            version = {"version": f"{self._start}-{self._change}"}
            if start != self._start or not (number.isascii() and number.isdecimal()):
                return version | {"machines": [row.content for row in self._rows.values()]}
            return version | self._changes_since(int(number))

    def _changes_since(self, since: int) -> dict[str, Any]:
        rows = enumerate(self._rows.values())
        return {
            "changed": [(place, row.content) for place, row in rows if row.change > since],
            "gone": [key for key, change in self._gone.items() if change > since],
        }

    def _look(self) -> None:
        """Look at the files, and number what has changed."""
        change = self._change + 1
        rows = {standing.key: self._row(standing, change) for standing in self.standings()}
        self._gone |= dict.fromkeys(self._rows.keys() - rows.keys(), change)
        self._gone = {key: number for key, number in self._gone.items() if key not in rows}
        numbers = [row.change for row in rows.values()]
        self._change = max([self._change, *numbers, *self._gone.values()])
        self._rows, self._looked = rows, time.monotonic()

    def _row(self, standing: MachineStanding, change: int) -> _BoardRow:
        """That of the last look, where it would be the same again."""
        standing = _in_whole_days(standing)
        interrupted, running = _interrupted_hits(standing.path), standing.key in self._running
        dated = standing.dated._replace(time=standing.dated.time.replace(hour=0, minute=0, second=0, microsecond=0))
        ground = (standing.summary, dated, interrupted, running)
        last = self._rows.get(standing.key)
        if last is not None and last.ground == ground:
            return last
        row = plant_row(standing) | {"interrupted": interrupted, "running": running}
        content = msgspec.Raw(msgspec.json.encode(row))
        return _BoardRow(ground, content, last.change if last is not None and last.content == content else change)


def _in_whole_days(standing: MachineStanding) -> MachineStanding:
    """Days left rounded down, as pages show them: what changes with every look would be sent with every look."""
    left = standing.dated.days_left
    return standing._replace(dated=standing.dated._replace(days_left=left if left is None else math.floor(left)))


def _interrupted_hits(folder: Path) -> dict[str, int]:
    """Hits of the interrupted tests of a machine, by direction."""
    try:
        if not os.path.isdir(f"{folder}/spool"):  # noqa: PTH112 - of thousands of machines at every look
            return {}
        is_empty = not any(path.is_dir() for path in (folder / "spool").iterdir())
        return {} if is_empty else interrupted_tests(MachineFolder(folder))
    except (OSError, ValueError):
        return {}  # the row says what is wrong
