"""Collect the data shared by the sections of the report: status, rows, programs, values over time, lobes."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import cached_property

import numpy as np

from acquisition import CROSS_TAP, Frf, Remark, TapTest, merge_remarks
from lobewatch.arrays import Floats
from lobewatch.cuts.learning.program_learning import compute_lobes_at_speed
from lobewatch.history import HistoryRow
from lobewatch.history.history import compute_row_lobes
from lobewatch.history.tap_measurements import measure_excluded_taps
from lobewatch.logbook import Analysis
from lobewatch.logbook.machine_forecast import MachineForecast, forecast_from_analysis
from lobewatch.machine import Machine
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.measurement import Estimate, Measurement
from lobewatch.monitoring import SeriesStatus
from lobewatch.monitoring.status_rules import STATUS_BY_CODE, StatusLevel
from lobewatch.monitoring.trend import DAYS_PER_MONTH, Trend, days_since_epoch
from lobewatch.show.figures.lobe_figures import LobeDiagram, pick_evenly, select_test_cuts
from lobewatch.show.figures.trend_figures import SeriesValue, ValueTrend, make_trend_curve
from lobewatch.show.programs.advice import ProgramAdvice, advise_program
from lobewatch.show.trend import no_dates_text
from lobewatch.tool import Assembly, compute_lobes
from lobewatch.tool.assembly import compute_tip_lobes
from lobewatch.verdicts.monte_carlo import compute_limit_band
from lobewatch.verdicts.setting_robustness import model_softening
from modal import Mode, UnexplainedPeak

MAX_LOBE_DIAGRAMS = 24
"""Largest number of tap tests with a lobe diagram."""
MAX_FORECAST_DROP = 0.5
"""Largest relative frequency drop with a forecast diagram (chosen): such a spindle no longer cuts."""
MAX_REASONS = 3
"""Largest number of reasons next to the status."""
TABLE_REASON_CODES = (
    *("frequency-alarm", "frequency-warn", "decay"),
    *("program-not-stable", "program-doubtful", "program-unknown"),
    "overdue",
)
"""Codes of reasons that the first tables show. Only the most severe is stated again."""
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
    """Oldest tap test of the series; None if the newest is the only one."""
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
    def reasons(self) -> tuple[list[str], list[str]]:
        """Reasons next to the status, the most severe first, and those for the notes."""
        first, others = self._pick_reasons()
        notable = [remark for remark in others if STATUS_BY_CODE[remark.code] is not StatusLevel.GOOD]
        shown = [*first, *notable[: MAX_REASONS - 1]]
        return [it.finding for it in shown], [it.finding for it in others if it not in shown]

    def _pick_reasons(self) -> tuple[list[Remark], list[Remark]]:
        """Return the most severe reason, of the series of the figures if it has it, and those that no table shows."""
        status = self.outlook.status
        order = [self.series.name, *(series.name for series in status.series)]
        alike = [remark for remark in status.remarks if remark.code == status.remarks[0].code]
        alike.sort(key=lambda remark: order.index(remark.about) if remark.about in order else 0)
        first, plain = merge_remarks(alike)[:1], set(status.reasons)
        other = [remark for remark in status.remarks if remark.code not in TABLE_REASON_CODES or remark not in plain]
        return first, [remark for remark in merge_remarks(other) if remark not in first]

    @cached_property
    def no_dates(self) -> str:
        """Reason why there are no forecast dates; empty if there are."""
        return no_dates_text(self.outlook)

    @cached_property
    def assembly(self) -> Assembly:
        """Tool of the series as tapped."""
        return self.analysis.assembly(self.last.tool)

    @cached_property
    def excluded_rows(self) -> Sequence[HistoryRow]:
        """Rows of excluded tap tests of the series."""
        return measure_excluded_taps(self.analysis.folder, self.analysis.files.excluded, self.rows)

    @cached_property
    def measurement(self) -> Measurement:
        """Measurement of the newest tap test."""
        return self.analysis.measurement(self.last.tap_id)

    @cached_property
    def frfs(self) -> tuple[Frf | None, Frf | None]:
        """FRFs of the first and of the newest tap test as fitted, or as stored if the fit failed; None without one."""
        first = None if self.first is None else self.analysis.measurement(self.rows[0].tap_id).frf or self.first.frf
        return first, self.measurement.frf or self.newest.frf

    @property
    def tap_place(self) -> str:
        """Point of excitation and response, as text."""
        distance = self.machine.tap.position_mm
        return f"{LENGTH.text(distance)} from the tool tip" if distance else "at the tool tip"

    @property
    def unexplained_peaks(self) -> Sequence[UnexplainedPeak]:
        """Measured peaks that the used modes do not explain within their errors; none of a cross FRF."""
        peaks = () if self.measurement.direction == CROSS_TAP else self.measurement.unexplained
        return [peak for peak in peaks if not peak.is_within_errors]

    @cached_property
    def lobe_diagram(self) -> LobeDiagram | None:
        """Lobes of the first cut of the tool, with its programs; None if it has none."""
        return make_lobe_diagram(self)

    def response_band(self, frf: Frf) -> tuple[float, float]:
        """Return the frequency range (Hz) in which a response is shown."""
        ends = float(frf.frequency[0]), float(frf.frequency[-1])
        low, high = self.machine.mode.band_hz or frf.usable_band or ends
        lowest = min((frequency for frequency, *_ in self.last.modes), default=0.0)
        return max(BAND_LOW_FACTOR * low, MODE_LOW_FACTOR * lowest, ends[0]), min(BAND_HIGH_FACTOR * high, ends[1])


def collect_report_data(analysis: Analysis, tool: str, direction: str, now: datetime | None) -> ReportData:
    """Collect the data of one series; ValueError if it has no tap test. now: None for the current time."""
    rows, entries = analysis.history.series(tool, direction), {entry.id: entry for entry in analysis.taps}
    if not rows:
        raise ValueError(f"{analysis.folder.path}: no tap test with tool {tool!r} in direction {direction!r} yet")
    outlook = forecast_from_analysis(analysis, now or analysis.now)
    newest = analysis.folder.read(entries[rows[-1].tap_id])
    first = analysis.folder.read(entries[rows[0].tap_id]) if len(rows) > 1 else None
    programs = [advise_program(analysis, verdict) for verdict in analysis.verdicts()]
    return ReportData(analysis, rows, first, newest, outlook, programs)


MIN_TAPS_FOR_VALUE = 2
"""Smallest number of tap tests in a trend."""
SHOWN_VALUES = (
    SeriesValue("frequency", "Natural frequency", "Hz", 1.0, "Error bars: 95 % interval with reclamping."),
    SeriesValue(
        "bearing_stiffness",
        "Bearing stiffness",
        "N/µm",
        1e6,
        "Equivalent stiffness of each bearing, from the spindle model.",
    ),
)
"""Values shown over time, in order."""


def make_value_trend(data: ReportData, value: SeriesValue) -> ValueTrend | None:
    """Return the trend of a value of the series; None if too few tap tests have the value."""
    rows = data.rows
    estimates = [(row.time, getattr(row, value.field)) for row in rows if getattr(row, value.field).is_known]
    if len(estimates) < MIN_TAPS_FOR_VALUE:
        return None
    since = rows[0].time if rows[0].baseline is None else rows[0].baseline
    events = [(event.time, event.text) for event in data.analysis.files.contents.events if event.time >= since]
    aside = [(row.time, getattr(row, value.field).value / value.scale) for row in data.excluded_rows]
    trend = data.series.trend if value.field == "frequency" else None
    if trend is None:
        return ValueTrend(value, [(time, Estimate(it.value)) for time, it in estimates], aside, events)
    stds = [trend.drop_model.std(100 * it.std / it.value) / 100 * it.value for _, it in estimates]
    bars = [(time, Estimate(it.value, std)) for (time, it), std in zip(estimates, stds, strict=True)]
    start = data.series.history.frequency.start.value / value.scale
    return ValueTrend(value, bars, aside, events, data.machine.limits, make_trend_curve(trend), start)


def make_lobe_diagram(data: ReportData) -> LobeDiagram | None:
    """Return the lobe diagram of a tool as tapped; None if it has no lobes."""
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


def compute_lobe_history(data: ReportData, cut: str) -> list[tuple[str, Floats]]:
    """Return the limiting depths (m) of a cut after each tap test of the series and in the forecast, by label.

    The forecast lets all modes drop by the same share, with K from the model. Empty below two tap tests.
    """
    machine, assembly = data.machine, data.assembly
    shown = pick_evenly([row for row in data.rows if row.x or row.y], MAX_LOBE_DIAGRAMS)
    diagrams = [(row.time, compute_row_lobes(row, machine, [cut]).get(cut)) for row in shown]
    depths = [(f"{time:%Y-%m-%d}", lobes.depth) for time, lobes in diagrams if lobes is not None]
    sides = (side for side in data.outlook.status.series if side.tool == assembly.tool)
    trends = {side.direction: side.trend for side in sides if side.trend is not None}
    return [*depths, *_forecast_depths(cut, assembly, trends, machine)] if len(depths) > 1 else []


def _forecast_depths(
    cut: str, assembly: Assembly, trends: Mapping[str, Trend], machine: Machine
) -> Iterator[tuple[str, Floats]]:
    for months in (6, 12):
        shares = {name: _forecast_drop(trend, months) for name, trend in trends.items()}
        drops = {name: drop for name, drop in shares.items() if drop is not None}
        if not drops:
            return
        x, y = (_degraded_modes(assembly, name, drops.get(name, max(drops.values()))) for name in ("x", "y"))
        lobes = compute_tip_lobes(assembly.tool, x, y, machine, [cut], assembly.cross).get(cut)
        if lobes is not None:
            at = assembly.time + timedelta(days=months * DAYS_PER_MONTH)
            yield f"{at:%Y-%m} (forecast)", lobes.depth


def _forecast_drop(trend: Trend, months: int) -> float | None:
    """Return the relative drop of the forecast line after some months; None if it is too far or too large."""
    forecast, last = trend.forecast, days_since_epoch(trend.points[-1].time)
    at = last + months * DAYS_PER_MONTH
    if forecast is None or trend.is_stale or not forecast.dates[0] <= at <= forecast.dates[-1]:
        return None
    change = float(np.interp(at, forecast.dates, forecast.mean_line)) - float(forecast.fitted[-1])
    share = -math.expm1(min(change, 0.0) / 100)
    return share if share < MAX_FORECAST_DROP else None


def _degraded_modes(assembly: Assembly, direction: str, drop: float) -> list[Mode]:
    stiffness = model_softening(assembly)[0](drop)
    modes = (assembly.x if direction == "x" else assembly.y) or ()
    return [mode.scaled(1 - drop, stiffness, "forecast") for mode in modes]
