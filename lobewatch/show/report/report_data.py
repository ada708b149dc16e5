"""Collect the data that the sections of the report share: rows, programs, values over time, stability lobes."""

import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cached_property
from typing import NamedTuple

import numpy as np

from acquisition import Frf, TapTest
from lobewatch.arrays import Floats
from lobewatch.cuts.learning.program_learning import compute_lobes_at_speed
from lobewatch.history import HistoryRow
from lobewatch.history.history import compute_row_lobes
from lobewatch.history.tap_measurements import measure_excluded_taps
from lobewatch.logbook import Analysis
from lobewatch.logbook.machine_forecast import MachineForecast, forecast_from_analysis
from lobewatch.machine import Machine
from lobewatch.machine.journal.entries import CutEntry
from lobewatch.monitoring import SeriesStatus
from lobewatch.monitoring.trend import DAYS_PER_MONTH, Trend, days_since_epoch
from lobewatch.show.figures.lobe_figures import LobeDiagram, pick_evenly, select_test_cuts
from lobewatch.show.figures.trend_figures import SeriesValue, ValueTrend, make_trend_curve
from lobewatch.show.programs.advice import ProgramAdvice, advise_program
from lobewatch.show.report.section import NumberTable
from lobewatch.tool import Assembly, compute_lobes, speed_grid
from lobewatch.tool.assembly import compute_tip_lobes
from lobewatch.verdicts.monte_carlo import compute_limit_band
from lobewatch.verdicts.setting_robustness import model_softening
from modal import Mode

MAX_LOBE_DIAGRAMS = 24
"""Largest number of tap tests shown."""
MAX_LOBE_SPEEDS = 600
"""Largest number of speeds of each diagram."""
MAX_FORECAST_DROP = 0.5
"""Frequency drop from which on no diagram is forecast: no such spindle still cuts; chosen."""


class LobeHistory(NamedTuple):
    """Lobe diagrams of one cut over time, oldest first; at least two."""

    cut: str
    """Name of the cut."""
    speed_rpm: Floats
    """Speeds common to all diagrams (rpm), shape (n,)."""
    times: Sequence[datetime]
    """Times of the tap tests, m of them."""
    depth: Floats
    """Limiting depths after each tap test (m), shape (m, n)."""
    ahead: Mapping[str, Floats]
    """Forecast limiting depths (m), shape (n,), by the label of each diagram."""
    heard: Sequence[CutEntry]
    """Test cuts of the same cut."""

    @property
    def labels(self) -> list[str]:
        """Labels of the diagrams."""
        return [*(f"{time:%Y-%m-%d}" for time in self.times), *self.ahead]

    @property
    def numbers(self) -> NumberTable:
        """Depth (mm) over speed of each diagram."""
        step = max(math.ceil(self.speed_rpm.size / MAX_LOBE_SPEEDS), 1)
        named = zip(self.labels, [*self.depth, *self.ahead.values()], strict=True)
        return NumberTable.from_lobes(self.speed_rpm[::step], {name: depth[::step] for name, depth in named})

    @property
    def marks(self) -> NumberTable | None:
        """Test cuts, each with the number of the diagram (from 1) that it first belongs to; None without any.

        A cut after the newest tap test belongs to the newest diagram.
        """
        diagrams = [min(bisect_left(self.times, cut.at), len(self.times) - 1) + 1 for cut in self.heard]
        lines = [
            [at, cut.word, f"{cut.at:%Y-%m-%d}", cut.speed_rpm, 1e3 * cut.depth, cut.chatter_frequency_hz]
            for at, cut in zip(diagrams, self.heard, strict=True)
        ]
        heads = ["from diagram", "heard", "date", "speed (rpm)", "depth (mm)", "chatter (Hz)"]
        return NumberTable(heads, lines) if lines else None


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
        return make_lobe_diagram(self)

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
        return None if cut is None else compute_lobe_history(self, cut)


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


MIN_TAPS_FOR_VALUE = 2
"""Smallest number of tap tests with a value that make a trend."""


FREQUENCY_VALUE = SeriesValue("frequency", "Natural frequency", "Hz", 1.0, "Bars: 95 % interval of each tap alone.")
BEARING_TEXT = "Equivalent stiffness of each bearing in the model."
SHOWN_VALUES = (FREQUENCY_VALUE, SeriesValue("bearing_stiffness", "Bearing stiffness", "N/µm", 1e6, BEARING_TEXT))
"""Values shown over time, in order."""


def make_value_trend(data: ReportData, value: SeriesValue) -> ValueTrend | None:
    """Return the trend of a value of the series; None where too few tap tests have the value."""
    rows = data.rows
    estimates = [(row.time, getattr(row, value.field)) for row in rows if getattr(row, value.field).is_known]
    if len(estimates) < MIN_TAPS_FOR_VALUE:
        return None
    since = rows[0].time if rows[0].baseline is None else rows[0].baseline
    events = [(event.time, event.text) for event in data.analysis.files.contents.events if event.time >= since]
    aside = [(row.time, getattr(row, value.field).value / value.scale) for row in data.excluded_rows]
    is_followed, trend = value is FREQUENCY_VALUE, data.series.trend
    limits = data.machine.limits if is_followed else None
    course = make_trend_curve(trend) if trend is not None and is_followed else None
    return ValueTrend(value, estimates, aside, events, limits, course)


def make_lobe_diagram(data: ReportData) -> LobeDiagram | None:
    """Return the lobe diagram of a tool as tapped; None where it has no lobes."""
    analysis, assembly, machine = data.analysis, data.assembly, data.machine
    lobes = compute_lobes(assembly, machine)
    if not lobes:
        return None
    cut, now = next(iter(lobes.items()))
    first = analysis.first_assembly(assembly)
    depths = {} if first is None else {first.label: compute_lobes(first, machine)[cut].depth}
    cuts = machine.cuts(assembly.tool)
    same = [program for program in data.programs if cuts.get(program.verdict.program.name) == cuts[cut]]
    settings = (setting for program in same for setting in (program.advice.best, program.advice.deepest_here))
    verdicts, depths = [program.verdict for program in same], depths | {assembly.label: now.depth}
    band = compute_limit_band(now, cut, assembly, machine)
    heard = select_test_cuts(analysis.cuts, cut, assembly.tool, cuts[cut][0])
    learned = compute_lobes_at_speed(verdicts, machine)
    return LobeDiagram(cut, now, depths, verdicts, list(dict.fromkeys(filter(None, settings))), band, heard, learned)


def compute_lobe_history(data: ReportData, cut: str) -> LobeHistory | None:
    """Return the lobe diagrams of the series that show the cut; None where fewer than two do.

    The forecast lets all modes drop by the same share, with K from the model.
    """
    machine, assembly = data.machine, data.assembly
    shown = pick_evenly([row for row in data.rows if row.x or row.y], MAX_LOBE_DIAGRAMS)
    diagrams = [(row.time, compute_row_lobes(row, machine, [cut]).get(cut)) for row in shown]
    limits = [(time, lobes.depth) for time, lobes in diagrams if lobes is not None]
    if len(limits) < 2:
        return None
    sides = (side for side in data.outlook.status.series if side.tool == assembly.tool)
    trends = {side.direction: side.trend for side in sides if side.trend is not None}
    times, depths = zip(*limits, strict=True)
    ahead = _forecast_depths(cut, assembly, trends, machine)
    heard = select_test_cuts(data.analysis.cuts, cut, assembly.tool, machine.cuts(assembly.tool)[cut][0])
    return LobeHistory(cut, speed_grid(machine), times, np.stack(depths), ahead, heard)


def _forecast_depths(cut: str, assembly: Assembly, trends: Mapping[str, Trend], machine: Machine) -> dict[str, Floats]:
    depths: dict[str, Floats] = {}
    for months in (6, 12):
        shares = {name: _forecast_drop(trend, months) for name, trend in trends.items()}
        falls = {name: fall for name, fall in shares.items() if fall is not None}
        if not falls:
            break
        x, y = (_degraded_modes(assembly, name, falls.get(name, max(falls.values()))) for name in ("x", "y"))
        lobes = compute_tip_lobes(assembly.tool, x, y, machine, [cut], assembly.cross).get(cut)
        if lobes is not None:
            at = assembly.time + timedelta(days=months * DAYS_PER_MONTH)
            depths[f"{at:%Y-%m} (forecast)"] = lobes.depth
    return depths


def _forecast_drop(trend: Trend, months: int) -> float | None:
    """Return the relative drop of the forecast line after some months; None where it is too long or too large."""
    forecast, last = trend.forecast, days_since_epoch(trend.points[-1].time)
    at = last + months * DAYS_PER_MONTH
    if forecast is None or trend.is_stale or not forecast.dates[0] <= at <= forecast.dates[-1]:
        return None
    change = float(np.interp(at, forecast.dates, forecast.mean_line)) - float(forecast.fitted[-1])
    share = -math.expm1(min(change, 0.0) / 100)
    return share if share < MAX_FORECAST_DROP else None


def _degraded_modes(assembly: Assembly, direction: str, fall: float) -> list[Mode]:
    stiffness = model_softening(assembly)[0](fall)
    modes = (assembly.x if direction == "x" else assembly.y) or ()
    return [mode.scaled(1 - fall, stiffness, "foretold") for mode in modes]
