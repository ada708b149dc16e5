"""Bearing stiffness of a model from frequencies that are given, not measured here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dsm import Calibration, DampingCalibration, Spindle, StiffnessFit, calibrate, calibrate_damping, fit_stiffness
from lobewatch.machine import Machine


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
    if len(frequency) == 1 and _scales_bearings_alike(spindle, group):
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


def _scales_bearings_alike(spindle: Spindle, group: Sequence[str]) -> bool:
    return len(group) <= 1 and not {joint.group for joint in spindle.joints} & set(group)
