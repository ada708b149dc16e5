"""Keep the table of all machines for the dashboard, with the changes since a request."""

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
from lobewatch.show.terminal.option_names import with_option_names, with_option_names_inside
from lobewatch.tap.spool import count_interrupted_hits

MACHINE_POLL_INTERVAL = 4.0
"""Shortest time between two polls of the files (s), for all pages together; chosen."""


class _MachineRow(NamedTuple):
    """Row of one machine."""

    inputs: tuple[Any, ...]
    """Data that the row was made from."""
    content: msgspec.Raw
    """Row, encoded as JSON."""
    change: int
    """Number of the change that made this row."""


class DashboardTable:
    """Rows of all machines of a folder, most severe first, each with the number of its last change.

    Machines come and go with their folders. One poll serves all pages within MACHINE_POLL_INTERVAL.
    """

    def __init__(self, path: Path) -> None:
        """Assess the machines. DataError if there is no machine."""
        self._path = path
        self.fleet = Fleet(find_machines(path), with_option_names)
        self._start = secrets.token_hex(4)
        self._change = 0
        self._rows: dict[str, _MachineRow] = {}
        self._gone: dict[str, int] = {}
        self._running: Collection[str] = ()
        self._polled = 0.0
        self._lock = threading.Lock()
        self._poll()

    def assess_machines(self) -> list[FleetMachine]:
        """Assess the machines that are present now."""
        with suppress(DataError):  # a missing folder may come back; each machine reports it
            self.fleet.set_machines(find_machines(self._path))
        return self.fleet.assess_machines()

    def updates_since(self, known: str, running: Collection[str]) -> dict[str, Any]:
        """Return the changes since a version of the table, or all rows if the version is not of this server.

        Changes are new rows with their places in the table, in order, and the names of missing machines. `running`
        holds the machines with a running tap test.
        """
        start, _, number = known.partition("-")
        with self._lock:
            if running != self._running or time.monotonic() - self._polled >= MACHINE_POLL_INTERVAL:
                self._running = running
                self._poll()
            version = {"version": f"{self._start}-{self._change}"}
            if start != self._start or not (number.isascii() and number.isdecimal()):
                return version | {"machines": [row.content for row in self._rows.values()]}
            since, rows = int(number), enumerate(self._rows.values())
            changed = [(place, row.content) for place, row in rows if row.change > since]
            gone = [key for key, change in self._gone.items() if change > since]
            return version | {"changed": changed, "gone": gone}

    def _poll(self) -> None:
        """Assess the machines and number the changes."""
        change = self._change + 1
        rows = {machine.key: self._row(machine, change) for machine in self.assess_machines()}
        self._gone |= dict.fromkeys(self._rows.keys() - rows.keys(), change)
        self._gone = {key: number for key, number in self._gone.items() if key not in rows}
        numbers = [row.change for row in rows.values()]
        self._change = max([self._change, *numbers, *self._gone.values()])
        self._rows, self._polled = rows, time.monotonic()

    def _row(self, machine: FleetMachine, change: int) -> _MachineRow:
        """Make the row of a machine, or keep the last one if nothing has changed."""
        days = machine.current.days_left  # rounded as pages show them, else every poll would change every row
        current = machine.current._replace(days_left=None if days is None else math.floor(days))
        interrupted, running = _count_interrupted_hits(machine.path), machine.key in self._running
        today = current.time.replace(hour=0, minute=0, second=0, microsecond=0)
        inputs = (machine.summary, current._replace(time=today), interrupted, running)
        last = self._rows.get(machine.key)
        if last is not None and last.inputs == inputs:
            return last
        row = fleet_row(machine._replace(current=current)) | {"interrupted": interrupted, "running": running}
        content = msgspec.Raw(msgspec.json.encode({key: with_option_names_inside(value) for key, value in row.items()}))
        return _MachineRow(inputs, content, last.change if last is not None and last.content == content else change)


def _count_interrupted_hits(folder: Path) -> dict[str, int]:
    """Count the hits of the interrupted tap tests of a machine, by direction."""
    try:
        if not os.path.isdir(f"{folder}/spool"):  # noqa: PTH112 - fast for thousands of machines
            return {}
        is_empty = not any(path.is_dir() for path in (folder / "spool").iterdir())
        return {} if is_empty else count_interrupted_hits(MachineFolder(folder))
    except (OSError, ValueError):
        return {}  # the row shows what is wrong
