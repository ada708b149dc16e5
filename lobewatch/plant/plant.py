"""The machines of a folder, each as it stands; made anew where its files have changed."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from acquisition import DataError, Remark
from lobewatch.decay.light import Light
from lobewatch.machine.folder_path import mark_of
from lobewatch.plant.standing_file import KEPT, read_standing
from lobewatch.plant.summary import DatedStanding, Summary, unreadable_summary

VERIFY_EVERY = 6 * 3600.0
"""Time between two looks at every byte (s)."""


class MachineStanding(NamedTuple):
    """One machine."""

    key: str
    """Name of its folder."""
    path: Path
    """Its folder."""
    summary: Summary
    """What follows from its files."""
    dated: DatedStanding
    """How it stands now."""


def find_machines(path: Path) -> dict[str, Path]:
    """The machine at this path, or all in this folder, by name of their folders; DataError where there is none."""
    if (path / "machine.toml").is_file():
        return {path.resolve().name: path}
    found = {toml.parent.name: toml.parent for toml in sorted(path.glob("*/machine.toml"))}
    if not found:
        raise DataError(f"{path}: neither a machine folder nor a folder of them; make one with: lobewatch init")
    return found


class Plant:
    """The standings of some machines, read again where their files have changed."""

    def __init__(self, machines: Mapping[str, Path]) -> None:
        """machines: by name of their folders. Nothing is read yet."""
        self.machines = machines
        self._known: dict[str, tuple[tuple[int, ...], datetime, Summary]] = {}
        self._damage: dict[str, tuple[Remark, ...]] = {}
        self._anew: set[str] = set()
        self._lock = threading.Lock()

    def standings(self, now: datetime | None = None) -> list[MachineStanding]:
        """One a machine, worst first; who asks meanwhile waits."""
        now = now or datetime.now(UTC)
        with self._lock:
            found = [self._standing(key, path, now) for key, path in self.machines.items()]
        lights = list(Light)
        return sorted(found, key=lambda one: (lights.index(one.dated.light), -_fall(one.summary), one.key))

    def verify_until(self, end: threading.Event) -> None:
        """Look at every byte of all machines, now and every few hours until the end; what is damaged is said."""
        from lobewatch.machine.archive.verify import verify

        while True:
            for key, path in self.machines.items():
                if end.is_set():
                    return
                try:
                    damage = verify(path).damage
                except (ValueError, OSError):
                    continue  # its standing says it
                with self._lock:
                    if damage != self._damage.get(key, ()):
                        self._known.pop(key, None)
                        self._anew.add(key)
                    self._damage[key] = damage
            if end.wait(VERIFY_EVERY):
                return

    def _standing(self, key: str, path: Path, now: datetime) -> MachineStanding:
        summary = self._summary(key, path, now)
        return MachineStanding(key, path, summary, summary.at(now, path, self._damage.get(key, ())))

    def _summary(self, key: str, path: Path, now: datetime) -> Summary:
        known = self._known.get(key)
        if known is not None and known[0] == mark_of(path, known[2].newest_file) and now - known[1] < KEPT:
            return known[2]
        mark = mark_of(path)
        try:
            found = (None if key in self._anew else read_standing(path, now)) or _made(path, now)
        except (ValueError, OSError) as error:
            self._known.pop(key, None)
            return unreadable_summary(known[2].name if known else key, str(error))
        self._anew.discard(key)
        if mark == mark_of(path):  # else somebody has written meanwhile
            self._known[key] = mark_of(path, found.newest_file), now, found
        return found


def _made(path: Path, now: datetime) -> Summary:
    from lobewatch.logbook.logbook import Logbook
    from lobewatch.plant.summarise import summarise

    return summarise(Logbook.open(path), now)


def _fall(summary: Summary) -> float:
    worst = summary.series[0].fall if summary.series else 0.0
    return float("inf") if worst is None else worst
