"""Tool in the spindle: modes in x and y from tap tests, cross FRF and lobes."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from acquisition import CROSS_TAP, DataError, Remark
from dsm import Calibration
from lobes import Cut, StabilityLobes
from lobewatch.machine import Machine
from lobewatch.measurement.recording_questions import find_open_questions, label_question
from lobewatch.measurement.sensor_effects import NO_FORCE_CODE
from lobewatch.measurement.tap_measurement import Measurement
from lobewatch.tool.principal_directions import (
    PrincipalDirections,
    TipModes,
    find_principal_directions,
    lowest_zero_order_lobes,
)
from lobewatch.tool.tap_series import FollowedMode, Scatter, compute_scatter, interpolate_frequency
from modal import Mode

MAX_CROSS_FREQUENCY_DISTANCE = 0.01
"""Relative distance of a cross mode from the nearest mode of x or y, beyond which it is of another clamping; chosen."""
MAX_CROSS_RESIDUE_RATIO = 1.5
"""Largest cross residue over sqrt(Rx Ry): above 1 by more than the errors of three stiffnesses it cannot be."""
SAME_STIFFNESS_TOLERANCE = 0.1
"""Relative difference of stiffnesses below which a cross mode is that of x or y; chosen: three times the scatter."""
MIN_CROSS_PEAK_RATIO = 0.3
"""Peak of a cross mode over the largest peak, from which on it is asked where it belongs."""


def check_cross_tap(x: TipModes, y: TipModes, cross: TipModes) -> tuple[TipModes, tuple[Remark, ...]]:
    """The modes of a cross tap where they go with those of x and y; else None, and a remark that says why.

    None where one of the three is not known.
    """
    if not x or not y or cross is None:
        return None, ()
    problem = next(_find_cross_tap_problems(x, y, cross), None)
    if problem is None:
        return cross, ()
    cure = "tap x, y and xy of the tool as it is clamped now"
    return None, (Remark("cross-other-clamping", "", f"cross tap not used: {problem}", cure),)


def _find_cross_tap_problems(x: Sequence[Mode], y: Sequence[Mode], cross: Sequence[Mode]) -> Iterator[str]:
    """What of it does not go with them."""
    loudest = max((1 / (abs(mode.stiffness) * mode.damping_ratio) for mode in cross), default=0.0)
    loud = [mode for mode in cross if 1 / (abs(mode.stiffness) * mode.damping_ratio) >= MIN_CROSS_PEAK_RATIO * loudest]
    for name, side in (("x", x), ("y", y)):
        if loud and all(any(_is_same_mode(mode, other) for other in side) for mode in loud):
            yield f"it is the tap in {name} once more: hammer and sensor were in the same direction"
    possible = math.sqrt(math.prod(sum(1 / mode.stiffness for mode in side) for side in (x, y)))
    for mode in loud:
        at, share = mode.frequency, 1 / abs(mode.stiffness) / possible
        apart = min(abs(other.frequency / at - 1) for other in (*x, *y))
        if apart > MAX_CROSS_FREQUENCY_DISTANCE:
            yield f"it shows {at:.0f} Hz, {100 * apart:.1f} % from the nearest mode of x and y: another clamping"
        if share > MAX_CROSS_RESIDUE_RATIO:
            yield f"at {at:.0f} Hz it shows {share:.1f} times what x and y allow: other sensors or another clamping"


def _is_same_mode(mode: Mode, other: Mode) -> bool:
    """Whether two modes are one, sign and size of the stiffness included."""
    return (
        abs(other.frequency / mode.frequency - 1) < MAX_CROSS_FREQUENCY_DISTANCE
        and abs(other.stiffness / mode.stiffness - 1) < SAME_STIFFNESS_TOLERANCE
    )


DIRECTION_CODES = ("one-direction", "older-direction")
"""Codes of the remarks on what is known in x and y."""
UNUSABLE_TAP_REASONS = {
    NO_FORCE_CODE: ("no force was measured, K is not known", "tap {} with a hammer that measures its force"),
    "no-lobes-driving-point": ("not a driving point", "hit and measure at one point in {} and tap again"),
    "no-lobes-beside-tip": ("not at the tool tip", "tap {} at the tip, or add a [spindle]"),
}
"""Why a tap test gives no modes at the tip, and what to do in its direction, by the code of its remark ..."""
NO_MODE_REASON = ("no mode in the band", "tap {} again")
"""... and without such a remark."""
MAX_DIRECTION_AGE = timedelta(hours=24)
"""Time between the taps in x and y beyond which the older one is moved, and called so; chosen."""


@dataclass(frozen=True, eq=False)
class Assembly:
    """A tool in the spindle as tapped: what its lobes and verdicts are computed from."""

    tool: str
    """Tool in the spindle."""
    time: datetime
    """Time of its newest tap test; of the one that the bearings come from where it is predicted."""
    tap_id: str
    """Identity of that tap test, or where the prediction comes from."""
    x: TipModes
    """Modes at the tool tip in x of the machine; like y where x was not tapped."""
    y: TipModes
    """Modes at the tool tip in y; like x where y was not tapped."""
    directions: tuple[str, ...]
    """Directions that are known; the other one is taken like it, never as rigid."""
    calibration: Calibration | None
    """The model with the newest bearings."""
    taps: Mapping[str, str]
    """Tap test by direction; empty where it is predicted."""
    predicted: bool
    """Whether all of it comes from the model, for a tool that was never tapped."""
    remarks: tuple[Remark, ...]
    """Remarks on what is not known, and what is in doubt."""
    series: Mapping[str, Sequence[FollowedMode]] = field(default_factory=dict)
    """Tap tests of the same tool up to then, by direction; empty where it is predicted."""
    unusable: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    """Why a tap test gives no modes at the tip, and what to do, by its direction."""
    cross: TipModes = None
    """Modes at the tool tip hit in x and seen in y, signed; None where that was not tapped."""
    without_stiffness: Mapping[str, Mode] = field(default_factory=dict)
    """Modes followed in tap tests without force, whose stiffness is not known, by direction."""
    questions: tuple[Remark, ...] = ()
    """Questions about these tap tests that nobody has answered; until then nothing is sure."""

    @property
    def is_complete(self) -> bool:
        """Whether both directions are known, from tap tests that nothing is asked about."""
        return len(self.directions) == 2 and not self.questions

    @property
    def missing_direction(self) -> tuple[str, str]:
        """Which direction is not known, in words, and what to do, where one is not."""
        missing = "y" if "x" in self.directions else "x"
        if missing not in self.unusable:
            return f"direction {missing} was not tapped", f"tap direction {missing} of tool {self.tool!r} too"
        why, cure = self.unusable[missing]
        return f"direction {missing} is tapped, not usable: {why}", cure

    @property
    def label(self) -> str:
        """Name in a legend."""
        return f"predicted, bearings of {self.time:%Y-%m-%d}" if self.predicted else f"{self.time:%Y-%m-%d}"

    @property
    def principal_directions(self) -> PrincipalDirections:
        """Axes of the modes of x, then of y, and what is open of them."""
        return find_principal_directions(self.x or (), self.y or (), self.cross)

    def check(self) -> Assembly:
        """Itself; DataError with the reason where no modes at the tip are known in either direction."""
        if not self.directions:
            raise DataError(f"{self.tap_id}: {'; '.join(map(str, self.remarks))}")
        return self

    def scatter(self, direction: str) -> Scatter | None:
        """Scatter from tap test to tap test; None where there are too few."""
        return compute_scatter(self.series.get(direction, ()))


def assemble(
    newest: Measurement,
    across: Measurement | None,
    series: Mapping[str, Sequence[FollowedMode]],
    cross: Measurement | None = None,
) -> Assembly:
    """The tool by its newest tap test and the newest one across, in the other direction, where there is one.

    series: tap tests of both directions up to the newest; cross: the newest cross tap, where there is one. The
    frequencies of an older direction, however old, are moved by as much as those of the newest one have changed since.
    """
    taps = [newest, *([across] if across is not None else [])]
    modes: dict[str, TipModes] = {tap.direction: tap.at_tip for tap in taps if tap.at_tip}
    moved = None if across is None else _frequency_change_since(across.time, series.get(newest.direction, ()))
    if across is not None and moved is not None and newest.time - across.time > MAX_DIRECTION_AGE:
        modes[across.direction] = [mode.scaled(moved, 1.0, "moved with the other direction") for mode in across.at_tip]
    directions = tuple(name for name in ("x", "y") if modes.get(name))
    signed, about_cross = check_cross_tap(modes.get("x"), modes.get("y"), None if cross is None else cross.cross)
    return Assembly(
        tool=newest.tool,
        time=newest.time,
        tap_id=newest.tap_id,
        x=modes.get("x") or modes.get("y"),
        y=modes.get("y") or modes.get("x"),
        directions=directions,
        calibration=next((tap.calibration for tap in taps if tap.calibration is not None), None),
        taps={tap.direction: tap.tap_id for tap in taps},
        predicted=False,
        remarks=(*newest.remarks, *_direction_remarks(newest, across, directions, moved), *about_cross),
        cross=signed,
        series={direction: modes for direction, modes in series.items() if direction != CROSS_TAP},
        unusable={
            tap.direction: _unusable_reason(tap) for tap in taps if not tap.at_tip and tap.direction != CROSS_TAP
        },
        without_stiffness={
            tap.direction: mode for tap in taps if (mode := tap.followed) and _lacks_stiffness(tap, mode)
        },
        questions=tuple(
            label_question(tap.tap_id, asked) for tap in taps for asked in find_open_questions(tap.remarks)
        ),
    )


def _lacks_stiffness(tap: Measurement, mode: Mode) -> bool:
    return tap.direction != CROSS_TAP and not mode.has_stiffness


def _unusable_reason(tap: Measurement) -> tuple[str, str]:
    codes = {remark.code for remark in tap.remarks}
    why, cure = next((words for code, words in UNUSABLE_TAP_REASONS.items() if code in codes), NO_MODE_REASON)
    return why, cure.format(tap.direction)


def untapped_remark(tool: str, tapped: str, unusable: tuple[str, str] | None = None) -> Remark:
    """Remark that one direction alone is known; unusable: why the tap test of the other one is not, and what to do."""
    missing = "y" if tapped == "x" else "x"
    text = f"modes in the {tapped} direction alone, {missing} taken like {tapped}"
    if unusable is None:
        return Remark("one-direction", tool, text, f"tap direction {missing} of the same tool too")
    return Remark("one-direction", tool, f"{text}; {missing} is tapped, not usable: {unusable[0]}", unusable[1])


def _frequency_change_since(time: datetime, series: Sequence[FollowedMode]) -> float | None:
    """Frequency of the newest test of a series over that at a time."""
    frequency = interpolate_frequency(series, time)
    return None if frequency is None else series[-1].frequency / frequency


def _direction_remarks(
    newest: Measurement, across: Measurement | None, directions: Sequence[str], moved: float | None
) -> tuple[Remark, ...]:
    if len(directions) == 1:
        useless = [tap for tap in (newest, across) if tap is not None and not tap.at_tip]
        return (untapped_remark(newest.tool, directions[0], _unusable_reason(useless[0]) if useless else None),)
    if across is None or newest.time - across.time <= MAX_DIRECTION_AGE:
        return ()
    days = round((newest.time - across.time) / timedelta(days=1))
    text = f"direction {across.direction} is that of {across.time:%Y-%m-%d}, {days} day{'s' if days > 1 else ''} older"
    if moved is not None:
        text += f", its frequency moved by {100 * (moved - 1):+.1f} % as that of {newest.direction} since"
    return (Remark("older-direction", newest.tool, text, f"tap direction {across.direction} again"),)


def speed_grid(machine: Machine) -> NDArray[np.float64]:
    """The common speeds of all diagrams of a machine (rpm), shape ([speed] steps,).

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
    """Diagrams by zero order, by name of the cut: the reference cut and every program of the tool. A chart, no verdict.

    Each shows the lower one of its directions of feed. Empty where no modes are known.
    """
    return compute_tip_lobes(assembly.tool, assembly.x, assembly.y, machine, cross=assembly.cross)


def compute_tip_lobes(
    tool: str, x: TipModes, y: TipModes, machine: Machine, names: Collection[str] | None = None, cross: TipModes = None
) -> dict[str, StabilityLobes]:
    """Diagrams of modes at the tip; names: of these cuts alone. Cuts that are alike are worked out once."""
    if not x and not y:
        return {}
    speeds, diagrams = speed_grid(machine), dict[tuple[Cut, ...], StabilityLobes]()
    wanted = {name: cuts for name, cuts in machine.cuts(tool).items() if names is None or name in names}
    for cuts in wanted.values():
        if cuts not in diagrams:
            diagrams[cuts] = lowest_zero_order_lobes(x, y, cuts, speeds, cross)
    return {name: diagrams[cuts] for name, cuts in wanted.items()}
