"""From the standing of a machine to its summary.

It needs the logbook and numpy; who may do without them asks `lobewatch.plant`, which loads it when it is needed.
"""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lobewatch.decay.known_scatter import scatter_of
from lobewatch.decay.light import all_well
from lobewatch.decay.standing import SeriesStanding
from lobewatch.decay.trend import Trend, days_of
from lobewatch.history.row_bytes import encode_row
from lobewatch.logbook.logbook import Logbook
from lobewatch.logbook.outlook import Outlook, outlook_of
from lobewatch.machine import BusyError
from lobewatch.machine.folder_path import mark_of
from lobewatch.measuring.workers.share_work import Workers, share_work
from lobewatch.plant.standing_file import fitting_summary, standing_content, write_standing
from lobewatch.plant.summary import SeriesSummary, Summary

MOST = 60
"""Points kept of a series; chosen, more than its small picture can show."""
OF_THE_DATE = ("overdue", "tap-in-future")
"""Codes of the reasons that `Summary.at` adds."""


def summarise_folder(path: Path, now: datetime) -> Summary:
    """The summary of a machine folder as `summarise` makes it; DataError where it is none."""
    return summarise(Logbook.open(path), now)


def share_summaries(
    folders: Sequence[Path], now: datetime, workers: Workers
) -> Iterator[tuple[Path, tuple[int, ...], Summary]]:
    """The summaries of machine folders that others could make, each with the mark of its files.

    They must see the folders under the same names; each leaves standing.json there as `summarise` does. What
    `share_work` raises.
    """
    tasks = [_SummaryTask(os.getcwd(), str(folder), now) for folder in folders]  # noqa: PTH109
    for folder, content in zip(folders, share_work(_standing_content, tasks, workers), strict=True):
        summary = fitting_summary(folder, content, now)
        if summary is not None:
            yield folder, mark_of(folder, summary.newest_file), summary


class _SummaryTask(NamedTuple):
    """A machine to be summarised."""

    place: str
    """Folder that its path counts from."""
    path: str
    """Path of the machine folder as it was named."""
    now: datetime
    """Time of the summary."""


def _standing_content(task: _SummaryTask) -> bytes:
    """Content of its standing.json; empty where it cannot be made."""
    folder = Path(task.path)
    try:
        with contextlib.chdir(task.place):
            mark = mark_of(folder)
            summary = summarise_folder(folder, task.now)
            is_same = mark == mark_of(folder)
            return standing_content(summary, mark_of(folder, summary.newest_file), task.now) if is_same else b""
    except Exception:  # noqa: BLE001 - whatever is wrong with it is said by who asks for it
        return b""


def summarise_with_rows(path: Path, now: datetime) -> tuple[Summary, list[bytes]]:
    """The summary of a machine folder, and each row of its history as history.rows holds it."""
    logbook = Logbook.open(path)
    summary, hashes = summarise(logbook, now), logbook.machine.program_hashes
    return summary, [encode_row(number, row, hashes) for number, row in enumerate(logbook.history.rows)]


def summarise(logbook: Logbook, now: datetime | None = None) -> Summary:
    """The summary of a machine, kept beside it where its lock can be had; what `Logbook.standing` raises."""
    now = now or datetime.now(UTC)
    summary = _summary(logbook, logbook.ask(outlook_of, now))
    mark = mark_of(logbook.folder.path, summary.newest_file)
    if logbook.is_current:
        try:
            with logbook.folder.locked(patience=0):
                write_standing(logbook.folder.path, summary, mark, now)
        except (BusyError, OSError):
            pass  # it is made anew by the next who asks
    return summary


def _summary(logbook: Logbook, outlook: Outlook) -> Summary:
    machine, rows, standing = logbook.machine, logbook.history.current, outlook.standing
    last = standing.last_tap
    interval = machine.machine.tap_interval_days
    return Summary(
        name=machine.machine.name,
        remarks=tuple(remark for remark in standing.reasons if remark.code not in OF_THE_DATE),
        alarms=standing.alarms,
        otherwise=standing.next_step if last is None else all_well(last, interval),
        path=str(logbook.folder.path),
        interval_days=interval,
        has_port=bool(machine.daq.port),
        newest=rows[-1].tap_id if last is not None else "",
        last_tap="" if last is None else last.isoformat(),
        tap_tests=len(logbook.history.rows),
        programs={name: ruling.word.value for name, ruling in (rows[-1].rulings or {}).items()} if rows else {},
        fates=dict(outlook.programs),
        limits=outlook.limits,
        series=tuple(map(_series_summary, standing.series)),
    )


def _series_summary(series: SeriesStanding) -> SeriesSummary:
    trend, fall = series.trend, series.fall
    return SeriesSummary(
        name=series.name,
        tool=series.tool,
        direction=series.direction,
        fall=fall.value if fall.is_known else None,
        fall_std=fall.std if fall.is_known and math.isfinite(fall.std) else None,
        frequency=None if trend is None else trend.first * math.exp(trend.points[-1].percent / 100),
        alarm=trend.open_fall.fall.kind if trend is not None and trend.open_fall is not None else "",
        scatter=(0.0, 0.0) if trend is None else scatter_of(trend.readings.y),
        common_scatter=(0.0, 0.0) if trend is None else scatter_of(trend.readings.common.y),
        points=() if trend is None else tuple(_thin_out(trend)),
    )


def _thin_out(trend: Trend) -> Iterator[tuple[float, float]]:
    """Day and change (%) of the points, means of neighbours where there are many; the newest as it is."""
    percents = np.array([point.percent for point in trend.points])
    points = np.column_stack([days_of(trend.points), percents - trend.start])
    if len(points) > MOST:
        least, more = divmod(len(points) - 1, MOST - 1)
        begins = np.cumsum([0, *[least + 1] * more, *[least] * (MOST - 1 - more)])
        points = np.add.reduceat(points, begins) / np.diff(begins, append=len(points))[:, np.newaxis]
    for at, percent in points.tolist():
        yield round(at, 1), round(percent, 3)
