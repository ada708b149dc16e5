"""Where to go with a program or a cut: settings that would be called stable with something to spare; decay left."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import msgspec

from acquisition import Remark
from lobewatch.machine import REFERENCE_CUT, CutTable, Machine, ProgramTable
from lobewatch.machine.settings.cut_range import MM
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.aging import softening, tolerable_decay
from lobewatch.verdicts.setting import Setting
from lobewatch.verdicts.setting_search import SettingSearch
from lobewatch.verdicts.spindle_at_speed import AT_REST, SpindleAtSpeed
from lobewatch.verdicts.tool_remarks import not_described
from lobewatch.verdicts.verdict import Verdict, Word, is_sure


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
    """Remarks on what the decay rests on, and what would have to be known of the tool."""


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
    search, program = SettingSearch(verdict.program, tool, machine, verdict.at_speed), verdict.program
    remarks = (*remarks, *not_described(program, search.reach.limits))
    elsewhere = search.nearest(program.depth_mm, program.speed_rpm)
    if elsewhere is not None:
        return Advice(elsewhere, None, decay, remarks)
    return Advice(search.best, search.here(program.speed_rpm, program.depth_mm), decay, remarks)


def robust_pockets(
    table: CutTable, assembly: Assembly, machine: Machine, at_speed: SpindleAtSpeed = AT_REST, count: int = 3
) -> list[Setting]:
    """Speeds and depths that would be called stable with depth to spare, the largest removal rate first.

    The speed is the middle of those that are safe now and until it is tapped again. Empty where nothing is safe in the
    range of speeds, or a direction was not tapped or is in question: then nothing is called stable.
    """
    if not is_sure(table, assembly):
        return []
    program = as_cut_program(at_speed.taught(table), assembly.tool, machine)
    return SettingSearch(program, assembly, machine, at_speed).pockets(count)


def as_cut_program(table: CutTable, tool: str, machine: Machine) -> ProgramTable:
    """A cut as a program of a tool, at any speed and depth where it has none: no search rests on them."""
    if isinstance(table, ProgramTable):
        return table
    place: dict[str, Any] = {"speed_rpm": machine.speed.high_rpm, "depth_mm": MM}
    return ProgramTable(**{"name": REFERENCE_CUT, "tool": tool} | msgspec.structs.asdict(table) | place)
