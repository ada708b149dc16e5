"""Recommend settings for a program or a cut, or say why there are none."""

import math
import shlex
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np

from acquisition import DataError, Remark
from acquisition.errors import join_sentences
from lobewatch.machine import REFERENCE_CUT, CutTable, Machine, ProgramTable
from lobewatch.machine.settings.display_units import CUTTING_SPEED, LENGTH
from lobewatch.machine.settings.drive_power import DEPTH_STEP_MM, CutRange
from lobewatch.machine.settings.setting_questions import find_program_questions
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.program_case import NO_TEST_CUTS, ProgramCase, SpindleAtSpeed
from lobewatch.verdicts.program_remarks import missing_tool_remarks
from lobewatch.verdicts.setting_robustness import Setting, find_tolerable_drop, model_softening
from lobewatch.verdicts.setting_search import SettingSearch
from lobewatch.verdicts.verdict import Stability, Verdict, evaluate_program, find_open_question, is_compliance_known


@dataclass(frozen=True)
class Advice:
    """Settings to use instead of a program, and how far its frequency can drop."""

    best: Setting | None = None
    """Recommended setting: the nearest speed window at the depth of the program, else the largest removal rate. None
    if the program is stable or there is no safe setting."""
    deepest_here: Setting | None = None
    """Deepest cut at the program's own speed, where `best` has another depth."""
    tolerable_drop: float = math.nan
    """Tolerable relative frequency drop in the median estimate; 0 if not stable now, inf if stable down to 80 %, NaN
    if not evaluated."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on the assumptions of the frequency drop, and on missing tool data."""


def advise(verdict: Verdict, machine: Machine) -> Advice:
    """Advise on a program: settings to use instead, and the tolerable frequency drop.

    Parameters
    ----------
    verdict
        Verdict on the program.
    machine
        Machine with its speeds, drive and tap interval.

    Returns
    -------
    Advice
        Advice; empty if the verdict is unknown.
    """
    tool, samples = verdict.assembly, verdict.samples
    if tool is None or samples is None:
        return Advice()
    stiffness_at, remark = model_softening(tool)
    decay = find_tolerable_drop(samples, verdict.program.depth_mm / 1e3, stiffness_at) if verdict.is_stable else 0.0
    remarks = (remark,) if verdict.is_stable else ()
    if verdict.stability is Stability.STABLE or not is_compliance_known(verdict.program, tool):
        return Advice(tolerable_drop=decay, remarks=remarks)
    search, program = SettingSearch(ProgramCase(verdict.program, tool, machine, verdict.at_speed)), verdict.program
    remarks = (*remarks, *missing_tool_remarks(program, search.cut_range.limits))
    elsewhere = search.nearest_window(program.depth_mm, program.speed_rpm)
    if elsewhere is not None:
        return Advice(elsewhere, None, decay, remarks)
    return Advice(search.best, search.deepest_at(program.speed_rpm, program.depth_mm), decay, remarks)


def find_stable_pockets(
    table: CutTable, assembly: Assembly, machine: Machine, at_speed: SpindleAtSpeed = NO_TEST_CUTS, count: int = 3
) -> list[Setting]:
    """Find settings that would be called stable with depth to spare, the largest removal rate first.

    Parameters
    ----------
    table
        Program or reference cut; its own speed and depth do not count.
    assembly
        Tool as tapped.
    machine
        Machine with its speeds, drive and tap interval.
    at_speed
        Spindle at speed, as learned from test cuts.
    count
        Largest number of settings.

    Returns
    -------
    list of Setting
        Settings in different stable pockets; empty if none is stable, a direction was not tapped or is in question.
    """
    if not is_compliance_known(table, assembly):
        return []
    program = at_speed.apply_coefficients(table)
    if not isinstance(program, ProgramTable):
        place: dict[str, Any] = {"speed_rpm": machine.speed.high_rpm, "depth_mm": DEPTH_STEP_MM}
        named = {"name": REFERENCE_CUT, "tool": assembly.tool}
        program = ProgramTable(**named | msgspec.structs.asdict(program) | place)
    return SettingSearch(ProgramCase(program, assembly, machine, at_speed)).pockets(count)


MAX_REMOVAL_LABEL, PRESENT_SPEED_LABEL = "most chips", "deepest at the present speed"
"""Labels of alternative settings by their advantage."""
NEW_TOOL_REMEDIES = "Use a shorter stick-out and tap again", "Use a thicker tool or one with fewer flutes"
CUT_REMEDIES = (*NEW_TOOL_REMEDIES, "Reduce the radial depth")
"""Measures that make an unsafe cut safe, for verdicts."""
TOOL_DATA_REMEDY = "Set tool_material and cutting_speed_m_min in the [[tool]] if the tool allows other speeds"
SLOWER_SPINDLE_REMEDY = "Reduce low_rpm in [speed] if the spindle can run slower"
TOOL_SPEED_REMEDIES = ("Use a smaller diameter", SLOWER_SPINDLE_REMEDY, TOOL_DATA_REMEDY)
"""Measures if the spindle is too fast for the tool."""
MAX_SPEED_REMEDIES = ("Use a tool or holder with a higher speed limit", "Correct max_speed_rpm in the [[tool]]")
"""Measures if max_speed_rpm limits the speed."""
FIXED_SPEED_REMEDIES = ("Choose a speed in the allowed range", TOOL_DATA_REMEDY)
"""Measures if a program runs at a speed outside the tool limits."""
THIN_CUT_IMMERSION = 0.1
"""Immersion up to which a smaller radial depth is not recommended (-)."""
REQUESTED_KEYS = ("speed_rpm", "depth_mm")
"""Keys of a program that are ignored if a setting is requested."""


@dataclass(frozen=True, eq=False)
class Recommendation:
    """Answer to a request for speed and depth."""

    program: ProgramTable
    """Requested cut as in machine.toml; at the recommended setting if there is one."""
    any_direction: bool = False
    """True if the milling direction is open: valid for up and down milling, evaluated for the worse."""
    setting: Setting | None = None
    """Recommended setting; None if there is none."""
    verdict: Verdict | None = None
    """Verdict on the program at that setting; None without a setting."""
    reason: str = ""
    """Reason why there is no setting."""
    remedies: tuple[str, ...] = ()
    """Measures that would allow one."""
    alternatives: tuple[tuple[str, Setting], ...] = ()
    """Alternative settings with the label of their advantage, at most two."""
    feed_mm: tuple[float, float] | None = None
    """Smallest and largest feed per tooth (mm): that of the program, else the tool limits; None if unknown."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on assumptions and on the uncertainty of the tool."""


def recommend(
    table: ProgramTable,
    tool: Assembly | DataError,
    machine: Machine,
    at_speed: SpindleAtSpeed,
    either: bool = False,
    depth_mm: float | None = None,
    present_rpm: float | None = None,
    is_set: bool = False,
) -> Recommendation:
    """Recommend the setting of the largest removal rate, at a given depth if there is one.

    table: the cut, whose own speed and depth do not count; either: it may be milled up or down, the worse counts;
    present_rpm: speed that it runs at now, where that is known; is_set: it shall run at no other.
    """
    if isinstance(tool, DataError):
        tap = f"Run TapSession.run MACHINE Circumstances.tool {shlex.quote(table.tool)}"
        return Recommendation(table, either, reason=str(tool), remedies=(tap,))
    if gap := _find_gap(table, tool, machine) or _find_speed_conflict(CutRange.of(machine, table)):
        return Recommendation(table, either, reason=gap[0], remedies=gap[1:])
    search = SettingSearch(ProgramCase(at_speed.apply_coefficients(table), tool, machine, at_speed, either))
    if is_set and present_rpm is not None:
        setting = search.deepest_at(present_rpm, search.cut_range.deepest_mm)
    else:
        setting = search.best if depth_mm is None else search.nearest_window(depth_mm, search.cut_range.high_rpm)
    others = tuple(_list_alternatives(search, setting, present_rpm))
    if setting is None:
        reason, cures = _explain_gap(search, depth_mm, present_rpm if is_set else None)
        feed = _feed_range(search, table)
        return Recommendation(table, either, reason=reason, remedies=cures, alternatives=others, feed_mm=feed)
    return replace(_recommend_setting(search, table, setting), alternatives=others)


def _find_gap(table: ProgramTable, tool: Assembly, machine: Machine) -> tuple[str, ...]:
    """Return why nothing can be called stable at any setting, and the remedies; empty if it can."""
    asked = find_program_questions(machine, table, tool.predicted or machine.tap.position_mm > 0)
    asked = [doubted for doubted in asked if doubted.key not in REQUESTED_KEYS]
    if asked:
        return (join_sentences(*(f"{doubted.statement} {doubted.reason}" for doubted in asked)), asked[0].remark.cure)
    return find_open_question(table, tool) or ()


def _find_speed_conflict(reach: CutRange) -> tuple[str, ...]:
    """Return why no spindle speed is within the tool limits, and the remedies; empty if one is."""
    speed, limits = reach.machine.speed, reach.limits
    if not reach.is_empty:
        return ()
    edge = limits.cutting_speed_m_min
    edge_text = "" if edge is None else f" ({CUTTING_SPEED.text(edge.high, '.0f')})"
    is_capped = limits.high_rpm == limits.tool.max_speed_rpm
    why, cures = (" (max_speed_rpm)", MAX_SPEED_REMEDIES) if is_capped else (edge_text, TOOL_SPEED_REMEDIES)
    text = f"the tool limit is {reach.high_rpm:g} rpm{why}, below the lowest spindle speed of {speed.low_rpm:g} rpm"
    return (text, *cures)


def _recommend_setting(search: SettingSearch, table: ProgramTable, setting: Setting) -> Recommendation:
    """Build the recommendation of a setting, evaluated as a program."""
    case, (speed, depth) = search.case, (setting.speed_rpm, setting.depth_mm)
    result = search.results[speed, depth]
    milled = result.samples.cuts[0].direction
    program = msgspec.structs.replace(table, speed_rpm=speed, depth_mm=depth, direction=milled)
    verdict = evaluate_program(program, case.assembly, case.machine, case.at_speed, result)
    if verdict.stability is not Stability.STABLE or verdict.is_beyond_drive:
        reason = join_sentences(*map(str, verdict.remarks)) or verdict.stability.value
        return Recommendation(table, case.any_direction, reason=reason)
    remarks = (*verdict.remarks, *missing_tool_remarks(table, search.cut_range.limits))
    feed = _feed_range(search, table)
    return Recommendation(program, case.any_direction, setting, verdict, feed_mm=feed, remarks=remarks)


def _feed_range(search: SettingSearch, table: ProgramTable) -> tuple[float, float] | None:
    """Return the range of feed per tooth (mm): of the program, else of the tool, else None."""
    own, borne = table.feed_per_tooth_mm, search.cut_range.limits.feed_per_tooth_mm
    return (own, own) if own is not None else None if borne is None else (borne.low, borne.high)


def _list_alternatives(search: SettingSearch, best: Setting | None, rpm: float | None) -> Iterator[tuple[str, Setting]]:
    places = {(best.speed_rpm, best.depth_mm)} if best else set[tuple[float, float]]()
    wanted = {MAX_REMOVAL_LABEL: search.best}
    if rpm is not None:
        wanted[PRESENT_SPEED_LABEL] = search.deepest_at(rpm, search.cut_range.deepest_mm)
    for what, other in wanted.items():
        if other is not None and (place := (other.speed_rpm, other.depth_mm)) not in places:
            places.add(place)
            yield what, other


def _explain_gap(search: SettingSearch, depth_mm: float | None, set_rpm: float | None) -> tuple[str, tuple[str, ...]]:
    """Explain why there is no setting, with remedies, that of the decisive uncertainty first."""
    reach = search.cut_range
    if set_rpm is not None and not reach.low_rpm <= set_rpm <= reach.high_rpm:
        return f"{set_rpm:g} rpm is outside {reach.text}", FIXED_SPEED_REMEDIES
    named = "speed and depth" if depth_mm is None else f"speed for {LENGTH.text(depth_mm)}"
    reason = f"no stable {named} in {reach.text}" if set_rpm is None else f"no stable depth at {set_rpm:g} rpm"
    likely = search.likely_depths
    speed = float(likely.speeds[int(np.argmax(likely.depths))])
    probe = search.case.with_changes(speed_rpm=speed, depth_mm=depth_mm or DEPTH_STEP_MM)
    verdict = evaluate_program(probe.table, probe.assembly, probe.machine, probe.at_speed)
    settles = [remark.cure for remark in verdict.remarks if remark.code == "doubt-decides"]
    return reason, (
        *settles,
        *(CUT_REMEDIES if probe.table.immersion > THIN_CUT_IMMERSION else NEW_TOOL_REMEDIES),
    )
