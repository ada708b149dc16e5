"""The history as columns and diagrams, for other programs."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from acquisition import Conditions
from lobes import SldHistory, StabilityLobes
from lobewatch.history.history import ESTIMATES, MAX_MODES, MODELLED, History, Row, Values
from lobewatch.machine import Machine
from lobewatch.tool.assembly import speed_grid, tip_lobes
from lobewatch.verdicts.verdict import Ruling
from modal import Mode

TEXTS = ("tap_id", "tool", "direction", "series", "operator")
MODE_COLUMNS = {"mode_frequency": "Hz", "mode_damping_ratio": "", "mode_stiffness": "N/m", "mode_phase_deg": "deg"}
CONDITIONS = {"temperature_c": "degC", "stick_out_mm": "mm", "drawbar_kn": "kN", "hours": "h"}
"""Numbers among the conditions, with their units; NaN where nobody said."""
CONDITION_TEXTS = ("state", "note")


def to_columns(history: History, machine: Machine) -> SldHistory:
    """What `lobes.write_history` writes."""
    rows, programs = history.rows, [program.name for program in machine.program]
    columns: dict[str, Any] = {name: _texts(getattr(row, name) for row in rows) for name in TEXTS}
    columns["time"] = _texts(row.time.isoformat() for row in rows)
    columns["baseline"] = _texts(row.baseline.isoformat() if row.baseline else "" for row in rows)
    columns["notes"] = _texts("\n".join(map(str, row.remarks)) for row in rows)
    columns["remarks"] = _texts(_as_json([asdict(remark) for remark in row.remarks]) for row in rows)
    columns |= _condition_columns([row.conditions for row in rows])
    for name in ESTIMATES:
        columns[name], columns[f"{name}_std"] = _numbers([getattr(row, name) for row in rows], 2).T
    for name in MODELLED:
        columns[name] = _numbers([getattr(row, name) for row in rows])
    table = np.full((len(rows), MAX_MODES, len(MODE_COLUMNS)), np.nan)
    for i, row in enumerate(rows):
        table[i, : len(row.modes)] = np.reshape(row.modes, (-1, len(MODE_COLUMNS)))
    columns |= {name: table[:, :, k] for k, name in enumerate(MODE_COLUMNS)}
    if programs:
        columns["program_limit"] = _numbers([_limits(row.rulings, programs) for row in rows], len(programs))
        columns["program_verdict"] = _texts(_words(row.rulings, programs) for row in rows)
    speeds = speed_grid(machine)
    depth = _depths(rows, machine, speeds)
    units = ESTIMATES | {f"{name}_std": unit for name, unit in ESTIMATES.items()} | MODELLED
    units |= MODE_COLUMNS | CONDITIONS
    units = {name: unit for name, unit in (units | {"program_limit": "m"}).items() if unit and name in columns}
    return SldHistory(history.settings_hash, history.software, speeds, columns, depth, units)


def row_lobes(row: Row, machine: Machine, names: Collection[str] | None = None) -> dict[str, StabilityLobes]:
    """The diagrams of a row, as `lobes_of` of the assembly as it was then; names: of these cuts alone.

    They are worked out where they are asked for, not stored.
    """
    return tip_lobes(row.tool, _modes(row.x), _modes(row.y), machine, names)


def _modes(values: Sequence[Values]) -> list[Mode]:
    return [Mode(frequency, damping, stiffness, phase_deg=phase) for frequency, damping, stiffness, phase in values]


def _depths(rows: Sequence[Row], machine: Machine, speeds: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Limits of each row over speeds (m), by name of the cut; NaN where there is no diagram of it."""
    nowhere = np.full(speeds.size, np.nan)
    diagrams = [row_lobes(row, machine) for row in rows]
    return {
        name: _numbers([lobes[name].depth if name in lobes else nowhere for lobes in diagrams], speeds.size)
        for name in machine.cut_names
    }


def _condition_columns(conditions: Sequence[Conditions]) -> dict[str, NDArray[Any]]:
    stated = [under.known for under in conditions]
    numbers = {name: np.array([under.get(name, np.nan) for under in stated], dtype=np.float64) for name in CONDITIONS}
    texts = {name: np.array([under.get(name, "") for under in stated], dtype=np.str_) for name in CONDITION_TEXTS}
    reclamped = np.array([under.reclamped for under in conditions], dtype=np.float64)
    return {**numbers, **texts, "reclamped": reclamped}


def _limits(rulings: Mapping[str, Ruling] | None, programs: Sequence[str]) -> list[float]:
    """Limit of each program (m); NaN where nobody has asked yet."""
    return [rulings[name].limit if rulings and name in rulings else np.nan for name in programs]


def _words(rulings: Mapping[str, Ruling] | None, programs: Sequence[str]) -> str:
    """One word a program, a line each; empty where nobody has asked yet."""
    return "\n".join(rulings[name].word if name in rulings else "" for name in programs) if rulings else ""


def _texts(values: Any) -> NDArray[np.str_]:
    return np.array(list(values), dtype=np.str_)


def _numbers(values: Sequence[Any], *width: int) -> NDArray[np.float64]:
    return np.array(values, dtype=np.float64).reshape(len(values), *width)


def _as_json(value: Any) -> str:
    return msgspec.json.encode(value).decode()
