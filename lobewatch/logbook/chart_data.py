"""Collect the data of charts: stability lobes then and now, and the spindle model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquisition import DataError, Frf, Remark
from dsm import Modes, Spindle, WhirlMap, mode_shapes, natural_frequencies, stiffness_curve, whirl_map
from lobes import PocketShift, match_pockets
from lobes.tip_response import TipData
from lobewatch.cuts.learning.verdict_at_speed import learn_spindle
from lobewatch.history.usable_taps import NotTappedError
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine import Machine
from lobewatch.machine.settings.cut_range import CutRange
from lobewatch.measurement.spindle_model import (
    MODEL_FRF_POINTS,
    ModelState,
    build_model_state,
    compute_model_frf,
    first_critical_speed,
    tap_position,
)
from lobewatch.tool.assembly import Assembly, speed_grid
from lobewatch.tool.lobe_chart import (
    MAX_CHART_DEPTH_RATIO,
    DynamicsSource,
    LobeChart,
    LobeMethod,
    compute_lobe_chart,
    find_cut_table,
)
from lobewatch.verdicts.recommendation import find_stable_pockets
from lobewatch.verdicts.setting_robustness import Setting
from lobewatch.verdicts.speed_pockets import SpeedPocket, find_speed_pockets
from lobewatch.verdicts.verdict import Verdict

NO_POCKET_CODE = "no-safe-pocket"
"""Code of the remark that says why there are no pockets."""


@dataclass(frozen=True, eq=False)
class LobeComparison:
    """One cut, then and now."""

    now: LobeChart
    """Chart from the newest tap tests, or predicted."""
    then: LobeChart | None
    """Chart from the first tap tests of the same tool and directions; None where there are no earlier ones."""
    pockets: Sequence[Setting]
    """Safe settings of now, whatever the method of the chart, the largest removal rate first."""
    shifts: Sequence[PocketShift]
    """Shifts of the pockets of the diagram; nothing of them is recommended."""
    verdicts: Sequence[Verdict]
    """Verdicts on the programs with this same cut: not by the method of the chart, but those of `Logbook.verdicts`."""
    remarks: Sequence[Remark]
    """Remarks on what the chart rests on, and why there are no pockets."""


def compare_lobes(
    logbook: Logbook, tool: str | None, cut: str, source: DynamicsSource, method: LobeMethod
) -> LobeComparison:
    """tool None: that of the program, of the newest tap test for the reference cut.

    DataError with the reason where there are no lobes.
    """
    assembly = _find_assembly(logbook, tool, cut)
    now = _make_chart(logbook, assembly, cut, source, method)
    first = logbook.first_assembly(assembly)
    then = None if first is None else _make_chart(logbook, first, cut, source, method)
    cuts = logbook.machine.cuts(assembly.tool)
    same = logbook.verdicts(names=[name for name, program_cuts in cuts.items() if program_cuts == now.cuts])
    learnt = learn_spindle(now.table, assembly, logbook.machine, logbook.cuts)
    pockets = find_stable_pockets(now.table, assembly, logbook.machine, learnt)
    remarks = [*assembly.remarks, *(replace(remark, about=cut) for remark in now.lobes.remarks)]
    remarks += [] if pockets else [_no_pocket_remark(now, logbook.machine)]
    return LobeComparison(now, then, pockets, _find_pocket_shifts(then, now), same, remarks)


def chart_speed_pockets(logbook: Logbook, tool: str | None, cut: str) -> tuple[Assembly, list[SpeedPocket]] | None:
    """Pockets of a cut with a tool that was tapped without force; None where lobes can be drawn, or not even that."""
    assembly = _find_assembly(logbook, tool, cut)
    if assembly.directions or not assembly.without_stiffness or cut not in logbook.machine.cuts(assembly.tool):
        return None
    return assembly, find_speed_pockets(find_cut_table(logbook.machine, cut), assembly, logbook.machine)


def _find_assembly(logbook: Logbook, tool: str | None, cut: str) -> Assembly:
    program_tool = next((program.tool for program in logbook.machine.program if program.name == cut), None)
    return logbook.assembly(program_tool if tool is None else tool)


def _make_chart(
    logbook: Logbook, assembly: Assembly, cut: str, source: DynamicsSource, method: LobeMethod
) -> LobeChart:
    machine = logbook.machine
    cuts = machine.cuts(assembly.tool)
    if cut not in cuts:
        raise DataError(f"--cut {cut!r} is none of the cuts with tool {assembly.tool!r}: {', '.join(cuts) or 'none'}")
    assembly = assembly.check()
    x: TipData | None = assembly.x
    y: TipData | None = assembly.y
    if source is DynamicsSource.FRF:
        x, y = _read_frfs(logbook, assembly)
    lobes = compute_lobe_chart(method, x, y, cuts[cut], speed_grid(machine))
    return LobeChart(cut, find_cut_table(machine, cut), assembly, source, x, y, cuts[cut], lobes)


def _read_frfs(logbook: Logbook, assembly: Assembly) -> tuple[Frf, Frf]:
    """In x and y, measured or predicted by receptance coupling; a direction that is not known is like the other."""
    place = logbook.machine.tap.position_mm
    if place > 0 and (not assembly.predicted or assembly.tool == logbook.machine.tap.tool):
        raise DataError(
            f"--source frf needs an FRF at the tool tip, but [tap] position_mm = {place:g} lays it beside the tip; "
            "use --source modes, which the model carries to the tip"
        )
    read = _predict_frf if assembly.predicted else _read_assembly_frf
    frfs = {name: read(logbook, assembly, name) for name in assembly.directions}
    other = frfs[assembly.directions[0]]
    return frfs.get("x", other), frfs.get("y", other)


def _predict_frf(logbook: Logbook, assembly: Assembly, direction: str) -> Frf:
    """With the newest bearings that were found in this direction."""
    rows = logbook.history.current
    newest = [row for row in rows if row.direction == direction and row.bearing_stiffness.is_known][-1]
    return compute_model_frf(build_model_state(logbook.machine, logbook.measurement(newest.tap_id), assembly.tool))


def _read_assembly_frf(logbook: Logbook, assembly: Assembly, direction: str) -> Frf:
    """Moved as the assembly has moved the modes of an older tap test."""
    tap_id = assembly.taps[direction]
    entry = next(tap for tap in logbook.taps if tap.id == tap_id)
    frf = logbook.folder.read(entry).required_frf.in_band(logbook.machine.mode.band_hz)
    now, then = (assembly.x, assembly.y)["xy".index(direction)], logbook.measurement(tap_id).at_tip
    moved = now[0].frequency / then[0].frequency if now else 1.0
    band = None if frf.usable_band is None else (moved * frf.usable_band[0], moved * frf.usable_band[1])
    return replace(frf, frequency=moved * frf.frequency, usable_band=band)


def _no_pocket_remark(now: LobeChart, machine: Machine) -> Remark:
    """Why nothing is recommended."""
    if len(now.assembly.directions) == 1:
        gap, cure = now.assembly.missing_direction
        return Remark(NO_POCKET_CODE, now.name, f"no speed and depth can be called safe: {gap}", cure)
    text = f"no safe speed and depth found in {CutRange.of(machine, now.table).text}"
    return Remark(NO_POCKET_CODE, now.name, text, "choose another tool or a narrower cut")


def _find_pocket_shifts(then: LobeChart | None, now: LobeChart) -> list[PocketShift]:
    """How pockets moved, but for those that are cut off: the tops of both must be known."""
    if then is None:
        return []
    deepest = MAX_CHART_DEPTH_RATIO * max(then.lobes.minimum.depth, now.lobes.minimum.depth)
    if not np.isfinite(deepest):
        return []
    shifts = match_pockets(then.lobes, now.lobes, deepest)
    return [shift for shift in shifts if max(shift.before.depth, shift.after.depth) < deepest]


_Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ModelFigureData:
    """What is drawn of a model."""

    title: str
    """Headline."""
    spindle: Spindle
    """The shaft."""
    modes: Modes
    """Modes along the shaft."""
    curve: tuple[_Float, _Float]
    """Bearing stiffness (N/m) and frequency (Hz) of the followed mode, shape (n,) each."""
    points: tuple[_Float, _Float]
    """The same of the tap tests."""
    whirl: WhirlMap
    """Whirl frequencies over speed."""
    highest_speed: float
    """End of the speed range of the machine (rpm)."""
    frf_place: str
    """Place of force and motion of the frequency responses, in words."""
    model_frf: Frf
    """Frequency response of the model."""
    measured_frf: Frf | None
    """Newest measured one of the same tool."""


def collect_model_figure(logbook: Logbook, state: ModelState, modes: int) -> ModelFigureData:
    """What `lobewatch model --figure` draws."""
    spindle, machine = state.spindle, state.machine
    speeds = np.linspace(0.0, 1.15 * (first_critical_speed(spindle) or machine.speed.high_rpm), 24)
    return ModelFigureData(
        title=state.title,
        spindle=spindle,
        modes=mode_shapes(spindle, min(modes, 4), np.linspace(0.0, spindle.length, MODEL_FRF_POINTS)),
        curve=_compute_stiffness_curve(spindle, machine.mode.model_mode),
        points=_calibrated_points(logbook, state.tool),
        whirl=whirl_map(spindle, speeds, min(modes, 2)),
        highest_speed=machine.speed.high_rpm,
        frf_place="at the tool tip" if tap_position(state) == 0 else f"{tap_position(state) * 1e3:g} mm from the tip",
        model_frf=compute_model_frf(state),
        measured_frf=_read_newest_frf(logbook, state.tool),
    )


def _compute_stiffness_curve(spindle: Spindle, mode: int) -> tuple[_Float, _Float]:
    """Bearing stiffness over the followed frequency, from a thirtieth to thirty times the present one."""
    if not any(bearing.group and np.isfinite(bearing.stiffness) for bearing in spindle.bearings):
        return np.empty(0), np.empty(0)
    ends = []
    for factor in (1 / 30, 30.0):
        scaled = [replace(bearing, stiffness=factor * bearing.stiffness) for bearing in spindle.bearings]
        ends.append(float(natural_frequencies(replace(spindle, bearings=scaled), mode)[-1]))
    frequency = np.linspace(ends[0], ends[1], MODEL_FRF_POINTS)[1:-1]
    return stiffness_curve(spindle, frequency, mode), frequency


def _calibrated_points(logbook: Logbook, tool: str) -> tuple[_Float, _Float]:
    calibrated_rows = [row for row in logbook.history.current if row.tool == tool and row.bearing_stiffness.is_known]
    points = np.array([(row.bearing_stiffness.value, row.frequency.value) for row in calibrated_rows]).reshape(-1, 2)
    return points[:, 0], points[:, 1]


def _read_newest_frf(logbook: Logbook, tool: str) -> Frf | None:
    try:
        return logbook.folder.read(logbook.newest_tap(tool)).frf
    except NotTappedError:
        return None
