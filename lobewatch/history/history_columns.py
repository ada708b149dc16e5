"""The history as columns and diagrams, for other programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from lobes import SldHistory
from lobewatch.history.condition_columns import (NUMBERS, condition_columns)
from lobewatch.history.row_lobes import row_lobes
from lobewatch.history.ruling_columns import (limits, words)
from lobewatch.history.history import ESTIMATES, MAX_MODES, MODELLED, History
from lobewatch.machine import Machine
from lobewatch.tool.assembly import speed_grid

TEXTS = ("tap_id", "tool", "direction", "series")
MODE_COLUMNS = {"mode_frequency": "Hz", "mode_damping_ratio": "", "mode_stiffness": "N/m", "mode_phase_deg": "deg"}


def to_columns(history: History, machine: Machine) -> SldHistory:
    """What `lobes.write_history` writes."""
    rows, programs = history.rows, [program.name for program in machine.program]
    columns: dict[str, Any] = {name: _texts(getattr(row, name) for row in rows) for name in TEXTS}
    columns["time"] = _texts(row.time.isoformat() for row in rows)
    columns["baseline"] = _texts(row.baseline.isoformat() if row.baseline else "" for row in rows)
    columns["notes"] = _texts("\n".join(map(str, row.remarks)) for row in rows)
    columns["remarks"] = _texts(_as_json([asdict(one) for one in row.remarks]) for row in rows)
    columns |= condition_columns([row.conditions for row in rows])
    for name in ESTIMATES:
        columns[name], columns[f"{name}_std"] = _numbers([getattr(row, name) for row in rows], 2).T
    for name in MODELLED:
        columns[name] = _numbers([getattr(row, name) for row in rows])
    table = np.full((len(rows), MAX_MODES, len(MODE_COLUMNS)), np.nan)
    for i, row in enumerate(rows):
        table[i, : len(row.modes)] = np.reshape(row.modes, (-1, len(MODE_COLUMNS)))
    columns |= {name: table[:, :, k] for k, name in enumerate(MODE_COLUMNS)}
    if programs:
        columns["program_limit"] = _numbers([limits(row.rulings, programs) for row in rows], len(programs))
        columns["program_verdict"] = _texts(words(row.rulings, programs) for row in rows)
    speeds = speed_grid(machine)
    nowhere = np.full(speeds.size, np.nan)
    found = [row_lobes(row, machine) for row in rows]
    depth = {
        name: _numbers([one[name].depth if name in one else nowhere for one in found], speeds.size)
        for name in machine.cut_names
    }
    units = ESTIMATES | {f"{name}_std": unit for name, unit in ESTIMATES.items()} | MODELLED
    units |= MODE_COLUMNS | NUMBERS
    units = {name: unit for name, unit in (units | {"program_limit": "m"}).items() if unit and name in columns}
    return SldHistory(history.settings_hash, history.software, speeds, columns, depth, units)


def _texts(values: Any) -> NDArray[np.str_]:
    return np.array(list(values), dtype=np.str_)


def _numbers(values: Sequence[Any], *width: int) -> NDArray[np.float64]:
    return np.array(values, dtype=np.float64).reshape(len(values), *width)


def _as_json(value: Any) -> str:
    return msgspec.json.encode(value).decode()
