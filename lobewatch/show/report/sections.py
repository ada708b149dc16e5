"""Make the sections of the report, in their order.

Contents follow ISO 17359 (condition monitoring) and ISO 13381-1 (prognostics).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from acquisition import merge_remarks
from lobewatch.history import HistoryRow
from lobewatch.machine import REFERENCE_CUT
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.measurement.hit_choice import format_decisions
from lobewatch.monitoring import SeriesStatus
from lobewatch.monitoring.change_detection import MIN_MONITORED_POINTS, SURE_CHANGE_SCORE
from lobewatch.monitoring.forecast import MIN_FORECAST_POINTS
from lobewatch.monitoring.status_rules import Alarm, is_early_alarm, sort_by_severity, worst_status
from lobewatch.monitoring.threshold_dates import date_of_days
from lobewatch.monitoring.trend import Trend
from lobewatch.show import trend as trends
from lobewatch.show.figures.lobe_figures import plot_lobes
from lobewatch.show.figures.trend_figures import ValueTrend, plot_frf, plot_trend
from lobewatch.show.history import condition_texts, cut_result_text
from lobewatch.show.programs import verdicts
from lobewatch.show.programs.advice import ProgramAdvice, advice_lines, format_rpm, frequency_margin_text
from lobewatch.show.report.measured_changes import make_values
from lobewatch.show.report.report_data import SHOWN_VALUES, ReportData, compute_lobe_history, make_value_trend
from lobewatch.show.report.section import (
    BulletList,
    DataTable,
    Drawing,
    NumberTable,
    Paragraph,
    Section,
    SectionPart,
    TableCell,
)
from lobewatch.show.sensors import sensor_rows
from lobewatch.show.terminal.status_labels import status_css_class, status_label
from lobewatch.tool import DIRECTION_CODES
from lobewatch.verdicts import Stability
from lobewatch.verdicts.speed_pockets import SPEEDS_ONLY_CODE

SectionMakers = Sequence[Callable[[ReportData], Sequence[Section]]]
"""Functions that make sections of the report in the order of the page; none if there is nothing to show."""
MAX_SHOWN_SERIES = 3
"""Largest number of series that are not folded."""
SERIES_HEADS = (
    *("series", "status", "f1 (Hz)", "f1 change", "trend", "rate", "margin to alarm"),
    *("scatter", f"alarm score (limit {SURE_CHANGE_SCORE:g})", "tests", "newest"),
)


def make_series(data: ReportData) -> list[Section]:
    """Make the table of series, the largest drop first, with the dates of the frequency limits."""
    alarm = data.machine.limits.frequency_alarm_percent
    rows = [_series_row(series, alarm) for series in data.outlook.status.series]
    shown, more = rows[:MAX_SHOWN_SERIES], rows[MAX_SHOWN_SERIES:]
    now, limits = data.outlook.status.time, data.outlook.limits
    dates = ", ".join(f"-{percent:g} % {trends.reach_text(reach, now)}" for percent, reach in limits)
    table = DataTable(SERIES_HEADS, shown, "words")
    note = Paragraph(data.no_dates or f"f1 limits reached: {dates}.", is_small=True)
    folded = Section(f"{len(more)} more series", [DataTable(SERIES_HEADS, more, "words")], "folded")
    return [Section("Series", [table, note]), *([folded] if more else [])]


def _series_row(series: SeriesStatus, alarm: float) -> list[str | TableCell]:
    ordered, trend, frequency = sort_by_severity(series.remarks), series.trend, series.history.frequency
    status, drop = (worst_status(ordered), is_early_alarm(ordered)), series.drop
    values = [frequency.start.value] if series.drop.is_known and not series.is_baseline else []
    values += [row.frequency.value for row in frequency.known_rows[-1:]]
    is_fitted = trend is not None and trend.forecast is not None
    score = trend.detection.scores[-1] if trend is not None else math.nan
    return [
        series.name,
        TableCell(status_label(*status), status_css_class(*status)),
        "\N{NO-BREAK SPACE}→ ".join(f"{value:.1f}" for value in values) or "-",
        "first test" if series.is_baseline else trends.change_text(series),
        trends.trend_text(series) or f"since {series.first_time:%Y-%m-%d}",
        (trend and trends.rate_text(trend)) or f"needs {MIN_FORECAST_POINTS} tests",
        _margin_text(alarm - drop.value) if drop.is_known else "-",
        f"{trend.spread:.2f} %" if trend is not None and is_fitted else "-",
        f"{score:.1f}" if math.isfinite(score) else f"needs {MIN_MONITORED_POINTS} tests",
        "0" if trend is None else str(len(trend.points)),
        f"{series.time:%Y-%m-%d}",
    ]


def _margin_text(margin: float) -> str:
    return f"{margin:.2f} %" if margin > 0 else "exceeded"


DATE_HEADS = "becomes doubtful", "becomes not stable"


def make_programs(data: ReportData) -> list[Section]:
    """Make the table of programs; folded: reasons, alternatives and uncertainty."""
    if not data.programs:
        return []
    dates = {} if data.no_dates else {name: texts for name, *texts in trends.forecast_date_rows(data.outlook)}
    heads = ["program", "verdict", *(DATE_HEADS if dates else ()), "run instead", "speed (rpm)", f"ap ({LENGTH.unit})"]
    heads += [f"limit, 98 % interval ({LENGTH.unit})", f"limit at speed ({LENGTH.unit})", "ap margin"]
    heads += ["chatter risk", "f1 margin", "first verdict"]
    table = DataTable(heads, [_program_row(program, dates) for program in data.programs], "words")
    checked = [program.verdict for program in data.programs if program.verdict.stability is not Stability.UNKNOWN]
    remarks = [remark for program in data.programs for remark in program.verdict.remarks]
    speeds = merge_remarks(remark for remark in remarks if remark.code == SPEEDS_ONLY_CODE)
    lines = [line for program in data.programs for line in advice_lines(program, data.machine)]
    notes = verdicts.verdict_notes(checked, data.machine)
    notes += [trends.FORECAST_ASSUMPTIONS] if dates else []
    notes += [f"Verdicts from the newest tap tests of each tool, by {checked[0].method}."] if checked else []
    below: list[SectionPart] = [BulletList([*lines, *map(str, speeds)])]
    below += [Paragraph(note, is_small=True) for note in notes]
    return [Section("Programs", [table]), Section("Reasons, alternatives and uncertainty", below, "folded")]


def _program_row(program: ProgramAdvice, dates: dict[str, list[str]]) -> list[str | TableCell]:
    """Return a row of the table of programs, with the values of `lobewatch check`."""
    verdict, at_first = program.verdict, program.first_verdict
    return [
        verdict.program.name,
        _verdict_cell(verdict.stability, verdicts.verdict_text(verdict)),
        *(dates.get(verdict.program.name, ["-", "-"]) if dates else ()),
        alternative_text(program),
        format_rpm(verdict.program.speed_rpm),
        LENGTH.number(verdict.program.depth_mm, "g"),
        verdicts.limits_text(verdict).replace("..", " to "),
        verdicts.limit_at_speed_text(verdict),
        verdicts.margin_text(verdict),
        verdicts.chatter_risk_text(verdict),
        frequency_margin_text(program.advice),
        "-" if at_first is None else _verdict_cell(at_first.stability, at_first.stability.value),
    ]


def _verdict_cell(word: Stability, text: str) -> TableCell:
    style = verdicts.VERDICT_STYLES[word]
    return TableCell(f"{style.symbol} {text}", style.css_class)


def alternative_text(program: ProgramAdvice) -> str:
    """Return the recommended speed and depth in a few words."""
    assembly, settings = program.verdict.assembly, (program.advice.best, program.advice.deepest_here)
    if program.verdict.stability is Stability.STABLE:
        return "no change"
    if program.verdict.stability is Stability.UNKNOWN or assembly is None or not assembly.is_complete:
        return "unknown, reasons below"
    texts = [
        f"{format_rpm(item.speed_rpm)} rpm, {LENGTH.text_at_most(item.depth_mm)}"
        for item in settings
        if item is not None
    ]
    return " or ".join(dict.fromkeys(texts)) or "another tool (no stable speed)"


def make_figures(data: ReportData) -> list[Section]:
    """Make all figures that have data; frequency and lobes next to each other, the others folded."""
    values = [*make_value_figures(data)]
    response = make_frequency_response(data, "folded" if values else "half")
    first, folded = (values[:1], [*values[1:], *response]) if values else (response, [])
    return [*first, *make_lobe_figure(data), *folded]


def make_value_figures(data: ReportData) -> Iterator[Section]:
    """Make a figure over time of each value that is known."""
    for value in SHOWN_VALUES:
        trend = make_value_trend(data, value)
        if trend is not None:
            texts = [value.text, *(["Dotted lines: maintenance."] if trend.events else [])]
            texts += ["Hollow points: excluded tests."] if trend.drawn_excluded else []
            texts += ["Line: trend. Band: 80 % interval of the forecast."] if trend.curve else []
            style = "half" if value is SHOWN_VALUES[0] else "folded"
            drawing = Drawing.of(plot_trend(trend), _tabulate_trend(trend))
            yield Section(value.heading, [Paragraph(" ".join(texts), is_small=True), drawing], style)


def _tabulate_trend(trend: ValueTrend) -> NumberTable:
    """Tabulate a value over time: tests, excluded tests, the fitted line, and the 80 % band of the forecast."""
    unit, scale, curve = trend.value.label, trend.value.scale, trend.curve
    tests = [(time, estimate.value / scale, estimate.std / scale) for time, estimate in trend.estimates]
    lines: list[list[Any]] = [["test", f"{time:%Y-%m-%d}", value, std, "", ""] for time, value, std in tests]
    lines += [["excluded", f"{time:%Y-%m-%d}", value, "", "", ""] for time, value in trend.excluded]
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
    """Make the lobes of the reference cut, or of the first program of the tool: first, now, and over time."""
    diagram = data.lobe_diagram
    if diagram is None:
        return []
    history = compute_lobe_history(data, diagram.cut)
    directions = data.assembly.directions
    method = f"{diagram.now.method}, {' and '.join(directions)} direction{'s' if len(directions) > 1 else ' only'}"
    text = f"{diagram.cut} ({method}): chatter above the line."
    if np.isinf(diagram.now.minimum.depth):
        text = f"{diagram.cut} has no stability limit in this speed range ({method})."
    if history:
        text += " Orange: chosen test or forecast (all modes drop by the same % as f1)."
    numbers = NumberTable.from_lobes(diagram.now.speed_rpm, [*diagram.depths.items(), *diagram.edges.items(), *history])
    drawing = Drawing.of(plot_lobes(diagram, is_small=True), numbers, len(history))
    return [Section("Stability lobes", [Paragraph(text, is_small=True), drawing], "half")]


def make_frequency_response(data: ReportData, style: str) -> list[Section]:
    """Make the receptance of the newest test and of the first; nothing if no force was measured."""
    first, newest = data.frfs
    if newest is None:
        return []
    band = data.response_band(newest)
    figure = plot_frf(first, newest, band, data.measurement.used, data.unexplained_peaks)
    drawing = Drawing.of(figure, NumberTable.from_response(newest.in_band(band)))
    text = f"Receptance {data.tap_place}. Fit: sum of the modes for lobes. Triangle: a peak that they do not explain."
    return [Section("Frequency response", [Paragraph(text, is_small=True), drawing], style)]


def make_notes(data: ReportData) -> list[Section]:
    """Make remarks on the machine, on the newest test of the series, and on both directions of its tool."""
    of_tap = [remark for remark in data.last.remarks if remark.code not in DIRECTION_CODES]
    of_tool = [remark for remark in data.assembly.remarks if remark.code in DIRECTION_CODES]
    lines = [*data.reasons[1], *map(str, merge_remarks([*of_tap, *of_tool]))]
    return [Section("Notes", [BulletList([*dict.fromkeys(lines)])])] if lines else []


def make_modes(data: ReportData) -> list[Section]:
    """Make the table of the modes of the newest test."""
    heads, rows = ["natural frequency", "damping ratio (%)", "stiffness (N/µm)", "remark"], list[list[str]]()
    for frequency, damping, stiffness, _ in data.last.modes:
        shown = "unknown" if math.isnan(stiffness) else f"{stiffness / 1e6:.3f}"
        remark = "not a driving point" if stiffness < 0 else ""
        rows.append([f"{frequency:.2f} Hz", f"{damping * 100:.3f}", shown, remark])
    return [Section("Modes of the newest test", [DataTable(heads, rows, if_empty="No modes found")], "folded")]


TAP_TABLE_HEADS = (
    *("time", "tool", "direction", "f_n (Hz)", "zeta (%)", "K (N/um)"),
    *("bearing stiffness (N/um)", "temperature (degC)"),
)
"""Headings of the numbers of tap tests."""
TAP_VALUE_FORMATS = (("{:.2f}", 1.0), ("{:.3f}", 0.01), ("{:.3f}", 1e6), ("{:.1f}", 1e6))
"""Format and size of the unit of f1, zeta, K and the bearing stiffness."""


def make_events(data: ReportData) -> list[Section]:
    """Make a list of events, acknowledged alarms and excluded tests, oldest first."""
    files = data.analysis.files
    reasons = {entry.id: entry.excluded for entry in files.excluded}
    ends = {True: " (new baseline)", False: ""}
    lines = [(event.time, f"{event.text}{ends[event.new_baseline]}") for event in files.contents.events]
    lines += [(word.time, f"{word.alarm_id} {word}") for word in files.contents.acknowledgements]
    for row in data.excluded_rows:
        value = f", {row.frequency.value:.1f} Hz" if row.frequency.is_known else ""
        lines.append((row.time, f"tap test excluded ({reasons[row.tap_id]}){value}"))
    bullets = BulletList([f"{time.astimezone():%Y-%m-%d}: {text}" for time, text in sorted(lines)])
    return [Section("Events and excluded tests", [bullets], "folded")] if lines else []


def make_test_cuts(data: ReportData) -> list[Section]:
    """Make the table of test cuts, the newest first."""
    heads, rows = ["time", "cut", "tool", "rpm", f"ap ({LENGTH.unit})", "detected", "by"], list[list[str]]()
    for cut in reversed(data.analysis.cuts):
        about = [f"{cut.at.astimezone():%Y-%m-%d %H:%M}", cut.program or REFERENCE_CUT, cut.tool]
        rows.append(
            [*about, f"{cut.speed_rpm:.0f}", LENGTH.number(1e3 * cut.depth, ".4g"), cut_result_text(cut), cut.by]
        )
    table = DataTable(heads, rows, "words", numbers=NumberTable(heads, rows))
    return [Section("Test cuts", [table], "folded")] if rows else []


def make_tap_tests(data: ReportData) -> list[Section]:
    """Make the table of tap tests, the newest first, and their numbers, the oldest first."""
    history = data.analysis.checked_history.current
    heads = ["time", "tool", "direction", "f1 (Hz)", "zeta (%)", "K (N/µm)", "k_b (N/µm)", "questions, verdicts"]
    numbers = NumberTable(TAP_TABLE_HEADS, [_tap_values(row) for row in history])
    table = DataTable(heads, [_tap_row(row) for row in reversed(history)], "words taps", numbers=numbers)
    return [Section("Tap tests", [table], "folded")]


def _tap_row(row: HistoryRow) -> list[str]:
    values = (row.frequency, row.damping_ratio, row.stiffness, row.bearing_stiffness)
    formats = zip(values, TAP_VALUE_FORMATS, strict=True)
    cells = [form.format(value.value / scale) if value.is_known else "-" for value, (form, scale) in formats]
    words = [f"{name} {verdicts.VERDICT_STYLES[it.stability].symbol}" for name, it in (row.verdicts or {}).items()]
    asked = [f"question {question.code}" for question in row.questions]
    return [f"{row.time.astimezone():%Y-%m-%d %H:%M}", row.tool, row.direction, *cells, ", ".join([*asked, *words])]


def _tap_values(row: HistoryRow) -> list[Any]:
    values = (row.frequency.value, row.damping_ratio.value / 0.01, row.stiffness.value / 1e6)
    temperature = math.nan if row.conditions.temperature_c is None else float(row.conditions.temperature_c)
    return [row.time.isoformat(), row.tool, row.direction, *values, row.bearing_stiffness.value / 1e6, temperature]


FAILURE_MODE = "stiffness loss of bearings, joints or clamping, seen as a drop of f1 at the tool tip (not rotating)"
NOT_DETECTED = (
    "Damage without stiffness loss: pitting, cage, lubrication, seals, unbalance, motor, weak drawbar",
    "Preload changes by heat and speed while the spindle rotates",
    "Damage since the newest tap test",
)
ALARM_RULE = "two clampings in a row with a score that scatter reaches once in 2000"
"""Rule of the alarm."""
INDEPENDENT_CONFIDENCE = "False alarms: 5 of 100 healthy series within 60 clampings"
"""Confidence of the alarm with independent scatter, measured (docs/decay.md)."""


def _alarm_confidence(trend: Trend | None) -> str:
    """Return rule and confidence of the alarm."""
    if trend is None or len(trend.points) < MIN_MONITORED_POINTS:
        return f"needs {MIN_MONITORED_POINTS} clampings, except at the fixed limits"
    check = trend.scatter_check
    if check is None or check.is_independent:
        return f"{ALARM_RULE}. {INDEPENDENT_CONFIDENCE}"
    share = check.false_alarm_share
    rate = "unknown" if share is None else f"{100 * share:.0f} of 100 series within 24 clampings"
    return f"{ALARM_RULE}. False alarms: {rate}"


def make_sign_off(data: ReportData) -> list[Section]:
    """Make the last section: measurement chain, confidence, open alarms, and room for a signature."""
    tap, circumstances = data.newest, data.newest.circumstances
    hits = f"{len(tap.accepted)} of {len(tap.hits)} averaged" if tap.hits else "unknown"
    hits += f" (by hand: {format_decisions(tap.decisions)})" if tap.decisions else ""
    rows = [
        ("machine", data.machine.machine.name),
        ("folder", data.analysis.folder.path.resolve().name),
        ("newest tap test", f"{data.last.time.astimezone():%Y-%m-%d %H:%M}, {data.series.name}"),
        ("file", tap.id),
        ("hits", hits),
        *(("condition", text) for text in condition_texts(data.last.conditions)),
        ("operator", circumstances.operator or "unknown"),
        ("device", circumstances.device or "unknown (file)"),
        *sensor_rows(tap.hits[0].channels or () if tap.hits else (), data.assembly.chain_checks),
        ("cutting coefficients", "machine.toml"),
        ("monitored failure", FAILURE_MODE),
        ("alarm", _alarm_confidence(data.series.trend)),
        ("forecast dates", "80 % intervals for unchanged use of the machine"),
        *(("open alarm", _alarm_text(alarm)) for alarm in data.outlook.status.alarms),
        ("name, date, signature", ""),
    ]
    unseen = Paragraph("Not detected:"), BulletList(NOT_DETECTED)
    return [Section("Sign-off", [DataTable(["item", "value"], rows, "words"), *unseen], "folded")]


def _alarm_text(alarm: Alarm) -> str:
    word = alarm.acknowledgement or "not acknowledged"
    return f"{alarm.about}: {alarm.code} since {alarm.triggered_at.astimezone():%Y-%m-%d}, {word} ({alarm.id})"


SECTIONS: SectionMakers = (
    make_figures,
    make_notes,
    make_values,
    make_modes,
    make_events,
    make_test_cuts,
    make_tap_tests,
    make_sign_off,
)
"""Functions that make the sections below the first screen, in the order of the page."""
