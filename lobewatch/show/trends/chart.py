"""A series drawn with characters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobewatch.decay.trend import Trend, date, days_of

WIDE, HIGH = 60, 12
"""Characters of the plot itself."""
POINT, LINE = "o", "."


def chart_lines(trend: Trend) -> list[str]:
    """Points and fitted line over the dates, fall downwards (%); the points alone below 8 of them."""
    dates = days_of(trend.points)
    percent = np.array([point.percent for point in trend.points]) - trend.start
    low, high = float(percent.min()), float(percent.max())
    low, high = (low, high) if high > low else (low - 0.5, high + 0.5)
    columns = _places(dates, dates[0], dates[-1], WIDE)
    canvas = np.full((HIGH, WIDE), " ")
    if trend.forecast is not None:
        at = np.linspace(dates[0], dates[-1], WIDE)
        line = np.interp(at, dates, trend.forecast.fitted - trend.start)
        canvas[_places(np.clip(line, low, high), high, low, HIGH), np.arange(WIDE)] = LINE
    canvas[_places(percent, high, low, HIGH), columns] = POINT
    labels = [f"{value:+8.2f} %" if row % 4 == 0 or row == HIGH - 1 else " " * 10 for row, value in _ticks(low, high)]
    drawn = [f"{label} |{''.join(cells)}".rstrip() for label, cells in zip(labels, canvas, strict=True)]
    first, last = (f"{date(days):%Y-%m-%d}" for days in dates[[0, -1]])
    return [*drawn, " " * 11 + "+" + "-" * WIDE, " " * 12 + first + last.rjust(WIDE - len(first))]


def _ticks(low: float, high: float) -> list[tuple[int, float]]:
    return list(enumerate(np.linspace(high, low, HIGH).tolist()))


def _places(values: NDArray[np.float64], start: float, end: float, count: int) -> NDArray[np.intp]:
    span = end - start
    share = (values - start) / span if span else np.zeros(values.size)
    return np.round(share * (count - 1)).astype(np.intp)
