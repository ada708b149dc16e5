"""Evaluate requested cuts: verdicts, recommended settings and unequal pitches."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import msgspec

from acquisition import DataError
from lobes.floquet.program_limit import MAX_PROGRAM_DEPTH_RATIO
from lobewatch.cuts.learning.verdict_at_speed import learn_spindle
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine import ProgramTable
from lobewatch.machine.settings.cut_range import DEPTH_STEP_MM
from lobewatch.machine.settings.requested_cut import (
    build_cut_without_setting,
    build_requested_program,
    find_by_name,
    find_common_speed,
)
from lobewatch.verdicts.pitch_proposal import PitchProposal, propose_pitch
from lobewatch.verdicts.recommendation import Recommendation, recommend
from lobewatch.verdicts.spindle_at_speed import NO_TEST_CUTS
from lobewatch.verdicts.verdict import Verdict


def recommend_requested(logbook: Logbook, said: Mapping[str, Any], name: str | None = None) -> Recommendation:
    """Of the cut that is said (see `build_cut_without_setting`), on all that tap tests and test cuts say of its tool.

    said: its depth_mm is asked for, its speed_rpm is that of now; name: that of its program. ValueError for a cut that
    is none, DataError where there is no tap test.
    """
    machine = logbook.machine
    table, either = build_cut_without_setting(machine, said)
    table = msgspec.structs.replace(table, name=name or table.name)
    logbook.newest_tap()
    now = said.get("speed_rpm") or find_common_speed(machine, table.tool)
    return _recommend_cut(logbook, table, either, said.get("depth_mm"), now)


def recommend_for_program(logbook: Logbook, program: ProgramTable) -> Recommendation:
    """Of a program of machine.toml whose speed or depth is asked for; what it has of both stays."""
    speed, depth = (None if math.isnan(value) else value for value in (program.speed_rpm, program.depth_mm))
    place = {"speed_rpm": speed or logbook.machine.speed.high_rpm, "depth_mm": depth or DEPTH_STEP_MM}
    table = msgspec.structs.replace(program, **place)
    return _recommend_cut(logbook, table, False, depth, speed, is_set=speed is not None)


def _recommend_cut(
    logbook: Logbook,
    table: ProgramTable,
    either: bool,
    depth_mm: float | None,
    now_rpm: float | None,
    is_set: bool = False,
) -> Recommendation:
    machine, tool = logbook.machine, logbook.query(Analysis.assembly_or_reason, table.tool)
    at_speed = NO_TEST_CUTS if isinstance(tool, DataError) else learn_spindle(table, tool, machine, logbook.cuts)
    return recommend(table, tool, machine, at_speed, either, depth_mm, now_rpm, is_set)


class RequestedVerdicts(NamedTuple):
    """Answers to what was asked about."""

    verdicts: list[Verdict]
    """Verdicts on the programs that have a speed and a depth."""
    recommendations: list[Recommendation]
    """Settings of those that have not."""


def evaluate_requested(logbook: Logbook, names: Sequence[str], said: Mapping[str, Any]) -> RequestedVerdicts:
    """Of the cut that is said (see `build_requested_program`), else of the programs of these names, else of all.

    ValueError for a name or a cut that is none, DataError where there is no program or no tap test.
    """
    machine = logbook.machine
    if any(value is not None for value in said.values()):
        if names:
            raise ValueError("--program has its own speed, depth and tool; give either it or the options of a cut")
        asked = build_requested_program(machine, said)
        logbook.newest_tap()
        return RequestedVerdicts([logbook.verdict_for(asked)], [])
    if not machine.all_programs:
        add = "add one for each cut that the shop runs, or give --speed, --depth, --tool and --material"
        raise DataError(f"{logbook.folder.toml}: no [[program]] to check; {add}")
    by_name = {table.name: table for table in machine.all_programs}
    chosen = [find_by_name(by_name, name).name for name in names] or list(by_name)
    logbook.newest_tap()
    wanted = [table for table in machine.incomplete_programs if table.name in chosen]
    is_judged = any(table.name in chosen for table in machine.program)
    verdicts = logbook.verdicts(names=chosen if names else None) if is_judged else []
    return RequestedVerdicts(verdicts, [recommend_for_program(logbook, table) for table in wanted])


def propose_requested_pitch(logbook: Logbook, said: Mapping[str, Any]) -> PitchProposal:
    """Pitches for the cut that is said (see `build_requested_program`), as deep as the tool cuts where no depth is.

    ValueError for what is no cut, DataError where its tool is not known.
    """
    machine, is_deep = logbook.machine, said.get("depth_mm") is None
    table = build_requested_program(machine, {**said, "depth_mm": DEPTH_STEP_MM} if is_deep else said)
    if is_deep:
        name = f"{table.speed_rpm:g} rpm"
        table = msgspec.structs.replace(table, name=name, depth_mm=table.deepest_mm / MAX_PROGRAM_DEPTH_RATIO)
    assembly = logbook.assembly(table.tool)
    return propose_pitch(table, assembly, machine, learn_spindle(table, assembly, machine, logbook.cuts))
