"""lobewatch model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lobewatch.machine.folder_path import named_folder
from lobewatch.show.terminal.output import Json, emit


def model(
    machine: Annotated[
        Path, typer.Argument(parser=named_folder, help="Machine folder with a [spindle] in its machine.toml.")
    ],
    tool: Annotated[str | None, typer.Option(help="Name of a [[tool]]; else the one that is tapped.")] = None,
    modes: Annotated[int, typer.Option(min=1, max=20, help="How many modes.")] = 4,
    figure: Annotated[Path | None, typer.Option(help="Draw the model to this file (.svg, .png, .pdf).")] = None,
    as_json: Json = False,
) -> None:
    """The spindle model: modes, stiffness, critical speed; with another tool in it, predicted before it is tapped.

    The bearings are those of the newest tap test, of machine.toml where there is none yet.

    Examples:

      lobewatch model trial --figure model.png
      lobewatch model trial --tool "end mill 16" --modes 6 --json
    """
    from acquisition import DataError
    from lobewatch.logbook import Logbook, model_picture
    from lobewatch.machine.settings.setting_questions import guessed_bearings
    from lobewatch.measuring import model_state, model_summary
    from lobewatch.show.spindle.describe_model import model_json, model_texts
    from lobewatch.show.terminal.output import remark_lines

    logbook = Logbook.open(machine)
    calibrated, guessed = logbook.calibrated, guessed_bearings(logbook.machine)
    if calibrated is None and guessed is not None:
        raise DataError(f"{guessed.remark}")
    state = model_state(logbook.machine, calibrated, tool)
    if figure is not None:
        from lobewatch.show.figures.model_figures import model_figure
        from lobewatch.show.figures.style import save_figure

        save_figure(model_figure(model_picture(logbook, state, modes)), figure)
    summary = model_summary(state, modes)
    emit(model_json(summary), as_json, *model_texts(summary), *remark_lines(logbook.remarks))
