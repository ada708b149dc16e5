"""What the dashboard says of each machine: how far the frequency has fallen, and when the next tap test is due."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from acquisition import DataError
from lobes import SldHistory, read_history
from lobewatch.analysis.history import series
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.machine_file import Machine

LIGHTS = ("alarm", "warn", "unknown", "good")
"""Worst first."""
DAY = 86400.0
"""s."""


@dataclass(frozen=True)
class Standing:
    """One machine on the dashboard."""

    key: str
    """Name of its folder, by which requests name it."""
    name: str
    """Of machine.toml."""
    light: str = "unknown"
    """One of LIGHTS, by the limits of machine.toml; warn too where a program is not stable."""
    fall: float | None = None
    """Fall of the followed frequency since the first test of the same tool and direction (%)."""
    fall_std: float | None = None
    """Its standard error (%)."""
    series: str = ""
    """Tool and direction of the newest test."""
    last_tap: str = ""
    """Date of the newest test (ISO 8601); empty where there is none."""
    days_left: float | None = None
    """Until the next test is due by tap_interval_days; negative where it is overdue; None before the first test."""
    note: str = ""
    """What else is to be said, e.g. what is wrong with its files."""

    @property
    def rank(self) -> tuple[int, float, str]:
        """Worst first."""
        return LIGHTS.index(self.light), -(self.fall or 0.0), self.key


def find_machines(path: Path) -> dict[str, MachineFolder]:
    """The machine at this path, or all in this folder, by name of their folders; DataError where there is none."""
    if (path / "machine.toml").is_file():
        return {path.resolve().name: MachineFolder(path)}
    found = {toml.parent.name: MachineFolder(toml.parent) for toml in sorted(path.glob("*/machine.toml"))}
    if not found:
        raise DataError(f"{path}: neither a machine folder nor a folder of them; make one with: lobewatch init")
    return found


def standing(key: str, folder: MachineFolder, now: datetime | None = None) -> Standing:
    """Read what the disk says of a machine; nothing is written. A machine whose files are wrong says so in its note."""
    try:
        return _standing(key, MachineFolder(folder.path), now or datetime.now(UTC))
    except (ValueError, OSError) as error:
        return Standing(key, key, note=str(error))


def _standing(key: str, folder: MachineFolder, now: datetime) -> Standing:
    machine, taps = folder.machine, folder.taps()
    if not taps:
        return Standing(key, machine.machine.name, note="no tap test yet")
    newest = taps[-1]
    about: dict[str, Any] = {
        "series": f"{newest.tool}, {newest.direction}",
        "last_tap": newest.time,
        "days_left": machine.machine.tap_interval_days
        - (now - datetime.fromisoformat(newest.time)).total_seconds() / DAY,
    }
    history = read_history(folder.history) if folder.history.exists() else None
    known = history is not None and history.settings_hash == machine.settings_hash and len(history) == len(taps)
    if history is None or not known:
        return Standing(
            key, machine.machine.name, note="not analysed with this machine.toml yet: open its report", **about
        )
    fall, std = _fall(history, newest.tool, newest.direction)
    if fall is None:
        return Standing(
            key, machine.machine.name, "warn", note="the newest test does not show the mode followed", **about
        )
    light, note = _light(fall, history, machine)
    return Standing(key, machine.machine.name, light, fall, std, note=note, **about)


def _fall(history: SldHistory, tool: str, direction: str) -> tuple[float | None, float | None]:
    """Percent, with standard error by that of both frequencies."""
    rows = series(history, tool, direction)
    frequency, std = (np.asarray(history.columns[name][rows]) for name in ("frequency", "frequency_std"))
    seen = np.flatnonzero(np.isfinite(frequency))
    if not seen.size or seen[-1] != rows.size - 1:
        return None, None
    first, last = seen[0], seen[-1]
    ratio = float(frequency[last] / frequency[first])
    if first == last:
        return 0.0, 0.0
    error = 100 * ratio * math.hypot(std[first] / frequency[first], std[last] / frequency[last])
    return 100 * (1 - ratio), error if math.isfinite(error) else None


def _light(fall: float, history: SldHistory, machine: Machine) -> tuple[str, str]:
    limits = machine.limits
    reached = (fall >= limits.frequency_warn_percent) + (fall >= limits.frequency_alarm_percent)
    light = ("good", "warn", "alarm")[reached]
    if not machine.program:
        return light, ""
    depth = history.columns["program_limit"][-1]
    unstable = [one.name for one, limit in zip(machine.program, depth, strict=True) if limit * 1e3 < one.depth_mm]
    if not unstable:
        return light, ""
    return min(light, "warn", key=LIGHTS.index), f"not stable: {', '.join(unstable)}"
