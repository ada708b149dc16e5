"""Collect the data of charts: stability lobes then and now, and the spindle model."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquisition import DataError, Frf, Remark
from dsm import Modes, Spindle, WhirlMap, mode_shapes, natural_frequencies, stiffness_curve, whirl_map
from lobes import PocketShift, match_pockets
from lobewatch.cuts.learning.program_learning import learn_spindle
from lobewatch.history.tap_measurements import NotTappedError
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine import Machine
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.machine.settings.drive_power import CutRange
from lobewatch.measurement import spindle_model
from lobewatch.tool import lobe_chart
from lobewatch.tool.assembly import Assembly, speed_grid
from lobewatch.verdicts import Setting, Verdict, find_stable_pockets
from lobewatch.verdicts.speed_pockets import SpeedPocket, find_speed_pockets
from lobewatch.verdicts.verdict import find_open_question

NO_POCKET_CODE = "no-safe-pocket"
"""Code of the remark on missing pockets."""


@dataclass(frozen=True, eq=False)
class LobeComparison:
    """Stability lobes of one cut, then and now."""

    now: lobe_chart.LobeChart
    """Chart from the newest tap tests, or predicted."""
    then: lobe_chart.LobeChart | None
    """Chart from the first tap tests of the same tool and directions. None if there are no earlier tap tests."""
    pockets: Sequence[Setting]
    """Stable pockets from the newest tap tests by semi-discretization, largest removal rate first."""
    shifts: Sequence[PocketShift]
    """Shifts of the pockets in the chart. Not a recommendation."""
    verdicts: Sequence[Verdict]
    """Verdicts of `Logbook.verdicts` on the programs with the same cut, whatever the method of the chart."""
    remarks: Sequence[Remark]
    """Remarks on the tap tests and the chart, and the reason for missing pockets."""


def compare_lobes(
    logbook: Logbook, tool: str | None, cut: str, source: lobe_chart.DynamicsSource, method: lobe_chart.LobeMethod
) -> LobeComparison:
    """Compare the stability lobes of a cut now with those from the first tap tests.

    Parameters
    ----------
    logbook
        Logbook of the machine.
    tool
        Name of the tool. None for the tool of the program, or of the newest tap test for the reference cut.
    cut
        Name of a program, or the reference cut.
    source
        Dynamics at the tool tip: fitted modes or the measured FRF.
    method
        Method of the chart. Pockets and verdicts use semi-discretization in any case.

    Returns
    -------
    LobeComparison
        Charts, pockets, verdicts and remarks.

    Raises
    ------
    DataError
        If there are no lobes, with the reason.
    """
    assembly = _find_assembly(logbook, tool, cut)
    now = _make_chart(logbook, assembly, cut, source, method)
    first = logbook.first_assembly(assembly)
    then = None if first is None else _make_chart(logbook, first, cut, source, method)
    cuts = logbook.machine.cuts(assembly.tool)
    same = logbook.verdicts(names=[name for name, program_cuts in cuts.items() if program_cuts == now.cuts])
    at_speed = learn_spindle(now.table, assembly, logbook.machine, logbook.cuts)
    pockets = find_stable_pockets(now.table, assembly, logbook.machine, at_speed)
    remarks = [*assembly.remarks, *(replace(remark, about=cut) for remark in now.lobes.remarks)]
    remarks += [] if pockets else [no_pocket_remark(now, logbook.machine)]
    return LobeComparison(now, then, pockets, _find_pocket_shifts(then, now), same, remarks)


def chart_speed_pockets(logbook: Logbook, tool: str | None, cut: str) -> tuple[Assembly, list[SpeedPocket]] | None:
    """Find the pocket speeds of a cut with a tool tapped without force. None if lobes can be drawn, or neither."""
    assembly = _find_assembly(logbook, tool, cut)
    if assembly.directions or not assembly.without_stiffness or cut not in logbook.machine.cuts(assembly.tool):
        return None
    return assembly, find_speed_pockets(logbook.machine.cut_tables[cut], assembly, logbook.machine)


def _find_assembly(logbook: Logbook, tool: str | None, cut: str) -> Assembly:
    program_tool = next((program.tool for program in logbook.machine.program if program.name == cut), None)
    return logbook.assembly(program_tool if tool is None else tool)


def _make_chart(
    logbook: Logbook, assembly: Assembly, cut: str, source: lobe_chart.DynamicsSource, method: lobe_chart.LobeMethod
) -> lobe_chart.LobeChart:
    machine = logbook.machine
    cuts = machine.cuts(assembly.tool)
    if cut not in cuts:
        known = f"Cuts of this tool: {', '.join(map(repr, cuts)) or 'none'}."
        raise DataError(f"compare_lobes.cut {cut!r} is not a cut of tool {assembly.tool!r}. {known}")
    assembly = assembly.check()
    frfs = _read_frfs(logbook, assembly) if source is lobe_chart.DynamicsSource.FRF else None
    x, y = frfs or (assembly.x, assembly.y)
    lobes = lobe_chart.compute_lobe_chart(method, x, y, cuts[cut], speed_grid(machine))
    return lobe_chart.LobeChart(cut, machine.cut_tables[cut], assembly, source, x, y, cuts[cut], lobes)


def _read_frfs(logbook: Logbook, assembly: Assembly) -> tuple[Frf, Frf]:
    """Read or predict the FRFs in x and y. A missing direction gets the FRF of the other."""
    place = logbook.machine.tap.position_mm
    if place > 0 and (not assembly.predicted or assembly.tool == logbook.machine.tap.tool):
        text = f"DynamicsSource.FRF needs an FRF at the tool tip, but [tap] position_mm = {place:g}"
        raise DataError(f"{text}. Use DynamicsSource.MODES, because the model transfers modes to the tip.")
    read = _predict_frf if assembly.predicted else _read_assembly_frf
    frfs = {name: read(logbook, assembly, name) for name in assembly.directions}
    other = frfs[assembly.directions[0]]
    return frfs.get("x", other), frfs.get("y", other)


def _predict_frf(logbook: Logbook, assembly: Assembly, direction: str) -> Frf:
    """Predict the FRF by receptance coupling, with the newest bearings calibrated in this direction."""
    rows = logbook.history.current
    newest = [row for row in rows if row.direction == direction and row.bearing_stiffness.is_known][-1]
    measurement = logbook.measurement(newest.tap_id)
    return spindle_model.compute_model_frf(spindle_model.build_model_state(logbook.machine, measurement, assembly.tool))


def _read_assembly_frf(logbook: Logbook, assembly: Assembly, direction: str) -> Frf:
    """Read the fitted FRF and shift it in frequency as the assembly has shifted the modes of an older tap test."""
    tap_id = assembly.taps[direction]
    entry = next(tap for tap in logbook.taps if tap.id == tap_id)
    measurement = logbook.measurement(tap_id)
    frf = (measurement.frf or logbook.folder.read(entry).required_frf).in_band(logbook.machine.mode.band_hz)
    now, then = (assembly.x, assembly.y)["xy".index(direction)], measurement.at_tip
    ratio = now[0].frequency / then[0].frequency if now else 1.0
    band = None if frf.usable_band is None else (ratio * frf.usable_band[0], ratio * frf.usable_band[1])
    return replace(frf, frequency=ratio * frf.frequency, usable_band=band)


def no_pocket_remark(now: lobe_chart.LobeChart, machine: Machine) -> Remark:
    """Return the reason for missing pockets as a remark."""
    if open_question := find_open_question(now.table, now.assembly):
        gap, cure = open_question
        return Remark(NO_POCKET_CODE, now.name, f"no stable pocket, because {gap}", cure)
    text = f"no stable pocket in {CutRange.of(machine, now.table).text}"
    return Remark(NO_POCKET_CODE, now.name, text, "Choose another tool or a smaller radial depth")


def _find_pocket_shifts(then: lobe_chart.LobeChart | None, now: lobe_chart.LobeChart) -> list[PocketShift]:
    """Match the pockets of both charts. Pockets cut off at the top of a chart are left out."""
    if then is None:
        return []
    deepest = lobe_chart.MAX_CHART_DEPTH_RATIO * max(then.lobes.minimum.depth, now.lobes.minimum.depth)
    if not np.isfinite(deepest):
        return []
    shifts = match_pockets(then.lobes, now.lobes, deepest)
    return [shift for shift in shifts if max(shift.before.depth, shift.after.depth) < deepest]


@dataclass(frozen=True, eq=False)
class ModelFigureData:
    """Data of the figure of a spindle model."""

    title: str
    """Title of the figure."""
    spindle: Spindle
    """Shaft with bearings and joints."""
    modes: Modes
    """Mode shapes along the shaft."""
    curve: tuple[NDArray[np.float64], NDArray[np.float64]]
    """Bearing stiffness (N/m) and frequency (Hz) of the followed mode, shape (n,) each."""
    points: tuple[NDArray[np.float64], NDArray[np.float64]]
    """Bearing stiffness (N/m) and frequency (Hz) of the tap tests, shape (n,) each."""
    whirl: WhirlMap
    """Whirl frequencies over speed."""
    highest_speed: float
    """End of the speed range of the machine (rpm)."""
    frf_place: str
    """Point of excitation and response of the FRFs, as text."""
    model_frf: Frf
    """FRF of the model."""
    measured_frf: Frf | None
    """Newest measured FRF of the same tool, or None."""


def collect_model_figure(logbook: Logbook, state: spindle_model.ModelState, modes: int) -> ModelFigureData:
    """Collect the data of the figure of a spindle model.

    Parameters
    ----------
    logbook
        Logbook of the machine.
    state
        Model with a tool.
    modes
        Number of modes to draw.

    Returns
    -------
    ModelFigureData
        Mode shapes, stiffness curve, whirl map and FRFs.
    """
    spindle, machine, position = state.spindle, state.machine, spindle_model.tap_position(state)
    speeds = np.linspace(0.0, 1.15 * (spindle_model.first_critical_speed(spindle) or machine.speed.high_rpm), 24)
    return ModelFigureData(
        title=state.title,
        spindle=spindle,
        modes=mode_shapes(spindle, min(modes, 4), np.linspace(0.0, spindle.length, spindle_model.MODEL_FRF_POINTS)),
        curve=_compute_stiffness_curve(spindle, machine.mode.model_mode),
        points=_calibrated_points(logbook, state.tool),
        whirl=whirl_map(spindle, speeds, min(modes, 2)),
        highest_speed=machine.speed.high_rpm,
        frf_place="at the tool tip" if position == 0 else f"{LENGTH.text(position * 1e3)} from the tip",
        model_frf=spindle_model.compute_model_frf(state),
        measured_frf=_read_newest_frf(logbook, state.tool),
    )


def _compute_stiffness_curve(spindle: Spindle, mode: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute frequency over bearing stiffness, from a thirtieth to thirty times the present stiffness."""
    if not any(bearing.group and np.isfinite(bearing.stiffness) for bearing in spindle.bearings):
        return np.empty(0), np.empty(0)
    ends = []
    for factor in (1 / 30, 30.0):
        scaled = [replace(bearing, stiffness=factor * bearing.stiffness) for bearing in spindle.bearings]
        ends.append(float(natural_frequencies(replace(spindle, bearings=scaled), mode)[-1]))
    frequency = np.linspace(ends[0], ends[1], spindle_model.MODEL_FRF_POINTS)[1:-1]
    return stiffness_curve(spindle, frequency, mode), frequency


def _calibrated_points(logbook: Logbook, tool: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rows = [row for row in logbook.history.current if row.tool == tool and row.bearing_stiffness.is_known]
    points = np.array([(row.bearing_stiffness.value, row.frequency.value) for row in rows]).reshape(-1, 2)
    return points[:, 0], points[:, 1]


def _read_newest_frf(logbook: Logbook, tool: str) -> Frf | None:
    try:
        return logbook.folder.read(logbook.newest_tap(tool)).frf
    except NotTappedError:
        return None
