"""Values of a series over time and its frequency response, with what was done and the tests that do not count."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from acquisition import Frf
from lobewatch.history import Row
from lobewatch.machine import Machine
from lobewatch.machine.journal.event import MaintenanceEvent
from lobewatch.show.figures.style import svg
from lobewatch.show.figures.trend_figures import Marks, course_of, frf_figure, trend_figure
from lobewatch.show.report.figure_data import response_numbers, value_numbers
from lobewatch.show.report.material import ReportMaterial
from lobewatch.show.report.section import BulletList, Download, Drawing, Paragraph, Section

NEAR = 0.15
"""Relative distance from all that counts up to which a value that does not count is drawn."""
BELOW, ABOVE = 0.6, 1.4
"""Ends of the frequencies shown over those of the usable band; chosen."""


class SeriesValue(NamedTuple):
    """A value of the tap tests of a series that is shown over time."""

    field: str
    """Name of the field of a row."""
    heading: str
    """Heading of its section."""
    unit: str
    """Unit that it is shown in."""
    scale: float
    """Size of that unit (SI)."""
    text: str
    """Sentence on how to read it."""


VALUES = (
    SeriesValue("frequency", "Natural frequency", "Hz", 1.0, "Bars: 95 % interval of each tap alone."),
    SeriesValue(
        "bearing_stiffness", "Bearing stiffness", "N/µm", 1e6, "Equivalent stiffness of each bearing in the model."
    ),
)


def happened(material: ReportMaterial) -> list[Section]:
    """A line for each event of the machine and each test that does not count, oldest first."""
    files = material.analysis.files
    reasons = {entry.id: entry.excluded for entry in files.excluded}
    lines = [(event.time, event_line(event)) for event in files.events]
    lines += [(row.time, _excluded_line(row, reasons[row.tap_id])) for row in material.excluded_rows]
    if not lines:
        return []
    heading = "What was done, and tests that do not count"
    return [Section(heading, [BulletList([line for _, line in sorted(lines)])])]


def event_line(event: MaintenanceEvent) -> str:
    """Day and text of an event."""
    return f"{event.time.astimezone():%Y-%m-%d}: {event.text}{' (new baseline)' if event.new_baseline else ''}"


def _excluded_line(row: Row, reason: str) -> str:
    value = f", f_n {row.frequency.value:.1f} Hz" if row.frequency.is_known else ""
    return f"{row.time.astimezone():%Y-%m-%d}: tap test excluded ({reason}){value}"


def values_over_time(material: ReportMaterial) -> list[Section]:
    """A picture of each value that is known."""
    return [section for value in VALUES if (section := _value_over_time(material, value)) is not None]


def _value_over_time(material: ReportMaterial, value: SeriesValue) -> Section | None:
    rows, scale, text = material.rows, value.scale, value.text
    since = rows[0].time if rows[0].baseline is None else rows[0].baseline
    events = [(event.time, event.text) for event in material.analysis.files.events if event.time >= since]
    estimates = [(row.time, getattr(row, value.field)) for row in rows if getattr(row, value.field).is_known]
    if not estimates:
        return None
    values, stds = np.array([estimate for _, estimate in estimates]).T / scale
    near = (1 - NEAR) * values.min(), (1 + NEAR) * values.max()
    aside = [(row.time, getattr(row, value.field).value / scale) for row in material.excluded_rows]
    marks = Marks(events, [(time, number) for time, number in aside if near[0] <= number <= near[1]])
    is_followed, trend = value.field == "frequency", material.series.trend
    limits = material.machine.limits if is_followed else None
    course = course_of(trend) if trend is not None and is_followed else None
    text += " Dotted lines: what was done." if events else ""
    text += " Hollow: tests that do not count." if marks.hollow else ""
    text += " Line: fitted; band: where it goes, 80 %." if course else ""
    label = f"{value.heading.lower()} ({value.unit})"
    figure = trend_figure([time for time, _ in estimates], values, stds, label, limits, marks, course)
    numbers = value_numbers(label, scale, estimates, aside, course)
    return Section(value.heading, [Paragraph(text, is_small=True), Drawing(svg(figure)), Download(numbers)])


def frequency_response(material: ReportMaterial) -> list[Section]:
    """Receptance of the newest test, and of the first."""
    first, newest = material.first, material.newest.frf
    band = _shown_band(newest, material.machine)
    figure = frf_figure(None if first is None else first.frf, newest, band)
    text, numbers = "Receptance: displacement over force.", response_numbers(newest.in_band(band))
    return [Section("Frequency response", [Paragraph(text, is_small=True), Drawing(svg(figure)), Download(numbers)])]


def _shown_band(frf: Frf, machine: Machine) -> tuple[float, float]:
    low, high = machine.mode.band_hz or frf.usable_band or (float(frf.frequency[0]), float(frf.frequency[-1]))
    return max(BELOW * low, float(frf.frequency[0])), min(ABOVE * high, float(frf.frequency[-1]))
