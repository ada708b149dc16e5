"""A recommended speed and depth, or why there is none, as a JSON object and as lines for people."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from acquisition import Remark
from lobewatch.machine import ProgramTable
from lobewatch.machine.journal.journal import command
from lobewatch.show.programs.describe_advice import IN_LINES, rpm, setting_json, spare_text, worst_feed
from lobewatch.show.terminal.output import remark_json, remark_lines
from lobewatch.verdicts import Setting
from lobewatch.verdicts.recommendation import Recommendation

UNIT_FEED = 0.1
"""Feed per tooth (mm) that chips are said for where it is not known."""


def recommendation_json(answer: Recommendation, remarks: Sequence[Remark] = ()) -> dict[str, Any]:
    """The recommended setting or the reason; remarks: on the files."""
    program = answer.program
    return {
        "name": program.name,
        "tool": program.tool,
        "material": program.material,
        "teeth": program.teeth,
        "tool_diameter_mm": program.tool_diameter_mm,
        "radial_depth_mm": program.radial_depth_mm,
        "recommended": _recommended_json(answer),
        "reason": answer.reason or None,
        "what_would_change_it": list(answer.cures),
        "alternatives": [{"what": other.what, **_setting_json(other.setting, answer)} for other in answer.alternatives],
        "remarks": [remark_json(remark) for remark in [*remarks, *_notes(answer)]],
    }


def _recommended_json(answer: Recommendation) -> dict[str, Any] | None:
    if answer.setting is None or answer.verdict is None:
        return None
    return _setting_json(answer.setting, answer) | {
        "direction": "either" if answer.either else answer.program.direction,
        "worse_direction": answer.program.direction,
        "feed": answer.program.feed,
        "worst_feed_deg": math.degrees(answer.verdict.feed_angle),
        "verdict": answer.verdict.word,
        "measured": answer.verdict.measured,
        "cuts": answer.verdict.cuts,
        "chance_turning": answer.verdict.chance_turning,
    }


def _setting_json(setting: Setting, answer: Recommendation) -> dict[str, Any]:
    feed = None if answer.feed_mm is None else answer.feed_mm[1]
    return {
        **(setting_json(setting) or {}),
        "cutting_speed_m_min": edge_speed(setting, answer.program),
        "feed_per_tooth_mm": feed,
        "chips_cm3_per_min": math.nan if feed is None else chips(setting, answer.program, feed),
    }


def edge_speed(setting: Setting, program: ProgramTable) -> float:
    """Speed of the edge (m/min)."""
    return math.pi * program.tool_diameter_mm * setting.speed_rpm / 1e3


def chips(setting: Setting, program: ProgramTable, feed_mm: float) -> float:
    """Chips a minute (cm3/min) at a feed per tooth (mm)."""
    area = setting.depth_mm * program.radial_mm[1]
    return area * feed_mm * program.teeth * setting.speed_rpm / 1e3


def recommendation_lines(answer: Recommendation, remarks: Sequence[Remark] = ()) -> list[str]:
    """The answer first, then what it rests on; remarks: on the files."""
    others = [(other.what, other.setting) for other in answer.alternatives]
    return [
        *(_answer(answer) if answer.setting else _none(answer)),
        *(f"{what}: {_place(place, answer)} {spare_text(place)}; {_chips(place, answer)}" for what, place in others),
        *remark_lines([*remarks, *_notes(answer)]),
    ]


def saved_lines(folder: Path, name: str) -> list[str]:
    """Where the setting was saved as a program, and what to do next."""
    return [f"saved in {folder / 'machine.toml'} as program {name!r}", f"next: {command('check', folder)}"]


def _answer(answer: Recommendation) -> Iterator[str]:
    setting, verdict = answer.setting, answer.verdict
    if setting is None or verdict is None:
        return
    way = "up or down" if answer.either and answer.program.immersion < 1 else ""
    predicted = "" if verdict.measured else ", predicted: doubtful until the tool is tapped"
    yield f"{answer.program.name}: {_place(setting, answer)}{f', milled {way}' if way else ''}{predicted}"
    yield f"  {spare_text(setting).strip('()')}"
    yield f"  {_chips(setting, answer)}{worst_feed(verdict)}"
    if verdict.cuts:
        yield f"  as {verdict.cuts} test cut{'s have' if verdict.cuts > 1 else ' has'} taught of the turning spindle"


def _none(answer: Recommendation) -> Iterator[str]:
    yield f"{answer.program.name}: none; {answer.reason}"
    if answer.cures:
        yield f"what would change it: {'; '.join(answer.cures)}"


def _place(setting: Setting, answer: Recommendation) -> str:
    edge = edge_speed(setting, answer.program)
    return f"{rpm(setting.speed_rpm)} rpm ({edge:.0f} m/min), {setting.depth_mm:g} mm deep"


def _chips(setting: Setting, answer: Recommendation) -> str:
    if answer.feed_mm is None:
        return f"{chips(setting, answer.program, UNIT_FEED):.3g} cm3/min for each {UNIT_FEED:g} mm of feed a tooth"
    teeth_per_min = answer.program.teeth * setting.speed_rpm
    texts = [
        (f"{chips(setting, answer.program, feed):.3g}", f"{feed:.3g}", rpm(round(feed * teeth_per_min)))
        for feed in dict.fromkeys(answer.feed_mm)
    ]
    volumes, feeds, speeds = (" to ".join(part) for part in zip(*texts, strict=True))
    return f"{volumes} cm3/min at {feeds} mm a tooth ({speeds} mm/min)"


def _notes(answer: Recommendation) -> list[Remark]:
    """Remarks that are said apart from its lines."""
    return [remark for remark in answer.remarks if remark.code not in IN_LINES]
