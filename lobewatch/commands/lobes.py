"""Command `lobewatch lobes`: stability lobes and stable pockets of a tool."""

from pathlib import Path
from typing import Annotated, Literal

from typer import Option

from lobewatch.commands.shared_options import Now, TappedMachine
from lobewatch.show.terminal.output import Json, emit, show_progress
from lobewatch.step_times import time_step

DynamicsName = Literal["modes", "frf"]
MethodName = Literal["zero-order", "average-angle", "semi-discretisation"]


def lobes(
    machine: TappedMachine,
    cut: Annotated[str, Option(help="Name of a program, or the reference cut.")] = "reference cut",
    tool: Annotated[
        str | None, Option(help="Tool name. Default: tool of the program, or the last tapped tool.")
    ] = None,
    source: Annotated[DynamicsName, Option(help="Dynamics: fitted modes or measured FRF.")] = "modes",
    method: Annotated[MethodName, Option(help="Method of the chart, without effect on verdicts.")] = "zero-order",
    figure: Annotated[Path | None, Option(help="Lobe diagram (.svg, .png, .pdf).")] = None,
    radial: Annotated[Path | None, Option(help="Figure of the limit over speed and radial depth ae.")] = None,
    waterfall: Annotated[Path | None, Option(help="Figure of the limit over speed and time.")] = None,
    now: Now = None,
    as_json: Json = False,
) -> None:
    """Show stability lobes and stable pockets.

    Each stable pocket has the verdict stable in lobewatch check. A tool without a tap test is predicted by the
    spindle model. Tap tests without a force sensor give pocket speeds, but no depths.

    Examples
    --------
      lobewatch lobes trial --figure lobes.png
      lobewatch lobes trial --cut "bracket, slot" --method semi-discretisation --radial radial.png
    """
    from lobewatch.logbook import Logbook, compare_lobes
    from lobewatch.logbook.chart_data import chart_speed_pockets
    from lobewatch.show.cuts.recorded_cuts import speed_pockets_json, speed_pockets_texts
    from lobewatch.show.programs.advice import comparison_json, comparison_texts
    from lobewatch.tool import DynamicsSource, LobeMethod

    logbook = Logbook.open(machine, now)
    drawn = figure or radial or waterfall
    alone = None if drawn else chart_speed_pockets(logbook, tool, cut)
    if alone is not None:
        assembly, pockets = alone
        remarks = [*logbook.remarks, *assembly.remarks]
        emit(speed_pockets_json(cut, pockets, remarks), as_json, *speed_pockets_texts(cut, pockets, remarks))
        return
    with show_progress("searching stable pockets"), time_step("lobes"):
        comparison = compare_lobes(logbook, tool, cut, DynamicsSource(source), LobeMethod(method))
    remarks = [*logbook.remarks, *comparison.remarks]
    if drawn:
        from lobewatch.show.figures.lobe_figures import save_lobe_figures  # brings matplotlib

        with time_step("figures"):
            remarks += save_lobe_figures(logbook, comparison, LobeMethod(method), figure, radial, waterfall)
    emit(comparison_json(comparison, remarks), as_json, *comparison_texts(comparison, remarks))
