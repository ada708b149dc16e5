"""Make the sections of the report below its summary, in their order.

What such a report says: ISO 17359 (condition monitoring) and ISO 13381-1 (prognostics).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from acquisition import Channel, merge_remarks
from dsm import format_with_error
from lobewatch.history import HistoryRow
from lobewatch.machine import REFERENCE_CUT
from lobewatch.monitoring.change_detection import MIN_MONITORED_POINTS
from lobewatch.monitoring.forecast import MIN_FORECAST_POINTS
from lobewatch.monitoring.series_history import SeriesHistory, estimate_preload
from lobewatch.monitoring.status_rules import Alarm, is_early_alarm, sort_by_severity, worst_status
from lobewatch.monitoring.threshold_dates import date_of_days
from lobewatch.show import trend as trends
from lobewatch.show.figures.lobe_figures import plot_lobes, plot_waterfall
from lobewatch.show.figures.trend_figures import ValueTrend, plot_frf, plot_trend
from lobewatch.show.history import cut_result_text
from lobewatch.show.programs import verdicts
from lobewatch.show.programs.advice import ProgramAdvice, advice_lines, frequency_margin_text
from lobewatch.show.report.report_data import SHOWN_VALUES, ReportData, make_value_trend
from lobewatch.show.report.section import BulletList, DataTable, Fragment, NumberTable, Paragraph, Section, TableCell
from lobewatch.show.terminal.output import count_noun, pick
from lobewatch.show.terminal.status_labels import status_css_class, status_label
from lobewatch.tool import DIRECTION_CODES
from lobewatch.verdicts import Stability
from lobewatch.verdicts.speed_pockets import SPEEDS_ONLY_CODE


def make_figures(data: ReportData) -> list[Section]:
    """Make all figures that have data."""
    return [*make_value_figures(data), *make_lobe_figure(data), *make_waterfall(data), *make_frequency_response(data)]


def make_value_figures(data: ReportData) -> Iterator[Section]:
    """Make a figure over time of each value that is known."""
    for value in SHOWN_VALUES:
        trend = make_value_trend(data, value)
        if trend is not None:
            texts = [value.text, *(["Dotted lines: what was done."] if trend.events else [])]
            texts += ["Hollow: tests that do not count."] if trend.drawn_excluded else []
            texts += ["Line: fitted; band: where it goes, 80 %."] if trend.curve else []
            yield Section.with_figure(value.heading, " ".join(texts), plot_trend(trend), _tabulate_trend(trend))


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
    numbers = NumberTable.from_lobes(diagram.now.speed_rpm, {**diagram.depths, **diagram.edges})
    return [Section.with_figure(heading, text, plot_lobes(diagram), numbers)]


def make_waterfall(data: ReportData) -> list[Section]:
    """Make a map of limiting depth over speed and time."""
    course = data.lobe_history
    if course is None or not np.isfinite(course.depth).any():
        return []
    text = f"Limit of the {course.cut} by zero order after each tap test; bright is deep."
    figure = plot_waterfall(course.speed_rpm, course.times, course.depth)
    return [Section.with_figure("Pockets over time", text, figure)]


def make_frequency_response(data: ReportData) -> list[Section]:
    """Make the receptance of the newest test and of the first; nothing where no force was measured."""
    first, newest = data.first, data.newest.frf
    if newest is None:
        return []
    band = data.response_band(newest)
    figure = plot_frf(None if first is None else first.frf, newest, band)
    text, numbers = "Receptance: displacement over force.", NumberTable.from_response(newest.in_band(band))
    return [Section.with_figure("Frequency response", text, figure, numbers)]


def make_lobe_history(data: ReportData) -> list[Section]:
    """Make the lobe diagrams over time, with a slider."""
    if data.lobe_history is None:
        return []
    return [Section("", [Fragment("lobe_course.html", {"course": data.lobe_history})], has_plot=True)]


SectionMakers = Sequence[Callable[[ReportData], Sequence[Section]]]
"""Functions that make sections of the report in the order of the page, none where there is nothing to show."""
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
    notes, method = verdicts.verdict_notes(checked, data.machine), checked[0].method if checked else ""
    rows = {"programs": list(map(_program_row, data.programs)), "lines": [*lines, *map(str, speeds)]}
    content = rows | {"doubt": notes, "method": method}
    return [Section("Cutting programs", [Fragment("programs.html", content)])]


def _program_row(program: ProgramAdvice) -> dict[str, Any]:
    """Return a row of the table of programs, with the same words as `lobewatch check`."""
    verdict, at_first = program.verdict, program.first_verdict
    return {
        **pick(verdict.program, "name", "speed_rpm", "depth_mm"),
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
    course = Paragraph(f"{trends.trend_sentence(data.series)}.")
    if trends.no_dates_text(data.outlook):
        return [Section("Until when", [course])]
    dates = DataTable(["what", "becomes doubtful", "is not stable"], trends.forecast_date_rows(data.outlook), "words")
    return [Section("Until when", [course, dates, Paragraph(trends.FORECAST_ASSUMPTIONS, is_small=True)])]


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
            yield [f"{label} tip stiffness, model (N/µm)", start, now, f"{100 * (values[-1] / values[0] - 1):+z.2f} %"]


def make_modes(data: ReportData) -> list[Section]:
    """Make the table of the modes of the newest test."""
    heads, rows = ["natural frequency", "damping ratio (%)", "stiffness (N/µm)", "remark"], list[list[str]]()
    for frequency, damping, stiffness, _ in data.last.modes:
        shown = "not known" if math.isnan(stiffness) else f"{stiffness / 1e6:.3f}"
        remark = "not a driving point" if stiffness < 0 else ""
        rows.append([f"{frequency:.2f} Hz", f"{damping * 100:.3f}", shown, remark])
    return [Section("Modes of the newest test", [DataTable(heads, rows, if_empty="none was found")], is_framed=False)]


TAP_TABLE_HEADS = (
    *("time", "tool", "direction", "f_n (Hz)", "zeta (%)", "K (N/um)"),
    *("bearing stiffness (N/um)", "temperature (degC)"),
)
"""Headings of the numbers of tap tests."""
TAP_VALUE_FORMATS = (("{:.2f}", 1.0), ("{:.3f}", 0.01), ("{:.3f}", 1e6), ("{:.1f}", 1e6))
"""Format and size of the unit of f_n, zeta, K and the bearing stiffness."""
COUNTING_TEXT = "Those that count, the newest first"
"""Words for what a list holds."""


def make_series(data: ReportData) -> list[Section]:
    """Make a table of the series, the largest drop first."""
    heads, rows = ["tool", "direction", "light", "points", "newest", "change", "rate"], list[list[str | TableCell]]()
    for series in data.outlook.status.series:
        ordered, trend = sort_by_severity(series.remarks), series.trend
        worst, early = worst_status(ordered), is_early_alarm(ordered)
        light = TableCell(status_label(worst, early), status_css_class(worst, early))
        points = "0" if trend is None else str(len(trend.points))
        rate = "-" if trend is None else trends.rate_text(trend) or f"from {MIN_FORECAST_POINTS} points on"
        change = trends.change_since_start_text(series)
        rows.append([series.tool, series.direction, light, points, f"{series.time:%Y-%m-%d}", change, rate])
    return [Section("Tools and directions", [DataTable(heads, rows, "words")], is_framed=False)]


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
    return [Section("What was done, and tests that do not count", [bullets])] if lines else []


def make_test_cuts(data: ReportData) -> list[Section]:
    """Make the table of test cuts, the newest first."""
    rows = list[list[str]]()
    for cut in reversed(data.analysis.cuts):
        about = [f"{cut.at.astimezone():%Y-%m-%d %H:%M}", cut.program or REFERENCE_CUT, cut.tool]
        rows.append([*about, f"{cut.speed_rpm:.0f}", f"{1e3 * cut.depth:.4g}", cut_result_text(cut), cut.by])
    table = DataTable(["when", "cut", "tool", "rpm", "mm", "heard", "by"], rows, "words")
    note = Paragraph(f"{COUNTING_TEXT}, as they were heard.", is_small=True)
    return [Section("Test cuts", [note, table])] if rows else []


def make_tap_tests(data: ReportData) -> list[Section]:
    """Make the table of tap tests, the newest first, and their numbers, the oldest first."""
    history = data.analysis.history.current
    heads = ["when", "tool", "in", "frequency (Hz)", "damping (%)", "stiffness (N/µm)", "bearings (N/µm)", "said of it"]
    numbers = NumberTable(TAP_TABLE_HEADS, [_tap_values(row) for row in history])
    table = DataTable(heads, [_tap_row(row) for row in reversed(history)], "words taps", numbers=numbers, key="taps")
    return [Section("Tap tests", [Paragraph(f"{COUNTING_TEXT}.", is_small=True), table], is_framed=False)]


def _tap_row(row: HistoryRow) -> list[str]:
    values = (row.frequency, row.damping_ratio, row.stiffness, row.bearing_stiffness)
    formats = zip(values, TAP_VALUE_FORMATS, strict=True)
    cells = [form.format(value.value / scale) if value.is_known else "-" for value, (form, scale) in formats]
    words = [
        f"{name} {verdicts.VERDICT_STYLES[ruling.stability].symbol}" for name, ruling in (row.verdicts or {}).items()
    ]
    asked = [f"question {question.code}" for question in row.questions]
    return [f"{row.time.astimezone():%Y-%m-%d %H:%M}", row.tool, row.direction, *cells, "; ".join([*asked, *words])]


def _tap_values(row: HistoryRow) -> list[Any]:
    values = (row.frequency.value, row.damping_ratio.value / 0.01, row.stiffness.value / 1e6)
    warmth = math.nan if row.conditions.temperature_c is None else float(row.conditions.temperature_c)
    return [row.time.isoformat(), row.tool, row.direction, *values, row.bearing_stiffness.value / 1e6, warmth]


FAILURE_MODE = (
    "loss of stiffness of bearings, joints and clamping, seen as a fall of the natural frequency that is followed at "
    "the tool tip, spindle standing"
)
"""Failure mode that is monitored."""
NOT_DETECTED: Sequence[str] = (
    "damage that leaves the stiffness as it is: pitting, cage, lubrication, seals, unbalance, motor, drawbar below its "
    "clamping force",
    "what heat and speed do to the preload while the spindle turns",
    "what has happened since the newest tap test",
)
"""Damage that no tap test detects."""
TOO_FEW_CLAMPINGS = f"no alarm by scatter below {MIN_MONITORED_POINTS} clampings"
"""Confidence of the alarm of a short series."""
ALARM_CONFIDENCE = (
    "alarm: two clampings running, each with a chance of 1 in 2000 of being scatter alone; of 100 healthy series 5 "
    "raise one in 60 clampings"
)
"""Confidence of the alarm; measured, docs/decay.md."""
DATE_CONFIDENCE = "dates: 80 % ranges, if the machine is used as before"
"""Confidence of the forecast."""


def make_provenance(data: ReportData) -> list[Section]:
    """Make the last section: what was measured with what, how sure it is, and room for a signature."""
    points = 0 if data.series.trend is None else len(data.series.trend.points)
    confidence = ALARM_CONFIDENCE if points >= MIN_MONITORED_POINTS else TOO_FEW_CLAMPINGS
    tap = data.newest
    rows = [
        ("machine", data.machine.machine.name),
        ("folder", data.analysis.folder.path.resolve().name),
        ("tool, direction", data.series.name),
        ("newest tap test", f"{data.last.time.astimezone():%Y-%m-%d %H:%M}"),
        ("hammer held by", tap.circumstances.operator or "not said"),
        ("device", tap.circumstances.device or "not known: a recorded file"),
        *map(_sensor_row, tap.hits[0].channels or () if tap.hits else ()),
        ("failure mode watched", FAILURE_MODE),
        ("confidence", f"{confidence}; {DATE_CONFIDENCE}"),
        *(("alarm", _alarm_text(alarm)) for alarm in data.outlook.status.alarms),
        ("name, date, signature", ""),
    ]
    unseen = Paragraph("It does not see:"), BulletList(NOT_DETECTED)
    return [Section("For whoever signs", [DataTable(["what", "is"], rows, "words"), *unseen])]


def _alarm_text(alarm: Alarm) -> str:
    word = alarm.acknowledgement or "not acknowledged"
    return f"{alarm.about}: {alarm.code}, raised {alarm.triggered_at.astimezone():%Y-%m-%d}, {word}; name: {alarm.id}"


def _sensor_row(channel: Channel) -> tuple[str, str]:
    name, unit = ("hammer", "N") if channel.quantity == "force" else ("accelerometer", "(m/s²)")
    number = f"serial number {channel.serial_number or 'not known'}"
    calibrated = f"calibrated {channel.calibration_date}" if channel.calibration_date else "calibration not known"
    return name, f"{number}, {1e3 * channel.sensitivity:.4g} mV/{unit}, {calibrated}"


SECTIONS: SectionMakers = (
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
