"""lobewatch calibrate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import dsm
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.named_folder import named_folder
from lobewatch.show.describe import calibration_json, damping_json, stiffness_fit_json
from lobewatch.show.output import Json, emit


def calibrate(
    machine: Annotated[
        Path, typer.Argument(parser=named_folder, help=r"Machine folder with a \[spindle] in its machine.toml.")
    ],
    frequency: Annotated[list[float], typer.Option(help="Measured natural frequency (Hz); may be repeated.")],
    frequency_std: Annotated[list[float] | None, typer.Option(help="Its standard error (Hz); one for each.")] = None,
    mode: Annotated[
        list[int] | None,
        typer.Option(min=1, max=50, help=r"Number of the mode, for each; else \[mode] model_mode, or 1, 2 ..."),
    ] = None,
    group: Annotated[
        list[str] | None, typer.Option(help="Bearings or joints of this group; may be repeated; all if not given.")
    ] = None,
    damping_ratio: Annotated[
        float | None, typer.Option(help="Measured damping ratio (-) of the first of these modes: finds dampers too.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Bearing stiffness for measured natural frequencies; nothing is stored.

    One frequency scales all bearings alike. Several find a factor for each group of bearings and joints.

    Examples:

      lobewatch calibrate trial --frequency 1550 --frequency-std 0.4

      lobewatch calibrate trial --frequency 1550 --mode 1 --damping-ratio 0.03 --json

      lobewatch calibrate trial --frequency 1550 --frequency 2600 --group front --group rear
    """
    machine_file = MachineFolder(machine).machine
    spindle = machine_file.model(machine_file.tap.tool)
    _check_counts(len(frequency), frequency_std or [], mode or [])
    found: dsm.Calibration | dsm.StiffnessFit
    joints = {joint.group for joint in spindle.joints}
    if len(frequency) == 1 and len(group or []) <= 1 and not joints & set(group or []):
        number = mode[0] if mode else machine_file.mode.model_mode
        std, name = frequency_std[0] if frequency_std else None, group[0] if group else None
        found = dsm.calibrate(spindle, frequency[0], std, number, name)
        payload = calibration_json(found)
    else:
        found = dsm.fit_stiffness(spindle, frequency, frequency_std or None, mode or None, group or None)
        number, payload = int(found.mode[0]), stiffness_fit_json(found)
    texts = [str(found)]
    if damping_ratio is not None:
        dampers = dsm.calibrate_damping(found.spindle, damping_ratio, mode=number, group=group[0] if group else None)
        payload |= damping_json(dampers)
        texts.append(str(dampers))
    label = machine_file.spindle.label if machine_file.spindle else ""
    emit(payload, as_json, *([f"model: {label}"] if label else []), *texts)


def _check_counts(frequencies: int, stds: list[float], modes: list[int]) -> None:
    for option, values in (("--frequency-std", stds), ("--mode", modes)):
        if values and len(values) != frequencies:
            raise ValueError(f"{len(values)} {option} for {frequencies} --frequency; give one for each, or none")
