"""Show recommended speeds and depths, and unequal pitches."""

import math
import textwrap
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from pathlib import Path

from acquisition import Remark
from acquisition.errors import join_sentences
from lobes.floquet.program_limit import MAX_PROGRAM_DEPTH_RATIO
from lobewatch.machine import ProgramTable
from lobewatch.machine.journal.journal import format_command
from lobewatch.machine.settings.display_units import (
    CUTTING_SPEED,
    FEED_PER_TOOTH,
    FEED_RATE,
    LENGTH,
    REMOVAL_RATE,
)
from lobewatch.show.programs.advice import (
    LINE_REMARK_CODES,
    format_rpm,
    margin_items,
    setting_json,
    window_text,
    worst_feed_text,
)
from lobewatch.show.programs.verdicts import limits_json, tap_age_json, tap_age_text
from lobewatch.show.terminal.output import (
    MIN_COLUMN_WIDTH,
    JsonObject,
    Texts,
    count_noun,
    new_table,
    pick,
    remark_lines,
)
from lobewatch.show.terminal.sentences import capitalize, wrap_lines
from lobewatch.verdicts import Setting, Verdict
from lobewatch.verdicts.pitch_proposal import MIN_PITCH_GAIN, PitchEvaluation, PitchProposal
from lobewatch.verdicts.recommendation import Recommendation

UNIT_FEED_MM = 0.1
"""Feed per tooth (mm) of the removal rate if the feed is unknown."""


def recommendation_json(answer: Recommendation, remarks: Sequence[Remark] = ()) -> JsonObject:
    """Return the recommended setting or the reason for none; remarks: on the files."""
    others = [{"what": label, **_setting_with_feed_json(setting, answer)} for label, setting in answer.alternatives]
    return {
        **pick(answer.program, "name", "tool", "material", "teeth", "tool_diameter_mm", "radial_depth_mm"),
        "recommended": _recommended_json(answer.setting, answer.verdict, answer),
        "reason": answer.reason or None,
        "what_would_change_it": answer.remedies,
        "alternatives": others,
        "remarks": [*remarks, *_other_remarks(answer)],
    }


def _recommended_json(setting: Setting | None, verdict: Verdict | None, answer: Recommendation) -> JsonObject | None:
    if setting is None or verdict is None:
        return None
    direction = answer.program.direction
    return {
        **_setting_with_feed_json(setting, answer),
        "direction": "either" if answer.any_direction else direction,
        "worse_direction": direction,
        "feed": answer.program.feed,
        "worst_feed_deg": math.degrees(verdict.feed_angle),
        "verdict": verdict.stability,
        "measured": verdict.is_measured,
        **limits_json(verdict),
        "cuts": verdict.n_cuts,
        "chance_turning": verdict.chatter_risk,
        "tap_age_days": tap_age_json(verdict.assembly),
    }


def _setting_with_feed_json(setting: Setting, answer: Recommendation) -> JsonObject:
    feed = None if answer.feed_mm is None else answer.feed_mm[1]
    rate = math.nan if feed is None else removal_rate(setting, answer.program, feed)
    speed = setting_json(setting) | {"cutting_speed_m_min": cutting_speed(setting, answer.program)}
    return speed | {"feed_per_tooth_mm": feed, "chips_cm3_per_min": rate}


def cutting_speed(setting: Setting, program: ProgramTable) -> float:
    """Return the cutting speed vc (m/min)."""
    return math.pi * program.tool_diameter_mm * setting.speed_rpm / 1e3


def removal_rate(setting: Setting, program: ProgramTable, feed_mm: float) -> float:
    """Return the material removal rate (cm3/min) at a feed per tooth (mm)."""
    return setting.depth_mm * program.radial_mm[1] * feed_mm * program.teeth * setting.speed_rpm / 1e3


def recommendation_lines(answer: Recommendation, remarks: Sequence[Remark] = ()) -> list[str]:
    """Return the recommendation first, then its margins and alternatives; remarks: on the files."""
    lines = [*_recommended_lines(answer)]
    for label, setting in answer.alternatives:
        lines += wrap_lines([f"{label}: {_setting_text(setting, answer)}"], "")
        lines += wrap_lines(_margin_items(setting, answer))
    return [*lines, *wrap_lines(remark_lines([*remarks, *_other_remarks(answer)]), "")]


def saved_lines(folder: Path, name: str) -> list[str]:
    """Return the file and the program in which the setting was saved, and the next step."""
    return [f"saved in {folder / 'machine.toml'} as program {name!r}", f"Next: {format_command('check', folder)}"]


def _recommended_lines(answer: Recommendation) -> Iterator[str]:
    setting, verdict = answer.setting, answer.verdict
    if setting is None or verdict is None:
        yield from wrap_lines(
            [join_sentences(f"{answer.program.name}: no recommendation", capitalize(answer.reason))], ""
        )
        if answer.remedies:
            yield "Possible remedies:"
            yield from wrap_lines(answer.remedies)
        return
    yield from wrap_lines([f"{answer.program.name}: {_setting_text(setting, answer)}"], "")
    items = ["Valid for up and down milling"] if answer.any_direction and answer.program.immersion < 1 else []
    items += [] if verdict.assembly is None else [tap_age_text(verdict.assembly)]
    items += [] if verdict.is_measured else ["Predicted by the spindle model, doubtful until you tap the tool"]
    cuts = f"Valid for the rotating spindle, learned from {count_noun(verdict.n_cuts, 'test cut')}"
    yield from wrap_lines(
        [*items, *_margin_items(setting, answer, worst_feed_text(verdict)), *[cuts][: verdict.n_cuts]]
    )


def _setting_text(setting: Setting, answer: Recommendation) -> str:
    edge = cutting_speed(setting, answer.program)
    depth, speed = LENGTH.text_at_most(setting.depth_mm), CUTTING_SPEED.text(edge, ".0f")
    return f"{format_rpm(setting.speed_rpm)} rpm, ap {depth}, cutting speed {speed}"


def _margin_items(setting: Setting, answer: Recommendation, feed: str = "") -> list[str]:
    return [capitalize(window_text(setting)) + feed, *margin_items(setting), _removal_rate_text(setting, answer)]


def _removal_rate_text(setting: Setting, answer: Recommendation) -> str:
    program = answer.program
    if answer.feed_mm is None:
        rate = removal_rate(setting, program, UNIT_FEED_MM)
        return f"Removal rate {REMOVAL_RATE.text(rate, '.3g')} per {FEED_PER_TOOTH.text(UNIT_FEED_MM)} feed per tooth"
    feeds = list(dict.fromkeys(answer.feed_mm))
    rates = " to ".join(REMOVAL_RATE.number(removal_rate(setting, program, feed), ".3g") for feed in feeds)
    rates_of_feed = [FEED_RATE.number(feed * (program.teeth * setting.speed_rpm), ".0f") for feed in feeds]
    speeds = f"{' to '.join(format_rpm(float(rate)) for rate in rates_of_feed)} {FEED_RATE.unit}"
    per_tooth = " to ".join(FEED_PER_TOOTH.number(feed, ".3g") for feed in feeds)
    return f"Removal rate {rates} {REMOVAL_RATE.unit} at {per_tooth} {FEED_PER_TOOTH.unit} feed per tooth ({speeds})"


def _other_remarks(answer: Recommendation) -> list[Remark]:
    return [remark for remark in answer.remarks if remark.code not in LINE_REMARK_CODES]


def pitches_json(proposal: PitchProposal, remarks: Sequence[Remark], depth_mm: float | None) -> JsonObject:
    """Return equal pitch, the unequal patterns, and the proposed one; remarks: on the files."""
    proposed, verdict = proposal.proposed, proposal.verdict
    return {
        **pick(verdict.program, "tool", "teeth", "speed_rpm"),
        "depth_mm": depth_mm,
        "equal_is_as_good": proposed is None,
        "proposed_deg": proposed and proposed.pattern.pitch_deg,
        "half_wave_deg": proposal.half_wave_deg,
        "chatter_frequency_hz": verdict.chatter_frequency,
        "equal": _pitch_json(proposal.equal, depth_mm),
        "unequal": [_pitch_json(pitch, depth_mm) for pitch in proposal.unequal],
        "remarks": _pitch_remarks(proposal, remarks),
    }


def _pitch_json(pitch: PitchEvaluation, depth_mm: float | None) -> JsonObject:
    pattern, (least, largest) = pitch.pattern, pitch.pattern.feed_ratio_range
    return {
        "pitch_deg": pattern.pitch_deg,
        "pattern": pattern.name,
        "limit_mm": pitch.limit * 1e3,
        "limit_low_mm": pitch.low * 1e3,
        "limit_high_mm": pitch.high * 1e3,
        **pick(pitch, "gain", "gain_low", "gain_high", "share_worse"),
        "least_chip": least,
        "largest_chip": largest,
        "verdict": None if depth_mm is None else pitch.stability,
        "off_centre": pattern.imbalance,
    }


def pitches_texts(proposal: PitchProposal, remarks: Sequence[Remark], depth_mm: float | None) -> Texts:
    """Return a table of the patterns, and the proposed one; depth_mm: requested depth of cut, None for any."""
    headings = (
        "<pitch\n(deg)",
        "<pattern",
        f"limit ({LENGTH.unit})\n98 % interval",
        "gain",
        "largest\nchip",
        "off-\ncentre",
    )
    table = new_table(*headings, *([] if depth_mm is None else [f"<verdict at\n{LENGTH.text(depth_mm)}"]))
    for pitch in (proposal.equal, *proposal.unequal):  # one line for each part of its angles, at least two
        verdict = [] if depth_mm is None else [[pitch.stability.value]]
        for cells in zip_longest(*_pitch_columns(pitch, pitch is proposal.equal), *verdict, fillvalue=""):
            table.add_row(*cells)
    return [table, *_proposal_lines(proposal), *wrap_lines(remark_lines(_pitch_remarks(proposal, remarks)), "")]


def _pitch_remarks(proposal: PitchProposal, remarks: Sequence[Remark]) -> list[Remark]:
    return [*remarks, *(remark for remark in proposal.verdict.remarks if remark.code != "doubt-decides")]


def _pitch_columns(pitch: PitchEvaluation, is_equal: bool) -> Iterator[list[str]]:
    """Return the lines of each column except the verdict."""
    gain, low, high = (f"{100 * share:+.0f}" for share in (pitch.gain, pitch.gain_low, pitch.gain_high))
    depths = pitch.limit, pitch.low, pitch.high
    limit, least, most = (LENGTH.number(1e3 * depth, ".2f") if math.isfinite(depth) else "none" for depth in depths)
    yield textwrap.wrap(" ".join(f"{angle:.4g}" for angle in pitch.pattern.pitch_deg), MIN_COLUMN_WIDTH)
    yield [pitch.pattern.name]
    yield [limit, f"({least}..{most})"]
    yield [""] if is_equal else [f"{gain} %", f"({low}..{high} %)"]
    yield [f"{pitch.pattern.feed_ratio_range[1]:.2f}"]
    yield [f"{100 * pitch.pattern.imbalance:.1f} %"]


def _proposal_lines(proposal: PitchProposal) -> Iterator[str]:
    """Return the proposed pitches, their uneven chips, and the speed that they are valid for."""
    proposed, program = proposal.proposed, proposal.verdict.program
    at = f"at {format_rpm(program.speed_rpm)} rpm"
    if proposed is None:
        yield f"Equal pitch is as good {at}: {_equal_pitch_reason(proposal)}"
        return
    angles = ", ".join(f"{angle:g}" for angle in proposed.pattern.pitch_deg)
    share = math.ceil(100 * proposed.share_worse)
    largest, fed = proposed.pattern.feed_ratio_range[1], program.feed_per_tooth_mm
    chip = ""
    if fed is not None:
        chip = f", {FEED_PER_TOOTH.text(fed * largest, '.3g')} at {FEED_PER_TOOTH.text(fed)} feed per tooth"
    yield f"Best pitches {at}: pitch_deg = [{angles}]"
    yield from wrap_lines(
        [
            f"The limit is lower than with equal pitch in {share} % of the Monte Carlo samples",
            f"Uneven chips: {round(100 * (largest - 1))} % thicker than the mean chip after the widest gap{chip}",
            "The pitches are valid for this speed only. Run lobewatch pitch again for another speed.",
            "lobewatch lobes shows stable speeds of the present cutter.",
        ]
    )


def _equal_pitch_reason(proposal: PitchProposal) -> str:
    if not math.isfinite(proposal.equal.limit):
        return f"no stability limit up to {LENGTH.text(MAX_PROGRAM_DEPTH_RATIO * proposal.verdict.program.depth_mm)}"
    if not proposal.unequal:
        return "no unequal pitch keeps chip load and balance within limits"
    return f"no unequal pitch raises the lower end of the 98 % interval by {100 * (MIN_PITCH_GAIN - 1):.0f} %"
