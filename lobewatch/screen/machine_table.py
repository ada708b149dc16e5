"""Table of all machines for the dashboard, with the changes since the last request."""

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
from lobewatch.fleet.fleet import Fleet, FleetMachine, find_machines
from lobewatch.machine.folder import MachineFolder
from lobewatch.show.fleet.fleet_status import fleet_row
from lobewatch.tap.spool import count_interrupted_hits

MACHINE_POLL_INTERVAL = 4.0
"""Time between two looks at the files at least (s), whatever the number of pages; chosen."""


class _MachineRow(NamedTuple):
    """The row of one machine."""

    inputs: tuple[Any, ...]
    """Ground that it was made on: the same again would give the same row."""
    content: msgspec.Raw
    """Row as JSON."""
    change: int
    """Number of the change that made it so."""


class MachineTable:
    """The rows of all machines of a folder, worst first, each with the number of its last change.

    Machines come and go with their folders. One look at the files serves all pages that ask within LOOK_EVERY.
    """

    def __init__(self, path: Path) -> None:
        """Brings the histories up to date; DataError where there is no machine."""
        self._path = path
        self.fleet = Fleet(find_machines(path))
        self._start = secrets.token_hex(4)
        self._change = 0
        self._rows: dict[str, _MachineRow] = {}
        self._gone: dict[str, int] = {}
        self._running: Collection[str] = ()
        self._polled = 0.0
        self._lock = threading.Lock()
        self._poll()

    def assess_machines(self) -> list[FleetMachine]:
        """Of the machines that are there now."""
        with suppress(DataError):  # none at all: the folder may be away for a while, and each of them says so
            self.fleet.set_machines(find_machines(self._path))
        return self.fleet.assess_machines()

    def updates_since(self, known: str, running: Collection[str]) -> dict[str, Any]:
        """What has changed since a known version; all, where it is none of this server.

        running: machines that a test runs on. What has changed are rows, each with its place in the new list, in order
        of these places, and the names of machines that are gone.
        """
        start, _, number = known.partition("-")
        with self._lock:
            if running != self._running or time.monotonic() - self._polled >= MACHINE_POLL_INTERVAL:
                self._running = running
                self._poll()
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

    def _poll(self) -> None:
        """Look at the files, and number what has changed."""
        change = self._change + 1
        rows = {standing.key: self._row(standing, change) for standing in self.assess_machines()}
        self._gone |= dict.fromkeys(self._rows.keys() - rows.keys(), change)
        self._gone = {key: number for key, number in self._gone.items() if key not in rows}
        numbers = [row.change for row in rows.values()]
        self._change = max([self._change, *numbers, *self._gone.values()])
        self._rows, self._polled = rows, time.monotonic()

    def _row(self, standing: FleetMachine, change: int) -> _MachineRow:
        """That of the last look, where it would be the same again."""
        standing = _round_days_left(standing)
        interrupted, running = _count_interrupted_hits(standing.path), standing.key in self._running
        dated = standing.current._replace(time=standing.current.time.replace(hour=0, minute=0, second=0, microsecond=0))
        ground = (standing.summary, dated, interrupted, running)
        last = self._rows.get(standing.key)
        if last is not None and last.inputs == ground:
            return last
        row = fleet_row(standing) | {"interrupted": interrupted, "running": running}
        content = msgspec.Raw(msgspec.json.encode(row))
        return _MachineRow(ground, content, last.change if last is not None and last.content == content else change)


def _round_days_left(standing: FleetMachine) -> FleetMachine:
    """Days left rounded down, as pages show them: what changes with every look would be sent with every look."""
    left = standing.current.days_left
    return standing._replace(current=standing.current._replace(days_left=left if left is None else math.floor(left)))


def _count_interrupted_hits(folder: Path) -> dict[str, int]:
    """Hits of the interrupted tests of a machine, by direction."""
    try:
        if not os.path.isdir(f"{folder}/spool"):  # noqa: PTH112 - of thousands of machines at every look
            return {}
        is_empty = not any(path.is_dir() for path in (folder / "spool").iterdir())
        return {} if is_empty else count_interrupted_hits(MachineFolder(folder))
    except (OSError, ValueError):
        return {}  # the row says what is wrong
