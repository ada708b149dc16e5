"""Where to go with a program or a cut: settings that would be called stable with something to spare; decay left."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import msgspec

from acquisition import Remark
from lobewatch.machine import REFERENCE_CUT, CutTable, Machine, ProgramTable
from lobewatch.tool.assembly import Assembly, speed_grid
from lobewatch.tool.mean_lobes import mean_lobes
from lobewatch.verdicts.aging import softening, tolerable_decay
from lobewatch.verdicts.doubt import doubt_of
from lobewatch.verdicts.draws import as_program, draw, worst_limit
from lobewatch.verdicts.setting_search import MM, SPARE, Setting, SettingSearch
from lobewatch.verdicts.spindle_at_speed import AT_REST, SpindleAtSpeed
from lobewatch.verdicts.verdict import Verdict, Word, is_sure
from lobewatch.verdicts.ways import ways

SHARE = 0.5
"""Depth that the search for pockets begins with, over the lowest limit of the diagram."""


@dataclass(frozen=True)
class Advice:
    """What goes beyond the word."""

    best: Setting | None = None
    """Setting to go to: at the program's depth, the nearest window of speeds; where there is none, the most chips per
    time. None where the program is stable, nothing is safe, or nothing can be said."""
    here: Setting | None = None
    """Deepest cut at the program's own speed, where `best` has another depth."""
    decay: float = math.nan
    """Tolerable fall of the frequency in the middle of the doubt, relative; 0 where it is not stable now, inf where
    nothing happens down to 80 %, NaN where the program could not be checked."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on what the decay rests on."""


def advise(verdict: Verdict, machine: Machine) -> Advice:
    """Advice beside a verdict; empty where it is unknown."""
    tool, draws = verdict.assembly, verdict.draws
    if tool is None or draws is None:
        return Advice()
    stiffness_at, remark = softening(tool)
    decay = tolerable_decay(draws, verdict.program.depth_mm / 1e3, stiffness_at) if verdict.stable else 0.0
    remarks = (remark,) if verdict.stable else ()
    if verdict.word is Word.STABLE or not is_sure(verdict.program, tool):
        return Advice(decay=decay, remarks=remarks)
    search = SettingSearch.of(verdict.program, draws, tool, machine, verdict.at_speed)
    best = search.elsewhere()
    if best is not None:
        return Advice(best, None, decay, remarks)
    at_own_speed = search.here(1e3 * min(verdict.limit_low, verdict.limit / (1 + SPARE)))
    return Advice(search.most_chips() or at_own_speed, at_own_speed, decay, remarks)


def robust_pockets(
    table: CutTable, assembly: Assembly, machine: Machine, at_speed: SpindleAtSpeed = AT_REST, count: int = 3
) -> list[Setting]:
    """Speeds and depths that would be called stable with depth to spare, the largest removal rate first.

    The speed is the middle of those that are safe now and until it is tapped again. Empty where nothing is safe in the
    range of speeds, or a direction was not tapped or is in question: then nothing is called stable.
    """
    if not is_sure(table, assembly):
        return []
    spindle = at_speed.moved(assembly)
    program_table = _stable_somewhere(at_speed.taught(table), spindle, machine)
    program, cuts = as_program(program_table, machine), ways(program_table, machine, spindle)
    doubt = at_speed.doubt or doubt_of(assembly, program_table, machine)
    limit, axes, _ = worst_limit(program, spindle, cuts)
    draws = draw(program, limit, cuts, spindle, doubt, axes)
    return SettingSearch.of(program_table, draws, assembly, machine, at_speed).pockets(count)


def _stable_somewhere(table: CutTable, assembly: Assembly, machine: Machine) -> ProgramTable:
    """A cut as a program that is surely stable somewhere: in the middle of the range of speeds, not deep."""
    cut, speeds = machine.build_cut(table), machine.speed
    lowest = mean_lobes(assembly.x, assembly.y, [cut], speed_grid(machine), assembly.cross).minimum.depth
    depth = min(max(SHARE * lowest * 1e3, MM), table.deepest_mm)
    place: dict[str, Any] = {"speed_rpm": math.sqrt(speeds.low_rpm * speeds.high_rpm), "depth_mm": depth}
    if isinstance(table, ProgramTable):
        return msgspec.structs.replace(table, **place)
    return ProgramTable(**{"name": REFERENCE_CUT, "tool": assembly.tool} | msgspec.structs.asdict(table) | place)
