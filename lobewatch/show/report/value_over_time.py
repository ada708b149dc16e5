"""A value of a series over time: what of it is drawn, large in its section and small on the first screen."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from lobewatch.machine import Limits
from lobewatch.measuring.estimate import Estimate
from lobewatch.show.figures.trend_figures import LOW, Marks, TrendCurve, course_of, trend_figure
from lobewatch.show.report.material import ReportMaterial

NEAR = 0.15
"""Relative distance from all that counts up to which a value that does not count is drawn."""
FEWEST = 2
"""Tap tests with a value from which on it has a course."""


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

    @property
    def label(self) -> str:
        """Name of the ordinate."""
        return f"{self.heading.lower()} ({self.unit})"


FREQUENCY = SeriesValue("frequency", "Natural frequency", "Hz", 1.0, "Bars: 95 % interval of each tap alone.")
BEARINGS = SeriesValue(
    "bearing_stiffness", "Bearing stiffness", "N/µm", 1e6, "Equivalent stiffness of each bearing in the model."
)


class ValueOverTime(NamedTuple):
    """What is drawn of a value."""

    value: SeriesValue
    """Which it is."""
    estimates: Sequence[tuple[datetime, Estimate]]
    """Tap tests that know it, at least FEWEST."""
    aside: Sequence[tuple[datetime, float]]
    """Tap tests that do not count, in the unit shown."""
    marks: Marks
    """Marks beside the course."""
    limits: Limits | None
    """Limits of its fall; None where it has none."""
    course: TrendCurve | None
    """Line that is fitted to it and goes on; None where there is none."""

    def figure(self, size: tuple[float, float] = LOW) -> Figure:
        """The picture, of this size (inches)."""
        values, stds = np.array([estimate for _, estimate in self.estimates]).T / self.value.scale
        times = [time for time, _ in self.estimates]
        return trend_figure(times, values, stds, self.value.label, self.limits, self.marks, self.course, size)


def value_over_time(material: ReportMaterial, value: SeriesValue) -> ValueOverTime | None:
    """What is drawn of a value of the series; None where too few tap tests know it."""
    rows = material.rows
    estimates = [(row.time, getattr(row, value.field)) for row in rows if getattr(row, value.field).is_known]
    if len(estimates) < FEWEST:
        return None
    since = rows[0].time if rows[0].baseline is None else rows[0].baseline
    events = [(event.time, event.text) for event in material.analysis.files.events if event.time >= since]
    numbers = [estimate.value / value.scale for _, estimate in estimates]
    near = (1 - NEAR) * min(numbers), (1 + NEAR) * max(numbers)
    aside = [(row.time, getattr(row, value.field).value / value.scale) for row in material.excluded_rows]
    marks = Marks(events, [(time, number) for time, number in aside if near[0] <= number <= near[1]])
    is_followed, trend = value is FREQUENCY, material.series.trend
    limits = material.machine.limits if is_followed else None
    course = course_of(trend) if trend is not None and is_followed else None
    return ValueOverTime(value, estimates, aside, marks, limits, course)
