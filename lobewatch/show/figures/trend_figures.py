"""Plot series over time with events, and frequency responses then and now."""

from collections.abc import Sequence
from datetime import datetime
from textwrap import shorten
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num
from matplotlib.figure import Figure

from acquisition import Frf
from lobewatch.arrays import Floats
from lobewatch.machine import LimitsTable
from lobewatch.measurement import Estimate
from lobewatch.monitoring.trend import Trend, point_days
from lobewatch.show.figures.drawing import Paint, new_axes
from lobewatch.show.figures.response_drawing import (
    compute_phase,
    mark_unexplained,
    set_coherence_axis,
    set_phase_axis,
)
from modal import Mode, UnexplainedPeak, synthesize_frf

FIGURE_WIDTH, TREND_HEIGHT, RESPONSE_HEIGHT = 6.4, 3.4, 1.7
"""Width of figures, heights of a trend and of each part of a frequency response (inches)."""
AMPLITUDE_RATIO = 1.8
"""Height of the amplitude over that of the other parts of a frequency response."""
LOWEST_PHASE = -270.0
"""Lowest phase shown of a receptance (degrees), far from the 0 to -180 degrees of a driving point."""
EXCLUDED_VALUE_RANGE = 0.15
"""Largest relative distance of a drawn excluded value from the values in use."""
FORECAST_SHARE = 0.5
"""Forecast time drawn, as a share of the length of the series."""


class TrendCurve(NamedTuple):
    """Fitted line of a series and its forecast, in the unit of the series."""

    days: Floats
    """Days since 1970, from the first point on, shape (n,)."""
    line: Floats
    """Values of the fitted mixture, shape (n,)."""
    days_ahead: Floats
    """Days since 1970, from the last point on, shape (m,)."""
    low: Floats
    """10 % quantile of the forecast, shape (m,)."""
    high: Floats
    """90 % quantile of the forecast, shape (m,)."""


class SeriesValue(NamedTuple):
    """Value of the tap tests of a series that is shown over time."""

    field: str
    """Field of a history row."""
    heading: str
    """Heading of its section."""
    unit: str
    """Unit shown."""
    scale: float
    """Size of this unit (SI)."""
    text: str
    """Note on reading the figure."""

    @property
    def label(self) -> str:
        """Label of the axis."""
        return f"{self.heading.lower()} ({self.unit})"


class ValueTrend(NamedTuple):
    """Trend of one value of a series."""

    value: SeriesValue
    """Value that is shown."""
    estimates: Sequence[tuple[datetime, Estimate]]
    """Times and estimates of the tap tests."""
    excluded: Sequence[tuple[datetime, float]] = ()
    """Times and values of excluded tap tests, in the unit shown."""
    events: Sequence[tuple[datetime, str]] = ()
    """Times and texts of maintenance events."""
    limits: LimitsTable | None = None
    """Limits of its drop; None without limits."""
    curve: TrendCurve | None = None
    """Fitted line and forecast; None without one."""
    start: float | None = None
    """Start of the series, in the unit shown; None for the first value."""

    @property
    def drawn_excluded(self) -> list[tuple[datetime, float]]:
        """Excluded tap tests near enough to the others to be drawn."""
        numbers = [estimate.value / self.value.scale for _, estimate in self.estimates]
        low, high = (1 - EXCLUDED_VALUE_RANGE) * min(numbers), (1 + EXCLUDED_VALUE_RANGE) * max(numbers)
        return [(time, number) for time, number in self.excluded if low <= number <= high]


def make_trend_curve(trend: Trend) -> TrendCurve | None:
    """Return the curve of a trend; None below 8 points."""
    forecast = trend.forecast
    if forecast is None:
        return None
    past = point_days(trend.points)
    near = forecast.dates <= max(past[-1] + FORECAST_SHARE * (past[-1] - past[0]), forecast.dates[1])
    low, high = (trend.first_value * np.exp(forecast.quantile_line(quantile)[near] / 100) for quantile in (0.1, 0.9))
    line = trend.first_value * np.exp(np.append(forecast.fitted, forecast.mean_line[near]) / 100)
    return TrendCurve(np.append(past, forecast.dates[near]), line, forecast.dates[near], low, high)


def plot_frf(
    first: Frf | None,
    now: Frf,
    band: tuple[float, float],
    modes: Sequence[Mode] = (),
    unexplained: Sequence[UnexplainedPeak] = (),
) -> Figure:
    """Plot amplitude and phase of the receptance and the coherence, of the newest and of the first test.

    modes: modes of the newest test for lobes, whose sum is drawn as the fit; unexplained: peaks that they do not
    explain.
    """
    newest = now.in_band(band)
    rows = 2 if newest.coherence is None else 3
    figure, axes = new_axes(rows, (FIGURE_WIDTH, RESPONSE_HEIGHT * (rows + AMPLITUDE_RATIO - 1)), AMPLITUDE_RATIO)
    curves = [(newest, "measured" if first is None else "newest", Paint.NEWEST, "-")]
    curves += [] if first is None else [(first.in_band(band), "first", Paint.FIRST, "--")]
    curves += [(synthesize_frf(modes, newest.frequency), "fit: modes for lobes", Paint.ALARM, ":")] if modes else []
    for frf, label, colour, dashes in curves:
        style: dict[str, Any] = {"color": colour, "ls": dashes, "lw": 1.3, "label": label}
        size = np.where(frf.receptance == 0, np.nan, np.abs(frf.receptance))
        axes[0].semilogy(frf.frequency, size * 1e9, **style)
        axes[1].plot(frf.frequency, compute_phase(frf.receptance, LOWEST_PHASE), **style)
        if rows == 3 and frf.coherence is not None:
            axes[2].plot(frf.frequency, frf.coherence, **style)
    mark_unexplained(axes[0], unexplained, newest.frequency, np.abs(newest.receptance) * 1e9)
    axes[0].set(ylabel="receptance (nm/N)")
    set_phase_axis(axes[1], LOWEST_PHASE)
    if rows == 3:
        set_coherence_axis(axes[2])
    axes[-1].set(xlabel="frequency (Hz)", xlim=band)
    if len(axes[0].lines) > 1:
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False)
    return figure


def plot_trend(trend: ValueTrend) -> Figure:
    """Plot a value over time with its 95 % interval, and the limits of its drop if given.

    The limits are in % of the start of the series.
    """
    figure, (axes,) = new_axes(1, (FIGURE_WIDTH, TREND_HEIGHT))
    curve, days = trend.curve, date2num([time for time, _ in trend.estimates])
    values, stds = np.array([estimate for _, estimate in trend.estimates]).T / trend.value.scale
    axes.errorbar(days, values, yerr=1.96 * np.nan_to_num(stds), fmt="o", ms=4, color=Paint.NEWEST, capsize=2)
    if trend.limits is not None:
        warn, alarm = trend.limits.frequency_warn_percent, trend.limits.frequency_alarm_percent
        style: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "ha": "right", "va": "bottom"}
        for percent, colour, dashes in ((warn, Paint.FIRST, "--"), (alarm, Paint.ALARM, "-")):
            level = (values[0] if trend.start is None else trend.start) * (1 - percent / 100)
            axes.axhline(level, color=colour, ls=dashes, lw=1)
            axes.annotate(f"-{percent:g} %", (1, level), color=colour, **style)
    if curve is not None:
        axes.plot(curve.days, curve.line, color=Paint.NEWEST, lw=1)
        axes.fill_between(curve.days_ahead, curve.low, curve.high, color=Paint.NEWEST, alpha=0.2, lw=0)
    _add_marks(axes, trend)
    locator = AutoDateLocator()
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(ConciseDateFormatter(locator))
    axes.set(ylabel=trend.value.label)
    axes.margins(y=0.12)
    return figure


def _add_marks(axes: Axes, trend: ValueTrend) -> None:
    if excluded := trend.drawn_excluded:
        days = date2num([time for time, _ in excluded])
        axes.plot(days, [value for _, value in excluded], "o", ms=5, mfc="none", mec=Paint.NEWEST)
    for time, text in trend.events:
        day = date2num(time)
        axes.axvline(day, color=Paint.EVENT, ls=":", lw=1)
        shown, coordinates = shorten(text, 26, placeholder="…"), (("data", "axes fraction"), "offset points")
        axes.annotate(shown, (day, 0), (2, 2), *coordinates, va="bottom", rotation=90, fontsize=8)
