"""Values over time with what was done to the machine and the tests that do not count, as pictures and as a list."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lobewatch.decay import Standing
from lobewatch.decay.trend import Trend
from lobewatch.history import Row
from lobewatch.history.left_out import left_out
from lobewatch.logbook import Logbook
from lobewatch.machine.journal.event import MaintenanceEvent
from lobewatch.show.figures.style import svg
from lobewatch.show.figures.trend_figures import Marks, course_of, trend_figure
from lobewatch.show.report.figure_data import Numbers, value_numbers

NEAR = 0.15
"""Relative distance from all that counts up to which a value that does not count is drawn."""


class Picture(NamedTuple):
    """A section of the report."""

    heading: str
    text: str
    """A sentence below the heading."""
    svg: str
    numbers: Numbers | None = None
    """What is drawn."""


class Trends(NamedTuple):
    """What has become of one series."""

    pictures: Sequence[Picture]
    """Values over time, where they are known."""
    happened: Sequence[str]
    """A line for each event of the machine and each test that does not count, oldest first."""


def trends(logbook: Logbook, rows: Sequence[Row], standing: Standing) -> Trends:
    """Of the rows of one series, oldest first."""
    out = left_out(logbook.folder, logbook.files.excluded, rows)
    reasons = {entry.id: entry.excluded for entry in logbook.files.excluded}
    told = [(event.time, event_line(event)) for event in logbook.files.events]
    told += [(row.time, _excluded_line(row, reasons[row.tap_id])) for row in out]
    series = standing.series_of(rows[-1].tool, rows[-1].direction)
    return Trends(_pictures(logbook, rows, out, series.trend if series else None), [line for _, line in sorted(told)])


def event_line(event: MaintenanceEvent) -> str:
    """Day and text of an event."""
    return f"{event.time.astimezone():%Y-%m-%d}: {event.text}{' (new baseline)' if event.new_baseline else ''}"


def _excluded_line(row: Row, reason: str) -> str:
    value = f", f_n {row.frequency.value:.1f} Hz" if row.frequency.is_known else ""
    return f"{row.time.astimezone():%Y-%m-%d}: tap test excluded ({reason}){value}"


def _pictures(logbook: Logbook, rows: Sequence[Row], out: Sequence[Row], trend: Trend | None) -> list[Picture]:
    found = []
    since = rows[0].time if rows[0].baseline is None else rows[0].baseline
    events = [(event.time, event.text) for event in logbook.files.events if event.time >= since]
    for name, heading, unit, scale, text in (
        ("frequency", "Natural frequency", "Hz", 1.0, "Bars: 95 % interval of each tap alone."),
        ("bearing_stiffness", "Bearing stiffness", "N/µm", 1e6, "Equivalent stiffness of each bearing in the model."),
    ):
        known = [(row.time, getattr(row, name)) for row in rows if getattr(row, name).is_known]
        if known:
            values, stds = np.array([estimate for _, estimate in known]).T / scale
            limits = logbook.machine.limits if name == "frequency" else None
            near = (1 - NEAR) * values.min(), (1 + NEAR) * values.max()
            aside = [(row.time, getattr(row, name).value / scale) for row in out]
            marks = Marks(events, [(time, value) for time, value in aside if near[0] <= value <= near[1]])
            text += " Dotted lines: what was done." if events else ""
            text += " Hollow: tests that do not count." if marks.hollow else ""
            times = [time for time, _ in known]
            course = course_of(trend) if trend is not None and name == "frequency" else None
            text += " Line: fitted; band: where it goes, 80 %." if course else ""
            figure = trend_figure(times, values, stds, f"{heading.lower()} ({unit})", limits, marks, course)
            numbers = value_numbers(f"{heading.lower()} ({unit})", scale, known, aside, course)
            found.append(Picture(heading, text, svg(figure), numbers))
    return found
