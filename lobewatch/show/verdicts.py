"""Verdicts on cutting programs as JSON objects and as tables: every place shows them by this one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rich.markup import escape
from rich.table import Table

from lobes.program_limit import DEEPEST
from lobewatch.analysis import Verdict, Word
from lobewatch.show.output import table

WORDS = {Word.STABLE: "stable", Word.NOT_STABLE: "NOT STABLE", Word.UNKNOWN: "not checked"}
"""What a table says."""


def verdict_json(found: Verdict) -> dict[str, Any]:
    """One program; numbers that are not known are null."""
    return {
        "name": found.program.name,
        "speed_rpm": found.program.speed_rpm,
        "depth_mm": found.program.depth_mm,
        "tap_id": found.assembly.tap_id if found.assembly else "",
        "stable": found.stable,
        "verdict": found.word,
        "measured": found.measured,
        "limit_mm": found.limit * 1e3,
        "depth_margin": found.depth_margin,
        "chatter_frequency_hz": found.chatter_frequency,
        "kind": found.kind,
        "drive_limit_mm": found.drive_limit * 1e3,
        "method": found.method,
        "method_detail": found.detail,
    }


def verdict_table(verdicts: Sequence[Verdict]) -> Table:
    """Programs, a line each."""
    made = table("<program", "speed (rpm)", "depth (mm)", "limit (mm)", "<verdict")
    for found in verdicts:
        made.add_row(*program_cells(found), limit_text(found), verdict_text(found))
    return made


def program_cells(found: Verdict) -> tuple[str, str, str]:
    """Name, speed and depth."""
    program = found.program
    return escape(program.name), f"{program.speed_rpm:g}", f"{program.depth_mm:g}"


def limit_text(found: Verdict) -> str:
    """The limit of a program (mm)."""
    if math.isnan(found.limit):
        return "-"
    return f"> {DEEPEST * found.program.depth_mm:g}" if math.isinf(found.limit) else f"{found.limit * 1e3:.2f}"


def margin_text(found: Verdict) -> str:
    """The margin of a program in depth."""
    return f"{100 * found.depth_margin:+.0f} %" if math.isfinite(found.depth_margin) else "-"


def verdict_text(found: Verdict, behind: str = "") -> str:
    """The word, with what must be said in the same breath; behind: what to add to the word."""
    if found.word is Word.UNKNOWN:
        return WORDS[found.word]
    words = [WORDS[found.word] + behind]
    if found.is_beyond_drive:
        words = ["beyond the drive"] if found.stable else [*words, "beyond the drive"]
    return ", ".join(words) + ("" if found.measured else " (predicted)")
