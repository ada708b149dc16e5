"""Command `lobewatch pitch`: propose unequal pitches for a cutter."""

from typing import Annotated

from typer import Option

from lobewatch.commands.shared_options import Flutes, Material, MillingDirection, TappedMachine, cut_fields
from lobewatch.show.terminal.output import Json, emit, show_progress
from lobewatch.step_times import time_step


def pitch(
    machine: TappedMachine,
    speed: Annotated[float, Option(help="Spindle speed, rpm: pitches are for one speed.")],
    tool: Annotated[str | None, Option(help="Tool whose teeth are to be spaced.")] = None,
    depth: Annotated[float | None, Option(help="Axial depth to be judged too, mm.")] = None,
    material: Material = None,
    teeth: Flutes = None,
    diameter: Annotated[float | None, Option(help="Diameter of the tool, mm.")] = None,
    radial: Annotated[float | None, Option(help="Its radial depth, mm.")] = None,
    direction: MillingDirection = None,
    as_json: Json = False,
) -> None:
    """Propose unequal pitches for a cutter at one speed.

    Alternating and linear pitches, as tool makers grind them, whose teeth cut at most 20 % more or less than the mean.
    The limit of each kind's best is that of lobewatch check over all that is not known, beside equal pitch on the same
    spindles. What is not said of the cut is taken from the programs of its tool where they agree.

    Examples
    --------
      lobewatch pitch trial --tool reference --speed 6200
      lobewatch pitch trial --speed 9000 --radial 5 --material 42CrMo4 --json
    """
    from lobewatch.logbook import Logbook
    from lobewatch.logbook.requested_cuts import propose_requested_pitch
    from lobewatch.show.programs.recommendations import pitches_json, pitches_texts

    cut = cut_fields(speed, depth, tool, material, teeth, diameter, radial, direction)
    logbook = Logbook.open(machine)
    with show_progress("comparing pitches"), time_step("lobes"):
        proposal = propose_requested_pitch(logbook, cut)
    remarks = logbook.remarks
    emit(pitches_json(proposal, remarks, depth), as_json, *pitches_texts(proposal, remarks, depth))
