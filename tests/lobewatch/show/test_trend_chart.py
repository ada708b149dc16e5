"""Test the chart of characters: points and fitted line over all dates."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np

from lobewatch.monitoring.trend import TapValue, fit_trend
from lobewatch.show.trend import CHART_WIDTH, chart_lines

START = datetime(2024, 1, 15, 9, tzinfo=UTC)


def test_the_line_runs_through_the_points_of_a_steady_fall_to_the_last() -> None:
    percents = -0.4 * np.arange(24.0)
    taps = [
        TapValue(START + timedelta(days=30 * i), 1700.0 * float(np.exp(percent / 100)), 0.01)
        for i, percent in enumerate(percents)
    ]
    rows = [
        line.partition("|")[2].ljust(CHART_WIDTH) for line in chart_lines(fit_trend(taps, taps[-1].time)) if "|" in line
    ]
    drawn = np.array([[character in (".", "o") for character in row] for row in rows])
    assert np.all(np.any(drawn, axis=0))
    deepest = drawn.shape[0] - 1 - np.argmax(drawn[::-1], axis=0)
    expected = np.linspace(0, len(rows) - 1, CHART_WIDTH)
    assert np.max(np.abs(deepest - expected)) <= 1.5
