"""When each program becomes doubtful and not stable, and when the fixed limits of machine.toml are reached."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from acquisition import DataError
from lobewatch.decay.forecast import DateRange
from lobewatch.decay.standing import SeriesStanding, Standing
from lobewatch.decay.trend import Trend
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.logbook import Logbook
from lobewatch.verdicts.critical import critical_fall
from lobewatch.verdicts.verdict import CriticalFall

ALREADY = DateRange(-math.inf, -math.inf, -math.inf)
NEVER = DateRange(math.inf, math.inf, math.inf)


@dataclass(frozen=True)
class Fate:
    """What becomes of one program; dates in days since 1970."""

    critical: CriticalFall
    """Falls that the frequency of its newest tap tests may take."""
    doubtful: DateRange | None
    """Date on which it becomes doubtful; None where nothing can be foretold."""
    not_stable: DateRange | None
    """Date from which it is not stable any more; None where nothing can be foretold."""


@dataclass(frozen=True)
class Outlook:
    """What becomes of a machine if it is used as before."""

    standing: Standing
    """Standing of the machine now."""
    programs: Mapping[str, Fate]
    """Fate of each program, by its name."""
    limits: Mapping[float, DateRange | None]
    """Dates when the worst of its series has fallen by each limit (%) of machine.toml; None where nobody can tell."""

    @property
    def horizon(self) -> float:
        """Last day that is foretold of all its series, in days since 1970; NaN where nothing is foretold."""
        foretold = (
            series.trend.forecast for series in self.standing.series if series.trend and not series.trend.is_stale
        )
        return min((float(forecast.dates[-1]) for forecast in foretold if forecast), default=math.nan)

    def series(self, tool: str | None = None, direction: str | None = None) -> SeriesStanding:
        """The series of a tool and direction, the one that fell most where several fit; DataError where none does."""
        fits = [
            series
            for series in self.standing.series
            if tool in (None, series.tool) and direction in (None, series.direction)
        ]
        if not fits:
            names = "; ".join(f"--tool {series.tool} --direction {series.direction}" for series in self.standing.series)
            raise DataError(f"tool {tool or 'any'}, direction {direction or 'any'}: no such series; there are: {names}")
        return fits[0]


def outlook(logbook: Logbook, now: datetime | None = None) -> Outlook:
    """The outlook of a machine; DataError where it was never tapped."""
    logbook.newest()
    return logbook.ask(outlook_of, now or datetime.now(UTC))


def outlook_of(analysis: Analysis, now: datetime) -> Outlook:
    """The outlook of a machine that was tapped."""
    standing, machine = analysis.standing(now), analysis.machine
    fixed = machine.limits
    percents = (fixed.frequency_warn_percent, fixed.frequency_alarm_percent)
    trends = [series.trend for series in standing.series if series.trend is not None]
    falls = _critical_falls(analysis)
    return Outlook(
        standing,
        {program.name: _fate(falls[program.name], program.tool, standing.series) for program in machine.program},
        {percent: _first(of_limit(trend, percent) for trend in trends) for percent in percents},
    )


def _critical_falls(analysis: Analysis) -> Mapping[str, CriticalFall]:
    """By program; kept in the history where there is a tap test to keep them with."""
    history = analysis.history
    if not history.current:
        return {verdict.program.name: critical_fall(verdict) for verdict in analysis.verdicts()}
    kept = analysis.rulings(history.rows[-1].tap_id, falls=True)
    return {name: ruling.critical for name, ruling in kept.items() if ruling.critical is not None}


def _fate(critical: CriticalFall, tool: str, series: Sequence[SeriesStanding]) -> Fate:
    if math.isnan(critical.not_stable):
        return Fate(critical, None, None)
    of_tool = [standing for standing in series if standing.tool == tool] or series
    trends = [standing.trend for standing in of_tool if standing.trend is not None]
    doubtful = _first(_after(trend, critical.doubtful, 0.0) for trend in trends)
    return Fate(critical, doubtful, _first(_after(trend, critical.not_stable, critical.error) for trend in trends))


def _after(trend: Trend, fall: float, error: float) -> DateRange | None:
    """When the frequency of the last point, which the word rests on, has fallen by a share.

    error: standard error of the share.
    """
    if fall == 0:
        return ALREADY
    if trend.forecast is None or trend.is_stale:
        return None
    if math.isinf(fall):
        return NEVER
    level = trend.points[-1].percent + 100 * math.log1p(-fall)
    return trend.forecast.reached(level, 100 * error / (1 - fall))


def of_limit(trend: Trend, percent: float) -> DateRange | None:
    """When a series has fallen by so much (%) from where it started; None where it cannot be told."""
    if trend.forecast is None or trend.is_stale:
        return None
    return trend.forecast.reached(trend.start + 100 * math.log1p(-percent / 100))


def _first(date_ranges: Iterator[DateRange | None]) -> DateRange | None:
    """The earliest of several series; None where one of them cannot be foretold and none is past it."""
    dates = [*date_ranges]
    if ALREADY in dates:
        return ALREADY
    foreseen = [date for date in dates if date is not None]
    return DateRange(*map(min, zip(*foreseen, strict=True))) if foreseen and len(foreseen) == len(dates) else None
