"""The stability lobes of a machine now, beside those at first, with pockets and the verdicts on the programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition import DataError, Frf, Remark
from lobes import Pocket, PocketShift, pocket_shifts, pockets
from lobes.tip_response import Tip
from lobewatch.analysis.assembly import Assembly, speed_grid
from lobewatch.analysis.charts import DEEPEST, Chart, Dynamics, Method, chart
from lobewatch.analysis.logbook import Logbook
from lobewatch.analysis.model_state import model_frf, model_state
from lobewatch.analysis.verdict import Verdict
from lobewatch.machine import Machine, drive_limit

USEFUL = 5.0
"""Pockets are cut off at this many times the lowest limit, where the diagram ends."""


@dataclass(frozen=True, eq=False)
class LobeComparison:
    """One cut, then and now."""

    now: Chart
    """From the newest tap tests, or predicted."""
    then: Chart | None
    """From the first tap tests of the same tool and directions; None where there are no earlier ones."""
    pockets: Sequence[Pocket]
    """Those of now, up to what the drive allows and the diagram shows."""
    shifts: Sequence[PocketShift]
    """How pockets moved."""
    verdicts: Sequence[Verdict]
    """On the programs with this same cut: not by the method of the chart, but those of `Logbook.verdicts`."""
    remarks: Sequence[Remark]
    """What the chart rests on."""


def compare_lobes(logbook: Logbook, tool: str | None, cut: str, source: Dynamics, method: Method) -> LobeComparison:
    """tool None: that of the program, of the newest tap test for the reference cut.

    DataError with the reason where there are no lobes.
    """
    own = next((program.tool for program in logbook.machine.program if program.name == cut), None)
    assembly = logbook.assembly(own if tool is None else tool)
    now = _charted(logbook, assembly, cut, source, method)
    first = logbook.first_assembly(assembly)
    then = None if first is None else _charted(logbook, first, cut, source, method)
    cuts = logbook.machine.cuts(assembly.tool)
    same = logbook.verdicts(names=[name for name, other in cuts.items() if other == now.cuts])
    remarks = (*assembly.remarks, *(replace(remark, about=cut) for remark in now.lobes.remarks))
    return LobeComparison(now, then, _pockets(logbook.machine, now), _shifts(then, now), same, remarks)


def _charted(logbook: Logbook, assembly: Assembly, cut: str, source: Dynamics, method: Method) -> Chart:
    machine = logbook.machine
    cuts = machine.cuts(assembly.tool)
    table = next((program for program in machine.program if program.name == cut), machine.reference_cut)
    if cut not in cuts or table is None:
        raise DataError(f"--cut {cut!r} is none of the cuts with tool {assembly.tool!r}: {', '.join(cuts) or 'none'}")
    if not assembly.directions:
        raise DataError(f"{assembly.tap_id}: {'; '.join(map(str, assembly.remarks))}")
    x: Tip | None = assembly.x
    y: Tip | None = assembly.y
    if source is Dynamics.FRF:
        x, y = _frfs(logbook, assembly)
    found = chart(method, x, y, cuts[cut], speed_grid(machine))
    return Chart(cut, table, assembly, source, x, y, cuts[cut], found)


def _frfs(logbook: Logbook, assembly: Assembly) -> tuple[Frf | None, Frf | None]:
    """Measured, in the directions that the modes know; predicted by receptance coupling, both alike."""
    machine = logbook.machine
    place = machine.tap.position_mm
    if place > 0 and (not assembly.predicted or assembly.tool == machine.tap.tool):
        raise DataError(
            f"--source frf needs an FRF at the tool tip, but [tap] position_mm = {place:g} lays it beside the tip; "
            "use --source modes, which the model carries to the tip"
        )
    if assembly.predicted:
        coupled = model_frf(model_state(machine, logbook.calibrated, assembly.tool))
        return coupled, coupled
    entries = {tap.id: tap for tap in logbook.taps}
    known = {name: logbook.folder.read(entries[assembly.taps[name]]).frf for name in assembly.directions}
    x, y = (known[name].in_band(machine.mode.band_hz) if name in known else None for name in ("x", "y"))
    return x, y


def _pockets(machine: Machine, now: Chart) -> list[Pocket]:
    """None where there is no limit."""
    lowest = now.lobes.minimum.depth
    if not np.isfinite(lowest):
        return []
    return pockets(now.lobes, np.minimum(USEFUL * lowest, drive_limit(machine, now.table, now.lobes.speed_rpm)))


def _shifts(then: Chart | None, now: Chart) -> list[PocketShift]:
    """How pockets moved, but for those that are cut off: the tops of both must be known."""
    if then is None:
        return []
    deepest = DEEPEST * max(then.lobes.minimum.depth, now.lobes.minimum.depth)
    if not np.isfinite(deepest):
        return []
    shifts = pocket_shifts(then.lobes, now.lobes, deepest)
    return [shift for shift in shifts if max(shift.then.depth, shift.now.depth) < deepest]
