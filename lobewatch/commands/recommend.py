"""Command `lobewatch recommend`: recommend speed and depth for a tool and a material."""

from typing import Annotated, Literal

from typer import Exit, Option

from lobewatch.commands import shared_options as shared
from lobewatch.show.terminal.output import Json, emit, show_progress
from lobewatch.step_times import time_step


def recommend(
    machine: shared.TappedMachine,
    tool: Annotated[str | None, Option(help="Tool name.")] = None,
    material: shared.Material = None,
    radial: shared.RadialDepth = None,
    direction: Annotated[
        Literal["up", "down"] | None, Option(help="Up or down milling. Default: the direction with the lower limit.")
    ] = None,
    depth: Annotated[float | None, Option(parser=shared.length, help="Required axial depth of cut ap (mm).")] = None,
    speed: Annotated[float | None, Option(parser=shared.rpm, help="Present spindle speed (rpm).")] = None,
    teeth: shared.Flutes = None,
    diameter: shared.Diameter = None,
    feed_per_tooth: Annotated[float | None, Option(parser=shared.feed, help="Feed per tooth (mm).")] = None,
    save: Annotated[str | None, Option(help="Name of a new program in machine.toml.")] = None,
    now: shared.Now = None,
    as_json: Json = False,
) -> None:
    """Recommend a speed and a depth for a tool and a material, then the next ordinary cuts.

    Finds the highest material removal rate that is stable with a margin in speed, depth and frequency. Missing values
    come from the programs of the tool if all these programs agree.
    At most three ordinary cuts follow, each with at most 5 % chance of chatter. After each lobewatch observe or listen,
    lobewatch names the next one. lobewatch suggest gains more, but its test cuts may chatter.

    Exit code 1: no stable speed and depth.

    Examples
    --------
      lobewatch recommend trial --tool reference --material 42CrMo4
      lobewatch recommend trial --material "AA 6061" --radial 4 --direction down --save "bracket, finish"
      lobewatch recommend trial --depth 1.5 --json
    """
    from lobewatch.logbook import Logbook
    from lobewatch.logbook.production import plan_recommended
    from lobewatch.logbook.requested_cuts import recommend_requested
    from lobewatch.machine.folder_updates import check_program_name, save_program
    from lobewatch.show.cuts.production_steps import ladder_json, ladder_lines
    from lobewatch.show.programs.recommendations import recommendation_json, recommendation_lines, saved_lines

    cut = shared.cut_fields(speed, depth, tool, material, teeth, diameter, radial, direction)
    cut["feed_per_tooth_mm"] = feed_per_tooth
    logbook = Logbook.open(machine, now)
    if save is not None:
        check_program_name(logbook.machine, save)
    with show_progress("searching stable speeds and depths"), time_step("lobes"):
        answer = recommend_requested(logbook, cut, save)
        plan = plan_recommended(logbook, answer) if depth is None else None
    saved = None if answer.setting is None else save
    if saved is not None:
        save_program(logbook.folder, answer.program)
    payload = recommendation_json(answer, logbook.remarks)
    payload |= {"saved": saved, "ladder": ladder_json(plan, answer.setting)}
    texts = [*recommendation_lines(answer, logbook.remarks), *ladder_lines(plan, logbook.folder.path)]
    emit(payload, as_json, *texts, *(saved_lines(logbook.folder.path, saved) if saved else ()))
    raise Exit(int(answer.setting is None))
