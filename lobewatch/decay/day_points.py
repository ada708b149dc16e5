"""The points of a series: the tap tests of a day are one clamping, but for those that the tool was clamped anew for."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta
from statistics import median
from typing import NamedTuple

import numpy as np

DAY = timedelta(hours=24)
"""Time within which tap tests are one clamping where nobody says otherwise; chosen."""
Span = tuple[int, int]
"""First tap test of a point, and the one behind its last."""


class PercentSeries(NamedTuple):
    """Tap tests with one of their values, oldest first."""

    times: tuple[datetime, ...]
    """Times of the tests."""
    percents: tuple[float, ...]
    """Changes of the value since the first test (%)."""
    temperatures: tuple[float, ...]
    """Temperatures of the spindle (degC); NaN where not recorded."""
    reclamped: tuple[bool, ...]
    """Whether the tool was clamped anew for each of them."""

    def percent(self, span: Span) -> float:
        """Change of a point (%): mean of two, median from three on."""
        first, end = span
        if end - first > 2:
            return median(self.percents[first:end])
        return (self.percents[first] + self.percents[end - 1]) / 2

    def temperature(self, span: Span) -> float:
        """Mean of the temperatures recorded for a point; NaN where none was."""
        recorded = [temperature for temperature in self.temperatures[slice(*span)] if temperature == temperature]
        return sum(recorded) / len(recorded) if recorded else np.nan


def divide_into_points(series: PercentSeries) -> Iterator[Span]:
    """The points of a series, one test at least."""
    first = 0
    for tap in range(1, len(series.times)):
        if series.reclamped[tap] or series.times[tap] - series.times[first] >= DAY:
            yield first, tap
            first = tap
    yield first, len(series.times)
