"""lobewatch calibrate."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from lobewatch.machine.named_folder import named_folder
from lobewatch.show.output import Json, emit


def calibrate(
    machine: Annotated[
        Path, typer.Argument(parser=named_folder, help="Machine folder with a [spindle] in its machine.toml.")
    ],
    frequency: Annotated[list[float], typer.Option(help="Measured natural frequency (Hz); may be repeated.")],
    frequency_std: Annotated[list[float] | None, typer.Option(help="Its standard error (Hz); one for each.")] = None,
    mode: Annotated[
        list[int] | None,
        typer.Option(min=1, max=50, help="Number of the mode, for each; else [mode] model_mode, or 1, 2 ..."),
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
    from lobewatch.analysis import calibrate_model
    from lobewatch.machine import MachineFolder
    from lobewatch.show.describe import model_calibration_json, model_calibration_texts

    _check_counts(len(frequency), frequency_std or [], mode or [])
    found = calibrate_model(
        MachineFolder(machine).machine, frequency, frequency_std or [], mode or [], group or [], damping_ratio
    )
    emit(model_calibration_json(found), as_json, *model_calibration_texts(found))


def _check_counts(frequencies: int, stds: Sequence[float], modes: Sequence[int]) -> None:
    for option, values in (("--frequency-std", stds), ("--mode", modes)):
        if values and len(values) != frequencies:
            raise ValueError(f"{len(values)} {option} for {frequencies} --frequency; give one for each, or none")
