"""The history of a machine as typed rows, one a measurement."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property

import numpy as np

from acquisition import UNSAID, Conditions, Remark
from dsm import Calibration
from lobewatch.machine import Machine
from lobewatch.measuring.estimate import UNKNOWN, Estimate
from lobewatch.measuring.measurement import BY_HAND, Measurement
from lobewatch.measuring.questions import accepted_codes, open_questions
from lobewatch.measuring.workers.software import SOFTWARE
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.order import Place
from lobewatch.verdicts.verdict import Ruling
from modal import Mode

MAX_MODES = 12
"""Modes kept of one measurement."""
ESTIMATES = {"frequency": "Hz", "damping_ratio": "", "stiffness": "N/m", "phase_deg": "deg", "bearing_stiffness": "N/m"}
"""Values with a standard error and their units, by name of the field and the column."""
WATCHED = ("frequency", "damping_ratio", "stiffness", "bearing_stiffness")
"""Those of them whose series are watched."""
MODELLED = {"static_tip_stiffness": "N/m", "modal_tip_stiffness": "N/m"}
"""Values of the model."""
Values = tuple[float, float, float, float]
"""Frequency (Hz), damping ratio, stiffness (N/m) and phase (degrees) of a mode."""
Watched = Sequence[tuple[float, float]]
"""Those of `WATCHED`, each with its standard error."""


@dataclass(frozen=True, eq=False)
class Row:
    """One measurement of the history: what was measured, and what was said of the programs where that was asked."""

    tap_id: str
    """Identity of the tap test."""
    time: datetime
    """Time of the tap test."""
    tool: str
    """Tool in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    frequency: Estimate = UNKNOWN
    """Natural frequency of the mode followed (Hz)."""
    damping_ratio: Estimate = UNKNOWN
    """Damping ratio of the mode followed (-)."""
    stiffness: Estimate = UNKNOWN
    """Modal stiffness of the mode followed, where it was tapped (N/m)."""
    phase_deg: Estimate = UNKNOWN
    """Phase of the modal constant of the mode followed (degrees)."""
    bearing_stiffness: Estimate = UNKNOWN
    """Mean of the bearings of the recalibrated model (N/m)."""
    static_tip_stiffness: float = np.nan
    """Static stiffness of the recalibrated model at the tool tip (N/m)."""
    modal_tip_stiffness: float = np.nan
    """Modal stiffness of the recalibrated model at the tool tip (N/m)."""
    modes: tuple[Values, ...] = ()
    """All modes found."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on what could not be done, and what is in doubt."""
    x: tuple[Values, ...] = ()
    """Modes at the tool tip in x of the assembly as it was then; empty where no direction was known."""
    y: tuple[Values, ...] = ()
    """The same in y."""
    rulings: Mapping[str, Ruling] | None = None
    """The word on every program with the machine as it was after this tap test; None where nobody has asked yet."""
    baseline: datetime | None = None
    """The event before it from which on all comparing begins anew."""
    series: str = ""
    """The first tap test of those that it is compared with: of one tool with one stick-out in one state."""
    conditions: Conditions = UNSAID
    """Conditions that it was taken under."""
    operator: str = ""
    """Who held the hammer; empty where nobody said so."""
    software: str = ""
    """Name and version of the program that made the row."""

    @cached_property
    def questions(self) -> tuple[Remark, ...]:
        """What nobody has answered yet; until then it is no reference for other tests."""
        return open_questions(self.remarks)

    @cached_property
    def accepted(self) -> frozenset[str]:
        """Codes of the questions that were answered."""
        return accepted_codes(self.remarks)

    @cached_property
    def by_hand(self) -> str:
        """What a person said of its modes, in the words of `ModeEdits`; empty where nobody did."""
        return next((remark.about for remark in self.remarks if remark.code in BY_HAND), "")

    @property
    def followed(self) -> Values:
        """The mode followed; NaN where it was not found."""
        return self.frequency.value, self.damping_ratio.value, self.stiffness.value, self.phase_deg.value

    @property
    def watched(self) -> Watched:
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
    rows: tuple[Row, ...]
    """One a measurement."""
    baseline: datetime | None = None
    """The newest event from which on all comparing begins anew."""
    kept: tuple[Row, ...] = ()
    """Rows of tap tests whose files cannot be used now, as they were worked out before; they count for nothing."""

    @cached_property
    def current(self) -> list[Row]:
        """Those since the baseline, of each tool with the stick-out and in the state of its newest."""
        since = [row for row in self.rows if row.baseline == self.baseline]
        newest = {row.tool: row.series for row in since}
        return [row for row in since if row.series == newest[row.tool]]

    @property
    def newest_calibrated(self) -> Row | None:
        """The newest that the bearings of the model were found from, without open questions."""
        rows = reversed(self.current)
        return next((row for row in rows if not row.questions and row.bearing_stiffness.is_known), None)

    @property
    def questions(self) -> dict[str, tuple[str, ...]]:
        """Codes of what is asked and not answered, by tap test."""
        return {row.tap_id: tuple(question.code for question in row.questions) for row in self.rows if row.questions}

    def with_rulings(self, number: int, rulings: Mapping[str, Ruling]) -> History:
        """The same with the word on every program after one of its rows."""
        row = replace(self.rows[number], rulings=rulings)
        return replace(self, rows=(*self.rows[:number], row, *self.rows[number + 1 :]))

    def series(self, tool: str, direction: str) -> list[Row]:
        """Those of one tool and direction, oldest first."""
        return [row for row in self.current if (row.tool, row.direction) == (tool, direction)]


def empty_history(machine: Machine) -> History:
    """The history of a machine that was never tapped."""
    return History(machine.settings_hash, f"lobewatch {SOFTWARE.lobewatch}", ())


def without_last_word(history: History) -> History:
    """The same as if nobody had asked for the programs after the newest tap test yet."""
    *before, last = history.rows
    return replace(history, rows=(*before, replace(last, rulings=None)))


def row_of(m: Measurement, assembly: Assembly, place: Place) -> Row:
    """A measurement as a row, with the tip and the remarks of the assembly as it was then."""
    frequency, damping_ratio, stiffness, phase = _of_mode(m.followed)
    calibration = m.calibration
    return Row(
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
        bearing_stiffness=_of_bearings(calibration),
        static_tip_stiffness=calibration.static_stiffness_after if calibration else np.nan,
        modal_tip_stiffness=calibration.modal_stiffness_after if calibration else np.nan,
        modes=_values(m.modes[:MAX_MODES]),
        remarks=tuple(assembly.remarks),
        x=_values(assembly.x or ()),
        y=_values(assembly.y or ()),
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


def _values(modes: Sequence[Mode]) -> tuple[Values, ...]:
    return tuple((mode.frequency, mode.damping_ratio, mode.stiffness, mode.phase_deg) for mode in modes)
