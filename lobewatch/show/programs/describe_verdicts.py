"""Verdicts on cutting programs as JSON objects and as tables: every place shows them by this one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from rich.markup import escape
from rich.table import Table

from lobes.floquet.program_limit import DEEPEST
from lobewatch.logbook import Logbook
from lobewatch.show.programs.describe_doubts import doubt_json, reading_lines
from lobewatch.show.terminal.output import remark_lines, table
from lobewatch.verdicts import Verdict, Word
from lobewatch.verdicts.drawn_limits import TRIED


class Look(NamedTuple):
    """How a word looks."""

    symbol: str
    """Character beside it, for those who do not see its colour."""
    kind: str
    """Class in the report."""
    style: str
    """Style in a terminal."""


WORDS: Mapping[Word, Look] = {
    Word.STABLE: Look("✓", "ok", "green"),
    Word.DOUBTFUL: Look("!", "doubt", "yellow"),
    Word.NOT_STABLE: Look("✗", "bad", "bold red"),
    Word.UNKNOWN: Look("?", "doubt", "bold"),
}
"""The four words, everywhere: each is its own text."""
LEFT = "fall\nleft"
"""Heading of how far the frequency may fall."""
HEADINGS = ("~program", "speed\n(rpm)", "depth\n(mm)", "limit (mm)\nlow..high", "turning", LEFT, "~verdict")


def verdict_json(verdict: Verdict) -> dict[str, Any]:
    """One program; numbers that are not known are null."""
    return {
        "name": verdict.program.name,
        "speed_rpm": verdict.program.speed_rpm,
        "depth_mm": verdict.program.depth_mm,
        "feed": verdict.program.feed,
        "tap_id": verdict.assembly.tap_id if verdict.assembly else "",
        "stable": verdict.stable,
        "verdict": verdict.word,
        "measured": verdict.measured,
        "limit_mm": verdict.limit * 1e3,
        "limit_low_mm": verdict.limit_low * 1e3,
        "limit_high_mm": verdict.limit_high * 1e3,
        "depth_margin": verdict.depth_margin,
        "chance_turning": verdict.chance_turning,
        "decided_by": verdict.decided_by or None,
        "cuts": verdict.cuts,
        "chatter_frequency_hz": verdict.chatter_frequency,
        "kind": verdict.kind,
        "worst_feed_deg": math.degrees(verdict.feed_angle),
        "drive_limit_mm": verdict.drive_limit * 1e3,
        "doubt": doubt_json(verdict),
        "method": verdict.method,
        "method_detail": verdict.detail,
    }


def verdict_table(verdicts: Sequence[Verdict], left: Sequence[str] = ()) -> Table:
    """Programs, a line each; left: how far the frequency of each may fall, a column where it is given."""
    rows = table(*(heading for heading in HEADINGS if left or heading != LEFT))
    for i, verdict in enumerate(verdicts):
        program = verdict.program
        numbers = (f"{program.speed_rpm:g}", f"{program.depth_mm:g}", limits_text(verdict), turning_text(verdict))
        rows.add_row(escape(program.name), *numbers, *left[i : i + 1], _styled(verdict))
    return rows


def limits_text(verdict: Verdict) -> str:
    """The limit in the middle of the doubt (mm), and how low and high it may be."""
    band = band_text(verdict)
    return limit_text(verdict) + (f" ({band})" if band else "")


def limit_text(verdict: Verdict) -> str:
    """The limit in the middle of the doubt (mm)."""
    return "-" if math.isnan(verdict.limit) else _depth(verdict.limit, verdict)


def band_text(verdict: Verdict) -> str:
    """How low and high the limit may be (mm); empty where that is not known, or more than is looked at."""
    if math.isnan(verdict.limit_low) or math.isinf(verdict.limit_low):
        return ""
    return f"{_depth(verdict.limit_low, verdict)}..{_depth(verdict.limit_high, verdict)}"


def turning_text(verdict: Verdict) -> str:
    """Chance of chatter once the spindle turns."""
    if math.isnan(verdict.chance_turning):
        return "-"
    percent = round(100 * verdict.chance_turning)
    return {0: "< 1 %", 100: "> 99 %"}.get(percent, f"{percent} %")


def margin_text(verdict: Verdict) -> str:
    """The margin of a program in depth."""
    return f"{100 * verdict.depth_margin:+.0f} %" if math.isfinite(verdict.depth_margin) else "-"


def verdict_text(verdict: Verdict) -> str:
    """The word, with what must be said in the same breath."""
    predicted = verdict.word is not Word.UNKNOWN and not verdict.measured
    words = [verdict.word.value, *(["beyond the drive"] if verdict.is_beyond_drive else [])]
    return ", ".join(words) + (" (predicted)" if predicted else "")


def is_safe(verdict: Verdict) -> bool:
    """Whether it may be run: stable, and not beyond the drive."""
    return verdict.word is Word.STABLE and not verdict.is_beyond_drive


def _styled(verdict: Verdict) -> str:
    style = WORDS[verdict.word].style if is_safe(verdict) or verdict.word is not Word.STABLE else "bold"
    return f"[{style}]{verdict_text(verdict)}[/]"


def _depth(depth: float, verdict: Verdict) -> str:
    """A depth in mm; how deep was looked where there is none."""
    if math.isinf(depth):
        return f"> {_millimetres(_looked_at(verdict))}"
    return _millimetres(depth)


def _looked_at(verdict: Verdict) -> float:
    """Depth (m) up to which every draw was looked at."""
    if math.isinf(verdict.limit) or verdict.draws is None:
        return DEEPEST * verdict.program.depth_mm / 1e3
    force = verdict.draws.rows.tangential
    return float(np.min(force[0] / force)) * float(TRIED[-1]) * verdict.limit


def _millimetres(depth: float) -> str:
    mm = depth * 1e3
    return f"{mm:.2f}" if mm < 99.995 else f"{mm:.1f}" if mm < 999.95 else f"{mm:.0f}"


def programs_json(verdicts: Sequence[Verdict]) -> list[dict[str, Any]]:
    """The verdict on every program."""
    return [verdict_json(verdict) for verdict in verdicts]


def program_texts(logbook: Logbook) -> list[str | Table]:
    """The verdict on every program, where to ask on, and what is to be said of the files."""
    verdicts = logbook.verdicts()
    if not verdicts:
        return [*remark_lines(logbook.remarks)]
    texts: list[str | Table] = [verdict_table(verdicts), *reading_lines(verdicts, logbook.machine)]
    if not all(map(is_safe, verdicts)):
        texts.append("lobewatch check says what would settle it, and where to go instead")
    return [*texts, *remark_lines(logbook.remarks)]
