"""The speed and the depth that are recommended for a cut, or why none is and what would change that."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import dataclass

import msgspec
import numpy as np

from acquisition import DataError, Remark
from lobewatch.machine import Machine, ProgramTable
from lobewatch.machine.settings.cut_range import MM, CutRange
from lobewatch.machine.settings.setting_questions import questions_of_program
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.setting import Setting
from lobewatch.verdicts.setting_search import SettingSearch
from lobewatch.verdicts.spindle_at_speed import SpindleAtSpeed
from lobewatch.verdicts.tool_remarks import not_described
from lobewatch.verdicts.verdict import Verdict, Word, judge, unanswered

MOST_CHIPS, HERE = "most chips", "deepest at the present speed"
"""What an alternative is good for."""
OTHER_CUT = (
    "a shorter stick-out: tap it again with it",
    "another tool: a thicker one, or with fewer teeth",
    "a smaller radial depth",
)
"""What makes a cut safe that is not, in words."""
SLOWER = ("a smaller diameter", "tool_material and cutting_speed_m_min in its [[tool]], where it bears more")
"""What makes a tool one that the spindle is slow enough for ..."""
FASTER = ("a tool or a holder that may turn faster", "max_speed_rpm in its [[tool]], where it is wrong")
"""... where max_speed_rpm holds it down."""
OTHER_SPEED = ("a speed within that", SLOWER[1])
"""... or where a program is set to run at a speed that it does not bear."""
THIN = 0.1
"""Radial depth over diameter up to which less of it is no advice."""
ITS_OWN = ("speed_rpm", "depth_mm")
"""Keys of a program that do not count where a setting is asked for."""


@dataclass(frozen=True)
class Alternative:
    """A setting beside the recommended one."""

    what: str
    """Name of what it is good for."""
    setting: Setting
    """Speed and depth."""


@dataclass(frozen=True, eq=False)
class Recommendation:
    """An answer to somebody who asks for a speed and a depth."""

    program: ProgramTable
    """Cut that is asked about, as it would stand in machine.toml; at the recommended setting where there is one."""
    either: bool = False
    """Direction left open: it holds for up and down milling, and the program is milled in the worse."""
    setting: Setting | None = None
    """Recommended setting; None where there is none."""
    verdict: Verdict | None = None
    """Verdict on the program at that setting; None where there is none."""
    reason: str = ""
    """Reason why there is none."""
    cures: tuple[str, ...] = ()
    """Measures that would change that."""
    alternatives: tuple[Alternative, ...] = ()
    """Settings beside it, two at most."""
    feed_mm: tuple[float, float] | None = None
    """Least and greatest feed per tooth (mm): its own, else what the tool bears; None where neither is known."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on what it rests on, and on what is not known of the tool."""


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
    """The setting of most chips, at a depth where one is asked for; it would be called stable when it is entered.

    table: the cut, whose own speed and depth do not count; either: it may be milled up or down, the worse counts;
    present_rpm: speed that it runs at now, where that is known; is_set: it shall run at no other.
    """
    if isinstance(tool, DataError):
        tap = f"tap it: lobewatch tap MACHINE --tool {shlex.quote(table.tool)}"
        return Recommendation(table, either, reason=str(tool), cures=(tap,))
    if gap := _gap(table, tool, machine):
        return Recommendation(table, either, reason=gap[0], cures=gap[1:])
    if too_fast := _too_fast(CutRange.of(machine, table)):
        return Recommendation(table, either, reason=too_fast[0], cures=too_fast[1:])
    search = SettingSearch(at_speed.taught(table), tool, machine, at_speed, either)
    if is_set and present_rpm is not None:
        setting = search.here(present_rpm, search.reach.deepest_mm)
    else:
        setting = search.best if depth_mm is None else search.fastest(depth_mm)
    others = tuple(_alternatives(search, setting, present_rpm))
    if setting is None:
        reason, cures = _no_safe(search, depth_mm, present_rpm if is_set else None)
        feed = _feed(search, table)
        return Recommendation(table, either, reason=reason, cures=cures, alternatives=others, feed_mm=feed)
    return _entered(search, table, setting, others)


def _gap(table: ProgramTable, tool: Assembly, machine: Machine) -> tuple[str, ...]:
    """Why nothing can be called safe at any speed and depth, and what to do; empty where it can be."""
    asked = questions_of_program(machine, table, tool.predicted or machine.tap.position_mm > 0)
    asked = [doubted for doubted in asked if doubted.key not in ITS_OWN]
    if asked:
        return ("; ".join(f"{doubted.claim} {doubted.why}" for doubted in asked), asked[0].remark.cure)
    return unanswered(table, tool) or ()


def _too_fast(reach: CutRange) -> tuple[str, ...]:
    """Why no speed of the spindle is one that the tool bears, and what would change it; empty where one is."""
    speed, limits = reach.machine.speed, reach.limits
    if not reach.is_empty:
        return ()
    edge = limits.cutting_speed_m_min
    edge_text = "" if edge is None else f" ({edge.high:.0f} m/min at its edge)"
    why, cures = (" (its max_speed_rpm)", FASTER) if limits.is_capped else (edge_text, SLOWER)
    slowest = f"and the spindle turns no slower than {speed.low_rpm:g} rpm"
    return (f"the tool bears no more than {reach.high_rpm:g} rpm{why}, {slowest}", *cures)


def _entered(
    search: SettingSearch, table: ProgramTable, setting: Setting, others: tuple[Alternative, ...]
) -> Recommendation:
    """The setting as a program, with the verdict that it has then: nothing is recommended that is refused."""
    judgement = search.judged[setting.speed_rpm, setting.depth_mm]
    at = {"speed_rpm": setting.speed_rpm, "depth_mm": setting.depth_mm, "direction": judgement.draws.cuts[0].direction}
    program = msgspec.structs.replace(table, **at)
    verdict = judge(program, search.assembly, search.machine, search.at_speed, judgement)
    if verdict.word is not Word.STABLE or verdict.is_beyond_drive:
        reason = "; ".join(str(remark) for remark in verdict.remarks) or verdict.word.value
        return Recommendation(table, search.either, reason=reason, alternatives=others)
    remarks = (*verdict.remarks, *not_described(table, search.reach.limits))
    return Recommendation(program, search.either, setting, verdict, "", (), others, _feed(search, table), remarks)


def _feed(search: SettingSearch, table: ProgramTable) -> tuple[float, float] | None:
    """Least and greatest feed per tooth (mm): its own, else what the tool bears; None where neither is known."""
    own, borne = table.feed_per_tooth_mm, search.reach.limits.feed_per_tooth_mm
    return (own, own) if own is not None else None if borne is None else (borne.low, borne.high)


def _alternatives(search: SettingSearch, setting: Setting | None, present_rpm: float | None) -> Iterator[Alternative]:
    places = {(setting.speed_rpm, setting.depth_mm)} if setting else set[tuple[float, float]]()
    wanted = {MOST_CHIPS: search.best}
    if present_rpm is not None:
        wanted[HERE] = search.here(present_rpm, search.reach.deepest_mm)
    for what, other in wanted.items():
        if other is not None and (place := (other.speed_rpm, other.depth_mm)) not in places:
            places.add(place)
            yield Alternative(what, other)


def _no_safe(search: SettingSearch, depth_mm: float | None, set_rpm: float | None) -> tuple[str, tuple[str, ...]]:
    """What there is not, and what would change that."""
    if set_rpm is not None and not search.reach.low_rpm <= set_rpm <= search.reach.high_rpm:
        return f"{set_rpm:g} rpm is outside {search.reach.words}", OTHER_SPEED
    if set_rpm is not None:
        return f"no safe depth at {set_rpm:g} rpm", _cures(search, depth_mm)
    named = "speed and depth" if depth_mm is None else f"speed for {depth_mm:g} mm"
    return f"no safe {named} in {search.reach.words}", _cures(search, depth_mm)


def _cures(search: SettingSearch, depth_mm: float | None) -> tuple[str, ...]:
    """What would make it safe: what settles the doubt first, where that alone stands in the way."""
    likely = search.likely
    speed = float(likely.speeds[int(np.argmax(likely.depths))])
    probe = msgspec.structs.replace(search.table, speed_rpm=speed, depth_mm=depth_mm or MM)
    verdict = judge(probe, search.assembly, search.machine, search.at_speed)
    settles = [remark.cure for remark in verdict.remarks if remark.code == "doubt-decides"]
    return (*settles, *(OTHER_CUT if search.table.immersion > THIN else OTHER_CUT[:2]))
