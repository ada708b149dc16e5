"""Make the sections of the report below its summary, in their order."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from acquisition import merge_remarks
from dsm import format_with_error
from lobewatch.monitoring.series_history import SeriesHistory, estimate_preload
from lobewatch.monitoring.threshold_dates import date_of_days
from lobewatch.show.figures.lobe_figures import plot_waterfall
from lobewatch.show.figures.trend_figures import plot_frf
from lobewatch.show.programs import verdicts
from lobewatch.show.programs.advice import ProgramAdvice, advice_lines, frequency_margin_text
from lobewatch.show.report.report_data import BEARING_VALUE, FREQUENCY_VALUE, ReportData, ValueTrend, make_value_trend
from lobewatch.show.report.section import (
    DataTable,
    Fragment,
    NumberTable,
    Paragraph,
    Section,
    TableCell,
    make_figure_section,
    tabulate_lobes,
    tabulate_response,
)
from lobewatch.show.report.tables import make_events, make_provenance, make_series, make_tap_tests, make_test_cuts
from lobewatch.show.terminal.output import count_noun, pick
from lobewatch.show.trend import FORECAST_ASSUMPTIONS, forecast_date_rows, no_dates_text, trend_sentence
from lobewatch.tool import DIRECTION_CODES
from lobewatch.verdicts import Stability
from lobewatch.verdicts.speed_pockets import SPEEDS_ONLY_CODE


def make_figures(data: ReportData) -> list[Section]:
    """Make all figures that have data."""
    lobes = [*make_value_figures(data), *make_lobe_figure(data), *make_waterfall(data)]
    return [*lobes, *make_frequency_response(data)]


def make_value_figures(data: ReportData) -> Iterator[Section]:
    """Make a figure over time of each value that is known."""
    for value in (FREQUENCY_VALUE, BEARING_VALUE):
        trend = make_value_trend(data, value)
        if trend is not None:
            texts = [value.text, *(["Dotted lines: what was done."] if trend.marks.events else [])]
            texts += ["Hollow: tests that do not count."] if trend.marks.excluded else []
            texts += ["Line: fitted; band: where it goes, 80 %."] if trend.curve else []
            yield make_figure_section(value.heading, " ".join(texts), trend.figure(), _tabulate_trend(trend))


def _tabulate_trend(trend: ValueTrend) -> NumberTable:
    """Tabulate a value over time: tests, excluded tests, the fitted line, and the 80 % band of the forecast."""
    unit, scale, curve = trend.value.label, trend.value.scale, trend.curve
    tests = [(time, estimate.value / scale, estimate.std / scale) for time, estimate in trend.estimates]
    lines: list[list[Any]] = [["test", f"{time:%Y-%m-%d}", value, std, "", ""] for time, value, std in tests]
    lines += [["does not count", f"{time:%Y-%m-%d}", value, "", "", ""] for time, value in trend.excluded]
    if curve is not None:
        days = [f"{date_of_days(day):%Y-%m-%d}" for day in curve.days.tolist()]
        past = curve.days.size - curve.days_ahead.size
        fitted = zip(days[:past], curve.line[:past].tolist(), strict=True)
        lines += [["fitted", day, value, "", "", ""] for day, value in fitted]
        ahead = np.column_stack([curve.line[past:], curve.low, curve.high]).tolist()
        band = list(zip(days[past:], ahead, strict=True))[::10]
        lines += [["forecast", day, value, "", low, high] for day, (value, low, high) in band]
    return NumberTable(["what", "date", unit, f"standard error ({unit})", f"10 % ({unit})", f"90 % ({unit})"], lines)


def make_lobe_figure(data: ReportData) -> list[Section]:
    """Make the lobe diagram of the reference cut, or of the first program of the tool, then and now."""
    diagram = data.lobe_diagram
    if diagram is None:
        return []
    cut, method, directions = diagram.cut, diagram.now.method, data.assembly.directions
    sides = f"{' and '.join(directions)} direction{'s' if len(directions) > 1 else ' alone'}"
    text = (
        f"Limit of the {cut} by {method}, {sides}; cuts above the band chatter. Marks: programs with this same cut and "
        "their verdicts; boxes: settings recommended instead, as in the table above."
    )
    if np.isinf(diagram.now.minimum.depth):
        text = f"The {cut} has no limit in this speed range ({method})."
    if diagram.heard:
        text += f" Rings and crosses: {count_noun(len(diagram.heard), 'test cut')}, as heard."
    heading = "Stability lobes, then and now" if len(diagram.depths) > 1 else "Stability lobes"
    numbers = tabulate_lobes(diagram.now.speed_rpm, {**diagram.depths, **diagram.edges})
    return [make_figure_section(heading, text, diagram.figure(), numbers)]


def make_waterfall(data: ReportData) -> list[Section]:
    """Make a map of limiting depth over speed and time."""
    course = data.lobe_history
    if course is None or not np.isfinite(course.depth).any():
        return []
    text = f"Limit of the {course.cut} by zero order after each tap test; bright is deep."
    figure = plot_waterfall(course.speed_rpm, course.times, course.depth)
    return [make_figure_section("Pockets over time", text, figure)]


def make_frequency_response(data: ReportData) -> list[Section]:
    """Make the receptance of the newest test and of the first; nothing where no force was measured."""
    first, newest = data.first, data.newest.frf
    if newest is None:
        return []
    band = data.response_band(newest)
    figure = plot_frf(None if first is None else first.frf, newest, band)
    text, numbers = "Receptance: displacement over force.", tabulate_response(newest.in_band(band))
    return [make_figure_section("Frequency response", text, figure, numbers)]


def make_lobe_history(data: ReportData) -> list[Section]:
    """Make the lobe diagrams over time, with a slider."""
    if data.lobe_history is None:
        return []
    return [Section("", [Fragment("lobe_course.html", {"course": data.lobe_history})], has_plot=True)]


SectionMaker = Callable[[ReportData], Sequence[Section]]
"""Function that makes some sections of the report, none where there is nothing to show."""
CHANGE_VALUES = (
    ("frequency", "natural frequency (Hz)", 1.0),
    ("damping_ratio", "damping ratio (%)", 0.01),
    ("stiffness", "stiffness K (N/µm)", 1e6),
    ("bearing_stiffness", "bearing stiffness (N/µm)", 1e6),
)
"""Field of a row, its name in the table, and the size of its unit."""
MODEL_CHANGE_VALUES = (("static_tip_stiffness", "static"), ("modal_tip_stiffness", "modal"))
"""Field of a row from the model, and its name in the table."""


def make_programs(data: ReportData) -> list[Section]:
    """Make the table of programs, and the lines below it."""
    if not data.programs:
        return []
    checked = [program.verdict for program in data.programs if program.verdict.stability is not Stability.UNKNOWN]
    remarks = [remark for program in data.programs for remark in program.verdict.remarks]
    speeds = merge_remarks(remark for remark in remarks if remark.code == SPEEDS_ONLY_CODE)
    lines = [line for program in data.programs for line in advice_lines(program, data.machine)]
    content = {
        "programs": [_program_row(program) for program in data.programs],
        "lines": [*lines, *map(str, speeds)],
        "doubt": verdicts.verdict_notes(checked, data.machine),
        "method": checked[0].method if checked else "",
    }
    return [Section("Cutting programs", [Fragment("programs.html", content)])]


def _program_row(program: ProgramAdvice) -> dict[str, Any]:
    """Return a row of the table of programs, with the same words as `lobewatch check`."""
    verdict, at_first = program.verdict, program.first_verdict
    return pick(verdict.program, "name", "speed_rpm", "depth_mm") | {
        "limit": verdicts.limit_text(verdict),
        "band": verdicts.band_text(verdict).replace("..", " to "),
        "margin": verdicts.margin_text(verdict),
        "turning": verdicts.chatter_risk_text(verdict),
        "left": frequency_margin_text(program.advice),
        "at_first": "-" if at_first is None else _verdict_cell(at_first.stability, at_first.stability.value),
        "now": _verdict_cell(verdict.stability, verdicts.verdict_text(verdict)),
    }


def _verdict_cell(word: Stability, text: str) -> TableCell:
    style = verdicts.VERDICT_STYLES[word]
    return TableCell(f"{style.symbol} {text}", style.css_class)


def make_forecast(data: ReportData) -> list[Section]:
    """Make the forecast dates; nothing for a single test."""
    if data.series.trend is None or data.series.is_baseline:
        return []
    course = Paragraph(f"{trend_sentence(data.series)}.")
    if no_dates_text(data.outlook):
        return [Section("Until when", [course])]
    dates = DataTable(["what", "becomes doubtful", "is not stable"], forecast_date_rows(data.outlook), "words")
    return [Section("Until when", [course, dates, Paragraph(FORECAST_ASSUMPTIONS, is_small=True)])]


def make_notes(data: ReportData) -> list[Section]:
    """Make remarks on the newest test of the series, and on both directions of its tool."""
    of_tap = [remark for remark in data.last.remarks if remark.code not in DIRECTION_CODES]
    of_tool = [remark for remark in data.assembly.remarks if remark.code in DIRECTION_CODES]
    merged = merge_remarks([*of_tap, *of_tool])
    return [Section("", [Paragraph(f"Note: {remark}.")], is_framed=False) for remark in merged]


def make_changes(data: ReportData) -> list[Section]:
    """Make the table of the first and the newest values and their change; of a single test only its values."""
    history = data.series.history
    rows = [*_measured_changes(history), *_model_changes(history)]
    if not rows:
        return []
    if data.series.is_baseline:
        values = DataTable(["value", f"{data.last.time:%Y-%m-%d}"], [[name, now] for name, _, now, _ in rows])
        text = "± is the standard error of this tap test alone. All later tests are compared with it."
        return [Section("What was measured", [values, Paragraph(text, is_small=True)])]
    first, last = (f"{row.time:%Y-%m-%d}" for row in (data.rows[0], data.last))
    limits = data.machine.limits
    reading = (
        "± of the newest is the standard error of one tap test alone; that of the start is, from 8 tests on, the "
        f"scatter from test to test.\nThe frequency limits, -{limits.frequency_warn_percent:g} % and "
        f"-{limits.frequency_alarm_percent:g} %, are set in machine.toml (the defaults are those of "
        "Gaber & Hashemi, 2015)."
    )
    left = estimate_preload(history, data.machine)
    preload = f"{left}." if left else ""
    table = DataTable(["value", f"at the start ({first})", last, "change"], rows)
    below = Paragraph(reading, is_small=True), Paragraph(preload[:1].upper() + preload[1:])
    return [Section("What has changed", [table, *below])]


def _measured_changes(history: SeriesHistory) -> Iterator[list[str]]:
    for name, label, scale in CHANGE_VALUES:
        values = history.values[name]
        if values.change.is_known:
            newest = getattr(values.known_rows[-1], name)
            now, start = (format_with_error(estimate.value, estimate.std, scale) for estimate in (newest, values.start))
            yield [label, start, now, f"{values.change.value:+z.2f} %"]


def _model_changes(history: SeriesHistory) -> Iterator[list[str]]:
    for name, label in MODEL_CHANGE_VALUES:
        values = [float(getattr(row, name)) for row in history.rows if np.isfinite(getattr(row, name))]
        if values and np.isfinite(getattr(history.rows[-1], name)):
            start, now = (f"{value / 1e6:.6g}" for value in (values[0], values[-1]))
            change = f"{100 * (values[-1] / values[0] - 1):+z.2f} %"
            yield [f"{label} tip stiffness, model (N/µm)", start, now, change]


def make_modes(data: ReportData) -> list[Section]:
    """Make the table of the modes of the newest test."""
    heads = ["natural frequency", "damping ratio (%)", "stiffness (N/µm)", "remark"]
    rows = list[list[str]]()
    for frequency, damping, stiffness, _ in data.last.modes:
        shown = "not known" if math.isnan(stiffness) else f"{stiffness / 1e6:.3f}"
        remark = "not a driving point" if stiffness < 0 else ""
        rows.append([f"{frequency:.2f} Hz", f"{damping * 100:.3f}", shown, remark])
    table = DataTable(heads, rows, if_empty="none was found")
    return [Section("Modes of the newest test", [table], is_framed=False)]


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
"""Functions that make the sections, in the order of the page."""
