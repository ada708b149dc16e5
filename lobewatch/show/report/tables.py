"""Make the tables of the report: series, events, test cuts, tap tests, provenance.

What such a report says: ISO 17359 (condition monitoring) and ISO 13381-1 (prognostics).
"""

import math
from collections.abc import Sequence
from typing import Any

from acquisition import Channel
from lobewatch.history import HistoryRow
from lobewatch.machine import REFERENCE_CUT
from lobewatch.monitoring.change_detection import MIN_MONITORED_POINTS
from lobewatch.monitoring.forecast import MIN_FORECAST_POINTS
from lobewatch.monitoring.status_rules import Alarm, is_early_alarm, sort_by_severity, worst_status
from lobewatch.show.history import cut_result_text
from lobewatch.show.programs.verdicts import VERDICT_STYLES
from lobewatch.show.report.report_data import ReportData
from lobewatch.show.report.section import BulletList, DataTable, NumberTable, Paragraph, Section, TableCell
from lobewatch.show.terminal.status_labels import status_css_class, status_label
from lobewatch.show.trend import change_since_start_text, rate_text

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
        rate = "-" if trend is None else rate_text(trend) or f"from {MIN_FORECAST_POINTS} points on"
        change = change_since_start_text(series)
        rows.append([series.tool, series.direction, light, points, f"{series.time:%Y-%m-%d}", change, rate])
    return [Section("Tools and directions", [DataTable(heads, rows, "words")], is_framed=False)]


def make_events(data: ReportData) -> list[Section]:
    """Make a list of events, acknowledged alarms and excluded tests, oldest first."""
    files = data.analysis.files
    reasons = {entry.id: entry.excluded for entry in files.excluded}
    lines = [
        (item.time, f"{item.text}{' (new baseline)' if item.new_baseline else ''}") for item in files.contents.events
    ]
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
    words = [f"{name} {VERDICT_STYLES[ruling.stability].symbol}" for name, ruling in (row.verdicts or {}).items()]
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
    channels = tap.hits[0].channels or () if tap.hits else ()
    rows = [
        ("machine", data.machine.machine.name),
        ("folder", data.analysis.folder.path.resolve().name),
        ("tool, direction", data.series.name),
        ("newest tap test", f"{data.last.time.astimezone():%Y-%m-%d %H:%M}"),
        ("hammer held by", tap.circumstances.operator or "not said"),
        ("device", tap.circumstances.device or "not known: a recorded file"),
        *((SENSOR_NAMES[channel.quantity], _sensor_text(channel)) for channel in channels),
        ("failure mode watched", FAILURE_MODE),
        ("confidence", f"{confidence}; {DATE_CONFIDENCE}"),
        *(("alarm", _alarm_text(alarm)) for alarm in data.outlook.status.alarms),
        ("name, date, signature", ""),
    ]
    unseen = Paragraph("It does not see:"), BulletList(NOT_DETECTED)
    return [Section("For whoever signs", [DataTable(["what", "is"], rows, "words"), *unseen])]


SENSOR_NAMES = {"force": "hammer", "acceleration": "accelerometer"}


def _alarm_text(alarm: Alarm) -> str:
    word = alarm.acknowledgement or "not acknowledged"
    return f"{alarm.about}: {alarm.code}, raised {alarm.triggered_at.astimezone():%Y-%m-%d}, {word}; name: {alarm.id}"


def _sensor_text(channel: Channel) -> str:
    unit = "N" if channel.quantity == "force" else "(m/s²)"
    number = f"serial number {channel.serial_number}" if channel.serial_number else "serial number not known"
    calibrated = f"calibrated {channel.calibration_date}" if channel.calibration_date else "calibration not known"
    return f"{number}, {1e3 * channel.sensitivity:.4g} mV/{unit}, {calibrated}"
