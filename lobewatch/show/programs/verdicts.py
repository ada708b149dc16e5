"""Verdicts on cutting programs as JSON objects and as tables: every place shows them by this one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from rich.markup import escape
from rich.table import Table

from lobes.program_limit import DEEPEST
from lobewatch.logbook import Logbook
from lobewatch.show.programs.doubts import doubt_json, reading_lines
from lobewatch.show.terminal.output import remark_lines, table
from lobewatch.verdicts import Verdict, Word
from lobewatch.verdicts.drawn_limits import TRIED


class Look(NamedTuple):
    """How a word looks."""

    symbol: str
    """Beside it, for those who do not see its colour."""
    kind: str
    """Its class in the report."""
    style: str
    """Its style in a terminal."""


WORDS: Mapping[Word, Look] = {
    Word.STABLE: Look("✓", "ok", "green"),
    Word.DOUBTFUL: Look("!", "doubt", "yellow"),
    Word.NOT_STABLE: Look("✗", "bad", "bold red"),
    Word.UNKNOWN: Look("?", "doubt", "bold"),
}
"""The four words, everywhere: each is its own text."""
HEADINGS = ("~program", "speed\n(rpm)", "depth\n(mm)", "limit (mm)\nlow..high", "turning", "f_n\nleft", "~verdict")


def verdict_json(found: Verdict) -> dict[str, Any]:
    """One program; numbers that are not known are null."""
    return {
        "name": found.program.name,
        "speed_rpm": found.program.speed_rpm,
        "depth_mm": found.program.depth_mm,
        "feed": found.program.feed,
        "tap_id": found.assembly.tap_id if found.assembly else "",
        "stable": found.stable,
        "verdict": found.word,
        "measured": found.measured,
        "limit_mm": found.limit * 1e3,
        "limit_low_mm": found.limit_low * 1e3,
        "limit_high_mm": found.limit_high * 1e3,
        "depth_margin": found.depth_margin,
        "chance_turning": found.chance_turning,
        "decided_by": found.decided_by or None,
        "cuts": found.cuts,
        "chatter_frequency_hz": found.chatter_frequency,
        "kind": found.kind,
        "worst_feed_deg": math.degrees(found.feed_angle),
        "drive_limit_mm": found.drive_limit * 1e3,
        "doubt": doubt_json(found),
        "method": found.method,
        "method_detail": found.detail,
    }


def verdict_table(verdicts: Sequence[Verdict], left: Sequence[str] = ()) -> Table:
    """Programs, a line each; left: how far the frequency of each may fall, a column where it is given."""
    made = table(*(heading for heading in HEADINGS if left or heading != "f_n\nleft"))
    for i, found in enumerate(verdicts):
        program = found.program
        numbers = (f"{program.speed_rpm:g}", f"{program.depth_mm:g}", limits_text(found), turning_text(found))
        made.add_row(escape(program.name), *numbers, *left[i : i + 1], _styled(found))
    return made


def limits_text(found: Verdict) -> str:
    """The limit in the middle of the doubt (mm), and how low and high it may be."""
    band = band_text(found)
    return limit_text(found) + (f" ({band})" if band else "")


def limit_text(found: Verdict) -> str:
    """The limit in the middle of the doubt (mm)."""
    return "-" if math.isnan(found.limit) else _depth(found.limit, found)


def band_text(found: Verdict) -> str:
    """How low and high the limit may be (mm); empty where that is not known, or more than is looked at."""
    if math.isnan(found.limit_low) or math.isinf(found.limit_low):
        return ""
    return f"{_depth(found.limit_low, found)}..{_depth(found.limit_high, found)}"


def turning_text(found: Verdict) -> str:
    """Chance of chatter once the spindle turns."""
    if math.isnan(found.chance_turning):
        return "-"
    percent = round(100 * found.chance_turning)
    return {0: "< 1 %", 100: "> 99 %"}.get(percent, f"{percent} %")


def margin_text(found: Verdict) -> str:
    """The margin of a program in depth."""
    return f"{100 * found.depth_margin:+.0f} %" if math.isfinite(found.depth_margin) else "-"


def verdict_text(found: Verdict) -> str:
    """The word, with what must be said in the same breath."""
    predicted = found.word is not Word.UNKNOWN and not found.measured
    words = [found.word.value, *(["beyond the drive"] if found.is_beyond_drive else [])]
    return ", ".join(words) + (" (predicted)" if predicted else "")


def is_safe(found: Verdict) -> bool:
    """Whether it may be run: stable, and not beyond the drive."""
    return found.word is Word.STABLE and not found.is_beyond_drive


def _styled(found: Verdict) -> str:
    style = WORDS[found.word].style if is_safe(found) or found.word is not Word.STABLE else "bold"
    return f"[{style}]{verdict_text(found)}[/]"


def _depth(depth: float, found: Verdict) -> str:
    """A depth in mm; how deep was looked where there is none."""
    if math.isinf(depth):
        return f"> {_millimetres(_looked_at(found))}"
    return _millimetres(depth)


def _looked_at(found: Verdict) -> float:
    """Depth (m) up to which every draw was looked at."""
    if math.isinf(found.limit) or found.drawn is None:
        return DEEPEST * found.program.depth_mm / 1e3
    force = found.drawn.rows.tangential
    return float(np.min(force[0] / force)) * float(TRIED[-1]) * found.limit


def _millimetres(depth: float) -> str:
    mm = depth * 1e3
    return f"{mm:.2f}" if mm < 99.995 else f"{mm:.1f}" if mm < 999.95 else f"{mm:.0f}"


def programs_json(verdicts: Sequence[Verdict]) -> list[dict[str, Any]]:
    """The verdict on every program."""
    return [verdict_json(found) for found in verdicts]


def program_texts(logbook: Logbook) -> list[str | Table]:
    """The verdict on every program, where to ask on, and what is to be said of the files."""
    verdicts = logbook.verdicts()
    if not verdicts:
        return [*remark_lines(logbook.remarks)]
    texts: list[str | Table] = [verdict_table(verdicts), *reading_lines(verdicts, logbook.machine)]
    if not all(map(is_safe, verdicts)):
        texts.append("lobewatch check says what would settle it, and where to go instead")
    return [*texts, *remark_lines(logbook.remarks)]
