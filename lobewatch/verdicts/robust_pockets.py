"""The pockets of a cut that can be recommended: `lobewatch check` would call each of them stable."""

from __future__ import annotations

import math
from typing import Any

import msgspec

from lobes import program_limit, zero_order
from lobewatch.machine import REFERENCE_CUT, CutTable, Machine, ProgramTable
from lobewatch.tool.assembly import Assembly, speed_grid
from lobewatch.verdicts.doubt import doubt_of
from lobewatch.verdicts.drawn import draw
from lobewatch.verdicts.setting_search import MM, Setting, SettingSearch
from lobewatch.verdicts.spindle_at_speed import AT_REST, SpindleAtSpeed
from lobewatch.verdicts.verdict import as_program

SHARE = 0.5
"""Depth that the search begins with, over the lowest limit of the diagram."""


def robust_pockets(
    table: CutTable, assembly: Assembly, machine: Machine, at_speed: SpindleAtSpeed = AT_REST, count: int = 3
) -> list[Setting]:
    """Speeds and depths that would be called stable with depth to spare, the largest removal rate first.

    The speed is the middle of those that are safe now and until it is tapped again. Empty where nothing is safe in the
    range of speeds, or a direction was not tapped or is in question: then nothing is called stable.
    """
    if not assembly.is_sure:
        return []
    spindle = at_speed.moved(assembly)
    table = _as_program(at_speed.taught(table), spindle, machine)
    program = as_program(table, machine)
    middle = program_limit(program, spindle.x, spindle.y, table.feed_angles)
    doubt = at_speed.doubt or doubt_of(assembly, table, machine)
    drawn = draw(program, middle, table.feed_angles, spindle, doubt)
    return SettingSearch.of(table, drawn, assembly, machine, at_speed).pockets(count)


def _as_program(table: CutTable, assembly: Assembly, machine: Machine) -> ProgramTable:
    """A cut as a program that is surely stable somewhere: in the middle of the range of speeds, not deep."""
    cut, speeds = machine.build_cut(table), machine.speed
    lowest = zero_order(assembly.x, assembly.y, cut, speed_grid(machine)).minimum.depth
    depth = min(max(SHARE * lowest * 1e3, MM), table.deepest_mm)
    place: dict[str, Any] = {"speed_rpm": math.sqrt(speeds.low_rpm * speeds.high_rpm), "depth_mm": depth}
    if isinstance(table, ProgramTable):
        return msgspec.structs.replace(table, **place)
    return ProgramTable(**{"name": REFERENCE_CUT, "tool": assembly.tool} | msgspec.structs.asdict(table) | place)
