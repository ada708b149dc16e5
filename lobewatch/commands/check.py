"""Command `lobewatch check`: verdicts on cutting programs."""

from typing import Annotated

from typer import Exit, Option

from lobewatch.commands import shared_options as shared
from lobewatch.show.terminal.output import Json, emit, notes, show_progress
from lobewatch.step_times import time_step


def check(
    machine: shared.Machine,
    program: Annotated[list[str] | None, Option(help="Program name, repeatable. Default: all programs.")] = None,
    speed: shared.OtherCutSpeed = None,
    depth: shared.AxialDepth = None,
    tool: Annotated[str | None, Option(help="Tool name.")] = None,
    material: shared.Material = None,
    teeth: shared.Flutes = None,
    diameter: shared.Diameter = None,
    radial: Annotated[float | None, Option(parser=shared.length, help="Radial depth of cut ae (mm).")] = None,
    direction: shared.MillingDirection = None,
    accept: Annotated[
        list[str] | None,
        Option(help="Key of a number in machine.toml that is correct although implausible, repeatable."),
    ] = None,
    now: shared.Now = None,
    as_json: Json = False,
) -> None:
    """Evaluate cutting programs on the newest tap tests.

    Verdicts (stable, doubtful, not stable, unknown) include all uncertainties. A program without speed or depth gets a
    recommendation. Missing values of a cut that is not in machine.toml come from the programs of its tool if all these
    programs agree. Without a tap test, only test cuts at the speed of a program decide.

    Exit code 1: not all cuts are stable.

    Examples
    --------
      lobewatch check trial
      lobewatch check trial --program A --json
      lobewatch check trial --speed 8000 --depth 2 --material 42CrMo4
    """
    from lobewatch.logbook import Logbook
    from lobewatch.logbook.requested_cuts import evaluate_requested
    from lobewatch.machine import MachineFolder
    from lobewatch.machine.folder_updates import accept_settings
    from lobewatch.show.programs import advice as show
    from lobewatch.show.programs.recommendations import recommendation_json, recommendation_lines
    from lobewatch.show.programs.verdicts import is_safe

    cut = shared.cut_fields(speed, depth, tool, material, teeth, diameter, radial, direction)
    if accept:
        for line in accept_settings(MachineFolder(machine), accept):
            notes.print(f"accepted: {line}")
    logbook = Logbook.open(machine, now)
    with show_progress("checking programs") as progress, time_step("verdicts"):
        verdicts, recommendations = evaluate_requested(logbook, program or (), cut)
        programs = [
            show.advise_program(logbook, verdict) for verdict in progress.track(verdicts, task_id=progress.task_ids[0])
        ]
    remarks = logbook.remarks
    payload = {"recommendations": [recommendation_json(answer) for answer in recommendations]}
    texts = show.check_texts(programs, remarks, logbook.machine) if programs else []
    lines = [line for answer in recommendations for line in recommendation_lines(answer)]
    summary = [show.check_summary_text(programs, len(recommendations))] if programs else []
    emit(show.check_json(programs, remarks) | payload, as_json, *texts, *lines, *summary)
    if not all(is_safe(advice.verdict) for advice in programs) or not all(answer.setting for answer in recommendations):
        raise Exit(1)
