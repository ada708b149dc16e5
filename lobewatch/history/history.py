"""History of a machine: one row per tap test, with rows of older versions.

In its place where the analysis refuses a tap test now, beside the history where its file cannot be used.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property

import numpy as np

from acquisition import UNKNOWN_CONDITIONS, Conditions, Remark
from dsm import Calibration
from lobewatch.machine import Machine
from lobewatch.measurement.estimate import UNKNOWN_ESTIMATE, Estimate
from lobewatch.measurement.recording_questions import find_accepted_codes, find_open_questions
from lobewatch.measurement.software import CURRENT_SOFTWARE
from lobewatch.measurement.tap_measurement import MODE_EDIT_CODES, Measurement
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.tap_series import TapPlace
from lobewatch.verdicts.verdict import StoredVerdict
from modal import Mode

MAX_STORED_MODES = 12
"""Modes kept of one measurement."""
ESTIMATE_UNITS = {
    "frequency": "Hz",
    "damping_ratio": "",
    "stiffness": "N/m",
    "phase_deg": "deg",
    "bearing_stiffness": "N/m",
}
"""Values with a standard error and their units, by name of the field and the column."""
WATCHED_VALUES = ("frequency", "damping_ratio", "stiffness", "bearing_stiffness")
"""Those of them whose series are watched."""
MODEL_VALUE_UNITS = {"static_tip_stiffness": "N/m", "modal_tip_stiffness": "N/m"}
"""Values of the model."""
ModeValues = tuple[float, float, float, float]
"""Frequency (Hz), damping ratio, stiffness (N/m) and phase (degrees) of a mode."""
WatchedEstimates = Sequence[tuple[float, float]]
"""Those of `WATCHED`, each with its standard error."""


@dataclass(frozen=True, eq=False)
class HistoryRow:
    """One measurement of the history: what was measured, and what was said of the programs where that was asked."""

    tap_id: str
    """Identity of the tap test."""
    time: datetime
    """Time of the tap test."""
    tool: str
    """Tool in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    frequency: Estimate = UNKNOWN_ESTIMATE
    """Natural frequency of the mode followed (Hz)."""
    damping_ratio: Estimate = UNKNOWN_ESTIMATE
    """Damping ratio of the mode followed (-)."""
    stiffness: Estimate = UNKNOWN_ESTIMATE
    """Modal stiffness of the mode followed, where it was tapped (N/m)."""
    phase_deg: Estimate = UNKNOWN_ESTIMATE
    """Phase of the modal constant of the mode followed (degrees)."""
    bearing_stiffness: Estimate = UNKNOWN_ESTIMATE
    """Mean of the bearings of the recalibrated model (N/m)."""
    static_tip_stiffness: float = np.nan
    """Static stiffness of the recalibrated model at the tool tip (N/m)."""
    modal_tip_stiffness: float = np.nan
    """Modal stiffness of the recalibrated model at the tool tip (N/m)."""
    modes: tuple[ModeValues, ...] = ()
    """All modes found."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on what could not be done, and what is in doubt."""
    x: tuple[ModeValues, ...] = ()
    """Modes at the tool tip in x of the assembly as it was then; empty where no direction was known."""
    y: tuple[ModeValues, ...] = ()
    """The same in y."""
    verdicts: Mapping[str, StoredVerdict] | None = None
    """The word on every program with the machine as it was after this tap test; None where nobody has asked yet."""
    baseline: datetime | None = None
    """The event before it from which on all comparing begins anew."""
    series: str = ""
    """The first tap test of those that it is compared with: of one tool with one stick-out in one state."""
    conditions: Conditions = UNKNOWN_CONDITIONS
    """Conditions that it was taken under."""
    operator: str = ""
    """Who held the hammer; empty where nobody said so."""
    software: str = ""
    """Name and version of the program that made the row."""

    @cached_property
    def questions(self) -> tuple[Remark, ...]:
        """What nobody has answered yet; until then it is no reference for other tests."""
        return find_open_questions(self.remarks)

    @cached_property
    def accepted(self) -> frozenset[str]:
        """Codes of the questions that were answered."""
        return find_accepted_codes(self.remarks)

    @cached_property
    def by_hand(self) -> str:
        """What a person said of its modes, in the words of `ModeEdits`; empty where nobody did."""
        return next((remark.about for remark in self.remarks if remark.code in MODE_EDIT_CODES), "")

    @property
    def followed(self) -> ModeValues:
        """The mode followed; NaN where it was not found."""
        return self.frequency.value, self.damping_ratio.value, self.stiffness.value, self.phase_deg.value

    @property
    def watched(self) -> WatchedEstimates:
        """Values whose series are watched."""
        return self.frequency, self.damping_ratio, self.stiffness, self.bearing_stiffness

    @property
    def mode(self) -> Mode | None:
        """The mode followed, without its errors; None where it was not found."""
        if not self.frequency.is_known:
            return None
        frequency, damping_ratio, stiffness, phase = self.followed
        alone = 1.0 if math.isnan(stiffness) else None
        return Mode(frequency, damping_ratio, stiffness, phase_deg=phase, relative_peak=alone)


@dataclass(frozen=True, eq=False)
class History:
    """All measurements of a machine, in order of time."""

    settings_hash: str
    """Hash of the settings that it was made with."""
    software: str
    """Name and version of the program that made it."""
    rows: tuple[HistoryRow, ...]
    """One a measurement."""
    baseline: datetime | None = None
    """The newest event from which on all comparing begins anew."""
    kept: tuple[HistoryRow, ...] = ()
    """Rows of tap tests whose files cannot be used now, as they were worked out before; they count for nothing."""

    @cached_property
    def current(self) -> list[HistoryRow]:
        """Those since the baseline, of each tool with the stick-out and in the state of its newest."""
        since = [row for row in self.rows if row.baseline == self.baseline]
        newest = {row.tool: row.series for row in since}
        return [row for row in since if row.series == newest[row.tool]]

    @property
    def newest_calibrated(self) -> HistoryRow | None:
        """The newest that the bearings of the model were found from, without open questions."""
        rows = reversed(self.current)
        return next((row for row in rows if not row.questions and row.bearing_stiffness.is_known), None)

    @property
    def questions(self) -> dict[str, tuple[str, ...]]:
        """Codes of what is asked and not answered, by tap test."""
        return {row.tap_id: tuple(question.code for question in row.questions) for row in self.rows if row.questions}

    def with_verdicts(self, number: int, rulings: Mapping[str, StoredVerdict]) -> History:
        """The same with the word on every program after one of its rows."""
        row = replace(self.rows[number], verdicts=rulings)
        return replace(self, rows=(*self.rows[:number], row, *self.rows[number + 1 :]))

    def series(self, tool: str, direction: str) -> list[HistoryRow]:
        """Those of one tool and direction, oldest first."""
        return [row for row in self.current if (row.tool, row.direction) == (tool, direction)]


def make_empty_history(machine: Machine) -> History:
    """The history of a machine that was never tapped."""
    return History(machine.settings_hash, f"lobewatch {CURRENT_SOFTWARE.lobewatch}", ())


def clear_newest_verdicts(history: History) -> History:
    """The same as if nobody had asked for the programs after the newest tap test yet."""
    *before, last = history.rows
    return replace(history, rows=(*before, replace(last, verdicts=None)))


def make_row(m: Measurement, assembly: Assembly, place: TapPlace) -> HistoryRow:
    """A measurement as a row, with the tip and the remarks of the assembly as it was then."""
    frequency, damping_ratio, stiffness, phase = _mode_estimates(m.followed)
    calibration = m.calibration
    return HistoryRow(
        tap_id=m.tap_id,
        time=m.time,
        tool=m.tool,
        direction=m.direction,
        baseline=place.baseline,
        series=place.series,
        conditions=place.entry.conditions,
        operator=place.entry.operator,
        frequency=frequency,
        damping_ratio=damping_ratio,
        stiffness=stiffness,
        phase_deg=phase,
        bearing_stiffness=_bearing_estimate(calibration),
        static_tip_stiffness=calibration.static_stiffness_after if calibration else np.nan,
        modal_tip_stiffness=calibration.modal_stiffness_after if calibration else np.nan,
        modes=_mode_values(m.modes[:MAX_STORED_MODES]),
        remarks=tuple(assembly.remarks),
        x=_mode_values(assembly.x or ()),
        y=_mode_values(assembly.y or ()),
    )


def _mode_estimates(mode: Mode | None) -> tuple[Estimate, Estimate, Estimate, Estimate]:
    if mode is None:
        return UNKNOWN_ESTIMATE, UNKNOWN_ESTIMATE, UNKNOWN_ESTIMATE, UNKNOWN_ESTIMATE
    f_std, zeta_std, k_std = mode.standard_error.tolist()
    phase = Estimate(mode.phase_deg, mode.phase_deg_std)
    return (
        Estimate(mode.frequency, f_std),
        Estimate(mode.damping_ratio, zeta_std),
        Estimate(mode.stiffness, k_std),
        phase,
    )


def _bearing_estimate(calibration: Calibration | None) -> Estimate:
    if calibration is None:
        return UNKNOWN_ESTIMATE
    std = calibration.bearing_stiffness_std
    return Estimate(calibration.bearing_stiffness, np.nan if std is None else std)


def _mode_values(modes: Sequence[Mode]) -> tuple[ModeValues, ...]:
    return tuple((mode.frequency, mode.damping_ratio, mode.stiffness, mode.phase_deg) for mode in modes)


OLDER_VERSION_CODE, KEPT_ROW_CODE = "row-of-older-version", "row-kept"
"""Codes of the remarks on them."""


def keep_older_row(row: HistoryRow, place: TapPlace, error: Exception) -> HistoryRow:
    """The row of an older version of a tap test whose analysis now ends in an error."""
    text = f"as {row.software} worked it out: this version cannot ({error})"
    others = [remark for remark in row.remarks if remark.code != OLDER_VERSION_CODE]
    remarks = (
        *others,
        Remark(OLDER_VERSION_CODE, f"tap test {row.tap_id}", text, "exclude it where it does not count"),
    )
    under = place.entry.conditions
    return replace(row, baseline=place.baseline, series=place.series, conditions=under, remarks=remarks)


def keep_unusable_row(row: HistoryRow, software: str) -> HistoryRow:
    """The row of a tap test whose file cannot be used; software: that made it, where the row does not say."""
    software_then = row.software or software
    text = f"its file cannot be used: as {software_then} worked it out, and counts for nothing"
    others = [remark for remark in row.remarks if remark.code != KEPT_ROW_CODE]
    remark = Remark(KEPT_ROW_CODE, f"taps/{row.tap_id}.h5", text, "put it back from a backup")
    return replace(row, software=software_then, remarks=(*others, remark))


def find_older_version_remarks(history: History | None) -> list[Remark]:
    """The remarks on rows that count though they could not be worked out anew."""
    rows = [] if history is None else [row for row in history.rows if row.software]
    return [remark for row in rows for remark in row.remarks if remark.code == OLDER_VERSION_CODE]
