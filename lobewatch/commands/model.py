"""Command `lobewatch model`: modes and stiffness of the spindle model."""

from pathlib import Path
from typing import Annotated

from typer import Option

from lobewatch.commands.shared_options import SpindleMachine
from lobewatch.show.terminal.output import Json, emit


def model(
    machine: SpindleMachine,
    tool: Annotated[str | None, Option(help="Name of a [[tool]]. Default: the tapped tool.")] = None,
    modes: Annotated[int, Option(min=1, max=20, help="Number of modes.")] = 4,
    figure: Annotated[Path | None, Option(help="Figure of the model (.svg, .png, .pdf).")] = None,
    as_json: Json = False,
) -> None:
    """Show the spindle model.

    Bearing stiffness comes from the newest tap test, or from machine.toml if there is no tap test.

    Examples
    --------
      lobewatch model trial --figure model.png
      lobewatch model trial --tool "end mill 16" --modes 6 --json
    """
    from acquisition import DataError
    from lobewatch.logbook import Logbook, collect_model_figure
    from lobewatch.machine.settings.setting_questions import find_template_bearings
    from lobewatch.measurement import build_model_state, summarize_model
    from lobewatch.show.models import model_json, model_texts
    from lobewatch.show.terminal.output import remark_lines

    logbook = Logbook.open(machine)
    calibrated, guessed = logbook.calibrated_measurement, find_template_bearings(logbook.machine)
    if calibrated is None and guessed is not None:
        raise DataError(f"{guessed.remark}")
    state = build_model_state(logbook.machine, calibrated, tool)
    if figure is not None:
        from lobewatch.show.figures.drawing import save_figure
        from lobewatch.show.figures.spindle_figures import plot_model

        save_figure(plot_model(collect_model_figure(logbook, state, modes)), figure)
    summary = summarize_model(state, modes)
    emit(model_json(summary), as_json, *model_texts(summary), *remark_lines(logbook.remarks))
