"""Unequal pitches for people and as JSON."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import Any

from rich.table import Table

from acquisition import Remark
from lobes.floquet.program_limit import DEEPEST
from lobewatch.show.programs.describe_advice import rpm
from lobewatch.show.terminal.output import SHORTEST, remark_json, remark_lines, table
from lobewatch.verdicts.pitch_proposal import WORTH, JudgedPitch, PitchProposal

IN_LINES = ("doubt-decides",)
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
        "remarks": [remark_json(remark) for remark in _remarks(proposal, remarks)],
    }


def _pitch_json(judged: JudgedPitch, depth_mm: float | None) -> dict[str, Any]:
    least, most = judged.pattern.chips
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
        "verdict": None if depth_mm is None else judged.word,
        "off_centre": judged.pattern.off_centre,
    }


def pitches_texts(proposal: PitchProposal, remarks: Sequence[Remark], depth_mm: float | None) -> list[str | Table]:
    """The patterns for people, and what to have ground; depth_mm: the one that was asked about."""
    return [
        _pitches_table(proposal, depth_mm),
        *_proposal_lines(proposal),
        *remark_lines(_remarks(proposal, remarks)),
    ]


def _remarks(proposal: PitchProposal, remarks: Sequence[Remark]) -> list[Remark]:
    return [*remarks, *(remark for remark in proposal.verdict.remarks if remark.code not in IN_LINES)]


def _pitches_table(proposal: PitchProposal, depth_mm: float | None) -> Table:
    """Each pattern in as many lines as its angles need, two at least, equal pitch first."""
    words = [] if depth_mm is None else [f"<at {depth_mm:g} mm"]
    heads = "<pitch\n(deg)", "<pattern", "limit (mm)\nlow..high", "over\nequal", "largest\nchip", "off\naxis"
    rows = table(*heads, *words)
    for judged in (proposal.equal, *proposal.unequal):
        columns = [*_columns(judged, judged is proposal.equal), *([[judged.word.value]] if words else [])]
        for line in zip_longest(*columns, fillvalue=""):
            rows.add_row(*line)
    return rows


def _columns(judged: JudgedPitch, is_equal: bool) -> Iterator[list[str]]:
    """Lines of each column but that of the word."""
    yield textwrap.wrap(" ".join(f"{angle:.4g}" for angle in judged.pattern.pitch_deg), SHORTEST)
    yield [judged.pattern.name]
    yield [_mm(judged.limit), f"({_mm(judged.low)}..{_mm(judged.high)})"]
    yield [""] if is_equal else _gain_texts(judged)
    yield [f"{judged.pattern.chips[1]:.2f}"]
    yield [f"{100 * judged.pattern.off_centre:.1f} %"]


def _mm(depth: float) -> str:
    return f"{1e3 * depth:.2f}" if math.isfinite(depth) else "none"


def _gain_texts(judged: JudgedPitch) -> list[str]:
    return [f"{100 * judged.gain:+.0f} %", f"({100 * judged.gain_low:+.0f}..{100 * judged.gain_high:+.0f} %)"]


def _proposal_lines(proposal: PitchProposal) -> Iterator[str]:
    """What to have ground, what that asks of the feed, and where it holds."""
    proposed, program = proposal.proposed, proposal.verdict.program
    at = f"at {rpm(program.speed_rpm)} rpm"
    if proposed is None:
        yield f"equal pitch is as good {at}: {_why_equal(proposal)}"
        return
    angles = ", ".join(f"{angle:g}" for angle in proposed.pattern.pitch_deg)
    gain, low, high = (round(100 * share) for share in (proposed.gain, proposed.gain_low, proposed.gain_high))
    yield (
        f"pitch_deg = [{angles}]: the limit {at} is {gain} % above that of equal pitch, {low} to {high} % over what is "
        f"not known, {_worse_text(proposed)}"
    )
    largest, fed = proposed.pattern.chips[1], program.feed_per_tooth_mm
    chip = "" if fed is None else f", {fed * largest:.3g} mm where {fed:g} mm is fed per tooth"
    more = round(100 * (largest - 1))
    yield f"its teeth cut uneven chips: the one after the widest gap {more} % more than the mean{chip}"
    yield (
        "it holds for this speed: at others the same pitches may have a lower limit than equal ones; ask again there, "
        "and see lobewatch lobes for speeds that need no other cutter"
    )


def _why_equal(proposal: PitchProposal) -> str:
    if not math.isfinite(proposal.equal.limit):
        return f"it has no limit up to {DEEPEST * proposal.verdict.program.depth_mm:g} mm"
    if not proposal.unequal:
        return "no unequal pitch stays within what chips and balance allow"
    return f"no pattern raises the low end of its limit by {100 * (WORTH - 1):.0f} %"


def _worse_text(judged: JudgedPitch) -> str:
    return f"below it in {math.ceil(100 * judged.share_worse)} % of that" if judged.share_worse else "never below it"
