"""Collect the data that the sections of the report share."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from acquisition import Frf, TapTest
from lobewatch.history import HistoryRow
from lobewatch.history.tap_measurements import measure_excluded_taps
from lobewatch.logbook import Analysis
from lobewatch.logbook.machine_forecast import MachineForecast, forecast_from_analysis
from lobewatch.machine import LimitsTable, Machine
from lobewatch.measurement import Estimate
from lobewatch.monitoring import SeriesStatus
from lobewatch.show.figures.trend_figures import TREND_FIGURE_SIZE, TrendCurve, TrendMarks, make_trend_curve, plot_trend
from lobewatch.show.programs.advice import ProgramAdvice, advise_program
from lobewatch.show.report.lobe_history import LobeDiagram, LobeHistory, compute_lobe_history, make_lobe_diagram
from lobewatch.tool import Assembly

BAND_LOW_FACTOR, BAND_HIGH_FACTOR = 0.6, 1.4
"""Ends of the frequency range shown, over those of the usable band; chosen."""
MODE_LOW_FACTOR = 0.3
"""Lower end of the range over the lowest mode: below it, division by omega^2 amplifies noise."""


@dataclass(frozen=True, eq=False)
class ReportData:
    """Data of a machine and one of its series, computed once for all sections of a report."""

    analysis: Analysis
    """Answers from the files of the machine."""
    rows: Sequence[HistoryRow]
    """Rows of the series that count, oldest first; at least one."""
    first: TapTest | None
    """Oldest tap test of the series; None where the newest is the only one."""
    newest: TapTest
    """Newest tap test of the series."""
    outlook: MachineForecast
    """Forecast for the machine."""
    programs: Sequence[ProgramAdvice]
    """Programs of the machine with verdict and advice."""

    @property
    def machine(self) -> Machine:
        """Settings of machine.toml."""
        return self.analysis.machine

    @property
    def last(self) -> HistoryRow:
        """Row of the newest tap test of the series."""
        return self.rows[-1]

    @property
    def series(self) -> SeriesStatus:
        """Status of the series."""
        return self.outlook.series(self.last.tool, self.last.direction)

    @cached_property
    def assembly(self) -> Assembly:
        """Tool of the series as tapped."""
        return self.analysis.assembly(self.last.tool)

    @cached_property
    def excluded_rows(self) -> Sequence[HistoryRow]:
        """Rows of excluded tap tests of the series."""
        return measure_excluded_taps(self.analysis.folder, self.analysis.files.excluded, self.rows)

    @cached_property
    def lobe_diagram(self) -> LobeDiagram | None:
        """Lobes of the first cut of the tool, with its programs; None where it has none."""
        return make_lobe_diagram(self.analysis, self.assembly, self.programs)

    def response_band(self, frf: Frf) -> tuple[float, float]:
        """Return the frequency range (Hz) in which a response is shown."""
        ends = float(frf.frequency[0]), float(frf.frequency[-1])
        low, high = self.machine.mode.band_hz or frf.usable_band or ends
        lowest = min((frequency for frequency, *_ in self.last.modes), default=0.0)
        return max(BAND_LOW_FACTOR * low, MODE_LOW_FACTOR * lowest, ends[0]), min(BAND_HIGH_FACTOR * high, ends[1])

    @cached_property
    def lobe_history(self) -> LobeHistory | None:
        """Lobes of the first cut of the tool over time; None below two tap tests."""
        cut = next(iter(self.machine.cuts(self.assembly.tool)), None)
        if cut is None:
            return None
        series = self.outlook.status.series
        return compute_lobe_history(cut, self.rows, self.assembly, series, self.machine, self.analysis.cuts)


def collect_report_data(analysis: Analysis, tool: str, direction: str, now: datetime | None) -> ReportData:
    """Collect the data of one series; raise ValueError where it has no tap test. now: None for the current time."""
    rows, entries = analysis.history.series(tool, direction), {entry.id: entry for entry in analysis.taps}
    if not rows:
        raise ValueError(f"{analysis.folder.path}: no tap test with tool {tool!r} in direction {direction!r} yet")
    outlook = forecast_from_analysis(analysis, now or datetime.now(UTC))
    newest = analysis.folder.read(entries[rows[-1].tap_id])
    first = analysis.folder.read(entries[rows[0].tap_id]) if len(rows) > 1 else None
    programs = [advise_program(analysis, verdict) for verdict in analysis.verdicts()]
    return ReportData(analysis, rows, first, newest, outlook, programs)


EXCLUDED_VALUE_RANGE = 0.15
"""Largest relative distance from the values that count at which an excluded value is drawn."""
MIN_TAPS_FOR_VALUE = 2
"""Smallest number of tap tests with a value that make a trend."""


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


FREQUENCY_VALUE = SeriesValue("frequency", "Natural frequency", "Hz", 1.0, "Bars: 95 % interval of each tap alone.")
BEARING_VALUE = SeriesValue(
    "bearing_stiffness", "Bearing stiffness", "N/µm", 1e6, "Equivalent stiffness of each bearing in the model."
)


class ValueTrend(NamedTuple):
    """Trend of one value of a series."""

    value: SeriesValue
    """Value that is shown."""
    estimates: Sequence[tuple[datetime, Estimate]]
    """Times and estimates of the tap tests, at least MIN_TAPS_FOR_VALUE."""
    excluded: Sequence[tuple[datetime, float]]
    """Times and values of excluded tap tests, in the unit shown."""
    marks: TrendMarks
    """Marks next to the trend."""
    limits: LimitsTable | None
    """Limits of its drop; None where it has none."""
    curve: TrendCurve | None
    """Fitted line and forecast; None where there is none."""

    def figure(self, size: tuple[float, float] = TREND_FIGURE_SIZE) -> Figure:
        """Plot the trend in a figure of this size (inches)."""
        values, stds = np.array([estimate for _, estimate in self.estimates]).T / self.value.scale
        times = [time for time, _ in self.estimates]
        return plot_trend(times, values, stds, self.value.label, self.limits, self.marks, self.curve, size)


def make_value_trend(data: ReportData, value: SeriesValue) -> ValueTrend | None:
    """Return the trend of a value of the series; None where too few tap tests have the value."""
    rows = data.rows
    estimates = [(row.time, getattr(row, value.field)) for row in rows if getattr(row, value.field).is_known]
    if len(estimates) < MIN_TAPS_FOR_VALUE:
        return None
    since = rows[0].time if rows[0].baseline is None else rows[0].baseline
    events = [(event.time, event.text) for event in data.analysis.files.contents.events if event.time >= since]
    numbers = [estimate.value / value.scale for _, estimate in estimates]
    low, high = (1 - EXCLUDED_VALUE_RANGE) * min(numbers), (1 + EXCLUDED_VALUE_RANGE) * max(numbers)
    aside = [(row.time, getattr(row, value.field).value / value.scale) for row in data.excluded_rows]
    marks = TrendMarks(events, [(time, number) for time, number in aside if low <= number <= high])
    is_followed, trend = value is FREQUENCY_VALUE, data.series.trend
    limits = data.machine.limits if is_followed else None
    course = make_trend_curve(trend) if trend is not None and is_followed else None
    return ValueTrend(value, estimates, aside, marks, limits, course)
