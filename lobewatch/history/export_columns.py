"""Columns and lobes of a history for export."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from acquisition import Conditions
from lobes import SldHistory, StabilityLobes
from lobewatch.arrays import Floats
from lobewatch.history import history as stored
from lobewatch.history.history import ESTIMATE_UNITS, MODEL_VALUE_UNITS, History, HistoryRow
from lobewatch.machine import Machine
from lobewatch.tool.assembly import compute_tip_lobes, speed_grid
from lobewatch.verdicts.verdict import StoredVerdict
from modal import Mode

TEXT_COLUMNS = ("tap_id", "tool", "direction", "series", "operator")
MODE_COLUMNS = {"mode_frequency": "Hz", "mode_damping_ratio": "", "mode_stiffness": "N/m", "mode_phase_deg": "deg"}
CONDITION_UNITS = {"temperature_c": "degC", "stick_out_mm": "mm", "drawbar_kn": "kN", "hours": "h"}
"""Numeric conditions with their units; NaN if unknown."""
CONDITION_TEXT_COLUMNS = ("state", "note")


def make_export_columns(history: History, machine: Machine, render: Callable[[str], str] = str) -> SldHistory:
    """Make the columns for `lobes.write_history`; render: translates the names in remarks."""
    rows, programs = history.rows, [program.name for program in machine.program]
    columns: dict[str, Any] = {name: _text_column(getattr(row, name) for row in rows) for name in TEXT_COLUMNS}
    columns["time"] = _text_column(row.time.isoformat() for row in rows)
    columns["baseline"] = _text_column(row.baseline.isoformat() if row.baseline else "" for row in rows)
    columns["notes"] = _text_column(render("\n".join(map(str, row.remarks))) for row in rows)
    remarks = (msgspec.json.encode([asdict(remark) for remark in row.remarks]).decode() for row in rows)
    columns["remarks"] = _text_column(map(render, remarks))
    columns |= _condition_columns([row.conditions for row in rows])
    for name in ESTIMATE_UNITS:
        columns[name], columns[f"{name}_std"] = _number_column([getattr(row, name) for row in rows], 2).T
    for name in MODEL_VALUE_UNITS:
        columns[name] = _number_column([getattr(row, name) for row in rows])
    table = np.full((len(rows), stored.MAX_STORED_MODES, len(MODE_COLUMNS)), np.nan)
    for i, row in enumerate(rows):
        table[i, : len(row.modes)] = np.reshape(row.modes, (-1, len(MODE_COLUMNS)))
    columns |= {name: table[:, :, k] for k, name in enumerate(MODE_COLUMNS)}
    if programs:
        limits = [_program_limits(row.verdicts, programs) for row in rows]
        columns["program_limit"] = _number_column(limits, len(programs))
        columns["program_verdict"] = _text_column(_program_verdicts(row.verdicts, programs) for row in rows)
    speeds = speed_grid(machine)
    depth = _lobe_depths(rows, machine, speeds)
    units = ESTIMATE_UNITS | {f"{name}_std": unit for name, unit in ESTIMATE_UNITS.items()} | MODEL_VALUE_UNITS
    units |= MODE_COLUMNS | CONDITION_UNITS
    units = {name: unit for name, unit in (units | {"program_limit": "m"}).items() if unit and name in columns}
    return SldHistory(history.settings_hash, history.software, speeds, columns, depth, units)


def compute_row_lobes(
    row: HistoryRow, machine: Machine, names: Collection[str] | None = None
) -> dict[str, StabilityLobes]:
    """Compute the lobes of a row as of its time; names: selected cuts."""
    return compute_tip_lobes(row.tool, _to_modes(row.x), _to_modes(row.y), machine, names)


def _to_modes(values: Sequence[stored.ModeValues]) -> list[Mode]:
    return [Mode(frequency, damping, stiffness, phase_deg=phase) for frequency, damping, stiffness, phase in values]


def _lobe_depths(rows: Sequence[HistoryRow], machine: Machine, speeds: Floats) -> dict[str, Floats]:
    """Return the limits of each row over speeds (m) by name of the cut; NaN without lobes."""
    nowhere = np.full(speeds.size, np.nan)
    diagrams = [compute_row_lobes(row, machine) for row in rows]
    return {
        name: _number_column([lobes[name].depth if name in lobes else nowhere for lobes in diagrams], speeds.size)
        for name in machine.cut_tables
    }


def _condition_columns(conditions: Sequence[Conditions]) -> dict[str, NDArray[Any]]:
    stated = [under.specified for under in conditions]
    numbers = {name: _number_column([under.get(name, np.nan) for under in stated]) for name in CONDITION_UNITS}
    texts = {name: _text_column(under.get(name, "") for under in stated) for name in CONDITION_TEXT_COLUMNS}
    return {**numbers, **texts, "reclamped": _number_column([under.reclamped for under in conditions])}


def _program_limits(rulings: Mapping[str, StoredVerdict] | None, programs: Sequence[str]) -> list[float]:
    """Return the limit of each program (m); NaN without a stored verdict."""
    return [rulings[name].limit if rulings and name in rulings else np.nan for name in programs]


def _program_verdicts(rulings: Mapping[str, StoredVerdict] | None, programs: Sequence[str]) -> str:
    """Return the verdict on each program, one per line; empty without stored verdicts."""
    return "\n".join(rulings[name].stability if name in rulings else "" for name in programs) if rulings else ""


def _text_column(values: Any) -> NDArray[np.str_]:
    return np.array(list(values), dtype=np.str_)


def _number_column(values: Sequence[Any], *width: int) -> Floats:
    return np.array(values, dtype=np.float64).reshape(len(values), *width)
