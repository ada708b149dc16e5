"""The speed and depth that are recommended for a cut that somebody asks about."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import msgspec

from acquisition import DataError
from lobewatch.cuts.learning.at_speed import spindle_at_speed
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine import ProgramTable
from lobewatch.machine.settings.asked_cut import present_speed, wanted_cut
from lobewatch.machine.settings.cut_range import MM
from lobewatch.verdicts.recommendation import Recommendation, recommend
from lobewatch.verdicts.spindle_at_speed import AT_REST


def recommended(logbook: Logbook, said: Mapping[str, Any], name: str | None = None) -> Recommendation:
    """Of the cut that is said (see `wanted_cut`), on all that tap tests and test cuts say of its tool.

    said: its depth_mm is asked for, its speed_rpm is that of now; name: that of its program. ValueError for a cut that
    is none, DataError where there is no tap test.
    """
    machine = logbook.machine
    table, either = wanted_cut(machine, said)
    table = msgspec.structs.replace(table, name=name or table.name)
    logbook.newest()
    now = said.get("speed_rpm") or present_speed(machine, table.tool)
    return _recommended(logbook, table, either, said.get("depth_mm"), now)


def recommended_program(logbook: Logbook, program: ProgramTable) -> Recommendation:
    """Of a program of machine.toml whose speed or depth is asked for; what it has of both stays."""
    speed, depth = (None if math.isnan(value) else value for value in (program.speed_rpm, program.depth_mm))
    place = {"speed_rpm": speed or logbook.machine.speed.high_rpm, "depth_mm": depth or MM}
    table = msgspec.structs.replace(program, **place)
    return _recommended(logbook, table, False, depth, speed, is_set=speed is not None)


def _recommended(
    logbook: Logbook,
    table: ProgramTable,
    either: bool,
    depth_mm: float | None,
    now_rpm: float | None,
    is_set: bool = False,
) -> Recommendation:
    machine, tool = logbook.machine, logbook.ask(Analysis.assembly_or_reason, table.tool)
    at_speed = AT_REST if isinstance(tool, DataError) else spindle_at_speed(table, tool, machine, logbook.cuts)
    return recommend(table, tool, machine, at_speed, either, depth_mm, now_rpm, is_set)
