"""Collect the data that the sections of the report share."""

from __future__ import annotations

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
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.machine_forecast import MachineForecast, forecast_from_analysis
from lobewatch.machine import LimitsTable, Machine
from lobewatch.measurement.estimate import Estimate
from lobewatch.monitoring import SeriesStatus
from lobewatch.show.figures.trend_figures import TREND_FIGURE_SIZE, TrendCurve, TrendMarks, make_trend_curve, plot_trend
from lobewatch.show.programs.advice import ProgramAdvice, advise_program
from lobewatch.show.report.lobe_history import LobeDiagram, LobeHistory, compute_lobe_history, make_lobe_diagram
from lobewatch.tool import Assembly

BAND_LOW_FACTOR, BAND_HIGH_FACTOR = 0.6, 1.4
"""Ends of the frequencies shown over those of the usable band; chosen."""
MODE_LOW_FACTOR = 0.3
"""Least of them over the lowest mode: further down a response drowns its modes, for acceleration is divided by w^2."""


@dataclass(frozen=True, eq=False)
class ReportData:
    """A machine and one of its series, with all that their report says; what several sections need is made once."""

    analysis: Analysis
    """Answers from the files of the machine."""
    rows: Sequence[HistoryRow]
    """Rows of the series that count, oldest first; at least one."""
    first: TapTest | None
    """Oldest tap test of the series; None where the newest is the only one."""
    newest: TapTest
    """Newest tap test of the series."""
    outlook: MachineForecast
    """Outlook of the machine."""
    programs: Sequence[ProgramAdvice]
    """Programs of the machine, with all that is said of them."""

    @property
    def machine(self) -> Machine:
        """machine.toml."""
        return self.analysis.machine

    @property
    def last(self) -> HistoryRow:
        """Row of the newest tap test of the series."""
        return self.rows[-1]

    @property
    def series(self) -> SeriesStatus:
        """How the series stands."""
        return self.outlook.series(self.last.tool, self.last.direction)

    @cached_property
    def assembly(self) -> Assembly:
        """The tool of the series as tapped."""
        return self.analysis.assembly(self.last.tool)

    @cached_property
    def excluded_rows(self) -> Sequence[HistoryRow]:
        """Rows of the tap tests of the series that do not count."""
        return measure_excluded_taps(self.analysis.folder, self.analysis.files.excluded, self.rows)

    @cached_property
    def lobe_diagram(self) -> LobeDiagram | None:
        """Lobes of the first cut of the tool, with the programs on them; None where it has none."""
        return make_lobe_diagram(self.analysis, self.assembly, self.programs)

    def response_band(self, frf: Frf) -> tuple[float, float]:
        """Frequencies that are shown of a response (Hz)."""
        ends = float(frf.frequency[0]), float(frf.frequency[-1])
        low, high = self.machine.mode.band_hz or frf.usable_band or ends
        lowest = min((frequency for frequency, *_ in self.last.modes), default=0.0)
        return max(BAND_LOW_FACTOR * low, MODE_LOW_FACTOR * lowest, ends[0]), min(BAND_HIGH_FACTOR * high, ends[1])

    @cached_property
    def lobe_history(self) -> LobeHistory | None:
        """Lobes of the first cut of the tool over the series; None where fewer than two tap tests show it."""
        cut = next(iter(self.machine.cuts(self.assembly.tool)), None)
        if cut is None:
            return None
        series = self.outlook.status.series
        return compute_lobe_history(cut, self.rows, self.assembly, series, self.machine, self.analysis.cuts)


def collect_report_data(analysis: Analysis, tool: str, direction: str, now: datetime | None) -> ReportData:
    """All for one series; ValueError where it holds no tap test. now: None for the clock's."""
    rows, entries = analysis.history.series(tool, direction), {entry.id: entry for entry in analysis.taps}
    if not rows:
        raise ValueError(f"{analysis.folder.path}: no tap test with tool {tool!r} in direction {direction!r} yet")
    outlook = forecast_from_analysis(analysis, now or datetime.now(UTC))
    newest = analysis.folder.read(entries[rows[-1].tap_id])
    first = analysis.folder.read(entries[rows[0].tap_id]) if len(rows) > 1 else None
    programs = [advise_program(analysis, verdict) for verdict in analysis.verdicts()]
    return ReportData(analysis, rows, first, newest, outlook, programs)


EXCLUDED_VALUE_RANGE = 0.15
"""Relative distance from all that counts up to which a value that does not count is drawn."""
MIN_TAPS_FOR_VALUE = 2
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


FREQUENCY_VALUE = SeriesValue("frequency", "Natural frequency", "Hz", 1.0, "Bars: 95 % interval of each tap alone.")
BEARING_VALUE = SeriesValue(
    "bearing_stiffness", "Bearing stiffness", "N/µm", 1e6, "Equivalent stiffness of each bearing in the model."
)


class ValueTrend(NamedTuple):
    """What is drawn of a value."""

    value: SeriesValue
    """Which it is."""
    estimates: Sequence[tuple[datetime, Estimate]]
    """Tap tests that know it, at least FEWEST."""
    excluded: Sequence[tuple[datetime, float]]
    """Tap tests that do not count, in the unit shown."""
    marks: TrendMarks
    """Marks beside the course."""
    limits: LimitsTable | None
    """Limits of its fall; None where it has none."""
    curve: TrendCurve | None
    """Line that is fitted to it and goes on; None where there is none."""

    def figure(self, size: tuple[float, float] = TREND_FIGURE_SIZE) -> Figure:
        """The picture, of this size (inches)."""
        values, stds = np.array([estimate for _, estimate in self.estimates]).T / self.value.scale
        times = [time for time, _ in self.estimates]
        return plot_trend(times, values, stds, self.value.label, self.limits, self.marks, self.curve, size)


def make_value_trend(data: ReportData, value: SeriesValue) -> ValueTrend | None:
    """What is drawn of a value of the series; None where too few tap tests know it."""
    rows = data.rows
    estimates = [(row.time, getattr(row, value.field)) for row in rows if getattr(row, value.field).is_known]
    if len(estimates) < MIN_TAPS_FOR_VALUE:
        return None
    since = rows[0].time if rows[0].baseline is None else rows[0].baseline
    events = [(event.time, event.text) for event in data.analysis.files.events if event.time >= since]
    numbers = [estimate.value / value.scale for _, estimate in estimates]
    near = (1 - EXCLUDED_VALUE_RANGE) * min(numbers), (1 + EXCLUDED_VALUE_RANGE) * max(numbers)
    aside = [(row.time, getattr(row, value.field).value / value.scale) for row in data.excluded_rows]
    marks = TrendMarks(events, [(time, number) for time, number in aside if near[0] <= number <= near[1]])
    is_followed, trend = value is FREQUENCY_VALUE, data.series.trend
    limits = data.machine.limits if is_followed else None
    course = make_trend_curve(trend) if trend is not None and is_followed else None
    return ValueTrend(value, estimates, aside, marks, limits, course)
