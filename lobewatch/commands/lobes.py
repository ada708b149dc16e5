"""lobewatch lobes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from acquisition import DataError, Frf
from lobes import (
    Cut,
    DepthBand,
    Pocket,
    PocketShift,
    StabilityLobes,
    best_pockets,
    coefficient_range,
    cutting_coefficients,
    measurement_band,
    pocket_shifts,
    pockets,
    radial_lobes,
)
from lobes.tip_response import Tip
from lobewatch.charts import DEEPEST, Method, chart
from lobewatch.cut_tables import CutTable
from lobewatch.describe import lobes_json, program_json, program_table
from lobewatch.drive import drive_limit
from lobewatch.figures import save_figure
from lobewatch.figures_lobes import lobes_figure, radial_figure, waterfall_figure
from lobewatch.history import measure, series, update_history
from lobewatch.machine import REFERENCE_CUT, Machine
from lobewatch.machine_folder import MachineFolder, TapEntry
from lobewatch.model_state import model_frf, model_state
from lobewatch.output import Json, emit
from lobewatch.pipeline import Measurement, speed_grid
from lobewatch.prediction import predict

USEFUL = 5.0
"""Pockets are cut off at this many times the lowest limit, where the diagram ends."""
IMMERSIONS = np.linspace(0.05, 1.0, 39)


class Dynamics(StrEnum):
    """What the lobes are computed from."""

    MODES = "modes"
    FRF = "frf"


@dataclass(frozen=True, eq=False)
class _Chart:
    """The lobes of one tap test, and what they came from."""

    measurement: Measurement
    x: Tip | None
    y: Tip | None
    cut: Cut
    lobes: StabilityLobes


def lobes(
    machine: Annotated[Path, typer.Argument(help="Machine folder with at least one tap test.")],
    cut: Annotated[str, typer.Option(help="Name of a [[program]], or the reference cut.")] = REFERENCE_CUT,
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
        emit({"materials": _materials(folder.machine)}, as_json, *_material_lines(folder.machine))
        return
    of_series = _series(folder, tool)
    newest = measure(folder, of_series[-1]) if of_series else predict(folder, tool or "")
    now = _found(folder, newest, cut, source, method)
    then = _found(folder, measure(folder, of_series[0]), cut, source, method) if len(of_series) > 1 else None
    best = _pockets(folder.machine, now.lobes, cut)
    if figure is not None:
        save_figure(_diagram(folder, now, then, cut, source, best), figure)
    if radial is not None:
        _draw_radial(folder.machine, now, cut, method, radial)
    if waterfall is not None:
        _draw_waterfall(folder, newest, cut, waterfall)
    shifts = pocket_shifts(then.lobes, now.lobes, DEEPEST * now.lobes.minimum.depth) if then is not None else []
    _say(folder.machine, now, cut, source, best, shifts, as_json)


def _say(
    machine: Machine,
    now: _Chart,
    cut: str,
    source: Dynamics,
    best: Sequence[Pocket],
    shifts: Sequence[PocketShift],
    as_json: bool,
) -> None:
    found, programs = now.lobes, program_json({cut: now.lobes}, machine)
    low, notes = found.minimum, dict.fromkeys([*now.measurement.notes, *([found.warning] if found.warning else [])])
    by_removal = best_pockets(best, by="removal")
    payload = lobes_json(cut, found) | {
        "tap_id": now.measurement.tap_id,
        "source": str(source),
        "speed_rpm": found.speed_rpm,
        "depth_mm": found.depth * 1e3,
        "chatter_frequencies_hz": found.chatter_frequency,
        "kind": found.kind,
        "pockets_by_depth": [_pocket_json(pocket) for pocket in best_pockets(best)],
        "pockets_by_removal": [_pocket_json(pocket) for pocket in by_removal],
        "pocket_shifts": [_shift_json(shift) for shift in shifts],
        "programs": programs,
        "notes": list(notes),
    }
    emit(
        payload,
        as_json,
        f"{cut}: {found.method}, from the {source} of {now.measurement.tap_id}",
        f"lowest limit {low.depth * 1e3:.3f} mm at {low.speed_rpm:.0f} rpm, chatter at {low.chatter_frequency:.1f} Hz",
        f"best pockets up to {USEFUL * low.depth * 1e3:.1f} mm, by depth: {_list(best_pockets(best))}",
        f"by removal rate: {_list(by_removal)}",
        *_shift_lines(shifts),
        *([program_table(programs)] if programs else []),
        *(f"note: {note}" for note in notes),
    )


def _series(folder: MachineFolder, tool: str | None) -> list[TapEntry]:
    """Taps with a tool in the direction of the newest of them; None: the tool that was tapped last."""
    taps = folder.taps()
    if not taps:
        raise DataError(f"{folder.path}: no tap test yet; take one with lobewatch tap, or replay a recorded file")
    of_tool = [tap for tap in taps if tap.tool == (taps[-1].tool if tool is None else tool)]
    return [tap for tap in of_tool if tap.direction == of_tool[-1].direction]


def _found(folder: MachineFolder, measurement: Measurement, cut: str, source: Dynamics, method: Method) -> _Chart:
    """The lobes of a measurement for one cut; DataError with the reason where there are none."""
    cuts = folder.machine.cuts(measurement.tool)
    if cut not in cuts:
        raise DataError(
            f"--cut {cut!r} is none of the cuts with tool {measurement.tool!r}: {', '.join(cuts) or 'none'}"
        )
    if cut not in measurement.lobes:
        raise DataError(f"{measurement.tap_id}: {'; '.join(measurement.notes)}")
    x: Tip | None = measurement.x
    y: Tip | None = measurement.y
    if source is Dynamics.FRF:
        x, y = _frfs(folder, measurement)
    return _Chart(measurement, x, y, cuts[cut], chart(method, x, y, cuts[cut], speed_grid(folder.machine)))


def _frfs(folder: MachineFolder, measurement: Measurement) -> tuple[Frf | None, Frf | None]:
    """Measured in one direction; predicted by receptance coupling, both alike."""
    taps = [tap for tap in folder.taps() if tap.id == measurement.tap_id]
    if not taps:
        coupled = model_frf(model_state(folder, measurement.tool))
        return coupled, coupled
    frf = folder.read(taps[0]).frf.in_band(folder.machine.mode.band_hz)
    return (frf, None) if measurement.direction == "x" else (None, frf)


def _table_of(machine: Machine, cut: str) -> CutTable | None:
    return next((program for program in machine.program if program.name == cut), machine.reference_cut)


def _pockets(machine: Machine, found: StabilityLobes, cut: str) -> list[Pocket]:
    """Pockets up to what the drive allows and the diagram shows; none where there is no limit."""
    lowest, of_cut = found.minimum.depth, _table_of(machine, cut)
    if not np.isfinite(lowest) or of_cut is None:
        return []
    return pockets(found, np.minimum(USEFUL * lowest, drive_limit(machine, of_cut, found.speed_rpm)))


def _diagram(
    folder: MachineFolder, now: _Chart, then: _Chart | None, cut: str, source: Dynamics, best: Sequence[Pocket]
) -> Any:
    depths = {f"{chart.measurement.time:%Y-%m-%d}": chart.lobes.depth for chart in (then, now) if chart is not None}
    title = f"{folder.machine.machine.name}: {cut}, from the {source}"
    cuts = folder.machine.cuts(now.measurement.tool)
    same = program_json({name: now.lobes for name, other in cuts.items() if other == now.cut}, folder.machine)
    band, spread = _bands(folder.machine, now, cut, source)
    return lobes_figure(now.lobes.speed_rpm, depths, same, title, band, spread, best_pockets(best))


def _bands(machine: Machine, now: _Chart, cut: str, source: Dynamics) -> tuple[DepthBand | None, DepthBand | None]:
    """Band of the measurement and range of the coefficients, each from zero order and carried over as ratios.

    None where modes have no standard errors, and where there are not two publications of one alloy.
    """
    if source is Dynamics.FRF:
        return None, None
    speeds = now.lobes.speed_rpm
    x, y = now.measurement.x, now.measurement.y
    base = chart(Method.ZERO_ORDER, x, y, now.cut, speeds).depth

    def carried(band: DepthBand) -> DepthBand:
        known = np.isfinite(base)
        low, high = (np.where(known, edge / np.where(known, base, 1.0), 1.0) for edge in band)
        return DepthBand(now.lobes.depth * low, now.lobes.depth * high)

    measured = spread = None
    if any(mode.best_covariance is not None for mode in (*(x or ()), *(y or ()))):
        measured = carried(measurement_band(lambda x, y: chart(Method.ZERO_ORDER, x, y, now.cut, speeds), x, y))
    of_cut = _table_of(machine, cut)
    alloy = machine.coefficients(of_cut).alloy if of_cut is not None else ""
    published = [one for one in cutting_coefficients() if alloy and one.alloy == alloy]
    if len(published) >= 2:
        spread = carried(coefficient_range(lambda cut: chart(Method.ZERO_ORDER, x, y, cut, speeds), now.cut, published))
    return measured, spread


def _draw_radial(machine: Machine, now: _Chart, cut: str, method: Method, path: Path) -> None:
    of_cut = _table_of(machine, cut)
    if of_cut is None:
        raise DataError(f"{cut}: no such cut in machine.toml")
    speeds = now.lobes.speed_rpm if method is not Method.SEMI_DISCRETISATION else now.lobes.speed_rpm[::4]
    found = radial_lobes(lambda cut: chart(method, now.x, now.y, cut, speeds), now.cut, IMMERSIONS)
    title = f"{machine.machine.name}: {cut}, {found.method.partition(',')[0]}"
    save_figure(radial_figure(found, of_cut.tool_diameter_mm / 1e3, title=title), path)


def _draw_waterfall(folder: MachineFolder, newest: Measurement, cut: str, path: Path) -> None:
    with folder.locked():
        history, _ = update_history(folder)
    rows = series(history, newest.tool, newest.direction)
    rows = rows[~np.isnan(history.depth[cut][rows, 0])]
    if not rows.size:
        raise DataError(f"--waterfall shows measured lobes; no tap test with tool {newest.tool!r} has any of {cut!r}")
    times = [datetime.fromisoformat(text) for text in history.columns["time"][rows]]
    title = f"{folder.machine.machine.name}: {cut}, zero order"
    save_figure(waterfall_figure(history.speed_rpm, times, history.depth[cut][rows], title), path)


def _list(best: Sequence[Pocket]) -> str:
    return ", ".join(f"{pocket.depth * 1e3:.2f} mm at {pocket.speed_rpm:.0f} rpm" for pocket in best) or "none"


def _pocket_json(pocket: Pocket) -> dict[str, float]:
    return {"speed_rpm": pocket.speed_rpm, "depth_mm": pocket.depth * 1e3}


def _shift_json(shift: PocketShift) -> dict[str, Any]:
    return {
        "then": _pocket_json(shift.then),
        "now": _pocket_json(shift.now),
        "speed_change": shift.speed_change,
        "depth_change": shift.depth_change,
    }


def _shift_lines(shifts: Sequence[PocketShift]) -> Iterator[str]:
    for shift in sorted(shifts, key=lambda one: one.then.speed_rpm, reverse=True)[:3]:
        yield (
            f"pocket moved from {shift.then.speed_rpm:.0f} to {shift.now.speed_rpm:.0f} rpm "
            f"({100 * shift.speed_change:+.1f} %), {shift.then.depth * 1e3:.2f} to {shift.now.depth * 1e3:.2f} mm "
            f"({100 * shift.depth_change:+.1f} %)"
        )


def _materials(machine: Machine) -> list[dict[str, Any]]:
    return [
        {
            "material": one.material,
            "tangential_n_per_mm2": one.tangential / 1e6,
            "radial_n_per_mm2": one.radial / 1e6,
            "note": one.note,
            "source": one.source,
        }
        for one in (*(own.build() for own in machine.material), *cutting_coefficients())
    ]


def _material_lines(machine: Machine) -> Iterator[str]:
    for one in _materials(machine):
        kt, kr = one["tangential_n_per_mm2"], one["radial_n_per_mm2"]
        about = "; ".join(filter(None, (one["note"], one["source"])))
        yield f"{one['material']:<42} Kt {kt:5.0f}  Kr {kr:4.0f} N/mm²  {about}"
