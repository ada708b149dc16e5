"""The machines of a folder, each as it stands; made anew where its files have changed."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import lobewatch.machine as machine
import lobewatch.plant as plant
from acquisition import DataError, Remark
from acquisition.errors import failure_text
from lobewatch.decay.light import Light
from lobewatch.machine.folder_path import mark_of, path_text
from lobewatch.plant.standing_file import LASTING, read_standing
from lobewatch.plant.summary import DatedStanding, Summary, unreadable_summary

VERIFY_EVERY = 6 * 3600.0
"""Time between two looks at every byte (s); chosen."""
RENEWED = 4
"""Number of summaries made anew at a look for their age alone: thousands of one day would hold up a server; chosen."""
Makers = Callable[[Sequence[Path], datetime], Iterable[tuple[Path, tuple[int, ...], Summary]]]
"""Function that has others make summaries of machine folders: those that could be, with the marks of their files."""
KNOWN_BY = ("machine.toml", "journal.jsonl")
"""Files that tell a machine folder: one without machine.toml is a machine that cannot be judged."""


class MachineStanding(NamedTuple):
    """One machine of a plant as it stands."""

    key: str
    """Name of its folder."""
    path: Path
    """Path of its folder."""
    summary: Summary
    """Summary that follows from its files."""
    dated: DatedStanding
    """Standing at the time that was asked for."""


class _ReadSummary(NamedTuple):
    """The summary of a machine as it was read or made last."""

    mark: tuple[int, ...]
    """Mark of the files it was made of."""
    time: datetime
    """Time of reading."""
    summary: Summary
    """Summary of these files."""


def find_machines(path: Path) -> dict[str, Path]:
    """The machine at this path, or all in this folder, by name of their folders; DataError where there is none."""
    if any((path / name).exists() for name in KNOWN_BY):
        return {path_text(path.resolve().name): path}
    try:
        names = sorted(name for name in os.listdir(path) if _is_machine(f"{path}/{name}"))  # noqa: PTH208
    except OSError:
        names = []
    if not names:
        raise DataError(f"{path}: neither a machine folder nor a folder of them; make one with: lobewatch init")
    return {path_text(name): path / name for name in names}


def _is_machine(folder: str) -> bool:
    """Whether it is a machine folder; of thousands at every look of a server."""
    return any(os.path.exists(f"{folder}/{name}") for name in KNOWN_BY)  # noqa: PTH110


class Plant:
    """The standings of some machines, read again where their files have changed.

    It holds by the key of each machine its summary, until its files change or the summary is a week old, and the damage
    that the last look at every byte has found.
    """

    def __init__(self, machines: Mapping[str, Path]) -> None:
        """machines: by name of their folders. Nothing is read yet."""
        self.machines = machines
        """Folder of each machine, by its key."""
        self._summaries: dict[str, _ReadSummary] = {}
        self._damage: dict[str, tuple[Remark, ...]] = {}
        self._outdated: set[str] = set()
        self._renewals = RENEWED
        self._lock = threading.Lock()

    def know(self, machines: Mapping[str, Path]) -> None:
        """Take these machines for those known so far."""
        if machines == self.machines:
            return
        with self._lock:
            for key in self.machines.keys() - machines.keys():
                self._summaries.pop(key, None)
                self._damage.pop(key, None)
            self.machines = machines

    def renew(self, make: Makers, now: datetime | None = None) -> None:
        """Have others make the summaries that are missing; what they cannot make is made when it is asked for.

        What `make` raises.
        """
        now = now or datetime.now(UTC)
        with self._lock:
            missing = {path: key for key, path in self.machines.items() if read_standing(path, now) is None}
            for path, mark, summary in make([*missing], now) if missing else ():
                self._summaries[missing[path]] = _ReadSummary(mark, now, summary)

    def standings(self, now: datetime | None = None) -> list[MachineStanding]:
        """One a machine, those that cannot be judged first, then worst first; who asks meanwhile waits."""
        now = now or datetime.now(UTC)
        with self._lock:
            self._renewals = RENEWED
            standings = [self._standing(key, path, now) for key, path in self.machines.items()]
        lights = list(Light)
        return sorted(
            standings,
            key=lambda m: (m.dated.can_be_judged, lights.index(m.dated.light), -_largest_fall(m.summary), m.key),
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
            if end.wait(VERIFY_EVERY):
                return

    def _standing(self, key: str, path: Path, now: datetime) -> MachineStanding:
        summary = self._summary(key, path, now)
        return MachineStanding(key, path, summary, summary.at(now, path, self._damage.get(key, ())))

    def _summary(self, key: str, path: Path, now: datetime) -> Summary:
        last = self._summaries.get(key)
        if last is not None and last.mark == mark_of(path, last.summary.newest_file):
            if now - last.time < LASTING or not self._renewals:
                return last.summary
            self._renewals -= 1
        mark = mark_of(path)
        try:
            summary = (None if key in self._outdated else read_standing(path, now)) or plant.summarise_folder(path, now)
        except Exception as error:  # noqa: BLE001 - whatever is wrong with it must not cost the others their standing
            return unreadable_summary(last.summary.name if last else key, failure_text(error))
        self._outdated.discard(key)
        if mark == mark_of(path):  # else somebody has written meanwhile
            self._summaries[key] = _ReadSummary(mark_of(path, summary.newest_file), now, summary)
        return summary


def _largest_fall(summary: Summary) -> float:
    fall = summary.series[0].fall if summary.series else 0.0
    return float("inf") if fall is None else fall
