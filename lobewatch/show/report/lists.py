"""Lists of the report: tools and directions, what was done, test cuts, tap tests."""

from __future__ import annotations

import math
from typing import Any

from lobewatch.decay import SeriesStanding
from lobewatch.decay.light import in_order, is_early, light_of
from lobewatch.history import Row
from lobewatch.machine.journal.event import MaintenanceEvent
from lobewatch.machine.settings.machine_file import REFERENCE_CUT
from lobewatch.measuring.estimate import Estimate
from lobewatch.show.history.describe_cut import heard_text
from lobewatch.show.programs.describe_verdicts import WORDS
from lobewatch.show.report.figure_data import Numbers
from lobewatch.show.report.material import ReportMaterial
from lobewatch.show.report.section import BulletList, DataTable, Paragraph, Section, TableCell
from lobewatch.show.terminal.light_words import light_kind, light_word
from lobewatch.show.trends.describe_trend import rate_text, short_text

NUMBER_HEADS = (
    "time",
    "tool",
    "direction",
    "f_n (Hz)",
    "zeta (%)",
    "K (N/um)",
    "bearing stiffness (N/um)",
    "temperature (degC)",
)
"""Headings of the tap tests as numbers."""
VALUE_FORMATS = (("{:.2f}", 1.0), ("{:.3f}", 0.01), ("{:.3f}", 1e6), ("{:.1f}", 1e6))
"""Format and size of the unit of f_n, zeta, K and the stiffness of a bearing."""
COUNTING = "Those that count, the newest first"
"""Words for what a list holds."""


def tools_and_directions(material: ReportMaterial) -> list[Section]:
    """A line for each, the one that fell most first."""
    heads = ["tool", "direction", "light", "points", "newest", "change", "rate"]
    rows = [_series_row(series) for series in material.outlook.standing.series]
    return [Section("Tools and directions", [DataTable(heads, rows, "words")], is_framed=False)]


def _series_row(series: SeriesStanding) -> list[str | TableCell]:
    ordered = in_order(series.remarks)
    worst, early = light_of(ordered), is_early(ordered)
    trend = series.trend
    return [
        series.tool,
        series.direction,
        TableCell(light_word(worst, early), light_kind(worst, early)),
        "0" if trend is None else str(len(trend.points)),
        f"{series.time:%Y-%m-%d}",
        short_text(series),
        "-" if trend is None else rate_text(trend) or "from 8 points on",
    ]


def events_and_exclusions(material: ReportMaterial) -> list[Section]:
    """A line for each event of the machine, each word on an alarm, each test that does not count, oldest first."""
    files = material.analysis.files
    reasons = {entry.id: entry.excluded for entry in files.excluded}
    lines = [(event.time, event_line(event)) for event in files.events]
    lines += [(word.time, f"{word.time.astimezone():%Y-%m-%d}: {word.alarm} {word}") for word in files.acknowledgements]
    lines += [(row.time, _excluded_line(row, reasons[row.tap_id])) for row in material.excluded_rows]
    if not lines:
        return []
    heading = "What was done, and tests that do not count"
    return [Section(heading, [BulletList([line for _, line in sorted(lines)])])]


def event_line(event: MaintenanceEvent) -> str:
    """Day and text of an event."""
    return f"{event.time.astimezone():%Y-%m-%d}: {event.text}{' (new baseline)' if event.new_baseline else ''}"


def _excluded_line(row: Row, reason: str) -> str:
    value = f", {row.frequency.value:.1f} Hz" if row.frequency.is_known else ""
    return f"{row.time.astimezone():%Y-%m-%d}: tap test excluded ({reason}){value}"


def test_cuts(material: ReportMaterial) -> list[Section]:
    """Date, what was cut, speed, depth, what it sounded like, who heard it."""
    rows = [
        [
            f"{cut.at.astimezone():%Y-%m-%d %H:%M}",
            cut.program or REFERENCE_CUT,
            cut.tool,
            f"{cut.speed_rpm:.0f}",
            f"{1e3 * cut.depth:.4g}",
            heard_text(cut),
            cut.by,
        ]
        for cut in reversed(material.analysis.cuts)
    ]
    if not rows:
        return []
    table = DataTable(["when", "cut", "tool", "rpm", "mm", "heard", "by"], rows, "words")
    return [Section("Test cuts", [Paragraph(f"{COUNTING}, as they were heard.", is_small=True), table])]


def tap_tests(material: ReportMaterial) -> list[Section]:
    """Date, tool, direction, values, words of then; the same as numbers, oldest first."""
    history = material.analysis.history.current
    heads = ["when", "tool", "in", "frequency (Hz)", "damping (%)", "stiffness (N/µm)", "bearings (N/µm)", "said of it"]
    numbers = Numbers(NUMBER_HEADS, [_tap_numbers(row) for row in history])
    table = DataTable(heads, [_tap_row(row) for row in reversed(history)], "words taps", numbers=numbers, key="taps")
    return [Section("Tap tests", [Paragraph(f"{COUNTING}.", is_small=True), table], is_framed=False)]


def _tap_row(row: Row) -> list[str]:
    values = (row.frequency, row.damping_ratio, row.stiffness, row.bearing_stiffness)
    cells = [_number(value, form, scale) for value, (form, scale) in zip(values, VALUE_FORMATS, strict=True)]
    words = [f"{name} {WORDS[ruling.word].symbol}" for name, ruling in (row.rulings or {}).items()]
    asked = [f"question {question.code}" for question in row.questions]
    return [f"{row.time.astimezone():%Y-%m-%d %H:%M}", row.tool, row.direction, *cells, "; ".join([*asked, *words])]


def _number(value: Estimate, form: str, scale: float) -> str:
    return form.format(value.value / scale) if value.is_known else "-"


def _tap_numbers(row: Row) -> list[Any]:
    values = (row.frequency.value, row.damping_ratio.value / 0.01, row.stiffness.value / 1e6)
    warmth = row.conditions.temperature_c
    bearing = row.bearing_stiffness.value / 1e6
    about = [row.time.isoformat(), row.tool, row.direction]
    return [*about, *values, bearing, math.nan if warmth is None else float(warmth)]
