"""Command `lobewatch lobes`: stability lobes and stable pockets of a tool."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typer import Context, Option

from lobewatch.commands import shared_options as shared
from lobewatch.commands.shared_options import Now
from lobewatch.show.terminal.output import Json, emit, show_progress
from lobewatch.step_times import time_step

if TYPE_CHECKING:
    from lobewatch.tool import LobeMethod

DynamicsName = Literal["modes", "frf"]
MethodName = Literal["zero-order", "average-angle", "semi-discretisation"]


MACHINE_OPTIONS = ("machine", "cut", "tool", "source", "radial", "waterfall", "now")
"""Names of the options that only a machine folder has."""
STATED_OPTIONS = ("mode_y", "teeth", "material", "diameter", "radial_depth", "direction", "speeds", "speed", "depth")
"""Names of the options that only --mode has."""


def lobes(
    ctx: Context,
    machine: Annotated[
        Path | None, shared.FolderArgument(help="Machine folder with at least one tap test. None with --mode.")
    ] = None,
    cut: Annotated[str, Option(help="Name of a program, or the reference cut.")] = "reference cut",
    tool: Annotated[
        str | None, Option(help="Tool name. Default: tool of the program, or the last tapped tool.")
    ] = None,
    source: Annotated[DynamicsName, Option(help="Dynamics: fitted modes or measured FRF.")] = "modes",
    method: Annotated[MethodName, Option(help="Method of the chart, without effect on verdicts.")] = "zero-order",
    figure: Annotated[Path | None, Option(help="Lobe diagram (.svg, .png, .pdf).")] = None,
    radial: Annotated[Path | None, Option(help="Figure of the limit over speed and radial depth ae.")] = None,
    waterfall: Annotated[Path | None, Option(help="Figure of the limit over speed and time.")] = None,
    mode: Annotated[
        list[str] | None,
        Option(help='Mode at the tool tip in place of a machine folder: "600 Hz 3% 10 N/um". Repeatable.'),
    ] = None,
    mode_y: Annotated[list[str] | None, Option(help="Mode in y, repeatable. Default: as in x.")] = None,
    teeth: shared.Flutes = None,
    material: shared.Material = None,
    diameter: shared.Diameter = None,
    radial_depth: shared.RadialDepth = None,
    direction: shared.MillingDirection = None,
    speeds: Annotated[
        str, Option(help='Lowest and highest spindle speed (rpm), with --mode. Default: "1000-24000".')
    ] = "",
    speed: shared.OtherCutSpeed = None,
    depth: shared.AxialDepth = None,
    now: Now = None,
    as_json: Json = False,
) -> None:
    """Show stability lobes and stable pockets.

    Each stable pocket has the verdict stable in lobewatch check. A tool without a tap test is predicted by the
    spindle model. Tap tests without a force sensor give pocket speeds, but no depths.

    --mode needs no machine folder: it takes natural frequency, damping ratio and stiffness at the tool tip, with the
    default uncertainties. --teeth to --depth belong to it. --speed and --depth add a verdict.

    Examples
    --------
      lobewatch lobes trial --figure lobes.png
      lobewatch lobes trial --cut "bracket, slot" --method semi-discretisation --radial radial.png
      lobewatch lobes --mode "600 Hz 3% 10 N/um" --teeth 4 --material 6061
      lobewatch lobes --mode "600 Hz 3% 10 N/um" --teeth 4 --material 4140 --speed 8000 --depth 0.5
    """
    from lobewatch.logbook import Logbook, compare_lobes
    from lobewatch.logbook.chart_data import chart_speed_pockets
    from lobewatch.show.cuts.suggested_cuts import speed_pockets_json, speed_pockets_texts
    from lobewatch.show.programs.advice import comparison_json, comparison_texts
    from lobewatch.tool import DynamicsSource, LobeMethod

    stated: dict[str, Any] = {"teeth": teeth, "material": material, "diameter": diameter, "radial-depth": radial_depth}
    stated |= {"direction": direction, "speed": speed, "depth": depth, "mode-y": mode_y, "speeds": speeds}
    if mode:
        shared.reject_options(ctx, MACHINE_OPTIONS, "cannot be used with --mode")
        _show_stated(mode, stated, LobeMethod(method), figure, as_json)
        return
    shared.reject_options(ctx, STATED_OPTIONS, "cannot be used without --mode")
    if machine is None:
        raise ValueError("neither a machine folder nor --mode is given. Give one of them.")
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


def _show_stated(
    modes: Sequence[str], stated: Mapping[str, Any], method: "LobeMethod", figure: Path | None, as_json: bool
) -> None:
    """Show lobes, pockets and a verdict for stated modes."""
    from lobewatch.logbook.stated_modes import StatedCut, build_stated_machine, compare_stated_modes, parse_mode
    from lobewatch.show.programs.advice import comparison_json, comparison_texts

    if missing := [f"--{name}" for name in ("teeth", "material") if stated[name] is None]:
        raise ValueError(f"--mode needs {' and '.join(missing)}. Write --teeth 4 --material 6061, for example.")
    low, high = shared.parse_speeds(stated["speeds"] or "1000 24000")
    sizes = stated["diameter"], stated["radial-depth"]
    cut = StatedCut(stated["teeth"], stated["material"], *sizes, stated["direction"] or "down", low, high)
    x, y = ([parse_mode(text) for text in texts or ()] for texts in (modes, stated["mode-y"]))
    with show_progress("searching stable pockets"), time_step("lobes"):
        comparison = compare_stated_modes(cut, x, y, stated["speed"], stated["depth"], method)
    if figure is not None:
        from lobewatch.show.figures.drawing import save_figure  # brings matplotlib
        from lobewatch.show.figures.lobe_figures import plot_comparison

        save_figure(plot_comparison(build_stated_machine(cut), comparison, ()), figure)
    emit(comparison_json(comparison, comparison.remarks), as_json, *comparison_texts(comparison, comparison.remarks))
