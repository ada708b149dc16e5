"""Command `lobewatch pitch`: propose unequal pitches for a cutter."""

from typing import Annotated

from typer import Option

from lobewatch.commands import shared_options as shared
from lobewatch.show.terminal.output import Json, emit, show_progress
from lobewatch.step_times import time_step


def pitch(
    machine: shared.TappedMachine,
    speed: Annotated[float, Option(parser=shared.rpm, help="Spindle speed (rpm).")],
    tool: Annotated[str | None, Option(help="Name of the cutter.")] = None,
    depth: Annotated[
        float | None, Option(parser=shared.length, help="Axial depth of cut ap (mm) to give verdicts for.")
    ] = None,
    material: shared.Material = None,
    teeth: shared.Flutes = None,
    diameter: shared.Diameter = None,
    radial: Annotated[float | None, Option(parser=shared.length, help="Radial depth of cut ae (mm).")] = None,
    direction: shared.MillingDirection = None,
    now: shared.Now = None,
    as_json: Json = False,
) -> None:
    """Propose unequal pitches for a cutter at one speed.

    Alternating and linear pitches are compared with equal pitch, including all uncertainties. The chip load
    of each flute differs by at most 20 % from the mean. Missing values come from the programs of the tool if all these
    programs agree.

    Examples
    --------
      lobewatch pitch trial --tool reference --speed 6200
      lobewatch pitch trial --speed 9000 --radial 5 --material 42CrMo4 --json
    """
    from lobewatch.logbook import Logbook
    from lobewatch.logbook.requested_cuts import propose_requested_pitch
    from lobewatch.show.programs.recommendations import pitches_json, pitches_texts

    cut = shared.cut_fields(speed, depth, tool, material, teeth, diameter, radial, direction)
    logbook = Logbook.open(machine, now)
    with show_progress("comparing pitches"), time_step("lobes"):
        proposal = propose_requested_pitch(logbook, cut)
    remarks = logbook.remarks
    emit(pitches_json(proposal, remarks, depth), as_json, *pitches_texts(proposal, remarks, depth))
