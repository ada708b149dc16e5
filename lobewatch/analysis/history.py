"""The history of a machine as typed rows, one a measurement, and its columns in history.h5."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import datetime
from importlib.metadata import version
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from acquisition import Remark
from dsm import Calibration
from lobes import SldHistory, StabilityLobes
from lobewatch.analysis.assembly import speed_grid
from lobewatch.analysis.columns.ruling_columns import limits, rulings_of, words
from lobewatch.analysis.estimate import UNKNOWN, Estimate
from lobewatch.analysis.measurement import Measurement
from lobewatch.analysis.programs.verdict import Ruling
from lobewatch.analysis.questions.asked import open_questions
from lobewatch.machine import Machine
from modal import Mode

MAX_MODES = 12
"""Modes kept of one measurement."""
ESTIMATES = {"frequency": "Hz", "damping_ratio": "", "stiffness": "N/m", "phase_deg": "deg", "bearing_stiffness": "N/m"}
"""Values with a standard error and their units, by name of the field and the column."""
MODELLED = {"static_tip_stiffness": "N/m", "modal_tip_stiffness": "N/m"}
"""Values of the model."""
MODE_COLUMNS = {"mode_frequency": "Hz", "mode_damping_ratio": "", "mode_stiffness": "N/m", "mode_phase_deg": "deg"}


@dataclass(frozen=True, eq=False)
class Row:
    """One measurement of the history: what was measured, and what was said of the programs where that was asked."""

    tap_id: str
    """Of the tap test."""
    time: datetime
    """When it was taken."""
    tool: str
    """What was in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    frequency: Estimate = UNKNOWN
    """Of the mode followed (Hz)."""
    damping_ratio: Estimate = UNKNOWN
    """Of the mode followed (-)."""
    stiffness: Estimate = UNKNOWN
    """Of the mode followed, where it was tapped (N/m)."""
    phase_deg: Estimate = UNKNOWN
    """Of the modal constant of the mode followed (degrees)."""
    bearing_stiffness: Estimate = UNKNOWN
    """Mean of the bearings of the recalibrated model (N/m)."""
    static_tip_stiffness: float = np.nan
    """Of the recalibrated model (N/m)."""
    modal_tip_stiffness: float = np.nan
    """Of the recalibrated model (N/m)."""
    modes: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 4)))
    """Frequency (Hz), damping ratio, stiffness (N/m) and phase (degrees) of all modes found, shape (m, 4)."""
    remarks: tuple[Remark, ...] = ()
    """What could not be done, and what is in doubt."""
    depth: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    """Limiting depth by zero order over the speeds of the history (m), by name of the cut; a chart, no verdict."""
    rulings: Mapping[str, Ruling] | None = None
    """The word on every program with the machine as it was after this tap test; None where nobody has asked yet."""
    baseline: datetime | None = None
    """The event before it from which on all comparing begins anew."""

    @property
    def questions(self) -> tuple[Remark, ...]:
        """What nobody has answered yet; until then it is no reference for other tests."""
        return open_questions(self.remarks)

    @property
    def mode(self) -> Mode | None:
        """The mode followed, without its errors; None where it was not found."""
        if not self.frequency.is_known:
            return None
        phase = self.phase_deg.value
        return Mode(self.frequency.value, self.damping_ratio.value, self.stiffness.value, phase_deg=phase)


@dataclass(frozen=True, eq=False)
class History:
    """All measurements of a machine, in order of time."""

    settings_hash: str
    """Of the settings that it was made with."""
    software: str
    """Name and version of the program that made it."""
    speed_rpm: NDArray[np.float64]
    """Common speeds of the depths (rpm), shape (n,)."""
    rows: tuple[Row, ...]
    """One a measurement."""
    baseline: datetime | None = None
    """The newest event from which on all comparing begins anew."""

    @property
    def current(self) -> list[Row]:
        """Those since the baseline."""
        return [row for row in self.rows if row.baseline == self.baseline]

    def series(self, tool: str, direction: str) -> list[Row]:
        """Rows of one tool and direction since the baseline, oldest first."""
        return [row for row in self.current if (row.tool, row.direction) == (tool, direction)]


def empty_history(machine: Machine) -> History:
    """The history of a machine that was never tapped."""
    return History(machine.settings_hash, f"lobewatch {version('lobewatch')}", speed_grid(machine), ())


def without_last_word(history: History) -> History:
    """The same as if nobody had asked for the programs after the newest tap test yet."""
    *before, last = history.rows
    return replace(history, rows=(*before, replace(last, rulings=None)))


def row_of(
    m: Measurement, lobes: Mapping[str, StabilityLobes], remarks: Sequence[Remark], baseline: datetime | None = None
) -> Row:
    """A measurement as a row, with the diagrams and remarks of the assembly as it was then."""
    modes = [(one.frequency, one.damping_ratio, one.stiffness, one.phase_deg) for one in m.modes[:MAX_MODES]]
    frequency, damping_ratio, stiffness, phase = _of_mode(m.followed)
    calibration = m.calibration
    return Row(
        tap_id=m.tap_id,
        time=m.time,
        tool=m.tool,
        direction=m.direction,
        baseline=baseline,
        frequency=frequency,
        damping_ratio=damping_ratio,
        stiffness=stiffness,
        phase_deg=phase,
        bearing_stiffness=_of_bearings(calibration),
        static_tip_stiffness=calibration.static_stiffness_after if calibration else np.nan,
        modal_tip_stiffness=calibration.modal_stiffness_after if calibration else np.nan,
        modes=np.array(modes, dtype=np.float64).reshape(-1, 4),
        remarks=tuple(remarks),
        depth={name: one.depth for name, one in lobes.items()},
    )


def _of_mode(mode: Mode | None) -> tuple[Estimate, Estimate, Estimate, Estimate]:
    if mode is None:
        return UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN
    f_std, zeta_std, k_std = mode.standard_error.tolist()
    phase = Estimate(mode.phase_deg, mode.phase_deg_std)
    return (
        Estimate(mode.frequency, f_std),
        Estimate(mode.damping_ratio, zeta_std),
        Estimate(mode.stiffness, k_std),
        phase,
    )


def _of_bearings(calibration: Calibration | None) -> Estimate:
    if calibration is None:
        return UNKNOWN
    std = calibration.bearing_stiffness_std
    return Estimate(calibration.bearing_stiffness, np.nan if std is None else std)


def to_columns(history: History, machine: Machine) -> SldHistory:
    """What history.h5 holds."""
    rows, programs = history.rows, [program.name for program in machine.program]
    columns: dict[str, Any] = {name: _texts(getattr(row, name) for row in rows) for name in ("tap_id", "tool")}
    columns["time"] = _texts(row.time.isoformat() for row in rows)
    columns["baseline"] = _texts(row.baseline.isoformat() if row.baseline else "" for row in rows)
    columns["direction"] = _texts(row.direction for row in rows)
    columns["notes"] = _texts("\n".join(map(str, row.remarks)) for row in rows)
    columns["remarks"] = _texts(_as_json([asdict(one) for one in row.remarks]) for row in rows)
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
    units = ESTIMATES | {f"{name}_std": unit for name, unit in ESTIMATES.items()} | MODELLED | MODE_COLUMNS
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
    text = {name: str(columns[name][i]) for name in ("tap_id", "time", "tool", "direction", "baseline", "remarks")}
    modes = np.stack([columns[name][i] for name in MODE_COLUMNS], axis=1)
    depth = {name: values[i] for name, values in stored.depth.items()}
    return Row(
        tap_id=text["tap_id"],
        time=datetime.fromisoformat(text["time"]),
        tool=text["tool"],
        direction=text["direction"],
        baseline=datetime.fromisoformat(text["baseline"]) if text["baseline"] else None,
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
