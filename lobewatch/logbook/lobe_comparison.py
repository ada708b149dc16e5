"""The stability lobes of a machine now, beside those at first, with pockets and the verdicts on the programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition import DataError, Frf, Remark
from lobes import PocketShift, pocket_shifts
from lobes.tip_response import Tip
from lobewatch.cuts.learning.at_speed import spindle_at_speed
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine import Machine
from lobewatch.machine.settings.cut_range import CutRange
from lobewatch.measuring.model import model_frf, model_state
from lobewatch.tool.assembly import Assembly, speed_grid
from lobewatch.tool.charts import DEEPEST, Chart, Dynamics, Method, chart, cut_table
from lobewatch.verdicts.advice import robust_pockets
from lobewatch.verdicts.setting import Setting
from lobewatch.verdicts.speed_pockets import SpeedPocket, speed_pockets
from lobewatch.verdicts.verdict import Verdict

NO_POCKET = "no-safe-pocket"
"""Code of the remark that says why there are no pockets."""


@dataclass(frozen=True, eq=False)
class LobeComparison:
    """One cut, then and now."""

    now: Chart
    """Chart from the newest tap tests, or predicted."""
    then: Chart | None
    """Chart from the first tap tests of the same tool and directions; None where there are no earlier ones."""
    pockets: Sequence[Setting]
    """Safe settings of now, whatever the method of the chart, the largest removal rate first."""
    shifts: Sequence[PocketShift]
    """Shifts of the pockets of the diagram; nothing of them is recommended."""
    verdicts: Sequence[Verdict]
    """Verdicts on the programs with this same cut: not by the method of the chart, but those of `Logbook.verdicts`."""
    remarks: Sequence[Remark]
    """Remarks on what the chart rests on, and why there are no pockets."""


def compare_lobes(logbook: Logbook, tool: str | None, cut: str, source: Dynamics, method: Method) -> LobeComparison:
    """tool None: that of the program, of the newest tap test for the reference cut.

    DataError with the reason where there are no lobes.
    """
    assembly = _assembly_for(logbook, tool, cut)
    now = _charted(logbook, assembly, cut, source, method)
    first = logbook.first_assembly(assembly)
    then = None if first is None else _charted(logbook, first, cut, source, method)
    cuts = logbook.machine.cuts(assembly.tool)
    same = logbook.verdicts(names=[name for name, program_cuts in cuts.items() if program_cuts == now.cuts])
    learnt = spindle_at_speed(now.table, assembly, logbook.machine, logbook.cuts)
    pockets = robust_pockets(now.table, assembly, logbook.machine, learnt)
    remarks = [*assembly.remarks, *(replace(remark, about=cut) for remark in now.lobes.remarks)]
    remarks += [] if pockets else [_no_pocket(now, logbook.machine)]
    return LobeComparison(now, then, pockets, _shifts(then, now), same, remarks)


def speeds_alone(logbook: Logbook, tool: str | None, cut: str) -> tuple[Assembly, list[SpeedPocket]] | None:
    """Pockets of a cut with a tool that was tapped without force; None where lobes can be drawn, or not even that."""
    assembly = _assembly_for(logbook, tool, cut)
    if assembly.directions or not assembly.unweighed or cut not in logbook.machine.cuts(assembly.tool):
        return None
    return assembly, speed_pockets(cut_table(logbook.machine, cut), assembly, logbook.machine)


def _assembly_for(logbook: Logbook, tool: str | None, cut: str) -> Assembly:
    program_tool = next((program.tool for program in logbook.machine.program if program.name == cut), None)
    return logbook.assembly(program_tool if tool is None else tool)


def _charted(logbook: Logbook, assembly: Assembly, cut: str, source: Dynamics, method: Method) -> Chart:
    machine = logbook.machine
    cuts = machine.cuts(assembly.tool)
    if cut not in cuts:
        raise DataError(f"--cut {cut!r} is none of the cuts with tool {assembly.tool!r}: {', '.join(cuts) or 'none'}")
    assembly = assembly.checked()
    x: Tip | None = assembly.x
    y: Tip | None = assembly.y
    if source is Dynamics.FRF:
        x, y = _frfs(logbook, assembly)
    lobes = chart(method, x, y, cuts[cut], speed_grid(machine))
    return Chart(cut, cut_table(machine, cut), assembly, source, x, y, cuts[cut], lobes)


def _frfs(logbook: Logbook, assembly: Assembly) -> tuple[Frf, Frf]:
    """In x and y, measured or predicted by receptance coupling; a direction that is not known is like the other."""
    place = logbook.machine.tap.position_mm
    if place > 0 and (not assembly.predicted or assembly.tool == logbook.machine.tap.tool):
        raise DataError(
            f"--source frf needs an FRF at the tool tip, but [tap] position_mm = {place:g} lays it beside the tip; "
            "use --source modes, which the model carries to the tip"
        )
    read = _predicted_frf if assembly.predicted else _measured_frf
    frfs = {name: read(logbook, assembly, name) for name in assembly.directions}
    other = frfs[assembly.directions[0]]
    return frfs.get("x", other), frfs.get("y", other)


def _predicted_frf(logbook: Logbook, assembly: Assembly, direction: str) -> Frf:
    """With the newest bearings that were found in this direction."""
    rows = logbook.history.current
    newest = [row for row in rows if row.direction == direction and row.bearing_stiffness.is_known][-1]
    return model_frf(model_state(logbook.machine, logbook.measurement(newest.tap_id), assembly.tool))


def _measured_frf(logbook: Logbook, assembly: Assembly, direction: str) -> Frf:
    """Moved as the assembly has moved the modes of an older tap test."""
    tap_id = assembly.taps[direction]
    entry = next(tap for tap in logbook.taps if tap.id == tap_id)
    frf = logbook.folder.read(entry).known_frf.in_band(logbook.machine.mode.band_hz)
    now, then = (assembly.x, assembly.y)["xy".index(direction)], logbook.measurement(tap_id).at_tip
    moved = now[0].frequency / then[0].frequency if now else 1.0
    band = None if frf.usable_band is None else (moved * frf.usable_band[0], moved * frf.usable_band[1])
    return replace(frf, frequency=moved * frf.frequency, usable_band=band)


def _no_pocket(now: Chart, machine: Machine) -> Remark:
    """Why nothing is recommended."""
    if len(now.assembly.directions) == 1:
        gap, cure = now.assembly.gap
        return Remark(NO_POCKET, now.name, f"no speed and depth can be called safe: {gap}", cure)
    text = f"no safe speed and depth found in {CutRange.of(machine, now.table).words}"
    return Remark(NO_POCKET, now.name, text, "choose another tool or a narrower cut")


def _shifts(then: Chart | None, now: Chart) -> list[PocketShift]:
    """How pockets moved, but for those that are cut off: the tops of both must be known."""
    if then is None:
        return []
    deepest = DEEPEST * max(then.lobes.minimum.depth, now.lobes.minimum.depth)
    if not np.isfinite(deepest):
        return []
    shifts = pocket_shifts(then.lobes, now.lobes, deepest)
    return [shift for shift in shifts if max(shift.then.depth, shift.now.depth) < deepest]
