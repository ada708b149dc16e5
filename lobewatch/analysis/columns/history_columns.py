"""A history as the columns of history.h5, and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from acquisition import Remark
from lobes import SldHistory
from lobewatch.analysis.columns import condition_columns as under
from lobewatch.analysis.columns.ruling_columns import limits, rulings_of, words
from lobewatch.analysis.estimate import Estimate
from lobewatch.analysis.history import MAX_MODES, History, Row
from lobewatch.machine import Machine

ESTIMATES = {"frequency": "Hz", "damping_ratio": "", "stiffness": "N/m", "phase_deg": "deg", "bearing_stiffness": "N/m"}
"""Values with a standard error and their units, by name of the field and the column."""
MODELLED = {"static_tip_stiffness": "N/m", "modal_tip_stiffness": "N/m"}
"""Values of the model."""
MODE_COLUMNS = {"mode_frequency": "Hz", "mode_damping_ratio": "", "mode_stiffness": "N/m", "mode_phase_deg": "deg"}


def to_columns(history: History, machine: Machine) -> SldHistory:
    """What history.h5 holds."""
    rows, programs = history.rows, [program.name for program in machine.program]
    names = ("tap_id", "tool", "direction", "series")
    columns: dict[str, Any] = {name: _texts(getattr(row, name) for row in rows) for name in names}
    columns["time"] = _texts(row.time.isoformat() for row in rows)
    columns["baseline"] = _texts(row.baseline.isoformat() if row.baseline else "" for row in rows)
    columns["notes"] = _texts("\n".join(map(str, row.remarks)) for row in rows)
    columns["remarks"] = _texts(_as_json([asdict(one) for one in row.remarks]) for row in rows)
    columns |= under.condition_columns([row.conditions for row in rows])
    for name in ESTIMATES:
        columns[name], columns[f"{name}_std"] = _numbers([getattr(row, name) for row in rows], 2).T
    for name in MODELLED:
        columns[name] = _numbers([getattr(row, name) for row in rows])
    table = np.full((len(rows), MAX_MODES, len(MODE_COLUMNS)), np.nan)
    for i, row in enumerate(rows):
        table[i, : len(row.modes)] = row.modes
    columns |= {name: table[:, :, k] for k, name in enumerate(MODE_COLUMNS)}
    if programs:
        columns["program_limit"] = _numbers([limits(row.rulings, programs) for row in rows], len(programs))
        columns["program_verdict"] = _texts(words(row.rulings, programs) for row in rows)
    nowhere = np.full(history.speed_rpm.size, np.nan)
    depth = {
        name: _numbers([row.depth.get(name, nowhere) for row in rows], history.speed_rpm.size)
        for name in machine.cut_names
    }
    units = ESTIMATES | {f"{name}_std": unit for name, unit in ESTIMATES.items()} | MODELLED
    units |= MODE_COLUMNS | under.NUMBERS
    units = {name: unit for name, unit in (units | {"program_limit": "m"}).items() if unit and name in columns}
    return SldHistory(history.settings_hash, history.software, history.speed_rpm, columns, depth, units)


def from_columns(stored: SldHistory, machine: Machine) -> History:
    """What history.h5 says. KeyError, IndexError or ValueError where it is of another make."""
    programs = [program.name for program in machine.program]
    rows = [_row(stored, i, programs) for i in range(len(stored))]
    return History(stored.settings_hash, stored.software, stored.speed_rpm, tuple(rows))


def _row(stored: SldHistory, i: int, programs: Sequence[str]) -> Row:
    columns = stored.columns
    number = {name: float(columns[name][i]) for name in (*ESTIMATES, *MODELLED)}
    known = {name: Estimate(number[name], float(columns[f"{name}_std"][i])) for name in ESTIMATES}
    names = ("tap_id", "time", "tool", "direction", "series", "baseline", "remarks")
    text = {name: str(columns[name][i]) for name in names}
    modes = np.stack([columns[name][i] for name in MODE_COLUMNS], axis=1)
    depth = {name: values[i] for name, values in stored.depth.items()}
    return Row(
        tap_id=text["tap_id"],
        time=datetime.fromisoformat(text["time"]),
        tool=text["tool"],
        direction=text["direction"],
        baseline=datetime.fromisoformat(text["baseline"]) if text["baseline"] else None,
        series=text["series"],
        conditions=under.conditions_of(columns, i),
        frequency=known["frequency"],
        damping_ratio=known["damping_ratio"],
        stiffness=known["stiffness"],
        phase_deg=known["phase_deg"],
        bearing_stiffness=known["bearing_stiffness"],
        static_tip_stiffness=number["static_tip_stiffness"],
        modal_tip_stiffness=number["modal_tip_stiffness"],
        modes=modes[np.isfinite(modes[:, 0])],
        remarks=msgspec.json.decode(text["remarks"], type=tuple[Remark, ...]),
        depth={name: values for name, values in depth.items() if not np.isnan(values[0])},
        rulings=rulings_of(stored, i, programs),
    )


def _texts(values: Any) -> NDArray[np.str_]:
    return np.array(list(values), dtype=np.str_)


def _numbers(values: Sequence[Any], *width: int) -> NDArray[np.float64]:
    return np.array(values, dtype=np.float64).reshape(len(values), *width)


def _as_json(value: Any) -> str:
    return msgspec.json.encode(value).decode()
