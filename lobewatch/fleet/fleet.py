"""Assess the machines of a folder and refresh those whose files have changed."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import lobewatch.fleet as plant
import lobewatch.machine as machine
from acquisition import DataError, Remark
from acquisition.errors import format_error
from lobewatch.fleet.machine_summary import (
    SUMMARY_LIFETIME,
    DatedStatus,
    MachineSummary,
    read_summary,
    summarize_unreadable,
)
from lobewatch.machine.folder_files import compute_change_mark, format_path
from lobewatch.monitoring.status_rules import StatusLevel

VERIFY_INTERVAL = 6 * 3600.0
"""Time between two looks at every byte (s); chosen."""
MAX_RENEWALS_PER_POLL = 4
"""Number of summaries made anew at a look for their age alone: thousands of one day would hold up a server; chosen."""
SummaryMaker = Callable[[Sequence[Path], datetime], Iterable[tuple[Path, tuple[int, ...], MachineSummary]]]
"""Function that has others make summaries of machine folders: those that could be, with the marks of their files."""
MACHINE_FOLDER_FILES = ("machine.toml", "journal.jsonl")
"""Files that tell a machine folder: one without machine.toml is a machine that cannot be judged."""


class FleetMachine(NamedTuple):
    """One machine of a plant as it stands."""

    key: str
    """Name of its folder."""
    path: Path
    """Path of its folder."""
    summary: MachineSummary
    """Summary that follows from its files."""
    current: DatedStatus
    """Standing at the time that was asked for."""


class _CachedSummary(NamedTuple):
    """The summary of a machine as it was read or made last."""

    mark: tuple[int, ...]
    """Mark of the files it was made of."""
    time: datetime
    """Time of reading."""
    summary: MachineSummary
    """Summary of these files."""


def find_machines(path: Path) -> dict[str, Path]:
    """The machine at this path, or all in this folder, by name of their folders; DataError where there is none."""
    if any((path / name).exists() for name in MACHINE_FOLDER_FILES):
        return {format_path(path.resolve().name): path}
    try:
        names = sorted(name for name in os.listdir(path) if _is_machine(f"{path}/{name}"))  # noqa: PTH208
    except OSError:
        names = []
    if not names:
        raise DataError(f"{path}: neither a machine folder nor a folder of them; make one with: lobewatch init")
    return {format_path(name): path / name for name in names}


def _is_machine(folder: str) -> bool:
    """Whether it is a machine folder; of thousands at every look of a server."""
    return any(os.path.exists(f"{folder}/{name}") for name in MACHINE_FOLDER_FILES)  # noqa: PTH110


class Fleet:
    """The standings of some machines, read again where their files have changed.

    It holds by the key of each machine its summary, until its files change or the summary is a week old, and the damage
    that the last look at every byte has found.
    """

    def __init__(self, machines: Mapping[str, Path]) -> None:
        """machines: by name of their folders. Nothing is read yet."""
        self.machines = machines
        """Folder of each machine, by its key."""
        self._summaries: dict[str, _CachedSummary] = {}
        self._damage: dict[str, tuple[Remark, ...]] = {}
        self._outdated: set[str] = set()
        self._renewals_left = MAX_RENEWALS_PER_POLL
        self._lock = threading.Lock()

    def set_machines(self, machines: Mapping[str, Path]) -> None:
        """Take these machines for those known so far."""
        if machines == self.machines:
            return
        with self._lock:
            for key in self.machines.keys() - machines.keys():
                self._summaries.pop(key, None)
                self._damage.pop(key, None)
            self.machines = machines

    def make_missing_summaries(self, make: SummaryMaker, now: datetime | None = None) -> None:
        """Have others make the summaries that are missing; what they cannot make is made when it is asked for.

        What `make` raises.
        """
        now = now or datetime.now(UTC)
        with self._lock:
            missing = {path: key for key, path in self.machines.items() if read_summary(path, now) is None}
            for path, mark, summary in make([*missing], now) if missing else ():
                self._summaries[missing[path]] = _CachedSummary(mark, now, summary)

    def assess_machines(self, now: datetime | None = None) -> list[FleetMachine]:
        """One a machine, those that cannot be judged first, then worst first; who asks meanwhile waits."""
        now = now or datetime.now(UTC)
        with self._lock:
            self._renewals_left = MAX_RENEWALS_PER_POLL
            standings = [self._assess_machine(key, path, now) for key, path in self.machines.items()]
        lights = list(StatusLevel)
        return sorted(
            standings,
            key=lambda m: (m.current.is_readable, lights.index(m.current.status), -_largest_drop(m.summary), m.key),
        )

    def verify_until(self, end: threading.Event) -> None:
        """Look at every byte of all machines, now and every few hours until the end; what is damaged is said."""
        while True:
            for key, path in self.machines.items():
                if end.is_set():
                    return
                try:
                    damage = machine.verify(path).damage
                except Exception:  # noqa: BLE001 - its standing says it
                    continue
                with self._lock:
                    if damage != self._damage.get(key, ()):
                        self._summaries.pop(key, None)
                        self._outdated.add(key)
                    self._damage[key] = damage
            if end.wait(VERIFY_INTERVAL):
                return

    def _assess_machine(self, key: str, path: Path, now: datetime) -> FleetMachine:
        summary = self._current_summary(key, path, now)
        return FleetMachine(key, path, summary, summary.status_at(now, path, self._damage.get(key, ())))

    def _current_summary(self, key: str, path: Path, now: datetime) -> MachineSummary:
        last = self._summaries.get(key)
        if last is not None and last.mark == compute_change_mark(path, last.summary.newest_file):
            if now - last.time < SUMMARY_LIFETIME or not self._renewals_left:
                return last.summary
            self._renewals_left -= 1
        mark = compute_change_mark(path)
        try:
            summary = (None if key in self._outdated else read_summary(path, now)) or plant.summarize_folder(path, now)
        except Exception as error:  # noqa: BLE001 - whatever is wrong with it must not cost the others their standing
            return summarize_unreadable(last.summary.name if last else key, format_error(error))
        self._outdated.discard(key)
        if mark == compute_change_mark(path):  # else somebody has written meanwhile
            self._summaries[key] = _CachedSummary(compute_change_mark(path, summary.newest_file), now, summary)
        return summary


def _largest_drop(summary: MachineSummary) -> float:
    fall = summary.series[0].drop if summary.series else 0.0
    return float("inf") if fall is None else fall
