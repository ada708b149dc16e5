"""Forecast when programs become doubtful or not stable and when limits are reached."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

from acquisition import DataError
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.logbook import Logbook
from lobewatch.monitoring.machine_status import MachineStatus, SeriesStatus
from lobewatch.monitoring.threshold_dates import (
    ALREADY_REACHED,
    NO_FORECAST,
    LimitForecasts,
    ProgramForecast,
    ThresholdDates,
    find_earliest,
)
from lobewatch.monitoring.trend import Trend
from lobewatch.verdicts.verdict import CriticalDrop, Stability, StoredVerdict


@dataclass(frozen=True)
class MachineForecast:
    """What becomes of a machine if it is used as before."""

    status: MachineStatus
    """Standing of the machine now."""
    critical_drops: Mapping[str, CriticalDrop]
    """Falls that the frequency of the newest tap tests may take, by program, where anything can be foretold."""
    programs: Mapping[str, ProgramForecast]
    """Fate of each program, by its name."""
    unknown_programs: frozenset[str]
    """Names of the programs on which there is no word now, for whatever reason: none can change."""
    limits: LimitForecasts
    """When the worst of its series has fallen by each limit of machine.toml."""

    def series(self, tool: str | None = None, direction: str | None = None) -> SeriesStatus:
        """The series of a tool and direction, the one that fell most where several fit; DataError where none does."""
        fits = [
            series
            for series in self.status.series
            if tool in (None, series.tool) and direction in (None, series.direction)
        ]
        if not fits:
            names = "; ".join(f"--tool {series.tool} --direction {series.direction}" for series in self.status.series)
            raise DataError(f"tool {tool or 'any'}, direction {direction or 'any'}: no such series; there are: {names}")
        return fits[0]


def forecast_machine(logbook: Logbook, now: datetime | None = None) -> MachineForecast:
    """The outlook of a machine; DataError where it was never tapped."""
    logbook.newest_tap()
    return logbook.query(forecast_from_analysis, now or datetime.now(UTC))


def forecast_from_analysis(analysis: Analysis, now: datetime) -> MachineForecast:
    """The outlook of a machine, be it that it was never tapped."""
    standing, machine = analysis.status(now), analysis.machine
    fixed, rulings = machine.limits, _stored_verdicts(analysis, standing)
    percents = (fixed.frequency_warn_percent, fixed.frequency_alarm_percent)
    return MachineForecast(
        standing,
        {name: ruling.critical for name, ruling in rulings.items() if ruling.critical is not None},
        {
            table.name: _forecast_program(rulings[table.name], table.tool, standing)
            for table in machine.program
            if rulings
        },
        frozenset(name for name, ruling in rulings.items() if ruling.stability is Stability.UNKNOWN),
        tuple((percent, _forecast_limit(standing, percent)) for percent in percents if standing.series),
    )


def _stored_verdicts(analysis: Analysis, standing: MachineStatus) -> Mapping[str, StoredVerdict]:
    """On every program after the newest tap test, with critical falls where anything can be foretold."""
    if not standing.series:
        return {}
    can_foretell = any(series.trend is not None and series.trend.has_forecast for series in standing.series)
    return analysis.stored_verdicts(analysis.history.rows[-1].tap_id, drops=can_foretell)


def _forecast_limit(standing: MachineStatus, percent: float) -> ThresholdDates:
    """When the worst series has fallen by a limit; those that nothing can be foretold of are left out."""
    reaches = [_forecast_series_limit(series, percent) for series in standing.series]
    return find_earliest([reach for reach in reaches if reach.is_known])


def _forecast_series_limit(series: SeriesStatus, percent: float) -> ThresholdDates:
    if series.drop.is_known and series.drop.value >= percent:
        return ALREADY_REACHED
    trend = series.trend
    return NO_FORECAST if trend is None else trend.forecast_level(trend.start + 100 * math.log1p(-percent / 100))


def _forecast_program(ruling: StoredVerdict, tool: str, standing: MachineStatus) -> ProgramForecast:
    if ruling.stability is Stability.UNKNOWN:
        return ProgramForecast(NO_FORECAST, NO_FORECAST)
    series = [series for series in standing.series if series.tool == tool] or standing.series
    trends, critical = [series.trend for series in series], ruling.critical
    not_stable = ALREADY_REACHED if ruling.stability is Stability.NOT_STABLE else NO_FORECAST
    doubtful = NO_FORECAST if ruling.stability is Stability.STABLE else ALREADY_REACHED
    if critical is not None and ruling.stability is Stability.STABLE:
        doubtful = find_earliest([_forecast_drop(trend, critical.doubtful) for trend in trends])
    if critical is not None and ruling.stability is not Stability.NOT_STABLE:
        not_stable = find_earliest([_forecast_drop(trend, critical.not_stable, critical.error) for trend in trends])
    return ProgramForecast(doubtful, not_stable)


def _forecast_drop(trend: Trend | None, fall: float, error: float = 0.0) -> ThresholdDates:
    """When the frequency of the last point, which the word rests on, has fallen by a share (with its error)."""
    if trend is None:
        return NO_FORECAST
    if math.isinf(fall):
        return trend.forecast_level(-math.inf)
    return trend.forecast_level(trend.points[-1].percent + 100 * math.log1p(-fall), 100 * error / (1 - fall))
