"""Show recommended speeds and depths, and unequal pitches."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

from rich.table import Table

from acquisition import Remark
from lobes.floquet.program_limit import MAX_PROGRAM_DEPTH_RATIO
from lobewatch.machine import ProgramTable
from lobewatch.machine.journal.journal import format_command
from lobewatch.show.programs.advice import LINE_REMARK_CODES, format_rpm, robustness_text, setting_json, worst_feed_text
from lobewatch.show.terminal.output import MIN_COLUMN_WIDTH, new_table, remark_json, remark_lines
from lobewatch.verdicts import Setting
from lobewatch.verdicts.pitch_proposal import MIN_PITCH_GAIN, PitchEvaluation, PitchProposal
from lobewatch.verdicts.recommendation import Recommendation

UNIT_FEED_MM = 0.1
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
        "what_would_change_it": list(answer.remedies),
        "alternatives": [
            {"what": other.label, **_setting_with_feed_json(other.setting, answer)} for other in answer.alternatives
        ],
        "remarks": [remark_json(remark) for remark in [*remarks, *_other_remarks(answer)]],
    }


def _recommended_json(answer: Recommendation) -> dict[str, Any] | None:
    if answer.setting is None or answer.verdict is None:
        return None
    return _setting_with_feed_json(answer.setting, answer) | {
        "direction": "either" if answer.any_direction else answer.program.direction,
        "worse_direction": answer.program.direction,
        "feed": answer.program.feed,
        "worst_feed_deg": math.degrees(answer.verdict.feed_angle),
        "verdict": answer.verdict.stability,
        "measured": answer.verdict.is_measured,
        "cuts": answer.verdict.n_cuts,
        "chance_turning": answer.verdict.chatter_risk,
    }


def _setting_with_feed_json(setting: Setting, answer: Recommendation) -> dict[str, Any]:
    feed = None if answer.feed_mm is None else answer.feed_mm[1]
    return {
        **(setting_json(setting) or {}),
        "cutting_speed_m_min": cutting_speed(setting, answer.program),
        "feed_per_tooth_mm": feed,
        "chips_cm3_per_min": math.nan if feed is None else removal_rate(setting, answer.program, feed),
    }


def cutting_speed(setting: Setting, program: ProgramTable) -> float:
    """Speed of the edge (m/min)."""
    return math.pi * program.tool_diameter_mm * setting.speed_rpm / 1e3


def removal_rate(setting: Setting, program: ProgramTable, feed_mm: float) -> float:
    """Chips a minute (cm3/min) at a feed per tooth (mm)."""
    area = setting.depth_mm * program.radial_mm[1]
    return area * feed_mm * program.teeth * setting.speed_rpm / 1e3


def recommendation_lines(answer: Recommendation, remarks: Sequence[Remark] = ()) -> list[str]:
    """The answer first, then what it rests on; remarks: on the files."""
    others = [(other.label, other.setting) for other in answer.alternatives]
    return [
        *(_recommended_lines(answer) if answer.setting else _no_setting_lines(answer)),
        *(
            f"{what}: {_setting_text(place, answer)} {robustness_text(place)}; {_removal_rate_text(place, answer)}"
            for what, place in others
        ),
        *remark_lines([*remarks, *_other_remarks(answer)]),
    ]


def saved_lines(folder: Path, name: str) -> list[str]:
    """Where the setting was saved as a program, and what to do next."""
    return [f"saved in {folder / 'machine.toml'} as program {name!r}", f"next: {format_command('check', folder)}"]


def _recommended_lines(answer: Recommendation) -> Iterator[str]:
    setting, verdict = answer.setting, answer.verdict
    if setting is None or verdict is None:
        return
    way = "up or down" if answer.any_direction and answer.program.immersion < 1 else ""
    predicted = "" if verdict.is_measured else ", predicted: doubtful until the tool is tapped"
    yield f"{answer.program.name}: {_setting_text(setting, answer)}{f', milled {way}' if way else ''}{predicted}"
    yield f"  {robustness_text(setting).strip('()')}"
    yield f"  {_removal_rate_text(setting, answer)}{worst_feed_text(verdict)}"
    if verdict.n_cuts:
        yield f"  as {verdict.n_cuts} test cut{'s have' if verdict.n_cuts > 1 else ' has'} taught of the turning spindle"


def _no_setting_lines(answer: Recommendation) -> Iterator[str]:
    yield f"{answer.program.name}: none; {answer.reason}"
    if answer.remedies:
        yield f"what would change it: {'; '.join(answer.remedies)}"


def _setting_text(setting: Setting, answer: Recommendation) -> str:
    edge = cutting_speed(setting, answer.program)
    return f"{format_rpm(setting.speed_rpm)} rpm ({edge:.0f} m/min), {setting.depth_mm:g} mm deep"


def _removal_rate_text(setting: Setting, answer: Recommendation) -> str:
    if answer.feed_mm is None:
        return f"{removal_rate(setting, answer.program, UNIT_FEED_MM):.3g} cm3/min for each {UNIT_FEED_MM:g} mm of feed a tooth"
    teeth_per_min = answer.program.teeth * setting.speed_rpm
    texts = [
        (f"{removal_rate(setting, answer.program, feed):.3g}", f"{feed:.3g}", format_rpm(round(feed * teeth_per_min)))
        for feed in dict.fromkeys(answer.feed_mm)
    ]
    volumes, feeds, speeds = (" to ".join(part) for part in zip(*texts, strict=True))
    return f"{volumes} cm3/min at {feeds} mm a tooth ({speeds} mm/min)"


def _other_remarks(answer: Recommendation) -> list[Remark]:
    """Remarks that are said apart from its lines."""
    return [remark for remark in answer.remarks if remark.code not in LINE_REMARK_CODES]


HIDDEN_PITCH_CODES = ("doubt-decides",)
"""Remarks on the word, which is not said here."""


def pitches_json(proposal: PitchProposal, remarks: Sequence[Remark], depth_mm: float | None) -> dict[str, Any]:
    """Equal pitch, the patterns, and which of them is proposed; remarks: on the files."""
    program, proposed = proposal.verdict.program, proposal.proposed
    return {
        "tool": program.tool,
        "teeth": program.teeth,
        "speed_rpm": program.speed_rpm,
        "depth_mm": depth_mm,
        "equal_is_as_good": proposed is None,
        "proposed_deg": None if proposed is None else proposed.pattern.pitch_deg,
        "half_wave_deg": proposal.half_wave_deg,
        "chatter_frequency_hz": proposal.verdict.chatter_frequency,
        "equal": _pitch_json(proposal.equal, depth_mm),
        "unequal": [_pitch_json(judged, depth_mm) for judged in proposal.unequal],
        "remarks": [remark_json(remark) for remark in _pitch_remarks(proposal, remarks)],
    }


def _pitch_json(judged: PitchEvaluation, depth_mm: float | None) -> dict[str, Any]:
    least, most = judged.pattern.feed_ratio_range
    return {
        "pitch_deg": judged.pattern.pitch_deg,
        "pattern": judged.pattern.name,
        "limit_mm": 1e3 * judged.limit,
        "limit_low_mm": 1e3 * judged.low,
        "limit_high_mm": 1e3 * judged.high,
        "gain": judged.gain,
        "gain_low": judged.gain_low,
        "gain_high": judged.gain_high,
        "share_worse": judged.share_worse,
        "least_chip": least,
        "largest_chip": most,
        "verdict": None if depth_mm is None else judged.stability,
        "off_centre": judged.pattern.imbalance,
    }


def pitches_texts(proposal: PitchProposal, remarks: Sequence[Remark], depth_mm: float | None) -> list[str | Table]:
    """The patterns for people, and what to have ground; depth_mm: the one that was asked about."""
    return [
        _pitches_table(proposal, depth_mm),
        *_proposal_lines(proposal),
        *remark_lines(_pitch_remarks(proposal, remarks)),
    ]


def _pitch_remarks(proposal: PitchProposal, remarks: Sequence[Remark]) -> list[Remark]:
    return [*remarks, *(remark for remark in proposal.verdict.remarks if remark.code not in HIDDEN_PITCH_CODES)]


def _pitches_table(proposal: PitchProposal, depth_mm: float | None) -> Table:
    """Each pattern in as many lines as its angles need, two at least, equal pitch first."""
    words = [] if depth_mm is None else [f"<at {depth_mm:g} mm"]
    heads = "<pitch\n(deg)", "<pattern", "limit (mm)\nlow..high", "over\nequal", "largest\nchip", "off\naxis"
    rows = new_table(*heads, *words)
    for judged in (proposal.equal, *proposal.unequal):
        columns = [*_pitch_columns(judged, judged is proposal.equal), *([[judged.stability.value]] if words else [])]
        for line in zip_longest(*columns, fillvalue=""):
            rows.add_row(*line)
    return rows


def _pitch_columns(judged: PitchEvaluation, is_equal: bool) -> Iterator[list[str]]:
    """Lines of each column but that of the word."""
    yield textwrap.wrap(" ".join(f"{angle:.4g}" for angle in judged.pattern.pitch_deg), MIN_COLUMN_WIDTH)
    yield [judged.pattern.name]
    yield [_pitch_limit_text(judged.limit), f"({_pitch_limit_text(judged.low)}..{_pitch_limit_text(judged.high)})"]
    yield [""] if is_equal else _gain_texts(judged)
    yield [f"{judged.pattern.feed_ratio_range[1]:.2f}"]
    yield [f"{100 * judged.pattern.imbalance:.1f} %"]


def _pitch_limit_text(depth: float) -> str:
    return f"{1e3 * depth:.2f}" if math.isfinite(depth) else "none"


def _gain_texts(judged: PitchEvaluation) -> list[str]:
    return [f"{100 * judged.gain:+.0f} %", f"({100 * judged.gain_low:+.0f}..{100 * judged.gain_high:+.0f} %)"]


def _proposal_lines(proposal: PitchProposal) -> Iterator[str]:
    """What to have ground, what that asks of the feed, and where it holds."""
    proposed, program = proposal.proposed, proposal.verdict.program
    at = f"at {format_rpm(program.speed_rpm)} rpm"
    if proposed is None:
        yield f"equal pitch is as good {at}: {_equal_pitch_reason(proposal)}"
        return
    angles = ", ".join(f"{angle:g}" for angle in proposed.pattern.pitch_deg)
    gain, low, high = (round(100 * share) for share in (proposed.gain, proposed.gain_low, proposed.gain_high))
    yield (
        f"pitch_deg = [{angles}]: the limit {at} is {gain} % above that of equal pitch, {low} to {high} % over what is "
        f"not known, {_worse_text(proposed)}"
    )
    largest, fed = proposed.pattern.feed_ratio_range[1], program.feed_per_tooth_mm
    chip = "" if fed is None else f", {fed * largest:.3g} mm where {fed:g} mm is fed per tooth"
    more = round(100 * (largest - 1))
    yield f"its teeth cut uneven chips: the one after the widest gap {more} % more than the mean{chip}"
    yield (
        "it holds for this speed: at others the same pitches may have a lower limit than equal ones; ask again there, "
        "and see lobewatch lobes for speeds that need no other cutter"
    )


def _equal_pitch_reason(proposal: PitchProposal) -> str:
    if not math.isfinite(proposal.equal.limit):
        return f"it has no limit up to {MAX_PROGRAM_DEPTH_RATIO * proposal.verdict.program.depth_mm:g} mm"
    if not proposal.unequal:
        return "no unequal pitch stays within what chips and balance allow"
    return f"no pattern raises the low end of its limit by {100 * (MIN_PITCH_GAIN - 1):.0f} %"


def _worse_text(judged: PitchEvaluation) -> str:
    return f"below it in {math.ceil(100 * judged.share_worse)} % of that" if judged.share_worse else "never below it"
