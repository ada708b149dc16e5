"""lobewatch lobes."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from acquisition import DataError
from lobes import StabilityLobes, average_angle
from lobewatch.describe import lobes_json, program_json, program_table
from lobewatch.figures import lobes_figure, save_figure
from lobewatch.history import measure
from lobewatch.machine import REFERENCE_CUT
from lobewatch.machine_folder import MachineFolder, TapEntry
from lobewatch.output import Json, emit
from lobewatch.pipeline import Measurement, speed_grid


class Dynamics(StrEnum):
    """What the lobes are computed from."""

    MODES = "modes"
    FRF = "frf"


def lobes(
    machine: Annotated[Path, typer.Argument(help="Machine folder with at least one tap test.")],
    cut: Annotated[str, typer.Option(help="Name of a [[program]], or the reference cut.")] = REFERENCE_CUT,
    source: Annotated[Dynamics, typer.Option(help="From the modes found, or straight from the FRF.")] = Dynamics.MODES,
    figure: Annotated[Path | None, typer.Option(help="Draw the diagram to this file (.svg, .png, .pdf).")] = None,
    as_json: Json = False,
) -> None:
    """Stability lobes of the newest tap test by the average tooth angle, drawn beside those of the first test.

    Examples:

      lobewatch lobes trial --figure lobes.png

      lobewatch lobes trial --cut "bracket, slot" --source frf --json
    """
    folder = MachineFolder(machine)
    taps = folder.taps()
    if not taps:
        raise DataError(f"{folder.path}: no tap test yet; take one with lobewatch tap, or replay a recorded file")
    measurement, found = _found(folder, taps[-1], cut, source)
    programs = program_json({cut: found}, folder.machine)
    if figure is not None:
        series = [tap for tap in taps if (tap.tool, tap.direction) == (taps[-1].tool, taps[-1].direction)]
        depths = {f"{measurement.time:%Y-%m-%d}": found.depth}
        if len(series) > 1:
            first, then = _found(folder, series[0], cut, source)
            depths = {f"{first.time:%Y-%m-%d}": then.depth} | depths
        title = f"{folder.machine.machine.name}: {cut}, from the {source}"
        same = program_json(dict.fromkeys(_same_cut(folder, measurement.tool, cut), found), folder.machine)
        save_figure(lobes_figure(found.speed_rpm, depths, same, title), figure)
    low = found.minimum
    payload = lobes_json(cut, found) | {
        "tap_id": measurement.tap_id,
        "source": str(source),
        "speed_rpm": found.speed_rpm,
        "depth_mm": found.depth * 1e3,
        "programs": programs,
        "notes": list(measurement.notes),
    }
    emit(
        payload,
        as_json,
        f"{cut}: {found.method}, from the {source} of {measurement.tap_id}",
        f"lowest limit {low.depth * 1e3:.3f} mm at {low.speed_rpm:.0f} rpm, chatter at {low.chatter_frequency:.1f} Hz",
        *([program_table(programs)] if programs else []),
        *(f"note: {note}" for note in measurement.notes),
    )


def _found(folder: MachineFolder, tap: TapEntry, cut: str, source: Dynamics) -> tuple[Measurement, StabilityLobes]:
    """The measurement of a tap and its lobes for one cut; DataError with the reason where there are none."""
    measurement = measure(folder, tap)
    cuts = folder.machine.cuts(measurement.tool)
    if cut not in cuts:
        raise DataError(
            f"--cut {cut!r} is none of the cuts with tool {measurement.tool!r}: {', '.join(cuts) or 'none'}"
        )
    if cut not in measurement.lobes:
        raise DataError(f"{tap.id}: {'; '.join(measurement.notes)}")
    if source is Dynamics.MODES:
        return measurement, measurement.lobes[cut]
    frf = folder.read(tap).frf.in_band(folder.machine.mode.band_hz)
    x, y = (frf, None) if measurement.direction == "x" else (None, frf)
    return measurement, average_angle(x, y, cuts[cut], speed_grid(folder.machine))


def _same_cut(folder: MachineFolder, tool: str, cut: str) -> list[str]:
    """Programs that are this very cut, so that they belong into its diagram."""
    cuts = folder.machine.cuts(tool)
    return [name for name, other in cuts.items() if other == cuts[cut]]
