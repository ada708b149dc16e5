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
    """How far the frequency of its newest tap tests may fall."""
    doubtful: DateRange | None
    """When it becomes doubtful; None where nothing can be foretold."""
    not_stable: DateRange | None
    """When it is not stable any more; None where nothing can be foretold."""


@dataclass(frozen=True)
class Outlook:
    """What becomes of a machine if it is used as before."""

    standing: Standing
    """As it stands now."""
    programs: Mapping[str, Fate]
    """By name."""
    limits: Mapping[float, DateRange | None]
    """When the worst of its series has fallen by so much (%), those of machine.toml; None where it cannot be told."""

    @property
    def horizon(self) -> float:
        """Last day that is foretold of all its series, in days since 1970; NaN where nothing is foretold."""
        foretold = (one.trend.forecast for one in self.standing.series if one.trend and not one.trend.is_stale)
        return min((float(forecast.dates[-1]) for forecast in foretold if forecast), default=math.nan)

    def series(self, tool: str | None = None, direction: str | None = None) -> SeriesStanding:
        """The series of a tool and direction, the one that fell most where several fit; DataError where none does."""
        fits = [one for one in self.standing.series if tool in (None, one.tool) and direction in (None, one.direction)]
        if not fits:
            there = "; ".join(f"--tool {one.tool} --direction {one.direction}" for one in self.standing.series)
            raise DataError(f"tool {tool or 'any'}, direction {direction or 'any'}: no such series; there are: {there}")
        return fits[0]


def outlook(logbook: Logbook, now: datetime | None = None) -> Outlook:
    """The outlook of a machine; DataError where it was never tapped."""
    logbook.newest()
    return logbook.ask(_outlook, now or datetime.now(UTC))


def _outlook(analysis: Analysis, now: datetime) -> Outlook:
    standing, machine = analysis.standing(now), analysis.machine
    fixed = machine.limits
    percents = (fixed.frequency_warn_percent, fixed.frequency_alarm_percent)
    series = [one.trend for one in standing.series if one.trend is not None]
    falls = _critical_falls(analysis)
    return Outlook(
        standing,
        {one.name: _fate(falls[one.name], one.tool, standing.series) for one in machine.program},
        {percent: _first(of_limit(trend, percent) for trend in series) for percent in percents},
    )


def _critical_falls(analysis: Analysis) -> Mapping[str, CriticalFall]:
    """By program; kept in the history where there is a tap test to keep them with."""
    history = analysis.history
    if not history.current:
        return {one.program.name: critical_fall(one) for one in analysis.verdicts()}
    kept = analysis.rulings(history.rows[-1].tap_id, falls=True)
    return {name: ruling.critical for name, ruling in kept.items() if ruling.critical is not None}


def _fate(critical: CriticalFall, tool: str, series: Sequence[SeriesStanding]) -> Fate:
    if math.isnan(critical.not_stable):
        return Fate(critical, None, None)
    own = [one for one in series if one.tool == tool] or series
    trends = [one.trend for one in own if one.trend is not None]
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


def _first(found: Iterator[DateRange | None]) -> DateRange | None:
    """The earliest of several series; None where one of them cannot be foretold and none is past it."""
    dates = [*found]
    if ALREADY in dates:
        return ALREADY
    known = [one for one in dates if one is not None]
    return DateRange(*map(min, zip(*known, strict=True))) if known and len(known) == len(dates) else None
