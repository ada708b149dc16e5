"""lobewatch lobes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from acquisition import DataError, Frf
from lobes import Pocket, PocketShift, StabilityLobes, best_pockets, pocket_shifts, pockets
from lobes.tip_response import Tip
from lobewatch.analysis.charts import DEEPEST, Chart, Dynamics, Method, chart
from lobewatch.analysis.history import measure, partner
from lobewatch.analysis.model_state import model_frf, model_state
from lobewatch.analysis.pipeline import Measurement, speed_grid
from lobewatch.analysis.prediction import predict
from lobewatch.machine.drive import drive_limit
from lobewatch.machine.folder import MachineFolder, TapEntry
from lobewatch.machine.machine_file import REFERENCE_CUT, Machine
from lobewatch.machine.named_folder import named_folder
from lobewatch.show.describe import lobes_json, program_json, program_table
from lobewatch.show.describe_lobes import (
    POCKET_RANGE,
    material_lines,
    materials_json,
    pocket_json,
    pocket_list,
    shift_json,
    shift_lines,
    with_option,
)
from lobewatch.show.figures import save_figure
from lobewatch.show.lobe_pictures import lobes_picture, radial_picture, waterfall_picture
from lobewatch.show.output import Json, emit

USEFUL = 5.0
"""Pockets are cut off at this many times the lowest limit, where the diagram ends."""


def lobes(
    machine: Annotated[Path, typer.Argument(parser=named_folder, help="Machine folder with at least one tap test.")],
    cut: Annotated[str, typer.Option(help=r"Name of a \[\[program]], or the reference cut.")] = REFERENCE_CUT,
    tool: Annotated[str | None, typer.Option(help="Of the newest tap test if not given; else predicted.")] = None,
    source: Annotated[Dynamics, typer.Option(help="From the modes found, or straight from the FRF.")] = Dynamics.MODES,
    method: Annotated[Method, typer.Option(help="How the limits are found.")] = Method.ZERO_ORDER,
    figure: Annotated[Path | None, typer.Option(help="Draw the diagram to this file (.svg, .png, .pdf).")] = None,
    radial: Annotated[Path | None, typer.Option(help="Draw the limit over speed and radial depth.")] = None,
    waterfall: Annotated[Path | None, typer.Option(help="Draw the limit over speed and time.")] = None,
    materials: Annotated[bool, typer.Option("--materials", help="List the known cutting coefficients.")] = False,
    as_json: Json = False,
) -> None:
    """Stability lobes of the newest tap test, drawn beside those of the first test, and the best pockets.

    A --tool that was never tapped is predicted by the model with the bearings of the newest tap test.

    Examples:

      lobewatch lobes trial --figure lobes.png

      lobewatch lobes trial --cut "bracket, slot" --method semi-discretisation --radial radial.png
    """
    folder = MachineFolder(machine)
    if materials:
        emit({"materials": materials_json(folder.machine)}, as_json, *material_lines(folder.machine))
        return
    of_series = _series(folder, tool)
    newest = measure(folder, of_series[-1]) if of_series else predict(folder, tool or "")
    now = _found(folder, newest, cut, source, method)
    then, notes = _then(folder, of_series, now, cut, source, method)
    best = _pockets(folder.machine, now)
    pictures = []
    if figure is not None:
        pictures.append((lobes_picture(folder, now, then, best), figure))
    if radial is not None:
        picture, remarks = radial_picture(folder.machine, now, method)
        pictures.append((picture, radial))
        notes += [f"--radial: {with_option(remark)}" for remark in remarks]
    if waterfall is not None:
        pictures.append((waterfall_picture(folder, newest, cut), waterfall))
    for picture, path in pictures:
        save_figure(picture, path)
    _say(folder.machine, now, best, _shifts(then, now), notes, as_json)


def _say(
    machine: Machine,
    now: Chart,
    best: Sequence[Pocket],
    shifts: Sequence[PocketShift],
    remarks: Sequence[str],
    as_json: bool,
) -> None:
    found, programs = now.lobes, program_json({now.name: now.lobes}, machine)
    warnings = [with_option(remark) for remark in found.remarks]
    if programs and found.method != "semi-discretisation":
        warnings.append(f"stable or not by {found.method}, in this chart; lobewatch check has the verdict")
    notes = dict.fromkeys([*now.measurement.reasons, *warnings, *remarks])
    payload = lobes_json(now.name, found) | {
        "tap_id": now.measurement.tap_id,
        "source": str(now.source),
        "speed_rpm": found.speed_rpm,
        "depth_mm": found.depth * 1e3,
        "chatter_frequencies_hz": found.chatter_frequency,
        "kind": found.kind,
        "pockets_by_depth": [pocket_json(pocket) for pocket in best_pockets(best)],
        "pockets_by_removal": [pocket_json(pocket) for pocket in best_pockets(best, by="removal")],
        "pocket_shifts": [shift_json(shift) for shift in shifts],
        "programs": programs,
        "notes": list(notes),
    }
    emit(
        payload,
        as_json,
        f"{now.name}: {found.stated_method}, from the {now.source} of {now.measurement.tap_id}",
        *_limit_lines(found, best),
        *shift_lines(shifts),
        *([program_table(programs)] if programs else []),
        *(f"note: {note}" for note in notes),
    )


def _limit_lines(found: StabilityLobes, best: Sequence[Pocket]) -> list[str]:
    low = found.minimum
    if not np.isfinite(low.depth):
        return [f"no limit in this speed range ({found.stated_method})"]
    return [
        f"lowest limit {low.depth * 1e3:.3f} mm at {low.speed_rpm:.0f} rpm, chatter at {low.chatter_frequency:.1f} Hz",
        f"best pockets up to {USEFUL * low.depth * 1e3:.1f} mm (in brackets: {POCKET_RANGE}), by depth: "
        f"{pocket_list(best_pockets(best))}",
        f"by removal rate: {pocket_list(best_pockets(best, by='removal'))}",
    ]


def _series(folder: MachineFolder, tool: str | None) -> list[TapEntry]:
    """Taps with a tool in the direction of the newest of them; None: the tool that was tapped last."""
    taps = folder.taps()
    if not taps:
        raise DataError(f"{folder.path}: no tap test yet; take one with lobewatch tap, or replay a recorded file")
    of_tool = [tap for tap in taps if tap.tool == (taps[-1].tool if tool is None else tool)]
    return [tap for tap in of_tool if tap.direction == of_tool[-1].direction]


def _found(folder: MachineFolder, measurement: Measurement, cut: str, source: Dynamics, method: Method) -> Chart:
    """The lobes of a measurement for one cut; DataError with the reason where there are none."""
    machine = folder.machine
    cuts = machine.cuts(measurement.tool)
    table = next((program for program in machine.program if program.name == cut), machine.reference_cut)
    if cut not in cuts or table is None:
        raise DataError(
            f"--cut {cut!r} is none of the cuts with tool {measurement.tool!r}: {', '.join(cuts) or 'none'}"
        )
    if cut not in measurement.lobes:
        raise DataError(f"{measurement.tap_id}: {'; '.join(measurement.notes)}")
    x: Tip | None = measurement.x
    y: Tip | None = measurement.y
    if source is Dynamics.FRF:
        x, y = _frfs(folder, measurement)
    found = chart(method, x, y, cuts[cut], speed_grid(machine))
    return Chart(cut, table, measurement, source, x, y, cuts[cut], found)


def _then(
    folder: MachineFolder, taps: Sequence[TapEntry], now: Chart, cut: str, source: Dynamics, method: Method
) -> tuple[Chart | None, list[str]]:
    """The lobes of the first test, None and why where there is nothing to compare with."""
    if len(taps) < 2:
        return None, []
    try:
        then = _found(folder, measure(folder, taps[0]), cut, source, method)
    except DataError as error:
        return None, [f"no comparison with the first test: {error}"]
    if then.directions != now.directions:
        return None, [
            f"no comparison with {taps[0].id}: its lobes know direction {then.directions}, "
            f"those of {now.measurement.tap_id} {now.directions}"
        ]
    return then, []


def _shifts(then: Chart | None, now: Chart) -> list[PocketShift]:
    """How pockets moved, but for those that are cut off: the tops of both must be known."""
    if then is None:
        return []
    deepest = DEEPEST * max(then.lobes.minimum.depth, now.lobes.minimum.depth)
    if not np.isfinite(deepest):
        return []
    shifts = pocket_shifts(then.lobes, now.lobes, deepest)
    return [shift for shift in shifts if max(shift.then.depth, shift.now.depth) < deepest]


def _frfs(folder: MachineFolder, measurement: Measurement) -> tuple[Frf | None, Frf | None]:
    """Measured, in the directions that the modes know; predicted by receptance coupling, both alike."""
    machine = folder.machine
    place = machine.tap.position_mm
    if place > 0 and (not measurement.predicted or measurement.tool == machine.tap.tool):
        raise DataError(
            f"--source frf needs an FRF at the tool tip, but [tap] position_mm = {place:g} lays it beside the tip; "
            "use --source modes, which the model carries to the tip"
        )
    if measurement.predicted:
        coupled = model_frf(model_state(folder, measurement.tool))
        return coupled, coupled
    (entry,) = (tap for tap in folder.taps() if tap.id == measurement.tap_id)
    own = folder.read(entry).frf.in_band(machine.mode.band_hz)
    tap = partner(folder, entry) if measurement.x and measurement.y else None
    other = tap.frf.in_band(machine.mode.band_hz) if tap is not None else None
    return (own, other) if measurement.direction == "x" else (other, own)


def _pockets(machine: Machine, now: Chart) -> list[Pocket]:
    """Pockets up to what the drive allows and the diagram shows; none where there is no limit."""
    lowest = now.lobes.minimum.depth
    if not np.isfinite(lowest):
        return []
    return pockets(now.lobes, np.minimum(USEFUL * lowest, drive_limit(machine, now.table, now.lobes.speed_rpm)))
