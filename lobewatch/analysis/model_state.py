"""The model as the newest tap test left it, with one tool or another in it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquisition import DataError, Frf
from dsm import (
    Calibration,
    Spindle,
    couple_tool,
    critical_speed,
    mode_shapes,
    natural_frequencies,
    receptance,
    spindle_side,
    stiffness_curve,
    whirl_map,
)
from lobewatch.analysis.history import measure, update_history
from lobewatch.analysis.model_picture import ModelPicture
from lobewatch.machine.folder import MachineFolder, TapEntry
from modal import Mode

_Float = NDArray[np.float64]
POINTS = 400
"""Of each curve."""


@dataclass(frozen=True, eq=False)
class ModelState:
    """The model with a tool in it."""

    folder: MachineFolder
    """Of the machine."""
    tool: str
    """What is in the spindle."""
    spindle: Spindle
    """The shaft with this tool and the newest bearings."""
    reference: Spindle
    """The same bearings with the tool that is tapped."""
    tap: TapEntry | None
    """The tap test that the bearings were found from; None: they are those of machine.toml."""
    followed: Mode | None
    """The mode that they were found from."""
    origin: str
    """Where the bearing stiffness comes from, in words."""

    @property
    def title(self) -> str:
        """Machine, its label and the tool."""
        machine = self.folder.machine
        label = f" ({machine.spindle.label})" if machine.spindle and machine.spindle.label else ""
        return f"{machine.machine.name}{label}, tool {self.tool}"


def model_state(folder: MachineFolder, tool: str | None = None) -> ModelState:
    """The model with a tool (None: the one that is tapped); DataError where there is none."""
    machine = folder.machine
    wanted = machine.tap.tool if tool is None else tool
    drawn, reference = machine.model(wanted), machine.model(machine.tap.tool)
    newest = _newest_calibration(folder)
    if newest is None:
        return ModelState(folder, wanted, drawn, reference, None, None, "machine.toml, not calibrated yet")
    tap, calibration, followed = newest
    origin = f"tap test {tap.id}: {calibration.bearing_stiffness / 1e6:.1f} N/um on average"
    drawn, reference = (_with_bearings_of(calibration.spindle, shaft) for shaft in (drawn, reference))
    return ModelState(folder, wanted, drawn, reference, tap, followed, origin)


def _with_bearings_of(calibrated: Spindle, shaft: Spindle) -> Spindle:
    pairs = zip(shaft.bearings, calibrated.bearings, strict=True)
    return replace(shaft, bearings=[replace(bearing, stiffness=found.stiffness) for bearing, found in pairs])


def _newest_calibration(folder: MachineFolder) -> tuple[TapEntry, Calibration, Mode] | None:
    """The newest tap test that the bearings could be found from."""
    history, _ = update_history(folder)
    usable = np.flatnonzero(np.isfinite(history.columns["bearing_stiffness"]))
    if not usable.size:
        return None
    tap = folder.taps()[int(usable[-1])]
    dynamics = measure(folder, tap).dynamics
    if dynamics.calibration is None or dynamics.followed is None:
        raise DataError(f"{folder.history}: does not fit the tap tests; delete it, it is made again")
    return tap, dynamics.calibration, dynamics.followed


def first_critical_speed(spindle: Spindle) -> float | None:
    """The lowest critical speed (rpm); None where gyroscopic moments leave none."""
    try:
        return critical_speed(spindle)
    except ArithmeticError:
        return None


def model_picture(state: ModelState, modes: int) -> ModelPicture:
    """What `lobewatch model --figure` draws."""
    spindle, machine = state.spindle, state.folder.machine
    speeds = np.linspace(0.0, 1.15 * (first_critical_speed(spindle) or machine.speed.high_rpm), 24)
    return ModelPicture(
        title=state.title,
        spindle=spindle,
        modes=mode_shapes(spindle, min(modes, 4), np.linspace(0.0, spindle.length, POINTS)),
        curve=_curve(spindle, machine.mode.model_mode),
        points=_points(state),
        whirl=whirl_map(spindle, speeds, min(modes, 2)),
        highest_speed=machine.speed.high_rpm,
        frf_place="at the tool tip" if _tap_position(state) == 0 else f"{_tap_position(state) * 1e3:g} mm from the tip",
        model_frf=model_frf(state),
        measured_frf=_measured_frf(state),
    )


def _curve(spindle: Spindle, mode: int) -> tuple[_Float, _Float]:
    """Bearing stiffness over the followed frequency, from a thirtieth to thirty times the present one."""
    if not any(bearing.group and np.isfinite(bearing.stiffness) for bearing in spindle.bearings):
        return np.empty(0), np.empty(0)
    ends = []
    for factor in (1 / 30, 30.0):
        scaled = [replace(bearing, stiffness=factor * bearing.stiffness) for bearing in spindle.bearings]
        ends.append(float(natural_frequencies(replace(spindle, bearings=scaled), mode)[-1]))
    frequency = np.linspace(ends[0], ends[1], POINTS)[1:-1]
    return stiffness_curve(spindle, frequency, mode), frequency


def _points(state: ModelState) -> tuple[_Float, _Float]:
    columns = update_history(state.folder)[0].columns
    mine = (columns["tool"] == state.tool) & np.isfinite(columns["bearing_stiffness"])
    return columns["bearing_stiffness"][mine], columns["frequency"][mine]


def model_frf(state: ModelState) -> Frf:
    """Around the first modes, where it is tapped; of another tool at its tip, by coupling to the calibrated spindle."""
    machine = state.folder.machine
    table = machine.spindle
    if table is None:
        raise DataError(f"{state.folder.toml}: no model")
    first = float(natural_frequencies(state.spindle, 1)[0])
    frequency = np.linspace(0.3 * first, 3.0 * first, 2 * POINTS)
    loss_factor = 2 * (table.damping_ratio if state.followed is None else state.followed.damping_ratio)
    spindle, reference = state.spindle, state.reference
    if state.followed is not None:
        spindle, reference = _undamped(spindle), _undamped(reference)
    if state.tool == machine.tap.tool or table.tool_length_mm is None:
        return Frf(frequency, receptance(spindle, frequency, _tap_position(state), loss_factor))
    side = spindle_side(reference, frequency, table.tool_length_mm / 1e3, loss_factor)
    return Frf(frequency, couple_tool(side, machine.tool_named(state.tool).build(state.reference)))


def _undamped(spindle: Spindle) -> Spindle:
    """Without dampers: a measured damping ratio holds what they do already."""
    return replace(spindle, bearings=[replace(bearing, damping=0.0) for bearing in spindle.bearings])


def _tap_position(state: ModelState) -> float:
    """From the tool tip (m); another tool than the one that is always tapped is looked at where it cuts."""
    tap = state.folder.machine.tap
    return tap.position_mm / 1e3 if state.tool == tap.tool else 0.0


def _measured_frf(state: ModelState) -> Frf | None:
    taps = [tap for tap in state.folder.taps() if tap.tool == state.tool]
    return state.folder.read(taps[-1]).frf if taps else None
