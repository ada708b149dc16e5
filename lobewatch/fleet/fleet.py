"""Assess the machines of a folder and refresh those whose files have changed."""

import math
import os
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import lobewatch.fleet as fleet
import lobewatch.machine as machine
from acquisition import DataError, Remark
from acquisition.errors import format_error
from lobewatch.fleet import machine_summary
from lobewatch.fleet.copied_folders import find_copies
from lobewatch.fleet.machine_summary import DatedStatus, MachineSummary, read_summary
from lobewatch.machine.folder_files import compute_change_mark
from lobewatch.machine.journal.file_names import format_path
from lobewatch.monitoring.status_rules import StatusLevel

VERIFY_INTERVAL = 6 * 3600.0
"""Time between two verifications of every byte (s); chosen."""
MAX_RENEWALS_PER_POLL = 4
"""Number of summaries renewed for their age at a time, so that a server is not blocked; chosen."""
SummaryMaker = Callable[[Sequence[Path], datetime], Iterable[tuple[Path, tuple[int, ...], MachineSummary]]]
"""Function that summarizes machine folders elsewhere and yields each folder, its change mark and its summary."""
MACHINE_FOLDER_FILES = ("machine.toml", "journal.jsonl")
"""Files that mark a machine folder. Without machine.toml the machine cannot be evaluated."""


class FleetMachine(NamedTuple):
    """Machine of a fleet with its status."""

    key: str
    """Name of the machine folder."""
    path: Path
    """Path of the machine folder."""
    summary: MachineSummary
    """Summary of the files."""
    current: DatedStatus
    """Status at the time of the assessment."""


def find_machines(path: Path) -> dict[str, Path]:
    """Find the machine folder at a path, or all machine folders in it, by name. DataError if there is none."""
    if _is_machine(path):
        return {format_path(path.resolve().name): path}
    try:
        names = sorted(name for name in os.listdir(path) if _is_machine(f"{path}/{name}"))  # noqa: PTH208
    except OSError:
        names = []
    if not names:
        raise DataError(
            f"{path} is not a machine folder and contains no machine folder. Make a folder with make_machine_folder."
        )
    return {format_path(name): path / name for name in names}


def _is_machine(folder: Path | str) -> bool:
    """Return whether a folder is a machine folder. Fast, as servers ask about thousands of folders."""
    return any(os.path.exists(f"{folder}/{name}") for name in MACHINE_FOLDER_FILES)  # noqa: PTH110


class Fleet:
    """Machines with their summaries, which are renewed after a change of the files or after a week."""

    def __init__(self, machines: Mapping[str, Path], render_text: Callable[[str], str] = str) -> None:
        """Read nothing yet.

        Parameters
        ----------
        machines
            Path of each machine folder, by name.
        render_text
            Function that replaces names of the library in the texts of new summaries.
        """
        self.machines = machines
        """Path of each machine folder, by name."""
        self._render_text = render_text
        self._summaries: dict[str, tuple[tuple[int, ...], datetime, MachineSummary]] = {}
        self._damage: dict[str, tuple[Remark, ...]] = {}
        self._outdated: set[str] = set()
        self._renewals_left = MAX_RENEWALS_PER_POLL
        self._lock = threading.Lock()

    def set_machines(self, machines: Mapping[str, Path]) -> None:
        """Replace the machines of the fleet.

        Parameters
        ----------
        machines
            Path of each machine folder, by name.
        """
        if machines == self.machines:
            return
        with self._lock:
            for key in self.machines.keys() - machines.keys():
                self._summaries.pop(key, None)
                self._damage.pop(key, None)
            self.machines = machines

    def make_missing_summaries(self, make: SummaryMaker, now: datetime | None = None) -> None:
        """Make missing summaries elsewhere. Summaries that fail there are made by the next assessment.

        Parameters
        ----------
        make
            Function that summarizes machine folders. Its errors are raised.
        now
            Time of the summaries. None for the present time.
        """
        now = now or datetime.now(UTC)
        with self._lock:
            missing = {path: key for key, path in self.machines.items() if read_summary(path, now) is None}
            for path, mark, summary in make([*missing], now) if missing else ():
                self._summaries[missing[path]] = mark, now, summary

    def assess_machines(self, now: datetime | None = None) -> list[FleetMachine]:
        """Assess all machines, unreadable ones first, then the most severe first.

        Parameters
        ----------
        now
            Time of the assessment. None for the present time.
        """
        now = now or datetime.now(UTC)
        with self._lock:
            self._renewals_left = MAX_RENEWALS_PER_POLL
            copies = find_copies(self.machines)
            machines = [self._assess_machine(key, path, now, copies.get(key)) for key, path in self.machines.items()]
        return sorted(machines, key=_sort_key)

    def verify_until(self, end: threading.Event) -> None:
        """Verify every byte of all machines, now and every few hours. Damage becomes part of the status.

        Parameters
        ----------
        end
            Event that ends the verification.
        """
        while True:
            for key, path in self.machines.items():
                if end.is_set():
                    return
                try:
                    damage = machine.verify(path).damage
                except Exception:  # noqa: BLE001 - the status of the machine shows it
                    continue
                with self._lock:
                    if damage != self._damage.get(key, ()):
                        self._summaries.pop(key, None)
                        self._outdated.add(key)
                    self._damage[key] = damage
            if end.wait(VERIFY_INTERVAL):
                return

    def _assess_machine(self, key: str, path: Path, now: datetime, copy: Remark | None) -> FleetMachine:
        summary, copies = self._current_summary(key, path, now), () if copy is None else (copy,)
        return FleetMachine(key, path, summary, summary.status_at(now, path, self._damage.get(key, ()), copies))

    def _current_summary(self, key: str, path: Path, now: datetime) -> MachineSummary:
        """Return the cached summary if it is up to date, else renew it."""
        last_mark, last_time, last = self._summaries.get(key, ((), now, None))
        if last is not None and last_mark == compute_change_mark(path, last.newest_file):
            if now - last_time < machine_summary.SUMMARY_LIFETIME or not self._renewals_left:
                return last
            self._renewals_left -= 1
        mark = compute_change_mark(path)
        try:
            summary = None if key in self._outdated else read_summary(path, now)
            summary = summary or fleet.summarize_folder(path, now, self._render_text)
        except Exception as error:  # noqa: BLE001 - an unreadable machine must not hide the others
            return machine_summary.summarize_unreadable(last.name if last else key, format_error(error))
        self._outdated.discard(key)
        if mark == compute_change_mark(path):  # else another program has written meanwhile
            self._summaries[key] = compute_change_mark(path, summary.newest_file), now, summary
        return summary


def _sort_key(machine: FleetMachine) -> tuple[bool, int, float, str]:
    current, series = machine.current, machine.summary.series
    drop = series[0].drop if series else 0.0
    severity = [*StatusLevel].index(current.status)
    return current.is_readable, severity, -math.inf if drop is None else -drop, machine.key
