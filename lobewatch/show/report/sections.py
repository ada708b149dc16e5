"""Make the sections of the report below its summary, in their order."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from acquisition import merge_remarks
from dsm import format_with_error
from lobewatch.monitoring.series_history import SeriesHistory, estimate_preload
from lobewatch.show.figures.lobe_figures import plot_waterfall
from lobewatch.show.figures.trend_figures import plot_frf
from lobewatch.show.programs.advice import ProgramAdvice, advice_lines, frequency_margin_text
from lobewatch.show.programs.verdicts import (
    VERDICT_STYLES,
    band_text,
    chatter_risk_text,
    limit_text,
    margin_text,
    verdict_notes,
    verdict_text,
)
from lobewatch.show.report.report_data import BEARING_VALUE, FREQUENCY_VALUE, ReportData, SeriesValue, make_value_trend
from lobewatch.show.report.section import (
    DataTable,
    Fragment,
    Paragraph,
    Section,
    TableCell,
    make_figure_section,
    tabulate_lobes,
    tabulate_response,
    tabulate_value,
)
from lobewatch.show.report.tables import make_events, make_provenance, make_series, make_tap_tests, make_test_cuts
from lobewatch.show.trend import FORECAST_ASSUMPTIONS, forecast_date_rows, no_dates_text, trend_sentence
from lobewatch.tool import DIRECTION_CODES
from lobewatch.verdicts import Stability
from lobewatch.verdicts.speed_pockets import SPEEDS_ONLY_CODE


def make_figures(material: ReportData) -> list[Section]:
    """A section for each picture that there is something to draw for."""
    makers = make_value_figures, make_lobe_figure, make_waterfall, make_frequency_response
    return [section for make in makers for section in make(material)]


def make_value_figures(material: ReportData) -> list[Section]:
    """A picture of each value that is known."""
    return [
        section
        for value in (FREQUENCY_VALUE, BEARING_VALUE)
        if (section := _value_section(material, value)) is not None
    ]


def _value_section(material: ReportData, value: SeriesValue) -> Section | None:
    points = make_value_trend(material, value)
    if points is None:
        return None
    text = value.text
    text += " Dotted lines: what was done." if points.marks.events else ""
    text += " Hollow: tests that do not count." if points.marks.excluded else ""
    text += " Line: fitted; band: where it goes, 80 %." if points.curve else ""
    numbers = tabulate_value(value.label, value.scale, points.estimates, points.excluded, points.curve)
    return make_figure_section(value.heading, text, points.figure(), numbers)


def make_lobe_figure(material: ReportData) -> list[Section]:
    """The diagram of the reference cut, or else of the first program of the tool, now and then."""
    diagram = material.lobe_diagram
    if diagram is None:
        return []
    text = f"The {diagram.cut} has no limit in this speed range ({diagram.now.method})."
    if not np.isinf(diagram.now.minimum.depth):
        text = _diagram_text(diagram.cut, diagram.now.method, material.assembly.directions)
    if diagram.heard:
        text += f" Rings and crosses: {len(diagram.heard)} test cut{'s' if len(diagram.heard) > 1 else ''}, as heard."
    heading = "Stability lobes, then and now" if len(diagram.depths) > 1 else "Stability lobes"
    numbers = tabulate_lobes(diagram.now.speed_rpm, {**diagram.depths, **diagram.edges})
    return [make_figure_section(heading, text, diagram.figure(), numbers)]


def _diagram_text(cut: str, method: str, directions: Sequence[str]) -> str:
    return (
        f"Limit of the {cut} by {method}, {' and '.join(directions)} direction"
        f"{'s' if len(directions) > 1 else ' alone'}; cuts above the band chatter. Marks: programs with this "
        "same cut and their verdicts; boxes: settings recommended instead, as in the table above."
    )


def make_waterfall(material: ReportData) -> list[Section]:
    """The depths over speed and time: how the pockets move."""
    course = material.lobe_history
    if course is None or not np.isfinite(course.depth).any():
        return []
    text = f"Limit of the {course.cut} by zero order after each tap test; bright is deep."
    figure = plot_waterfall(course.speed_rpm, course.times, course.depth)
    return [make_figure_section("Pockets over time", text, figure)]


def make_frequency_response(material: ReportData) -> list[Section]:
    """Receptance of the newest test, and of the first; nothing where no force was measured."""
    first, newest = material.first, material.newest.frf
    if newest is None:
        return []
    band = material.response_band(newest)
    figure = plot_frf(None if first is None else first.frf, newest, band)
    text, numbers = "Receptance: displacement over force.", tabulate_response(newest.in_band(band))
    return [make_figure_section("Frequency response", text, figure, numbers)]


def make_lobe_history(material: ReportData) -> list[Section]:
    """The diagrams one by one, with a slider."""
    if material.lobe_history is None:
        return []
    return [Section("", [Fragment("lobe_course.html", {"course": material.lobe_history})], has_plot=True)]


SectionMaker = Callable[[ReportData], Sequence[Section]]
"""What makes some sections of the report; none where there is nothing to show."""
CHANGE_VALUES = (
    ("frequency", "natural frequency (Hz)", 1.0),
    ("damping_ratio", "damping ratio (%)", 0.01),
    ("stiffness", "stiffness K (N/µm)", 1e6),
    ("bearing_stiffness", "bearing stiffness (N/µm)", 1e6),
)
"""Field of a row, what the table calls it, and the size of its unit."""
MODEL_CHANGE_VALUES = (("static_tip_stiffness", "static"), ("modal_tip_stiffness", "modal"))
"""Field of a row from the model, and what the table calls it."""


def make_programs(material: ReportData) -> list[Section]:
    """The table of programs, and what stands below it."""
    if not material.programs:
        return []
    checked = [program.verdict for program in material.programs if program.verdict.stability is not Stability.UNKNOWN]
    remarks = [remark for program in material.programs for remark in program.verdict.remarks]
    speeds = [str(remark) for remark in merge_remarks(remark for remark in remarks if remark.code == SPEEDS_ONLY_CODE)]
    content = {
        "programs": [_program_row(program) for program in material.programs],
        "lines": [
            *(line for program in material.programs for line in advice_lines(program, material.machine)),
            *speeds,
        ],
        "doubt": verdict_notes(checked, material.machine),
        "method": checked[0].method if checked else "",
    }
    return [Section("Cutting programs", [Fragment("programs.html", content)])]


def _program_row(program: ProgramAdvice) -> dict[str, Any]:
    """A row of the table, as `lobewatch check` says it."""
    verdict, at_first = program.verdict, program.first_verdict
    return {
        "name": verdict.program.name,
        "speed_rpm": verdict.program.speed_rpm,
        "depth_mm": verdict.program.depth_mm,
        "limit": limit_text(verdict),
        "band": band_text(verdict).replace("..", " to "),
        "margin": margin_text(verdict),
        "turning": chatter_risk_text(verdict),
        "left": frequency_margin_text(program.advice),
        "at_first": "-" if at_first is None else _verdict_cell(at_first.stability, at_first.stability.value),
        "now": _verdict_cell(verdict.stability, verdict_text(verdict)),
    }


def _verdict_cell(word: Stability, text: str) -> TableCell:
    return TableCell(f"{VERDICT_STYLES[word].symbol} {text}", VERDICT_STYLES[word].css_class)


def make_forecast(material: ReportData) -> list[Section]:
    """When programs stop holding; nothing where no test can be compared with."""
    if material.series.trend is None or material.series.is_baseline:
        return []
    course = Paragraph(f"{trend_sentence(material.series)}.")
    if no_dates_text(material.outlook):
        return [Section("Until when", [course])]
    dates = DataTable(["what", "becomes doubtful", "is not stable"], forecast_date_rows(material.outlook), "words")
    return [Section("Until when", [course, dates, Paragraph(FORECAST_ASSUMPTIONS, is_small=True)])]


def make_notes(material: ReportData) -> list[Section]:
    """Remarks on the newest test of the series, and on x and y of its tool as they are known now."""
    of_tap = [remark for remark in material.last.remarks if remark.code not in DIRECTION_CODES]
    of_tool = [remark for remark in material.assembly.remarks if remark.code in DIRECTION_CODES]
    return [
        Section("", [Paragraph(f"Note: {remark}.")], is_framed=False) for remark in merge_remarks([*of_tap, *of_tool])
    ]


def make_changes(material: ReportData) -> list[Section]:
    """What was measured first and last, and the change by the formula of the light; of an only test, what it says."""
    history = material.series.history
    rows = [*_measured_changes(history), *_model_changes(history)]
    if not rows:
        return []
    if material.series.is_baseline:
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
    left = estimate_preload(history, material.machine)
    preload = f"{left}." if left else ""
    table = DataTable(["value", f"at the start ({first})", last, "change"], rows)
    below = Paragraph(reading, is_small=True), Paragraph(preload[:1].upper() + preload[1:])
    return [Section("What has changed", [table, *below])]


def _measured_changes(history: SeriesHistory) -> list[list[str]]:
    rows = []
    for name, label, scale in CHANGE_VALUES:
        values = history.values[name]
        if values.change.is_known:
            newest = getattr(values.known_rows[-1], name)
            now, start = (format_with_error(estimate.value, estimate.std, scale) for estimate in (newest, values.start))
            rows.append([label, start, now, f"{values.change.value:+z.2f} %"])
    return rows


def _model_changes(history: SeriesHistory) -> list[list[str]]:
    rows = []
    for name, label in MODEL_CHANGE_VALUES:
        values = [float(getattr(row, name)) for row in history.rows if np.isfinite(getattr(row, name))]
        if values and np.isfinite(getattr(history.rows[-1], name)):
            start, now = (f"{value / 1e6:.6g}" for value in (values[0], values[-1]))
            change = f"{100 * (values[-1] / values[0] - 1):+z.2f} %"
            rows.append([f"{label} tip stiffness, model (N/µm)", start, now, change])
    return rows


def make_modes(material: ReportData) -> list[Section]:
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


SECTIONS: tuple[SectionMaker, ...] = (
    make_programs,
    make_forecast,
    make_notes,
    make_changes,
    make_events,
    make_figures,
    make_lobe_history,
    make_series,
    make_modes,
    make_test_cuts,
    make_tap_tests,
    make_provenance,
)
"""Functions that make the sections, in the order of the page; each gives none where there is nothing to show."""
