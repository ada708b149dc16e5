"""The sections of the report below its first screen, in their order."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from acquisition import joined
from dsm import plus_minus
from lobewatch.decay.series_history import SeriesHistory, preload_of
from lobewatch.show.programs.describe_advice import ProgramAdvice, advice_lines, decay_text
from lobewatch.show.programs.describe_doubts import reading_lines
from lobewatch.show.programs.describe_verdicts import (
    WORDS,
    band_text,
    limit_text,
    margin_text,
    turning_text,
    verdict_text,
)
from lobewatch.show.report.for_the_record import for_the_record
from lobewatch.show.report.lists import events_and_exclusions, tap_tests, test_cuts, tools_and_directions
from lobewatch.show.report.material import ReportMaterial
from lobewatch.show.report.picture_sections import lobes_over_time, pictures
from lobewatch.show.report.section import DataTable, Fragment, Paragraph, Section, TableCell
from lobewatch.show.trends.describe_trend import ASSUMED, dates_rows, no_dates_text, sentence
from lobewatch.tool import ABOUT_DIRECTIONS
from lobewatch.verdicts import Word
from lobewatch.verdicts.speed_pockets import SPEEDS_ALONE

MakesSections = Callable[[ReportMaterial], Sequence[Section]]
"""What makes some sections of the report; none where there is nothing to show."""
CHANGES = (
    ("frequency", "natural frequency (Hz)", 1.0),
    ("damping_ratio", "damping ratio (%)", 0.01),
    ("stiffness", "stiffness K (N/µm)", 1e6),
    ("bearing_stiffness", "bearing stiffness (N/µm)", 1e6),
)
"""Field of a row, what the table calls it, and the size of its unit."""
MODEL_CHANGES = (("static_tip_stiffness", "static"), ("modal_tip_stiffness", "modal"))
"""Field of a row from the model, and what the table calls it."""


def programs(material: ReportMaterial) -> list[Section]:
    """The table of programs, and what stands below it."""
    if not material.programs:
        return []
    checked = [program.verdict for program in material.programs if program.verdict.word is not Word.UNKNOWN]
    remarks = [remark for program in material.programs for remark in program.verdict.remarks]
    speeds = [str(remark) for remark in joined(remark for remark in remarks if remark.code == SPEEDS_ALONE)]
    content = {
        "programs": [_program_row(program) for program in material.programs],
        "lines": [
            *(line for program in material.programs for line in advice_lines(program, material.machine)),
            *speeds,
        ],
        "doubt": reading_lines(checked, material.machine),
        "method": checked[0].method if checked else "",
    }
    return [Section("Cutting programs", [Fragment("programs.html", content)])]


def _program_row(program: ProgramAdvice) -> dict[str, Any]:
    """A row of the table, as `lobewatch check` says it."""
    verdict, at_first = program.verdict, program.at_first
    return {
        "name": verdict.program.name,
        "speed_rpm": verdict.program.speed_rpm,
        "depth_mm": verdict.program.depth_mm,
        "limit": limit_text(verdict),
        "band": band_text(verdict).replace("..", " to "),
        "margin": margin_text(verdict),
        "turning": turning_text(verdict),
        "left": decay_text(program.advice),
        "at_first": "-" if at_first is None else _word_cell(at_first.word, at_first.word.value),
        "now": _word_cell(verdict.word, verdict_text(verdict)),
    }


def _word_cell(word: Word, text: str) -> TableCell:
    return TableCell(f"{WORDS[word].symbol} {text}", WORDS[word].kind)


def until_when(material: ReportMaterial) -> list[Section]:
    """When programs stop holding; nothing where no test can be compared with."""
    if material.series.trend is None or material.series.is_first:
        return []
    course = Paragraph(f"{sentence(material.series)}.")
    if no_dates_text(material.outlook):
        return [Section("Until when", [course])]
    dates = DataTable(["what", "becomes doubtful", "is not stable"], dates_rows(material.outlook), "words")
    return [Section("Until when", [course, dates, Paragraph(ASSUMED, is_small=True)])]


def notes(material: ReportMaterial) -> list[Section]:
    """Remarks on the newest test of the series, and on x and y of its tool as they are known now."""
    of_tap = [remark for remark in material.last.remarks if remark.code not in ABOUT_DIRECTIONS]
    of_tool = [remark for remark in material.assembly.remarks if remark.code in ABOUT_DIRECTIONS]
    return [Section("", [Paragraph(f"Note: {remark}.")], is_framed=False) for remark in joined([*of_tap, *of_tool])]


def changes(material: ReportMaterial) -> list[Section]:
    """What was measured first and last, and the change by the formula of the light; of an only test, what it says."""
    history = material.series.history
    rows = [*_measured_changes(history), *_model_changes(history)]
    if not rows:
        return []
    if material.series.is_first:
        values = DataTable(["value", f"{material.last.time:%Y-%m-%d}"], [[name, now] for name, _, now, _ in rows])
        text = "± is the standard error of this tap test alone. All later tests are compared with it."
        return [Section("What was measured", [values, Paragraph(text, is_small=True)])]
    first, last = (f"{row.time:%Y-%m-%d}" for row in (material.rows[0], material.last))
    limits = material.machine.limits
    reading = (
        "± of the newest is the standard error of one tap test alone; that of the start is, from 8 tests on, the "
        f"scatter from test to test.\nThe frequency limits, -{limits.frequency_warn_percent:g} % and "
        f"-{limits.frequency_alarm_percent:g} %, are set in machine.toml (the defaults are those of "
        "Gaber & Hashemi, 2015)."
    )
    left = preload_of(history, material.machine)
    preload = f"{left}." if left else ""
    table = DataTable(["value", f"at the start ({first})", last, "change"], rows)
    below = Paragraph(reading, is_small=True), Paragraph(preload[:1].upper() + preload[1:])
    return [Section("What has changed", [table, *below])]


def _measured_changes(history: SeriesHistory) -> list[list[str]]:
    rows = []
    for name, label, scale in CHANGES:
        values = history.values[name]
        if values.change.is_known:
            newest = getattr(values.known[-1], name)
            now, start = (plus_minus(estimate.value, estimate.std, scale) for estimate in (newest, values.start))
            rows.append([label, start, now, f"{values.change.value:+z.2f} %"])
    return rows


def _model_changes(history: SeriesHistory) -> list[list[str]]:
    rows = []
    for name, label in MODEL_CHANGES:
        values = [float(getattr(row, name)) for row in history.rows if np.isfinite(getattr(row, name))]
        if values and np.isfinite(getattr(history.rows[-1], name)):
            start, now = (f"{value / 1e6:.6g}" for value in (values[0], values[-1]))
            change = f"{100 * (values[-1] / values[0] - 1):+z.2f} %"
            rows.append([f"{label} tip stiffness, model (N/µm)", start, now, change])
    return rows


def newest_modes(material: ReportMaterial) -> list[Section]:
    """Modes of the newest test."""
    rows = [
        [f"{frequency:.2f} Hz", f"{damping * 100:.3f}", _stiffness_text(stiffness), _mode_remark(stiffness)]
        for frequency, damping, stiffness, _ in material.last.modes
    ]
    heads = ["natural frequency", "damping ratio (%)", "stiffness (N/µm)", "remark"]
    table = DataTable(heads, rows, if_empty="none was found")
    return [Section("Modes of the newest test", [table], is_framed=False)]


def _stiffness_text(stiffness: float) -> str:
    return "not known" if math.isnan(stiffness) else f"{stiffness / 1e6:.3f}"


def _mode_remark(stiffness: float) -> str:
    return "not a driving point" if stiffness < 0 else ""


SECTIONS: tuple[MakesSections, ...] = (
    programs,
    until_when,
    notes,
    changes,
    events_and_exclusions,
    pictures,
    lobes_over_time,
    tools_and_directions,
    newest_modes,
    test_cuts,
    tap_tests,
    for_the_record,
)
"""Functions that make the sections, in the order of the page; each gives none where there is nothing to show."""
