"""What the dashboard says of each machine."""

from __future__ import annotations

import math
import threading
from pathlib import Path
from typing import Any

from acquisition import DataError, Remark, joined
from lobewatch.analysis import Light, Logbook, Standing, unreadable
from lobewatch.analysis.standing import with_files
from lobewatch.machine import MachineFolder
from lobewatch.machine.archive.verify import verify

SHOWN_APART = ("frequency-alarm", "frequency-warn", "overdue")
"""Reasons that the page shows as the fall and the date."""

VERIFY_EVERY = 6 * 3600.0
"""Time between two looks at every byte (s)."""


def find_machines(path: Path) -> dict[str, MachineFolder]:
    """The machine at this path, or all in this folder, by name of their folders; DataError where there is none."""
    if (path / "machine.toml").is_file():
        return {path.resolve().name: MachineFolder(path)}
    found = {toml.parent.name: MachineFolder(toml.parent) for toml in sorted(path.glob("*/machine.toml"))}
    if not found:
        raise DataError(f"{path}: neither a machine folder nor a folder of them; make one with: lobewatch init")
    return found


class Board:
    """The standings of some machines, read again where their files have changed."""

    def __init__(self, machines: dict[str, MachineFolder]) -> None:
        """machines: by name of their folders."""
        self._machines = machines
        self._logbooks: dict[str, Logbook] = {}
        self._damage: dict[str, tuple[Remark, ...]] = {}
        self._lock = threading.Lock()

    def rows(self) -> list[dict[str, Any]]:
        """One a machine, worst first; who asks meanwhile waits."""
        with self._lock:
            standings = {key: self._standing(key) for key in self._machines}
        lights = list(Light)
        order = sorted(standings, key=lambda key: (lights.index(standings[key].light), -_fall(standings[key]), key))
        return [_row(key, self._name(key), standings[key]) for key in order]

    def verify_until(self, end: threading.Event) -> None:
        """Look at every byte of all machines, now and every few hours until the end; what is damaged stands in rows."""
        while True:
            for key, folder in self._machines.items():
                if end.is_set():
                    return
                try:
                    damage = verify(folder.path).damage
                except (ValueError, OSError):
                    continue  # the row says it
                with self._lock:
                    if damage != self._damage.get(key, ()):
                        self._logbooks.pop(key, None)
                    self._damage[key] = damage
            if end.wait(VERIFY_EVERY):
                return

    def _standing(self, key: str) -> Standing:
        logbook = self._logbooks.get(key)
        try:
            if logbook is None or not logbook.is_current:
                self._logbooks[key] = logbook = Logbook(MachineFolder(self._machines[key].path))
            return with_files(logbook.standing(), self._damage.get(key, ()))
        except (ValueError, OSError) as error:
            return unreadable(str(error))

    def _name(self, key: str) -> str:
        try:
            return self._logbooks[key].machine.machine.name
        except (KeyError, ValueError, OSError):
            return key


def _fall(standing: Standing) -> float:
    worst = standing.series[0].fall.value if standing.series else 0.0
    return worst if math.isfinite(worst) else math.inf


def _row(key: str, name: str, standing: Standing) -> dict[str, Any]:
    """As the page takes it; the series is the one that fell most."""
    worst = standing.series[0] if standing.series else None
    known = worst is not None and worst.fall.is_known
    std = worst.fall.std if worst is not None and math.isfinite(worst.fall.std) else None
    others = joined(remark for remark in standing.remarks if remark.code not in SHOWN_APART)
    reasons = [remark.finding for remark in others]
    return {
        "key": key,
        "name": name,
        "light": standing.light,
        "fall": worst.fall.value if worst is not None and known else None,
        "fall_std": std if known else None,
        "series": worst.name if worst else "",
        "last_tap": standing.last_tap.isoformat() if standing.last_tap else "",
        "days_left": standing.days_left,
        "reasons": reasons,
        "note": "; ".join(reasons),
        "next_step": standing.next_step,
    }
