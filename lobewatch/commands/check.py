"""Command `lobewatch check`: verdicts on cutting programs."""

from typing import Annotated

from typer import Exit, Option

from lobewatch.commands import shared_options as shared
from lobewatch.show.terminal.output import Json, emit, notes, show_progress
from lobewatch.step_times import time_step


def check(
    machine: shared.TappedMachine,
    program: Annotated[
        list[str] | None, Option(help="Only this program; may be repeated. All where none is named.")
    ] = None,
    speed: Annotated[
        float | None, Option(parser=shared.number, help="Of a cut that is no program: spindle speed, rpm.")
    ] = None,
    depth: Annotated[float | None, Option(parser=shared.number, help="Its axial depth, mm.")] = None,
    tool: Annotated[str | None, Option(help="Its tool.")] = None,
    material: shared.Material = None,
    teeth: shared.Flutes = None,
    diameter: shared.Diameter = None,
    radial: Annotated[float | None, Option(parser=shared.number, help="Its radial depth, mm.")] = None,
    direction: shared.MillingDirection = None,
    accept: Annotated[
        list[str] | None,
        Option(help="A number of machine.toml that is asked about is right, by its key; may be repeated."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Evaluate cutting programs on the newest tap tests.

    By semi-discretisation, over all that is not known: stable, doubtful, not stable or unknown. Says for each that is
    not stable what decides and where to go. fall left: how far the frequency may fall before it chatters, in the middle
    of what is not known; beside a setting that is recommended: how far it may fall and all of that stays stable. A cut
    that is no program is judged alike; what is not said of it is taken from the programs of its tool where they agree.
    A program of machine.toml without a speed or a depth is recommended what it has not.
    A number of machine.toml that is not plausible makes its programs unknown until it is corrected, or accepted.

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
    logbook = Logbook.open(machine)
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
