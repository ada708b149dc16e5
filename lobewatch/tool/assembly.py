"""Tool in the spindle: modes in x and y from tap tests or predicted by the model, cross FRF and lobes."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from functools import cached_property

import numpy as np

from acquisition import CROSS_TAP, DataError, Remark
from acquisition.errors import join_sentences
from dsm import Calibration, calibrate, modes_at
from lobes import Cut, StabilityLobes
from lobewatch.arrays import Floats
from lobewatch.machine import Machine
from lobewatch.measurement.chain_check import ChainCheck
from lobewatch.measurement.coverage import describe_uncovered, label_direction, peak_remark
from lobewatch.measurement.hit_choice import HIT_DECISION_CODES
from lobewatch.measurement.recording_questions import find_open_questions, label_question
from lobewatch.measurement.sensor_effects import NO_FORCE_CODE
from lobewatch.measurement.series_questions import MAX_DAY
from lobewatch.measurement.spindle_model import build_model_state
from lobewatch.measurement.tap_measurement import Measurement
from lobewatch.tool import principal_directions as principal
from lobewatch.tool.hidden_residues import compare_directions
from lobewatch.tool.principal_directions import PrincipalDirections, TipModes
from lobewatch.tool.tap_series import FollowedMode, Scatter, compute_scatter, interpolate_frequency
from modal import Mode, UnexplainedPeak
from modal.quality.unexplained_peaks import least_limiting_depth

MAX_CROSS_FREQUENCY_DISTANCE = 0.01
"""Relative distance of a cross mode from all modes of x and y that proves another clamping; chosen."""
MAX_CROSS_RESIDUE_RATIO = 1.5
"""Largest cross residue over sqrt(Rx Ry); above 1 by more than the errors of three stiffnesses."""
SAME_STIFFNESS_TOLERANCE = 0.1
"""Relative difference of stiffnesses of the same mode; chosen: three times the scatter."""
MIN_CROSS_PEAK_RATIO = 0.3
"""Peak of a checked cross mode over the largest peak."""


CrossCheck = tuple[TipModes, tuple[Remark, ...], tuple[Remark, ...]]
"""Signed modes if they are used, the remark if not, and the reasons why the modes do not cover the cross FRF."""


def _check_cross_tap(x: TipModes, y: TipModes, tap: Measurement | None) -> CrossCheck:
    """Check that the cross FRF modes cover the cross FRF and fit those of x and y; nothing if one is missing."""
    if not x or not y or tap is None or tap.cross is None:
        return None, (), ()
    if uncovered := tuple(_find_uncovered_cross((*x, *y), tap)):
        cure = describe_uncovered(uncovered)[1]
        text = "cross tap not used, because its modes do not cover it"
        return None, (Remark("cross-not-covered", "", text, cure),), uncovered
    problem = next(_find_cross_tap_problems(x, y, tap.cross), None)
    if problem is None:
        return tap.cross, (), ()
    cure = "Tap x, y and xy again without reclamping the tool"
    return None, (Remark("cross-other-clamping", "", f"cross tap not used, because {problem}", cure),), ()


def _find_cross_tap_problems(x: Sequence[Mode], y: Sequence[Mode], cross: Sequence[Mode]) -> Iterator[str]:
    loudest = max((1 / (abs(mode.stiffness) * mode.damping_ratio) for mode in cross), default=0.0)
    loud = [mode for mode in cross if 1 / (abs(mode.stiffness) * mode.damping_ratio) >= MIN_CROSS_PEAK_RATIO * loudest]
    for name, side in (("x", x), ("y", y)):
        if loud and all(any(_is_same_mode(mode, other) for other in side) for mode in loud):
            yield f"it repeats the tap in {name} (hammer and sensor in the same direction)"
    possible = math.sqrt(math.prod(sum(1 / mode.stiffness for mode in side) for side in (x, y)))
    for mode in loud:
        at, share = mode.frequency, 1 / abs(mode.stiffness) / possible
        apart = min(abs(other.frequency / at - 1) for other in (*x, *y))
        if apart > MAX_CROSS_FREQUENCY_DISTANCE:
            yield f"its mode at {at:.0f} Hz is {100 * apart:.1f} % off the nearest mode of x and y (another clamping?)"
        if share > MAX_CROSS_RESIDUE_RATIO:
            yield f"its mode at {at:.0f} Hz is {share:.1f} times larger than possible (other sensors or clamping?)"


def _find_uncovered_cross(modes: Sequence[Mode], tap: Measurement) -> Iterator[Remark]:
    """Yield the reasons why the modes of a cross tap do not cover it; peaks far below those of x and y do not count."""
    depths = [
        (mode.frequency, -1 / (4 * mode.stiffness * mode.damping_ratio * (1 + mode.damping_ratio))) for mode in modes
    ]
    limiting = [
        peak_remark(peak) for peak in tap.unexplained if not peak.is_within_errors and _may_limit(peak, depths, modes)
    ]
    for remark in (*tap.uncovered, *limiting):
        yield label_direction(remark, tap.direction)


def _may_limit(peak: UnexplainedPeak, depths: Sequence[tuple[float, float]], modes: Sequence[Mode]) -> bool:
    def real_at(frequency: float) -> float:
        return float(sum(mode.receptance(np.array(frequency)).real for mode in modes))

    return peak.measured < least_limiting_depth(peak.frequency, depths, real_at)


def _is_same_mode(mode: Mode, other: Mode) -> bool:
    frequency, stiffness = abs(other.frequency / mode.frequency - 1), abs(other.stiffness / mode.stiffness - 1)
    return frequency < MAX_CROSS_FREQUENCY_DISTANCE and stiffness < SAME_STIFFNESS_TOLERANCE


DIRECTION_CODES = ("one-direction", "older-direction")
"""Codes of the remarks on missing or older directions."""
UNUSABLE_TAP_REASONS = {
    NO_FORCE_CODE: ("no force was measured, so stiffness K is unknown", "Tap direction {} with a force hammer"),
    "no-lobes-driving-point": ("not a driving point", "Hit and measure at one point in direction {}, and tap again"),
    "no-lobes-beside-tip": ("not tapped at the tool tip", "Tap direction {} at the tool tip, or add a [spindle] table"),
}
"""Reason and remedy of a tap test without modes at the tip, by the code of its remark."""
NO_MODE_REASON = ("no mode in the band", "Tap direction {} again")
"""Reason and remedy without such a remark."""


@dataclass(frozen=True, eq=False)
class Assembly:
    """Tool in the spindle as measured or predicted, the input of lobes and verdicts."""

    tool: str
    """Tool in the spindle."""
    time: datetime
    """Time of its newest tap test, or of the one behind a prediction."""
    tap_id: str
    """Identity of that tap test, or the origin of the prediction."""
    x: TipModes
    """Modes at the tool tip in x; those of y if x was not tapped."""
    y: TipModes
    """Modes at the tool tip in y; those of x if y was not tapped."""
    directions: tuple[str, ...]
    """Known directions; an unknown one is taken like the other, never as rigid."""
    calibration: Calibration | None
    """Model with the newest bearings."""
    taps: Mapping[str, str]
    """Tap test by direction; empty for a prediction."""
    predicted: bool
    """True if the model predicts the tool."""
    remarks: tuple[Remark, ...]
    """Remarks on missing and doubtful results."""
    series: Mapping[str, Sequence[FollowedMode]] = field(default_factory=dict)
    """Followed modes of the tool up to then by direction; empty for a prediction."""
    unusable: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    """Reason and remedy of a tap test without modes at the tip, by direction."""
    cross: TipModes = None
    """Signed modes at the tool tip, hit in x and measured in y; None without a cross FRF."""
    without_stiffness: Mapping[str, Mode] = field(default_factory=dict)
    """Followed modes of tap tests without force, by direction."""
    questions: tuple[Remark, ...] = ()
    """Open questions about these tap tests."""
    uncovered: tuple[Remark, ...] = ()
    """Remarks that say the modes do not cover the measurement; no answer silences them."""
    hit_remarks: tuple[Remark, ...] = ()
    """Remarks on decisions on hits of these tap tests."""
    tapped_since: datetime | None = None
    """Time of the older of its newest tap tests in x and in y; None as of its newest test."""
    age_days: float | None = None
    """Age since then (days), from the clock; None as of its newest test."""
    age_remarks: tuple[Remark, ...] = ()
    """Remark on an old tap test where nobody has agreed an interval; it limits no verdict."""
    chain_checks: tuple[ChainCheck, ...] = ()
    """Checks of the sensors behind its tap tests."""
    unchecked: tuple[Remark, ...] = ()
    """Remarks on what a check or another tap test must still confirm; until then no program is stable."""
    hidden_residues: Floats | None = None
    """Largest residue of each mode of x, then y, in the FRF of the other direction (m/N), shape (n,); None without
    FRFs of both at the tip."""

    @property
    def is_complete(self) -> bool:
        """True if both directions are known from tap tests without open questions, covered by modes and checked."""
        return len(self.directions) == 2 and not (self.questions or self.uncovered or self.unchecked)

    @property
    def is_stated(self) -> bool:
        """True if a person stated the modes and no tap test is behind them."""
        return not self.taps and not self.predicted

    @property
    def missing_direction(self) -> tuple[str, str]:
        """Text on the missing direction, and its remedy."""
        missing = "y" if "x" in self.directions else "x"
        if missing not in self.unusable:
            return f"direction {missing} was not tapped", f"Tap direction {missing} of tool {self.tool!r} too"
        why, cure = self.unusable[missing]
        return f"direction {missing} is tapped but not usable ({why})", cure

    @property
    def label(self) -> str:
        """Name in a legend."""
        date = f"{self.time:%Y-%m-%d}"
        return self.tap_id if self.is_stated else f"predicted, bearings of {date}" if self.predicted else date

    @cached_property
    def principal_directions(self) -> PrincipalDirections:
        """Principal directions of the modes of x, then of y, with their uncertainty."""
        return principal.find_principal_directions(self.x or (), self.y or (), self.cross, self.hidden_residues)

    def check(self) -> Assembly:
        """Return itself; DataError without modes at the tip."""
        if not self.directions:
            raise DataError(f"{self.tap_id}: {join_sentences(*map(str, self.remarks))}")
        return self

    def scatter(self, direction: str) -> Scatter | None:
        """Return the scatter from test to test; None for too few tests.

        Parameters
        ----------
        direction
            Direction at the tool tip, "x" or "y".
        """
        return compute_scatter(self.series.get(direction, ()))


def assemble(
    newest: Measurement,
    across: Measurement | None,
    series: Mapping[str, Sequence[FollowedMode]],
    cross: Measurement | None = None,
) -> Assembly:
    """Assemble a tool from its newest tap test and the newest one in the other direction.

    series: tap tests of both directions up to the newest; cross: newest cross FRF. The frequencies of an older
    direction are shifted by the change of the newest one since.
    """
    taps = [newest, *([across] if across is not None else [])]
    modes: dict[str, TipModes] = {tap.direction: tap.at_tip for tap in taps if tap.at_tip}
    points = series.get(newest.direction, ())
    then = None if across is None else interpolate_frequency(points, across.time)
    moved = None if then is None else points[-1].frequency / then
    if across is not None and moved is not None and newest.time - across.time > MAX_DAY:
        modes[across.direction] = [mode.scaled(moved, 1.0, "moved with the other direction") for mode in across.at_tip]
    signed, about_cross, uncovered_cross = _check_cross_tap(modes.get("x"), modes.get("y"), cross)
    calibration = next((tap.calibration for tap in taps if tap.calibration is not None), None)
    direct = {tap.direction: tap for tap in taps if tap.direction != CROSS_TAP}
    followed = {direction: tap.followed for direction, tap in direct.items() if tap.followed is not None}
    assembly = _make_assembly(newest.tool, newest.time, newest.tap_id, modes, calibration)
    return replace(
        assembly,
        taps={tap.direction: tap.tap_id for tap in taps},
        predicted=False,
        remarks=(*newest.remarks, *_direction_remarks(newest, across, assembly.directions, moved), *about_cross),
        cross=signed,
        hidden_residues=compare_directions(direct.get("x"), direct.get("y")),
        series={direction: points for direction, points in series.items() if direction != CROSS_TAP},
        unusable={direction: _unusable_reason(tap) for direction, tap in direct.items() if not tap.at_tip},
        without_stiffness={direction: mode for direction, mode in followed.items() if not mode.has_stiffness},
        questions=tuple(label_question(tap.tap_id, own) for tap in taps for own in find_open_questions(tap.remarks)),
        uncovered=(*(label_direction(own, tap.direction) for tap in taps for own in tap.uncovered), *uncovered_cross),
        hit_remarks=tuple(
            label_direction(own, tap.direction)
            for tap in (*taps, *([cross] if cross is not None else []))
            for own in tap.remarks
            if own.code in HIT_DECISION_CODES
        ),
    )


def _make_assembly(
    tool: str, time: datetime, tap_id: str, modes: Mapping[str, TipModes], calibration: Calibration | None
) -> Assembly:
    """Make the assembly of a predicted tool from its modes at the tip by direction."""
    x, y = modes.get("x"), modes.get("y")
    directions = tuple(name for name in ("x", "y") if modes.get(name))
    return Assembly(tool, time, tap_id, x or y, y or x, directions, calibration, {}, True, ())


def _unusable_reason(tap: Measurement) -> tuple[str, str]:
    codes = {remark.code for remark in tap.remarks}
    why, cure = next((words for code, words in UNUSABLE_TAP_REASONS.items() if code in codes), NO_MODE_REASON)
    return why, cure.format(tap.direction)


def _untapped_remark(tool: str, tapped: str, unusable: tuple[str, str] | None = None) -> Remark:
    """Return the remark on a missing direction; unusable: reason and remedy of its tap test."""
    missing = "y" if tapped == "x" else "x"
    text = f"modes only in direction {tapped}, direction {missing} assumed equal"
    if unusable is None:
        return Remark("one-direction", tool, text, f"Tap direction {missing} of this tool too")
    return Remark("one-direction", tool, f"{text} ({missing} is tapped but not usable: {unusable[0]})", unusable[1])


def _direction_remarks(
    newest: Measurement, across: Measurement | None, directions: Sequence[str], moved: float | None
) -> tuple[Remark, ...]:
    if len(directions) == 1:
        useless = [tap for tap in (newest, across) if tap is not None and not tap.at_tip]
        return (_untapped_remark(newest.tool, directions[0], _unusable_reason(useless[0]) if useless else None),)
    if across is None or newest.time - across.time <= MAX_DAY:
        return ()
    days = round((newest.time - across.time) / timedelta(days=1))
    text = f"direction {across.direction} is from {across.time:%Y-%m-%d}, {days} day{'s' if days > 1 else ''} older"
    text += f" than direction {newest.direction}"
    if moved is not None:
        text += f", frequency shifted by {100 * (moved - 1):+.1f} % as in direction {newest.direction}"
    return (Remark("older-direction", newest.tool, text, f"Tap direction {across.direction} again"),)


PREDICTED_MODE_COUNT = 8
"""Number of computed modes."""
MAX_PREDICTED_STIFFNESS_RATIO = 50.0
"""Stiffness over that of the softest mode above which a mode changes limits by only a few percent and is left out."""


def predict_assembly(machine: Machine, newest: Sequence[Measurement], tool: str) -> Assembly:
    """Predict a tool in each direction, with the bearings of the newest calibrated measurement.

    newest: those measurements, newest first. The damping ratio is that of the followed mode, and so is the phase of the
    softest mode, since the same bearings and joints damp it. Raises DataError without a model of the tool or a tap
    test.
    """
    if not newest:
        build_model_state(machine, None, tool)
        raise DataError(f"tool {tool!r} was never tapped, and no tap test has calibrated the model. Tap the tool.")
    predictions = {tap.direction: _predict_direction(machine, tap, tool) for tap in newest}
    modes: dict[str, TipModes] = {direction: at_tip for direction, (at_tip, _) in predictions.items()}
    ids = " and ".join(tap.tap_id for tap in newest)
    remark = Remark("predicted", f"tool {tool!r}", f"predicted by the model with the bearings of {ids}", "Tap the tool")
    name, calibration = f"prediction from {newest[0].tap_id}", predictions[newest[0].direction][1]
    assembly = _make_assembly(tool, newest[0].time, name, modes, calibration)
    tapped = assembly.directions
    return replace(assembly, remarks=(remark, *([_untapped_remark(tool, tapped[0])] if len(tapped) == 1 else [])))


def _predict_direction(machine: Machine, tap: Measurement, tool: str) -> tuple[list[Mode], Calibration]:
    """Return the modes of the model in the measured band, shifted with the softest one."""
    state, followed = build_model_state(machine, tap, tool), tap.followed
    if followed is None:
        raise DataError(f"{tap.tap_id}: no followed mode in this tap test")
    frequency, stiffness = modes_at(state.spindle, PREDICTED_MODE_COUNT)
    softest = int(np.argmin(stiffness))
    shown = stiffness < MAX_PREDICTED_STIFFNESS_RATIO * stiffness[softest]
    if machine.mode.band_hz is not None:
        low, high = (edge / followed.frequency * frequency[softest] for edge in machine.mode.band_hz)
        shown &= (frequency >= low) & (frequency <= high)
    origin = f"model, bearings of {tap.tap_id}"
    modes = list[Mode]()
    for i in np.flatnonzero(shown).tolist():
        phase = followed.phase_deg if i == softest else 0.0
        values = float(frequency[i]), followed.damping_ratio, float(stiffness[i])
        modes.append(Mode(*values, method=origin, phase_deg=phase))
    return modes, calibrate(state.spindle, float(frequency[softest]), mode=softest + 1)


def speed_grid(machine: Machine) -> Floats:
    """Return the speeds of all diagrams of a machine.

    Parameters
    ----------
    machine
        Machine with its [speed].

    Returns
    -------
    ndarray, shape (n,)
        Spindle speeds (rpm).

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from lobewatch.machine import MachineFolder, make_machine_folder
    >>> with TemporaryDirectory() as parent:
    ...     toml = make_machine_folder(Path(parent) / "mill-3", "surrogate_machine.toml")
    ...     speeds = speed_grid(MachineFolder(toml.parent).machine)
    >>> speeds[[0, -1]].tolist(), speeds.size  # rpm
    ([3000.0, 24000.0], 1151)
    """
    return np.linspace(machine.speed.low_rpm, machine.speed.high_rpm, machine.speed.steps)


def compute_lobes(assembly: Assembly, machine: Machine) -> dict[str, StabilityLobes]:
    """Compute the stability lobes of all cuts of a tool by zero order, for charts only.

    Parameters
    ----------
    assembly
        Tool with its modes.
    machine
        Machine with its cuts and speeds.

    Returns
    -------
    dict of str to StabilityLobes
        Lowest lobes over the feed directions by name of the cut; empty without modes.
    """
    return compute_tip_lobes(assembly.tool, assembly.x, assembly.y, machine, cross=assembly.cross)


def compute_tip_lobes(
    tool: str, x: TipModes, y: TipModes, machine: Machine, names: Collection[str] | None = None, cross: TipModes = None
) -> dict[str, StabilityLobes]:
    """Compute the lobes of modes at the tip by name of the cut, once for equal cuts; names: selected cuts."""
    if not x and not y:
        return {}
    speeds, diagrams = speed_grid(machine), dict[tuple[Cut, ...], StabilityLobes]()
    wanted = {name: cuts for name, cuts in machine.cuts(tool).items() if names is None or name in names}
    for cuts in wanted.values():
        if cuts not in diagrams:
            diagrams[cuts] = principal.lowest_zero_order_lobes(x, y, cuts, speeds, cross)
    return {name: diagrams[cuts] for name, cuts in wanted.items()}
