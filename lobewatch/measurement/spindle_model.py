"""Spindle model with calibrated bearings: FRF, summary and calibration."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

import dsm
from acquisition import DataError, Frf
from dsm import Calibration, DampingCalibration, Spindle, StiffnessFit
from lobewatch.machine import Machine
from lobewatch.measurement.tap_measurement import Measurement

MODEL_FRF_POINTS = 400
"""Points of each curve; chosen, finer than a screen."""
MODEL_FRF_BAND = (0.3, 3.0)
"""Band of the model FRF relative to its first natural frequency; chosen."""


@dataclass(frozen=True, eq=False)
class ModelState:
    """Spindle model with a tool and the newest bearings."""

    machine: Machine
    """Machine of the model."""
    tool: str
    """Tool in the spindle."""
    spindle: Spindle
    """Spindle with this tool and the newest bearings."""
    reference: Spindle
    """Spindle with the tapped tool and the same bearings."""
    measurement: Measurement | None
    """Measurement that calibrated the bearings; None: bearings of machine.toml."""
    origin: str
    """Origin of the bearing stiffness, in words."""

    @property
    def title(self) -> str:
        """Machine, label of the model, and tool."""
        spindle = self.machine.spindle
        label = f" ({spindle.label})" if spindle and spindle.label else ""
        return f"{self.machine.machine.name}{label}, tool {self.tool}"


def build_model_state(machine: Machine, newest: Measurement | None, tool: str | None = None) -> ModelState:
    """Build the spindle model with a tool and the newest bearings.

    Parameters
    ----------
    machine
        Machine with a [spindle].
    newest
        Measurement that calibrates the bearings (`Logbook.calibrated`).
    tool
        Name of the tool; None for the tapped one.

    Returns
    -------
    ModelState
        Model with the tool.

    Raises
    ------
    DataError
        If there is no model of the tool.
    """
    wanted = machine.tap.tool if tool is None else tool
    drawn, reference = machine.model(wanted), machine.model(machine.tap.tool)
    calibration = newest.calibration if newest else None
    if newest is None or calibration is None:
        return ModelState(machine, wanted, drawn, reference, None, "machine.toml, not calibrated yet")
    origin = f"tap test {newest.tap_id}: {calibration.bearing_stiffness / 1e6:.1f} N/um on average per bearing"
    drawn, reference = (_copy_bearings(calibration.spindle, shaft) for shaft in (drawn, reference))
    return ModelState(machine, wanted, drawn, reference, newest, origin)


def _copy_bearings(calibrated: Spindle, shaft: Spindle) -> Spindle:
    pairs = zip(shaft.bearings, calibrated.bearings, strict=True)
    return replace(shaft, bearings=[replace(bearing, stiffness=fitted.stiffness) for bearing, fitted in pairs])


def first_critical_speed(spindle: Spindle) -> float | None:
    """Return the lowest critical speed.

    Parameters
    ----------
    spindle
        Spindle model.

    Returns
    -------
    float or None
        Speed (rpm); None if gyroscopic moments leave none.
    """
    try:
        return dsm.critical_speed(spindle)
    except ArithmeticError:
        return None


def compute_model_frf(state: ModelState) -> Frf:
    """Compute the FRF of the model around its first modes.

    Parameters
    ----------
    state
        Model; another tool than the tapped one is coupled to the calibrated spindle.

    Returns
    -------
    Frf
        Receptance (m/N) at the tapped place, or at the tip of another tool.
    """
    machine, table = state.machine, state.machine.spindle
    if table is None:
        raise DataError("no spindle model. Add a [spindle] table to machine.toml.")
    first = float(dsm.natural_frequencies(state.spindle, 1)[0])
    frequency = np.linspace(MODEL_FRF_BAND[0] * first, MODEL_FRF_BAND[1] * first, 2 * MODEL_FRF_POINTS)
    followed = state.measurement.followed if state.measurement else None
    loss_factor = 2 * (table.damping_ratio if followed is None else followed.damping_ratio)
    spindle, reference = state.spindle, state.reference
    if followed is not None:
        spindle, reference = _remove_dampers(spindle), _remove_dampers(reference)
    if state.tool == machine.tap.tool or table.tool_length_mm is None:
        return Frf(frequency, dsm.receptance(spindle, frequency, tap_position(state), loss_factor))
    side = dsm.spindle_side(reference, frequency, table.tool_length_mm / 1e3, loss_factor)
    return Frf(frequency, dsm.couple_tool(side, machine.find_modelled_tool(state.tool).build(state.reference)))


def _remove_dampers(spindle: Spindle) -> Spindle:
    """Remove the dampers, whose damping the measured damping ratio already includes."""
    return replace(spindle, bearings=[replace(bearing, damping=0.0) for bearing in spindle.bearings])


def tap_position(state: ModelState) -> float:
    """Return the distance of the FRF from the tool tip (m); 0 for another tool than the tapped one."""
    tap = state.machine.tap
    return tap.position_mm / 1e3 if state.tool == tap.tool else 0.0


@dataclass(frozen=True)
class ModelMode:
    """Mode of the model."""

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
    """Key figures of the model."""

    state: ModelState
    """Model with its tool."""
    modes: tuple[ModelMode, ...]
    """First modes, lowest first."""
    static_stiffness: float
    """Static stiffness at the tool tip (N/m)."""
    critical_speed: float | None
    """Lowest critical speed (rpm); None if gyroscopic moments leave none."""
    rigid_frequency: float
    """Natural frequency of the first mode with rigid bearings (Hz), its upper limit."""


def summarize_model(state: ModelState, count: int) -> ModelSummary:
    """Compute the key figures of a model.

    Parameters
    ----------
    state
        Model with a tool.
    count
        Number of modes.

    Returns
    -------
    ModelSummary
        First modes, static stiffness and critical speed.
    """
    frequency, stiffness = dsm.modes_at(state.spindle, count)
    shares = dsm.energy_shares(state.spindle, count)
    parts = shares.bearings + shares.housings, shares.segments, shares.joints
    tip = enumerate(zip(frequency.tolist(), stiffness.tolist(), strict=True))
    modes = tuple(ModelMode(*values, *(float(np.sum(part[n])) for part in parts)) for n, values in tip)
    rigid = float(dsm.natural_frequencies(state.spindle, 1, rigid_bearings=True)[0])
    return ModelSummary(state, modes, dsm.static_stiffness(state.spindle), first_critical_speed(state.spindle), rigid)


@dataclass(frozen=True)
class ModelCalibration:
    """Calibrated stiffness and damping of a model."""

    label: str
    """Label of the model in machine.toml."""
    stiffness: Calibration | StiffnessFit
    """Calibration with one factor for all bearings, or one for each group."""
    dampers: DampingCalibration | None
    """Dampers of the bearings; None without a damping ratio."""


def calibrate_model(
    machine: Machine,
    frequency: Sequence[float],
    frequency_std: Sequence[float] = (),
    mode: Sequence[int] = (),
    group: Sequence[str] = (),
    damping_ratio: float | None = None,
) -> ModelCalibration:
    """Calibrate bearing groups of a model to natural frequencies, and dampers to a damping ratio.

    It raises what dsm.calibrate, dsm.fit_stiffness and dsm.calibrate_damping raise.

    Parameters
    ----------
    machine
        Machine with a [spindle].
    frequency
        Natural frequencies (Hz), shape (n,).
    frequency_std
        Standard errors (Hz), shape (n,); optional.
    mode
        Mode numbers from 1, shape (n,); optional.
    group
        Groups of bearings and joints to scale; optional.
    damping_ratio
        Damping ratio of the first of these modes (-); None for no dampers.

    Returns
    -------
    ModelCalibration
        Scaled stiffness, and dampers.

    Examples
    --------
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
    scales_joints = not {joint.group for joint in spindle.joints}.isdisjoint(group)
    name = group[0] if group else None
    if len(frequency) == 1 and len(group) <= 1 and not scales_joints:
        number, std = mode[0] if mode else machine.mode.model_mode, frequency_std[0] if frequency_std else None
        stiffness = dsm.calibrate(spindle, frequency[0], std, number, name)
    else:
        named = frequency_std or None, mode or None, group or None
        tolerance = machine.spindle.tolerance if machine.spindle else 0.0
        stiffness = dsm.fit_stiffness(spindle, frequency, *named, tolerance=tolerance)
        number = int(stiffness.mode[0])
    dampers = None
    if damping_ratio is not None:
        dampers = dsm.calibrate_damping(stiffness.spindle, damping_ratio, mode=number, group=name)
    return ModelCalibration(machine.spindle.label if machine.spindle else "", stiffness, dampers)
