"""lobewatch calibrate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import dsm
from acquisition import DataError
from lobewatch.describe import calibration_json, calibration_lines
from lobewatch.machine_folder import MachineFolder
from lobewatch.output import Json, emit


def calibrate(
    machine: Annotated[Path, typer.Argument(help="Machine folder with a [spindle] in its machine.toml.")],
    frequency: Annotated[float, typer.Option(help="Measured first natural frequency (Hz).")],
    frequency_std: Annotated[float | None, typer.Option(help="Its standard error (Hz).")] = None,
    as_json: Json = False,
) -> None:
    """Bearing stiffness for a measured natural frequency; nothing is stored.

    Examples:

      lobewatch calibrate trial --frequency 1550

      lobewatch calibrate trial --frequency 1550 --frequency-std 0.4 --json
    """
    folder = MachineFolder(machine)
    spindle = folder.machine.spindle
    if spindle is None:
        raise DataError(f"{folder.toml}: no model: add a [spindle] table (lobewatch init FOLDER --example shows one)")
    calibration = dsm.calibrate(spindle.build(), frequency, frequency_std)
    label = [f"model: {spindle.label}"] if spindle.label else []
    emit(calibration_json(calibration), as_json, *label, calibration_lines(calibration))
