"""Spindle model with calibrated bearings: FRF, summary and calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquisition import DataError, Frf
from dsm import (
    Calibration,
    DampingCalibration,
    Spindle,
    StiffnessFit,
    calibrate,
    calibrate_damping,
    couple_tool,
    critical_speed,
    energy_shares,
    fit_stiffness,
    modes_at,
    natural_frequencies,
    receptance,
    spindle_side,
    static_stiffness,
)
from lobewatch.machine import Machine
from lobewatch.measurement.tap_measurement import Measurement

_Float = NDArray[np.float64]
MODEL_FRF_POINTS = 400
"""Points of each curve; chosen, finer than a screen shows."""
MODEL_FRF_BAND = (0.3, 3.0)
"""Band of the model's FRF, in parts of its first natural frequency; chosen."""


@dataclass(frozen=True, eq=False)
class ModelState:
    """The model with a tool in it."""

    machine: Machine
    """Settings of machine.toml."""
    tool: str
    """Tool in the spindle."""
    spindle: Spindle
    """Shaft with this tool and the newest bearings."""
    reference: Spindle
    """Shaft with the same bearings and the tool that is tapped."""
    measurement: Measurement | None
    """Measurement that set the bearings; None: they are those of machine.toml."""
    origin: str
    """Origin of the bearing stiffness, in words."""

    @property
    def title(self) -> str:
        """Machine, its label and the tool."""
        spindle = self.machine.spindle
        label = f" ({spindle.label})" if spindle and spindle.label else ""
        return f"{self.machine.machine.name}{label}, tool {self.tool}"


def build_model_state(machine: Machine, newest: Measurement | None, tool: str | None = None) -> ModelState:
    """The model with a tool (None: the one that is tapped); DataError where there is none.

    newest: the measurement that sets the bearings (`Logbook.calibrated`).
    """
    wanted = machine.tap.tool if tool is None else tool
    drawn, reference = machine.model(wanted), machine.model(machine.tap.tool)
    calibration = newest.calibration if newest else None
    if newest is None or calibration is None:
        return ModelState(machine, wanted, drawn, reference, None, "machine.toml, not calibrated yet")
    origin = f"tap test {newest.tap_id}: {calibration.bearing_stiffness / 1e6:.1f} N/um on average"
    drawn, reference = (_copy_bearings(calibration.spindle, shaft) for shaft in (drawn, reference))
    return ModelState(machine, wanted, drawn, reference, newest, origin)


def _copy_bearings(calibrated: Spindle, shaft: Spindle) -> Spindle:
    pairs = zip(shaft.bearings, calibrated.bearings, strict=True)
    return replace(shaft, bearings=[replace(bearing, stiffness=fitted.stiffness) for bearing, fitted in pairs])


def first_critical_speed(spindle: Spindle) -> float | None:
    """The lowest critical speed (rpm); None where gyroscopic moments leave none."""
    try:
        return critical_speed(spindle)
    except ArithmeticError:
        return None


def compute_model_frf(state: ModelState) -> Frf:
    """FRF around the first modes where the spindle is tapped; that of another tool at its tip, by coupling it to the
    calibrated spindle."""
    machine = state.machine
    table = machine.spindle
    if table is None:
        raise DataError("no model: add a [spindle] table")
    first = float(natural_frequencies(state.spindle, 1)[0])
    frequency = np.linspace(MODEL_FRF_BAND[0] * first, MODEL_FRF_BAND[1] * first, 2 * MODEL_FRF_POINTS)
    followed = state.measurement.followed if state.measurement else None
    loss_factor = 2 * (table.damping_ratio if followed is None else followed.damping_ratio)
    spindle, reference = state.spindle, state.reference
    if followed is not None:
        spindle, reference = _remove_dampers(spindle), _remove_dampers(reference)
    if state.tool == machine.tap.tool or table.tool_length_mm is None:
        return Frf(frequency, receptance(spindle, frequency, tap_position(state), loss_factor))
    side = spindle_side(reference, frequency, table.tool_length_mm / 1e3, loss_factor)
    return Frf(frequency, couple_tool(side, machine.find_modelled_tool(state.tool).build(state.reference)))


def _remove_dampers(spindle: Spindle) -> Spindle:
    """Spindle without dampers: a measured damping ratio holds what they do already."""
    return replace(spindle, bearings=[replace(bearing, damping=0.0) for bearing in spindle.bearings])


def tap_position(state: ModelState) -> float:
    """Distance from the tool tip (m); another tool than the one that is always tapped is looked at where it cuts."""
    tap = state.machine.tap
    return tap.position_mm / 1e3 if state.tool == tap.tool else 0.0


@dataclass(frozen=True)
class ModelMode:
    """One mode of the model."""

    frequency: float
    """Natural frequency (Hz)."""
    tip_stiffness: float
    """Modal stiffness at the tool tip (N/m)."""
    bearing_share: float
    """Share of its strain energy in bearings and housings (-)."""
    segment_share: float
    """Share of its strain energy in the shaft (-)."""
    joint_share: float
    """Share of its strain energy in the joints (-)."""


@dataclass(frozen=True)
class ModelSummary:
    """The model in figures."""

    state: ModelState
    """Model with its tool."""
    modes: tuple[ModelMode, ...]
    """First modes, the lowest first."""
    static_stiffness: float
    """Static stiffness at the tool tip (N/m)."""
    critical_speed: float | None
    """Lowest critical speed (rpm); None where gyroscopic moments leave none."""
    rigid_frequency: float
    """Natural frequency of the first mode with rigid bearings (Hz): no bearing lifts it beyond."""


def summarize_model(state: ModelState, count: int) -> ModelSummary:
    """The figures of a model: its first modes, stiffness and critical speed."""
    frequency, stiffness = modes_at(state.spindle, count)
    shares = energy_shares(state.spindle, count)
    modes = tuple(
        ModelMode(
            frequency=float(frequency[n]),
            tip_stiffness=float(stiffness[n]),
            bearing_share=float(np.sum(shares.bearings[n] + shares.housings[n])),
            segment_share=float(np.sum(shares.segments[n])),
            joint_share=float(np.sum(shares.joints[n])),
        )
        for n in range(count)
    )
    return ModelSummary(
        state,
        modes,
        static_stiffness(state.spindle),
        first_critical_speed(state.spindle),
        float(natural_frequencies(state.spindle, 1, rigid_bearings=True)[0]),
    )


@dataclass(frozen=True)
class ModelCalibration:
    """Stiffness and dampers that make a model fit."""

    label: str
    """Label of the model in machine.toml."""
    stiffness: Calibration | StiffnessFit
    """Calibration with one factor for all bearings, or with one for each group of bearings and joints."""
    dampers: DampingCalibration | None
    """Dampers of the bearings; None where no damping ratio was given."""


def calibrate_model(
    machine: Machine,
    frequency: Sequence[float],
    frequency_std: Sequence[float] = (),
    mode: Sequence[int] = (),
    group: Sequence[str] = (),
    damping_ratio: float | None = None,
) -> ModelCalibration:
    """Scale these groups until the model has these natural frequencies (Hz), and add dampers for a damping ratio (-).

    Standard errors (Hz), modes and groups may be left out; what is given stands for each frequency. Raises what
    dsm.calibrate, dsm.fit_stiffness and dsm.calibrate_damping raise.

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from lobewatch.machine import MachineFolder, make_machine_folder
    >>> with TemporaryDirectory() as parent:
    ...     toml = make_machine_folder(Path(parent) / "mill-3", "surrogate_machine.toml")
    ...     machine = MachineFolder(toml.parent).machine
    >>> f = natural_frequencies(machine.model("reference"), 1)[0]
    >>> now = calibrate_model(machine, [0.95 * f], [1.0])
    >>> f"{now.stiffness.factor:.3f} of the bearing stiffness"
    '0.715 of the bearing stiffness'
    """
    spindle = machine.model(machine.tap.tool)
    stiffness: Calibration | StiffnessFit
    if len(frequency) == 1 and _has_one_bearing_factor(spindle, group):
        number = mode[0] if mode else machine.mode.model_mode
        std, name = frequency_std[0] if frequency_std else None, group[0] if group else None
        stiffness = calibrate(spindle, frequency[0], std, number, name)
    else:
        named = frequency_std or None, mode or None, group or None
        stiffness = fit_stiffness(spindle, frequency, *named, tolerance=machine.drawing_tolerance)
        number = int(stiffness.mode[0])
    dampers = None
    if damping_ratio is not None:
        dampers = calibrate_damping(stiffness.spindle, damping_ratio, mode=number, group=group[0] if group else None)
    return ModelCalibration(machine.spindle.label if machine.spindle else "", stiffness, dampers)


def _has_one_bearing_factor(spindle: Spindle, group: Sequence[str]) -> bool:
    return len(group) <= 1 and not {joint.group for joint in spindle.joints} & set(group)
