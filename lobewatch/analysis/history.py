"""The history of a machine: one row a measurement, derived from its tap tests and its machine file."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition import TapTest
from dsm import Calibration
from lobes import SldHistory, read_history, write_history
from lobewatch.analysis.pipeline import Measurement, analyse, speed_grid
from lobewatch.machine.folder import MachineFolder, TapEntry
from lobewatch.machine.machine_file import Machine
from modal import Mode

MAX_MODES = 12
"""Modes kept of one measurement."""
PAIRING = timedelta(hours=24)
"""x and y taps of one tool within this time belong together."""
UNITS = {
    "frequency": "Hz",
    "frequency_std": "Hz",
    "stiffness": "N/m",
    "stiffness_std": "N/m",
    "bearing_stiffness": "N/m",
    "bearing_stiffness_std": "N/m",
    "static_tip_stiffness": "N/m",
    "modal_tip_stiffness": "N/m",
    "mode_frequency": "Hz",
    "mode_stiffness": "N/m",
    "program_limit": "m",
}
TEXTS = ("tap_id", "time", "tool", "direction", "notes")
NUMBERS = (
    "frequency",
    "frequency_std",
    "damping_ratio",
    "damping_ratio_std",
    "stiffness",
    "stiffness_std",
    "bearing_stiffness",
    "bearing_stiffness_std",
    "static_tip_stiffness",
    "modal_tip_stiffness",
)
MODE_COLUMNS = ("mode_frequency", "mode_damping_ratio", "mode_stiffness")


def update_history(folder: MachineFolder) -> tuple[SldHistory, list[Measurement]]:
    """The history with every committed tap in it, on the disk, and the measurements that were new to it.

    Rows stand in order of time. What is there is kept as long as it was made by these settings and this version from
    the oldest taps on; else all is analysed again, so that a history kept up is equal to one made again.
    """
    taps = folder.taps()
    history = _read_current(folder, [entry.id for entry in taps])
    measurements = []
    for entry in taps[len(history) :]:
        measurements.append(_measure(folder, entry, history))
        history = history.append(*_row(measurements[-1], folder.machine))
    if measurements or not folder.history.exists():
        write_history(folder.history, history)
    return history, measurements


def measure(folder: MachineFolder, entry: TapEntry) -> Measurement:
    """The measurement of one committed tap as the history holds it."""
    history, _ = update_history(folder)
    return _measure(folder, entry, history)


def _measure(folder: MachineFolder, entry: TapEntry, history: SldHistory) -> Measurement:
    """One tap, its partner in the other direction, and the mode that was followed before it."""
    return analyse(folder.read(entry), folder.machine, partner(folder, entry), _last_followed(history, entry))


def partner(folder: MachineFolder, entry: TapEntry) -> TapTest | None:
    """The newest tap of the other direction and the same tool, at most a day before."""
    time = datetime.fromisoformat(entry.time)
    for other in reversed(folder.taps()):
        age = time - datetime.fromisoformat(other.time)
        if other.tool == entry.tool and other.direction != entry.direction and timedelta(0) <= age <= PAIRING:
            return folder.read(other)
    return None


def series(history: SldHistory, tool: str, direction: str) -> NDArray[np.int64]:
    """Rows of one tool and direction, oldest first."""
    columns = history.columns
    return np.flatnonzero((columns["tool"] == tool) & (columns["direction"] == direction))


def _last_followed(history: SldHistory, entry: TapEntry) -> Mode | None:
    """The mode that was followed last before a tap, in its series."""
    columns = history.columns
    itself = np.flatnonzero(columns["tap_id"] == entry.id)
    before = itself[0] if itself.size else len(history)
    known = [row for row in series(history, entry.tool, entry.direction) if np.isfinite(columns["frequency"][row])]
    rows = [row for row in known if row < before]
    if not rows:
        return None
    frequency, damping, stiffness = (float(columns[name][rows[-1]]) for name in NUMBERS[:6:2])
    return Mode(frequency, damping, stiffness)


def _software() -> str:
    return f"lobewatch {version('lobewatch')}"


def _read_current(folder: MachineFolder, tap_ids: list[str]) -> SldHistory:
    """The stored history where it still holds, else an empty one."""
    empty = _empty(folder.machine)
    if not folder.history.exists():
        return empty
    try:
        stored = read_history(folder.history)
    except ValueError:
        return empty
    same = stored.settings_hash == empty.settings_hash and stored.software == empty.software
    return stored if same and list(stored.columns["tap_id"]) == tap_ids[: len(stored)] else empty


def _empty(machine: Machine) -> SldHistory:
    speeds = speed_grid(machine)
    programs = len(machine.program)
    columns: dict[str, NDArray[Any]] = {name: np.empty(0, np.str_) for name in TEXTS}
    columns |= {name: np.empty(0) for name in NUMBERS}
    columns |= {name: np.empty((0, MAX_MODES)) for name in MODE_COLUMNS}
    if programs:
        columns["program_limit"] = np.empty((0, programs))
    depth = {name: np.empty((0, speeds.size)) for name in machine.cut_names}
    units = {name: unit for name, unit in UNITS.items() if name in columns}
    return SldHistory(machine.settings_hash, _software(), speeds, columns, depth, units)


def _row(m: Measurement, machine: Machine) -> tuple[dict[str, Any], dict[str, NDArray[np.float64]]]:
    speeds = speed_grid(machine)
    unknown = np.full(speeds.size, np.nan)
    columns: dict[str, Any] = {
        "tap_id": m.tap_id,
        "time": m.time.isoformat(),
        "tool": m.tool,
        "direction": m.direction,
        "notes": "\n".join(m.notes),
        **_mode_values(m.dynamics.followed),
        **_calibration_values(m.dynamics.calibration),
        **_mode_table(m.dynamics.modes),
    }
    if machine.program:
        columns["program_limit"] = [
            m.lobes[program.name].depth_at(program.speed_rpm) if program.name in m.lobes else np.nan
            for program in machine.program
        ]
    return columns, {name: m.lobes[name].depth if name in m.lobes else unknown for name in machine.cut_names}


def _mode_values(mode: Mode | None) -> dict[str, float]:
    values = np.full(6, np.nan)
    if mode is not None:
        values[::2] = mode.frequency, mode.damping_ratio, mode.stiffness
        values[1::2] = mode.standard_error
    return dict(zip(NUMBERS[:6], values.tolist(), strict=True))


def _calibration_values(c: Calibration | None) -> dict[str, float]:
    if c is None:
        return dict.fromkeys(NUMBERS[6:], float("nan"))
    std = np.nan if c.bearing_stiffness_std is None else c.bearing_stiffness_std
    values = (c.bearing_stiffness, std, c.static_stiffness_after, c.modal_stiffness_after)
    return dict(zip(NUMBERS[6:], values, strict=True))


def _mode_table(modes: Sequence[Mode]) -> dict[str, NDArray[np.float64]]:
    table = np.full((3, MAX_MODES), np.nan)
    for i, mode in enumerate(modes[:MAX_MODES]):
        table[:, i] = mode.frequency, mode.damping_ratio, mode.stiffness
    return dict(zip(MODE_COLUMNS, table, strict=True))
