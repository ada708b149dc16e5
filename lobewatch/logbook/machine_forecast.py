"""Forecast when programs become doubtful or not stable and when limits are reached."""

import math
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime

from acquisition import DataError
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.logbook import Logbook
from lobewatch.monitoring import MachineStatus, SeriesStatus, threshold_dates
from lobewatch.monitoring.threshold_dates import ALREADY_REACHED, NO_FORECAST, ProgramForecast, ThresholdDates
from lobewatch.monitoring.trend import Trend
from lobewatch.verdicts.verdict import CriticalDrop, Stability, StoredVerdict


@dataclass(frozen=True)
class MachineForecast:
    """Forecast of a machine for unchanged use."""

    status: MachineStatus
    """Present status of the machine."""
    critical_drops: Mapping[str, CriticalDrop]
    """Critical frequency drops from the newest tap tests, by program. Empty without a forecast."""
    programs: Mapping[str, ProgramForecast]
    """Forecast of each program, by name."""
    unknown_programs: frozenset[str]
    """Names of the programs whose verdict is unknown."""
    limits: threshold_dates.LimitForecasts
    """Forecast date of each frequency-drop limit of machine.toml (%), for the worst series."""

    def series(self, tool: str | None = None, direction: str | None = None) -> SeriesStatus:
        """Return the worst matching series. DataError if there is none."""
        for series in self.status.series:
            if tool in (None, series.tool) and direction in (None, series.direction):
                return series
        known = [(shlex.quote(series.tool), series.direction) for series in self.status.series]
        names = ", ".join(f"SeriesStatus.tool {name} SeriesStatus.direction {axis}" for name, axis in known)
        wanted = f"{repr(tool) if tool else 'any'}, direction {direction or 'any'}"
        raise DataError(f"no tap-test series of tool {wanted}. Choose one of: {names}.")


def forecast_machine(logbook: Logbook, now: datetime | None = None) -> MachineForecast:
    """Forecast a machine. DataError if it was never tapped."""
    logbook.newest_tap()
    return logbook.query(forecast_from_analysis, now or logbook.analysis.now)


def forecast_from_analysis(analysis: Analysis, now: datetime) -> MachineForecast:
    """Forecast a machine, which may have no tap test yet."""
    status, machine = analysis.status(now), analysis.machine
    verdicts = _newest_verdicts(analysis, status)
    limits = machine.limits.frequency_warn_percent, machine.limits.frequency_alarm_percent
    programs = machine.program if verdicts else ()
    return MachineForecast(
        status,
        {name: verdict.critical for name, verdict in verdicts.items() if verdict.critical is not None},
        {table.name: _forecast_program(verdicts[table.name], table.tool, status) for table in programs},
        frozenset(name for name, verdict in verdicts.items() if verdict.stability is Stability.UNKNOWN),
        tuple((percent, _forecast_limit(status, percent)) for percent in limits if status.series),
    )


def _newest_verdicts(analysis: Analysis, status: MachineStatus) -> Mapping[str, StoredVerdict]:
    """Return the verdicts after the newest tap test, with critical drops if any series has a forecast."""
    if not status.series:
        return {}
    drops = any(series.trend is not None and series.trend.has_forecast for series in status.series)
    return analysis.stored_verdicts(analysis.history.rows[-1].tap_id, drops)


def _forecast_limit(status: MachineStatus, percent: float) -> ThresholdDates:
    """Forecast when the first series reaches a frequency-drop limit."""
    dates = [_forecast_series_limit(series, percent) for series in status.series]
    return threshold_dates.find_earliest([date for date in dates if date.is_known])


def _forecast_series_limit(series: SeriesStatus, percent: float) -> ThresholdDates:
    if series.drop.is_known and series.drop.value >= percent:
        return ALREADY_REACHED
    trend = series.trend
    return NO_FORECAST if trend is None else trend.forecast_level(trend.start + 100 * math.log1p(-percent / 100))


def _forecast_program(verdict: StoredVerdict, tool: str, status: MachineStatus) -> ProgramForecast:
    if verdict.stability is Stability.UNKNOWN:
        return ProgramForecast(NO_FORECAST, NO_FORECAST)
    series = [series for series in status.series if series.tool == tool] or status.series
    trends, critical = [series.trend for series in series], verdict.critical
    not_stable = ALREADY_REACHED if verdict.stability is Stability.NOT_STABLE else NO_FORECAST
    doubtful = NO_FORECAST if verdict.stability is Stability.STABLE else ALREADY_REACHED
    if critical is not None and verdict.stability is Stability.STABLE:
        doubtful = threshold_dates.find_earliest([_forecast_drop(trend, critical.doubtful) for trend in trends])
    if critical is not None and verdict.stability is not Stability.NOT_STABLE:
        not_stable = threshold_dates.find_earliest(
            [_forecast_drop(trend, critical.not_stable, critical.error) for trend in trends]
        )
    return ProgramForecast(doubtful, not_stable)


def _forecast_drop(trend: Trend | None, drop: float, error: float = 0.0) -> ThresholdDates:
    """Forecast when the frequency of the last point has dropped by a share with a standard error."""
    if trend is None:
        return NO_FORECAST
    if math.isinf(drop):
        return trend.forecast_level(-math.inf)
    return trend.forecast_level(trend.points[-1].percent + 100 * math.log1p(-drop), 100 * error / (1 - drop))
