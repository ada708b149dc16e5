"""lobewatch calibrate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import dsm
from lobewatch.describe import calibration_json
from lobewatch.machine_folder import MachineFolder
from lobewatch.output import Json, emit


def calibrate(
    machine: Annotated[Path, typer.Argument(help="Machine folder with a [spindle] in its machine.toml.")],
    frequency: Annotated[float, typer.Option(help="Measured natural frequency (Hz).")],
    frequency_std: Annotated[float | None, typer.Option(help="Its standard error (Hz).")] = None,
    mode: Annotated[int | None, typer.Option(min=1, help="Mode of the model; [mode] model_mode if not given.")] = None,
    group: Annotated[str | None, typer.Option(help="Bearings of this group alone; all groups if not given.")] = None,
    as_json: Json = False,
) -> None:
    """Bearing stiffness for a measured natural frequency; nothing is stored.

    Examples:

      lobewatch calibrate trial --frequency 1550

      lobewatch calibrate trial --frequency 1550 --frequency-std 0.4 --mode 1 --json
    """
    machine_file = MachineFolder(machine).machine
    spindle = machine_file.model(machine_file.tap.tool)
    calibration = dsm.calibrate(spindle, frequency, frequency_std, mode or machine_file.mode.model_mode, group)
    label = machine_file.spindle.label if machine_file.spindle else ""
    emit(
        calibration_json(calibration),
        as_json,
        *([f"model: {label}"] if label else []),
        str(calibration),
    )
