"""Evaluate requested cuts: verdicts, recommended settings and unequal pitches."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import msgspec

from acquisition import DataError, Remark
from lobes.floquet.program_limit import MAX_PROGRAM_DEPTH_RATIO
from lobewatch.cuts.learning.program_learning import learn_spindle
from lobewatch.cuts.learning.verdict_by_sound import evaluate_by_sound, find_deciding_cuts
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.heard_cuts import is_tool_untapped, is_untapped
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine import ProgramTable
from lobewatch.machine.journal.entries import POWER_READING
from lobewatch.machine.settings import requested_cut
from lobewatch.machine.settings.drive_power import DEPTH_STEP_MM
from lobewatch.verdicts.pitch_proposal import PitchProposal, propose_pitch
from lobewatch.verdicts.program_case import NO_TEST_CUTS
from lobewatch.verdicts.recommendation import Recommendation, recommend
from lobewatch.verdicts.verdict import Verdict


def recommend_requested(logbook: Logbook, cut: Mapping[str, Any], name: str | None = None) -> Recommendation:
    """Recommend a setting for a cut, from all tap tests and test cuts of its tool.

    The cut is that of `build_cut_without_setting`: its depth_mm is kept, and its speed_rpm is the present speed. The
    recommended program gets the name. ValueError for an invalid cut, DataError without a tap test.
    """
    machine = logbook.machine
    requested = requested_cut.build_cut_without_setting(machine, cut)
    table = msgspec.structs.replace(requested.table, name=name or requested.table.name)
    logbook.newest_tap()
    speed = cut.get("speed_rpm") or requested_cut.find_common_speed(machine, table.tool)
    answer = _recommend_cut(logbook, table, requested.is_any_direction, cut.get("depth_mm"), speed)
    remarks = [_reference_remark(table, cut)] if requested.is_reference else []
    return replace(answer, remarks=(*answer.remarks, *remarks))


def _reference_remark(table: ProgramTable, cut: Mapping[str, Any]) -> Remark:
    """Return what the cut has from [reference_cut]."""
    material = f"material {table.material}" if table.material else "cutting-force coefficients"
    direction = "" if cut.get("direction") else f" and the direction ({table.direction} milling)"
    cure = "Give ProgramTable.material and ProgramTable.direction for another cut"
    return Remark("from-reference-cut", "", f"{material}{direction} taken from [reference_cut]", cure)


def _recommend_for_program(logbook: Logbook, program: ProgramTable) -> Recommendation:
    """Recommend the missing speed or depth of a program."""
    speed, depth = (None if math.isnan(value) else value for value in (program.speed_rpm, program.depth_mm))
    setting = {"speed_rpm": speed or logbook.machine.speed.high_rpm, "depth_mm": depth or DEPTH_STEP_MM}
    table = msgspec.structs.replace(program, **setting)
    return _recommend_cut(logbook, table, False, depth, speed, is_speed_fixed=speed is not None)


def _recommend_cut(
    logbook: Logbook,
    table: ProgramTable,
    either: bool,
    depth_mm: float | None,
    speed_rpm: float | None,
    is_speed_fixed: bool = False,
) -> Recommendation:
    machine, tool = logbook.machine, logbook.query(Analysis.assembly_or_reason, table.tool)
    at_speed = NO_TEST_CUTS if isinstance(tool, DataError) else learn_spindle(table, tool, machine, logbook.cuts)
    return recommend(table, tool, machine, at_speed, either, depth_mm, speed_rpm, is_speed_fixed)


class RequestedVerdicts(NamedTuple):
    """Verdicts on requested programs, and recommendations for those that are incomplete."""

    verdicts: list[Verdict]
    """Verdicts on programs with a speed and a depth."""
    recommendations: list[Recommendation]
    """Recommended settings of the other programs."""


def evaluate_requested(logbook: Logbook, names: Sequence[str], cut: Mapping[str, Any]) -> RequestedVerdicts:
    """Evaluate a requested cut (see `build_requested_program`), else the named programs, else all programs.

    Test cuts decide on a tool without a tap test. ValueError for an unknown name or an invalid cut, DataError
    without a program.
    """
    machine = logbook.machine
    if any(value is not None for value in cut.values()):
        if names:
            cure = "Give either evaluate_requested.names or the options of a cut."
            raise ValueError(f"evaluate_requested.names already sets speed, depth and tool. {cure}")
        requested = requested_cut.build_requested_program(machine, cut)
        return RequestedVerdicts(_evaluate_untapped(logbook, [logbook.verdict_for(requested)]), [])
    if not machine.all_programs:
        fields = "ProgramTable.speed_rpm, ProgramTable.depth_mm, ProgramTable.tool and ProgramTable.material"
        text = f"no [[program]] to check. Add a [[program]] for each of your cuts, or give {fields}."
        raise DataError(f"{logbook.folder.toml}: {text}")
    by_name = {table.name: table for table in machine.all_programs}
    chosen = [requested_cut.find_by_name(by_name, name).name for name in names] or list(by_name)
    incomplete = [table for table in machine.all_programs if table.is_incomplete and table.name in chosen]
    has_complete = any(table.name in chosen for table in machine.program)
    verdicts = logbook.verdicts(names=chosen if names else None) if has_complete else []
    verdicts = [_mention_cuts_without_verdict(logbook, verdict) for verdict in _evaluate_untapped(logbook, verdicts)]
    return RequestedVerdicts(verdicts, [_recommend_for_program(logbook, table) for table in incomplete])


def _evaluate_untapped(logbook: Logbook, verdicts: list[Verdict]) -> list[Verdict]:
    """Return the verdicts, by test cuts only for tools without a tap test that have some, or without any tap test."""
    machine, cuts, since = logbook.machine, logbook.cuts, logbook.files.baseline

    def needs_cuts(program: ProgramTable) -> bool:
        if is_untapped(logbook):
            return True
        return is_tool_untapped(logbook, program.tool) and bool(find_deciding_cuts(program, machine, cuts, since))

    return [
        evaluate_by_sound(verdict, machine, cuts, since) if needs_cuts(verdict.program) else verdict
        for verdict in verdicts
    ]


def _mention_cuts_without_verdict(logbook: Logbook, verdict: Verdict) -> Verdict:
    """Add a remark on the recorded cuts of a program, or reference cuts of its tool, that have no verdict."""
    since, program = logbook.files.baseline, verdict.program
    found = [
        f"{cut.id} ({cut.reason})"
        for cut in logbook.files.contents.cuts
        if cut.word == "cannot tell"
        and cut.reason != POWER_READING
        and not cut.excluded
        and (since is None or cut.at >= since)
        if cut.tool == program.tool and cut.program in (program.name, None)
    ]
    if not found:
        return verdict
    text = f"test cuts without a verdict do not count: {', '.join(found)}"
    remark = Remark("cuts-without-verdict", program.name, text, "Record these cuts again")
    return replace(verdict, remarks=(*verdict.remarks, remark))


def propose_requested_pitch(logbook: Logbook, cut: Mapping[str, Any]) -> PitchProposal:
    """Propose unequal pitches for a cut (see `build_requested_program`), at the largest depth if it has none.

    ValueError for an invalid cut, DataError if its tool was not tapped.
    """
    machine, is_deep = logbook.machine, cut.get("depth_mm") is None
    table = requested_cut.build_requested_program(machine, {**cut, "depth_mm": DEPTH_STEP_MM} if is_deep else cut)
    if is_deep:
        name = f"{table.speed_rpm:g} rpm"
        table = msgspec.structs.replace(table, name=name, depth_mm=table.deepest_mm / MAX_PROGRAM_DEPTH_RATIO)
    assembly = logbook.assembly(table.tool)
    return propose_pitch(table, assembly, machine, learn_spindle(table, assembly, machine, logbook.cuts))
