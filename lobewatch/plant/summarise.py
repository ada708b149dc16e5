"""From the standing of a machine to its summary."""

from __future__ import annotations

import math
from collections.abc import Iterator
from datetime import UTC, datetime

import numpy as np

from lobewatch.decay.light import all_well
from lobewatch.decay.standing import SeriesStanding, Standing
from lobewatch.decay.trend import Trend, days_of
from lobewatch.logbook.logbook import Logbook
from lobewatch.logbook.outlook import of_limit
from lobewatch.machine import BusyError, Limits
from lobewatch.machine.folder_path import mark_of
from lobewatch.plant.standing_file import write_standing
from lobewatch.plant.summary import Ahead, SeriesSummary, Summary

MOST = 60
"""Points kept of a series."""
OF_THE_DATE = ("overdue", "tap-in-future")
"""Reasons that `Summary.at` adds."""


def summarise(logbook: Logbook, now: datetime | None = None) -> Summary:
    """Of a machine, kept beside it where its lock can be had; what `Logbook.standing` raises."""
    now = now or datetime.now(UTC)
    found = _summary(logbook, logbook.standing(now))
    mark = mark_of(logbook.folder.path, found.newest_file)
    if logbook.is_current:
        try:
            with logbook.folder.locked():
                write_standing(logbook.folder.path, found, mark, now)
        except (BusyError, OSError):
            pass  # it is made anew by the next who asks
    return found


def _summary(logbook: Logbook, standing: Standing) -> Summary:
    machine, rows, last = logbook.machine, logbook.history.current, standing.last_tap
    interval = machine.machine.tap_interval_days
    return Summary(
        name=machine.machine.name,
        remarks=tuple(remark for remark in standing.remarks if remark.code not in OF_THE_DATE),
        otherwise=standing.next_step if last is None else all_well(last, interval),
        path=str(logbook.folder.path),
        interval_days=interval,
        has_port=bool(machine.daq.port),
        newest=rows[-1].tap_id if last is not None else "",
        last_tap="" if last is None else last.isoformat(),
        tap_tests=len(logbook.history.rows),
        programs={name: one.word.value for name, one in (rows[-1].rulings or {}).items()} if rows else {},
        series=tuple(_course(one, machine.limits) for one in standing.series),
    )


def _course(one: SeriesStanding, limits: Limits) -> SeriesSummary:
    trend, fall = one.trend, one.fall
    percents = limits.frequency_warn_percent, limits.frequency_alarm_percent
    return SeriesSummary(
        name=one.name,
        tool=one.tool,
        direction=one.direction,
        fall=fall.value if fall.is_known else None,
        fall_std=fall.std if fall.is_known and math.isfinite(fall.std) else None,
        frequency=None if trend is None else trend.first * math.exp(trend.points[-1].percent / 100),
        alarm=trend.watch.fall.kind if trend is not None and trend.watch.fall is not None else "",
        points=() if trend is None else tuple(_thinned(trend)),
        limits=() if trend is None else tuple(_ahead(trend, percent) for percent in percents),
    )


def _thinned(trend: Trend) -> Iterator[tuple[float, float]]:
    """Means of neighbours where there are many; the newest as it is."""
    percents = np.array([point.percent for point in trend.points])
    found = np.column_stack([days_of(trend.points), percents - trend.start])
    if len(found) > MOST:
        least, more = divmod(len(found) - 1, MOST - 1)
        begins = np.cumsum([0, *[least + 1] * more, *[least] * (MOST - 1 - more)])
        found = np.add.reduceat(found, begins) / np.diff(begins, append=len(found))[:, np.newaxis]
    for at, percent in found.tolist():
        yield round(at, 1), round(percent, 3)


def _ahead(trend: Trend, percent: float) -> Ahead:
    found = of_limit(trend, percent)
    if found is None or trend.forecast is None:
        return Ahead(percent)
    first, middle, last = (None if one == math.inf else round(max(one, float(trend.today)), 1) for one in found)
    return Ahead(percent, first, middle, last, round(float(trend.forecast.dates[-1]), 1))
