"""History of a machine: one row per tap test, its stored form, rows of older versions, and columns for export."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from functools import cached_property
from typing import Any, get_type_hints

import msgspec
import numpy as np
from numpy.typing import NDArray

from acquisition import CROSS_TAP, UNKNOWN_CONDITIONS, Conditions, Frf, Remark
from lobes import SldHistory, StabilityLobes
from lobewatch.arrays import Floats
from lobewatch.machine import Machine
from lobewatch.measurement.estimate import UNKNOWN_ESTIMATE, Estimate
from lobewatch.measurement.hit_choice import HIT_DECISIONS_CODE
from lobewatch.measurement.recording_questions import find_accepted_codes, find_open_questions
from lobewatch.measurement.software import CURRENT_SOFTWARE
from lobewatch.measurement.tap_measurement import MODE_EDIT_CODES, Measurement
from lobewatch.measurement.tool_compliance import sum_compliance
from lobewatch.tool.assembly import Assembly, compute_tip_lobes, speed_grid
from lobewatch.tool.tap_series import TapPlace
from lobewatch.verdicts.verdict import StoredVerdict
from modal import Mode

MAX_STORED_MODES = 12
"""Largest number of stored modes of one tap test."""
ESTIMATE_UNITS = {"frequency": "Hz", "damping_ratio": "", "stiffness": "N/m", "phase_deg": "deg"}
ESTIMATE_UNITS |= {"bearing_stiffness": "N/m"}
"""Units of the values with a standard error, by name of field and column."""
WATCHED_VALUES = ("frequency", "damping_ratio", "stiffness", "bearing_stiffness")
"""Values whose series are monitored."""
MODEL_VALUE_UNITS = {"static_tip_stiffness": "N/m", "modal_tip_stiffness": "N/m"}
"""Units of the values of the model."""
ModeValues = tuple[float, float, float, float]
"""Frequency (Hz), damping ratio, stiffness (N/m) and phase (degrees) of a mode."""


@dataclass(frozen=True, eq=False)
class HistoryRow:
    """Row of the history: results of one tap test, and stored verdicts."""

    tap_id: str
    """Identity of the tap test."""
    time: datetime
    """Time of the tap test."""
    tool: str
    """Tool in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    frequency: Estimate = UNKNOWN_ESTIMATE
    """Natural frequency of the followed mode (Hz)."""
    damping_ratio: Estimate = UNKNOWN_ESTIMATE
    """Damping ratio of the followed mode (-)."""
    stiffness: Estimate = UNKNOWN_ESTIMATE
    """Modal stiffness of the followed mode at the tapped place (N/m)."""
    phase_deg: Estimate = UNKNOWN_ESTIMATE
    """Phase of the modal constant of the followed mode (degrees)."""
    bearing_stiffness: Estimate = UNKNOWN_ESTIMATE
    """Mean bearing stiffness of the calibrated model (N/m)."""
    static_tip_stiffness: float = np.nan
    """Static stiffness of the calibrated model at the tool tip (N/m)."""
    modal_tip_stiffness: float = np.nan
    """Modal stiffness of the calibrated model at the tool tip (N/m)."""
    modes: tuple[ModeValues, ...] = ()
    """All modes."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on missing and doubtful results."""
    x: tuple[ModeValues, ...] = ()
    """Modes at the tool tip in x of the assembly at that time; empty if no direction was known."""
    y: tuple[ModeValues, ...] = ()
    """Modes at the tool tip in y."""
    verdicts: Mapping[str, StoredVerdict] | None = None
    """Stored verdict on each program after this tap test; None if never evaluated."""
    baseline: datetime | None = None
    """Newest baseline before it."""
    series: str = ""
    """First tap test of its series."""
    conditions: Conditions = UNKNOWN_CONDITIONS
    """Conditions of the tap test."""
    operator: str = ""
    """Name of the operator; empty if unknown."""
    software: str = ""
    """Version of the program that made the row."""
    tip_compliance: float = np.nan
    """Static compliance of its modes at the tool tip (m/N)."""
    highest_frequency: float = np.nan
    """Upper end of its usable band (Hz); NaN without an FRF."""

    @cached_property
    def questions(self) -> tuple[Remark, ...]:
        """Open questions; with one the test is no reference for others."""
        return find_open_questions(self.remarks)

    @cached_property
    def accepted(self) -> frozenset[str]:
        """Codes of the accepted questions."""
        return find_accepted_codes(self.remarks)

    @cached_property
    def by_hand(self) -> str:
        """Mode edits in words; empty without any."""
        return next((remark.about for remark in self.remarks if remark.code in MODE_EDIT_CODES), "")

    @cached_property
    def hit_decisions(self) -> str:
        """Decisions on hits in words; empty without any."""
        return next((remark.about for remark in self.remarks if remark.code == HIT_DECISIONS_CODE), "")

    @property
    def predicts_tools(self) -> bool:
        """True if other tools can be predicted from it: calibrated, with stiffness, without open questions."""
        return self.bearing_stiffness.is_known and self.stiffness.is_known and not self.questions

    @property
    def followed(self) -> ModeValues:
        """Followed mode; NaN without one."""
        return self.frequency.value, self.damping_ratio.value, self.stiffness.value, self.phase_deg.value

    @property
    def mode(self) -> Mode | None:
        """Followed mode without its errors; None without one."""
        if not self.frequency.is_known:
            return None
        frequency, damping_ratio, stiffness, phase = self.followed
        alone = 1.0 if math.isnan(stiffness) else None
        return Mode(frequency, damping_ratio, stiffness, phase_deg=phase, relative_peak=alone)


@dataclass(frozen=True, eq=False)
class History:
    """All tap tests of a machine in order of time."""

    settings_hash: str
    """Hash of the settings behind the rows."""
    software: str
    """Version of the program that made the rows."""
    rows: tuple[HistoryRow, ...]
    """Rows, one per tap test."""
    baseline: datetime | None = None
    """Newest baseline."""
    kept: tuple[HistoryRow, ...] = ()
    """Earlier rows of tap tests with unusable files; they do not count."""

    @cached_property
    def current(self) -> list[HistoryRow]:
        """Rows since the baseline, of each tool with its newest mounting."""
        since = [row for row in self.rows if row.baseline == self.baseline]
        newest = {row.tool: row.series for row in since}
        return [row for row in since if row.series == newest[row.tool]]

    @property
    def questions(self) -> dict[str, tuple[str, ...]]:
        """Codes of the open questions by tap test."""
        return {row.tap_id: tuple(question.code for question in row.questions) for row in self.rows if row.questions}

    def tapped_since(self, tool: str) -> datetime | None:
        """Return the time that the age of a tool counts from: the older of its newest tap tests in x and in y.

        For a tool that was never tapped it is that of the tests behind its prediction, None without any.

        Parameters
        ----------
        tool
            Name of the tool.
        """
        rows = [row for row in self.current if row.tool == tool and row.direction != CROSS_TAP]
        rows = rows or [row for row in self.rows if row.baseline == self.baseline and row.predicts_tools]
        return min({row.direction: row.time for row in rows}.values(), default=None)

    def with_verdicts(self, number: int, verdicts: Mapping[str, StoredVerdict] | None) -> History:
        """Return the history with the verdicts after one of its rows.

        Parameters
        ----------
        number
            Index of the row.
        verdicts
            Stored verdicts by name of the program; None clears them.
        """
        row = replace(self.rows[number], verdicts=verdicts)
        return replace(self, rows=(*self.rows[:number], row, *self.rows[number + 1 :]))

    def series(self, tool: str, direction: str) -> list[HistoryRow]:
        """Return the current rows of one tool and direction, oldest first.

        Parameters
        ----------
        tool
            Name of the tool.
        direction
            Direction, "x" or "y".
        """
        return [row for row in self.current if (row.tool, row.direction) == (tool, direction)]


def make_empty_history(machine: Machine) -> History:
    """Return the history of a machine without tap tests."""
    return History(machine.settings_hash, f"lobewatch {CURRENT_SOFTWARE.lobewatch}", ())


def make_row(m: Measurement, assembly: Assembly, place: TapPlace) -> HistoryRow:
    """Make the row of a measurement, with tip modes and remarks of its assembly."""
    values: dict[str, Any] = {}
    if m.followed is not None:
        numbers = m.followed.frequency, m.followed.damping_ratio, m.followed.stiffness
        values = dict(zip(WATCHED_VALUES[:3], map(Estimate, numbers, m.followed.standard_error.tolist()), strict=True))
        values["phase_deg"] = Estimate(m.followed.phase_deg, m.followed.phase_deg_std)
    if m.calibration is not None:
        std = m.calibration.bearing_stiffness_std
        values["bearing_stiffness"] = Estimate(m.calibration.bearing_stiffness, np.nan if std is None else std)
        values["static_tip_stiffness"] = m.calibration.static_stiffness_after
        values["modal_tip_stiffness"] = m.calibration.modal_stiffness_after
    values |= {"baseline": place.baseline, "series": place.series, "remarks": tuple(assembly.remarks)}
    values |= {"conditions": place.entry.conditions, "operator": place.entry.operator}
    values |= {"tip_compliance": sum_compliance(m.at_tip), "highest_frequency": _usable_end(m.frf)}
    modes = {"modes": m.modes[:MAX_STORED_MODES], "x": assembly.x or (), "y": assembly.y or ()}
    values |= {name: to_mode_values(part) for name, part in modes.items()}
    return HistoryRow(m.tap_id, m.time, m.tool, m.direction, **values)


def _usable_end(frf: Frf | None) -> float:
    """Return the upper end of the usable band of an FRF (Hz), or of all its lines; NaN without an FRF."""
    if frf is None:
        return np.nan
    return float(frf.frequency[-1] if frf.usable_band is None else frf.usable_band[1])


def to_mode_values(modes: Sequence[Mode]) -> tuple[ModeValues, ...]:
    """Return frequency, damping ratio, stiffness and phase of modes."""
    return tuple((mode.frequency, mode.damping_ratio, mode.stiffness, mode.phase_deg) for mode in modes)


OLDER_VERSION_CODE, KEPT_ROW_CODE = "row-of-older-version", "row-kept"
"""Codes of the remarks on kept rows."""


def keep_older_row(row: HistoryRow, place: TapPlace, error: Exception) -> HistoryRow:
    """Return the row of an older version if this version cannot analyse the tap test."""
    text = f"result of {row.software} kept, because this version of lobewatch cannot analyse the test ({error})"
    remark = Remark(OLDER_VERSION_CODE, f"tap test {row.tap_id}", text, "Exclude the tap test if it is not valid")
    row = replace(row, baseline=place.baseline, series=place.series, conditions=place.entry.conditions)
    return _set_remark(row, remark)


def _set_remark(row: HistoryRow, remark: Remark) -> HistoryRow:
    """Return a row with a remark in place of those of the same code."""
    return replace(row, remarks=(*(other for other in row.remarks if other.code != remark.code), remark))


def keep_unusable_row(row: HistoryRow, software: str) -> HistoryRow:
    """Return the row of a tap test with an unusable file; software: default version of the row."""
    row = replace(row, software=row.software or software)
    text = f"tap file unusable, so the result of {row.software} is shown but not used"
    return _set_remark(row, Remark(KEPT_ROW_CODE, f"taps/{row.tap_id}.h5", text, "Restore the file from a backup"))


def find_older_version_remarks(history: History | None) -> list[Remark]:
    """Return the remarks on rows of older versions that count."""
    rows = [] if history is None else [row for row in history.rows if row.software]
    return [remark for row in rows for remark in row.remarks if remark.code == OLDER_VERSION_CODE]


RECORD_FIELDS = ["tap_id", "time", "tool", "direction", "baseline", "series", "conditions", *ESTIMATE_UNITS]
RECORD_FIELDS += [*MODEL_VALUE_UNITS, "modes", "x", "y", "remarks", "verdicts"]
"""Stored fields of a row in their order; those that the first rows lack follow."""
RECORD_TYPES = get_type_hints(HistoryRow) | {"time": str, "baseline": str, "conditions": dict[str, Any]}
RECORD_TYPES |= {"verdicts": dict[str, tuple[str, StoredVerdict]]}
"""Types of these fields: times as text with their zone, and each verdict with the hash of its program."""
_stored: list[Any] = [("number", int), *((name, RECORD_TYPES[name]) for name in RECORD_FIELDS)]
_stored += [(name, str, "") for name in ("software", "operator")]
_stored += [(name, float, np.nan) for name in ("tip_compliance", "highest_frequency")]
RowRecord = msgspec.defstruct("RowRecord", _stored, array_like=True, gc=False)
"""Stored form of a row."""
_encode_record, _decode_record = msgspec.msgpack.Encoder().encode, msgspec.msgpack.Decoder(RowRecord).decode


def encode_row(number: int, row: HistoryRow, hashes: Mapping[str, str]) -> bytes:
    """Encode a row with its number, -1 for one outside of the history; hashes: of the programs by name."""
    values: dict[str, Any] = {name: getattr(row, name) for name in RowRecord.__struct_fields__[1:]}
    values |= {"number": number, "time": row.time.isoformat(), "conditions": row.conditions.specified}
    values["baseline"] = row.baseline.isoformat() if row.baseline else ""
    values["verdicts"] = {name: (hashes[name], verdict) for name, verdict in (row.verdicts or {}).items()}
    return _encode_record(RowRecord(**values))


def decode_row(content: bytes, hashes: Mapping[str, str], software: str = "") -> tuple[int, HistoryRow]:
    """Decode number and row, without verdicts on changed programs; ValueError for invalid bytes.

    software: version of a row that does not state it; empty for this version.
    """
    values = msgspec.structs.asdict(_decode_record(content))
    stored, values["time"] = values["verdicts"].items(), datetime.fromisoformat(values["time"])
    values["software"] = values["software"] or software
    values["baseline"] = datetime.fromisoformat(values["baseline"]) if values["baseline"] else None
    conditions = values["conditions"]
    values["conditions"] = Conditions.from_mapping(conditions) if conditions else UNKNOWN_CONDITIONS
    verdicts = {name: verdict for name, (made_with, verdict) in stored if hashes.get(name) == made_with}
    values["verdicts"] = verdicts if verdicts or not hashes else None
    return values.pop("number"), HistoryRow(**values)


TEXT_COLUMNS = ("tap_id", "tool", "direction", "series", "operator")
MODE_COLUMNS = {"mode_frequency": "Hz", "mode_damping_ratio": "", "mode_stiffness": "N/m", "mode_phase_deg": "deg"}
CONDITION_UNITS = {"temperature_c": "degC", "stick_out_mm": "mm", "drawbar_kn": "kN", "hours": "h"}
"""Numeric conditions with their units; NaN if unknown."""


def make_export_columns(history: History, machine: Machine, render: Callable[[str], str] = str) -> SldHistory:
    """Make the columns for `lobes.write_history`; render: translates the names in remarks."""
    rows, programs = history.rows, [program.name for program in machine.program]
    columns: dict[str, Any] = {name: _text_column(getattr(row, name) for row in rows) for name in TEXT_COLUMNS}
    columns["time"] = _text_column(row.time.isoformat() for row in rows)
    columns["baseline"] = _text_column(row.baseline.isoformat() if row.baseline else "" for row in rows)
    columns["notes"] = _text_column(render("\n".join(map(str, row.remarks))) for row in rows)
    remarks = (msgspec.json.encode([asdict(remark) for remark in row.remarks]).decode() for row in rows)
    columns["remarks"] = _text_column(map(render, remarks))
    stated = [row.conditions.specified for row in rows]
    columns |= {name: _number_column([under.get(name, np.nan) for under in stated]) for name in CONDITION_UNITS}
    columns |= {name: _text_column(under.get(name, "") for under in stated) for name in ("state", "note")}
    columns["reclamped"] = _number_column([row.conditions.reclamped for row in rows])
    for name in ESTIMATE_UNITS:
        columns[name], columns[f"{name}_std"] = _number_column([getattr(row, name) for row in rows], 2).T
    for name in MODEL_VALUE_UNITS:
        columns[name] = _number_column([getattr(row, name) for row in rows])
    table = np.full((len(rows), MAX_STORED_MODES, len(MODE_COLUMNS)), np.nan)
    for i, row in enumerate(rows):
        table[i, : len(row.modes)] = np.reshape(row.modes, (-1, len(MODE_COLUMNS)))
    columns |= {name: table[:, :, k] for k, name in enumerate(MODE_COLUMNS)}
    if programs:
        limits = [_program_limits(row.verdicts, programs) for row in rows]
        columns["program_limit"] = _number_column(limits, len(programs))
        columns["program_verdict"] = _text_column(_program_verdicts(row.verdicts, programs) for row in rows)
    speeds = speed_grid(machine)
    nowhere, diagrams = np.full(speeds.size, np.nan), [compute_row_lobes(row, machine) for row in rows]
    depth = {}
    for name in machine.cut_tables:
        depths = [lobes[name].depth if name in lobes else nowhere for lobes in diagrams]
        depth[name] = _number_column(depths, speeds.size)
    units = ESTIMATE_UNITS | {f"{name}_std": unit for name, unit in ESTIMATE_UNITS.items()} | MODEL_VALUE_UNITS
    units |= MODE_COLUMNS | CONDITION_UNITS
    units = {name: unit for name, unit in (units | {"program_limit": "m"}).items() if unit and name in columns}
    return SldHistory(history.settings_hash, history.software, speeds, columns, depth, units)


def compute_row_lobes(
    row: HistoryRow, machine: Machine, names: Collection[str] | None = None
) -> dict[str, StabilityLobes]:
    """Compute the lobes of a row as of its time; names: selected cuts."""
    return compute_tip_lobes(row.tool, _to_modes(row.x), _to_modes(row.y), machine, names)


def _to_modes(values: Sequence[ModeValues]) -> list[Mode]:
    return [Mode(frequency, damping, stiffness, phase_deg=phase) for frequency, damping, stiffness, phase in values]


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
