"""When each program becomes doubtful and not stable, and when the fixed limits of machine.toml are reached."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

from acquisition import DataError
from lobewatch.decay.reach import ALREADY, NOBODY_KNOWS, Fate, Limits, Reach, earliest_of
from lobewatch.decay.standing import SeriesStanding, Standing
from lobewatch.decay.trend import Trend
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.logbook import Logbook
from lobewatch.verdicts.verdict import CriticalFall, Ruling, Word


@dataclass(frozen=True)
class Outlook:
    """What becomes of a machine if it is used as before."""

    standing: Standing
    """Standing of the machine now."""
    critical: Mapping[str, CriticalFall]
    """Falls that the frequency of the newest tap tests may take, by program, where anything can be foretold."""
    programs: Mapping[str, Fate]
    """Fate of each program, by its name."""
    unknown: frozenset[str]
    """Names of the programs on which there is no word now, for whatever reason: none can change."""
    limits: Limits
    """When the worst of its series has fallen by each limit of machine.toml."""

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
    """The outlook of a machine, be it that it was never tapped."""
    standing, machine = analysis.standing(now), analysis.machine
    fixed, rulings = machine.limits, _rulings(analysis, standing)
    percents = (fixed.frequency_warn_percent, fixed.frequency_alarm_percent)
    return Outlook(
        standing,
        {name: ruling.critical for name, ruling in rulings.items() if ruling.critical is not None},
        {table.name: _fate(rulings[table.name], table.tool, standing) for table in machine.program if rulings},
        frozenset(name for name, ruling in rulings.items() if ruling.word is Word.UNKNOWN),
        tuple((percent, _limit(standing, percent)) for percent in percents if standing.series),
    )


def _rulings(analysis: Analysis, standing: Standing) -> Mapping[str, Ruling]:
    """On every program after the newest tap test, with critical falls where anything can be foretold."""
    if not standing.series:
        return {}
    can_foretell = any(series.trend is not None and series.trend.can_be_foretold for series in standing.series)
    return analysis.rulings(analysis.history.rows[-1].tap_id, falls=can_foretell)


def _limit(standing: Standing, percent: float) -> Reach:
    """When the worst series has fallen by a limit; those that nothing can be foretold of are left out."""
    reaches = [_limit_of(series, percent) for series in standing.series]
    return earliest_of([reach for reach in reaches if reach.is_known])


def _limit_of(series: SeriesStanding, percent: float) -> Reach:
    if series.fall.is_known and series.fall.value >= percent:
        return ALREADY
    trend = series.trend
    return NOBODY_KNOWS if trend is None else trend.reach(trend.start + 100 * math.log1p(-percent / 100))


def _fate(ruling: Ruling, tool: str, standing: Standing) -> Fate:
    if ruling.word is Word.UNKNOWN:
        return Fate(NOBODY_KNOWS, NOBODY_KNOWS)
    series = [series for series in standing.series if series.tool == tool] or standing.series
    trends, critical = [series.trend for series in series], ruling.critical
    not_stable = ALREADY if ruling.word is Word.NOT_STABLE else NOBODY_KNOWS
    doubtful = NOBODY_KNOWS if ruling.word is Word.STABLE else ALREADY
    if critical is not None and ruling.word is Word.STABLE:
        doubtful = earliest_of([_after(trend, critical.doubtful) for trend in trends])
    if critical is not None and ruling.word is not Word.NOT_STABLE:
        not_stable = earliest_of([_after(trend, critical.not_stable, critical.error) for trend in trends])
    return Fate(doubtful, not_stable)


def _after(trend: Trend | None, fall: float, error: float = 0.0) -> Reach:
    """When the frequency of the last point, which the word rests on, has fallen by a share (with its error)."""
    if trend is None:
        return NOBODY_KNOWS
    if math.isinf(fall):
        return trend.reach(-math.inf)
    return trend.reach(trend.points[-1].percent + 100 * math.log1p(-fall), 100 * error / (1 - fall))
