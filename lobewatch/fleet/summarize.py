"""Make the summary of a machine, and learn scatter from its neighbors. Needs numpy.

It needs the logbook and numpy; who may do without them asks `lobewatch.fleet`, which loads it when it is needed.
"""

from __future__ import annotations

import contextlib
import math
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from acquisition import CROSS_TAP
from lobewatch.fleet.machine_summary import (
    SUMMARY_FILE_NAME,
    MachineSummary,
    SeriesSummary,
    decode_summary,
    encode_summary,
    read_last_summary,
    write_summary,
)
from lobewatch.history.history import History
from lobewatch.history.row_codec import encode_row
from lobewatch.logbook.logbook import Logbook
from lobewatch.logbook.machine_forecast import MachineForecast, forecast_from_analysis
from lobewatch.machine import BusyError
from lobewatch.machine.folder_files import compute_change_mark
from lobewatch.machine.journal.entries import FleetScatter
from lobewatch.machine.settings.setting_questions import hash_programs
from lobewatch.measurement.share_work import Workers, share_work
from lobewatch.monitoring.change_detection import MIN_MONITORED_POINTS
from lobewatch.monitoring.machine_status import SeriesStatus
from lobewatch.monitoring.series_history import build_series_history
from lobewatch.monitoring.series_points import (
    NO_SCATTER_PRIOR,
    NO_SERIES_PRIOR,
    ScatterPrior,
    SeriesScatterPrior,
    estimate_scatter,
    pool_scatter,
)
from lobewatch.monitoring.status_rules import next_tap_step
from lobewatch.monitoring.trend import Trend, point_days

MAX_SERIES_POINTS = 60
"""Points kept of a series; chosen, more than its small picture can show."""
DATE_REMARK_CODES = ("overdue", "tap-in-future")
"""Codes of the reasons that `MachineSummary.at` adds."""


def summarize_folder(path: Path, now: datetime) -> MachineSummary:
    """The summary of a machine folder as `summarize_machine` makes it; DataError where it is none."""
    return summarize_machine(Logbook.open(path), now)


def summarize_in_parallel(
    folders: Sequence[Path], now: datetime, workers: Workers
) -> Iterator[tuple[Path, tuple[int, ...], MachineSummary]]:
    """The summaries of machine folders that others could make, each with the mark of its files.

    They must see the folders under the same names; each leaves standing.json there as `summarize_machine` does. What
    `share_work` raises.
    """
    tasks = [_SummaryTask(os.getcwd(), str(folder), now) for folder in folders]  # noqa: PTH109
    for folder, content in zip(folders, share_work(_make_summary_content, tasks, workers), strict=True):
        summary = decode_summary(folder, content, now)
        if summary is not None:
            yield folder, compute_change_mark(folder, summary.newest_file), summary


class _SummaryTask(NamedTuple):
    """A machine to be summarised."""

    place: str
    """Folder that its path counts from."""
    path: str
    """Path of the machine folder as it was named."""
    now: datetime
    """Time of the summary."""


def _make_summary_content(task: _SummaryTask) -> bytes:
    """Content of its standing.json; empty where it cannot be made."""
    folder = Path(task.path)
    try:
        with contextlib.chdir(task.place):
            mark = compute_change_mark(folder)
            summary = summarize_folder(folder, task.now)
            is_same = mark == compute_change_mark(folder)
            return (
                encode_summary(summary, compute_change_mark(folder, summary.newest_file), task.now) if is_same else b""
            )
    except Exception:  # noqa: BLE001 - whatever is wrong with it is said by who asks for it
        return b""


def summarize_with_rows(path: Path, now: datetime) -> tuple[MachineSummary, list[bytes]]:
    """The summary of a machine folder, and each row of its history as history.rows holds it."""
    logbook = Logbook.open(path)
    summary, hashes = summarize_machine(logbook, now), hash_programs(logbook.machine)
    return summary, [encode_row(number, row, hashes) for number, row in enumerate(logbook.history.rows)]


def summarize_machine(logbook: Logbook, now: datetime | None = None) -> MachineSummary:
    """The summary of a machine, kept beside it where its lock can be had; what `Logbook.standing` raises."""
    now = now or datetime.now(UTC)
    summary = _build_summary(logbook, logbook.query(forecast_from_analysis, now))
    mark = compute_change_mark(logbook.folder.path, summary.newest_file)
    if logbook.is_current:
        try:
            with logbook.folder.locked(patience=0):
                write_summary(logbook.folder.path, summary, mark, now)
        except (BusyError, OSError):
            pass  # it is made anew by the next who asks
    return summary


def _build_summary(logbook: Logbook, outlook: MachineForecast) -> MachineSummary:
    machine, rows, standing = logbook.machine, logbook.history.current, outlook.status
    last = standing.last_tap
    interval = machine.machine.tap_interval_days
    return MachineSummary(
        name=machine.machine.name,
        remarks=tuple(remark for remark in standing.reasons if remark.code not in DATE_REMARK_CODES),
        alarms=standing.alarms,
        default_next_step=standing.next_step if last is None else next_tap_step(last, interval),
        path=str(logbook.folder.path),
        interval_days=interval,
        has_port=bool(machine.daq.port),
        newest_tap_id=rows[-1].tap_id if last is not None else "",
        last_tap="" if last is None else last.isoformat(),
        tap_tests=len(logbook.history.rows),
        programs={name: ruling.stability.value for name, ruling in (rows[-1].verdicts or {}).items()} if rows else {},
        fates=dict(outlook.programs),
        limits=outlook.limits,
        series=tuple(map(_summarize_series, standing.series)),
    )


def _summarize_series(series: SeriesStatus) -> SeriesSummary:
    trend, fall = series.trend, series.drop
    return SeriesSummary(
        name=series.name,
        tool=series.tool,
        direction=series.direction,
        drop=fall.value if fall.is_known else None,
        drop_std=fall.std if fall.is_known and math.isfinite(fall.std) else None,
        frequency=None if trend is None else trend.first_value * math.exp(trend.points[-1].percent / 100),
        alarm=trend.open_drop.change.kind if trend is not None and trend.open_drop is not None else "",
        scatter=(0.0, 0.0) if trend is None else estimate_scatter(trend.readings.y),
        common_scatter=(0.0, 0.0) if trend is None else estimate_scatter(trend.readings.mean_of_directions.y),
        points=() if trend is None else tuple(_thin_out(trend)),
    )


def _thin_out(trend: Trend) -> Iterator[tuple[float, float]]:
    """Day and change (%) of the points, means of neighbours where there are many; the newest as it is."""
    percents = np.array([point.percent for point in trend.points])
    points = np.column_stack([point_days(trend.points), percents - trend.start])
    if len(points) > MAX_SERIES_POINTS:
        least, more = divmod(len(points) - 1, MAX_SERIES_POINTS - 1)
        begins = np.cumsum([0, *[least + 1] * more, *[least] * (MAX_SERIES_POINTS - 1 - more)])
        points = np.add.reduceat(points, begins) / np.diff(begins, append=len(points))[:, np.newaxis]
    for at, percent in points.tolist():
        yield round(at, 1), round(percent, 3)


MAX_MACHINES_READ = 500
"""Machines that are asked at most; chosen."""


def learn_scatter(logbook: Logbook) -> None:
    """Write down in the journal what the machines beside a young one tell of its scatter, and what it was before a
    repair; once after each baseline, as soon as there is anything to tell.

    BusyError, OSError and DataError as every line of the journal.
    """
    history = logbook.history
    rows = history.current
    counts = Counter((row.tool, row.direction) for row in rows if row.direction != CROSS_TAP)
    if (
        not counts
        or logbook.files.fleet_scatter is not None
        or all(count >= MIN_MONITORED_POINTS for count in counts.values())
    ):
        return
    known = [*_read_neighbor_scatters(logbook.folder.path), *_collect_earlier_scatters(history)]
    alone, common = (pool_scatter(scatters) for scatters in zip(*known, strict=True)) if known else NO_SERIES_PRIOR
    if alone.freedom:
        number = sum(scatter.freedom > 0 for scatter, _ in known)
        with logbook.folder.locked():
            logbook.folder.journal.append(FleetScatter(rows[-1].time, alone, common, number).line)


def _read_neighbor_scatters(folder: Path) -> Iterator[SeriesScatterPrior]:
    """Those of the series of all machines in the folder that a machine stands in."""
    for path in islice(sorted(folder.resolve().parent.glob(f"*/{SUMMARY_FILE_NAME}")), MAX_MACHINES_READ):
        summary = read_last_summary(path.parent)
        for series in () if summary is None else summary.series:
            common = series.common_scatter if series.direction == "x" else NO_SCATTER_PRIOR
            yield SeriesScatterPrior(ScatterPrior(*series.scatter), ScatterPrior(*common))


def _collect_earlier_scatters(history: History) -> Iterator[SeriesScatterPrior]:
    """Those of the series that ended with a new baseline."""
    before = [row for row in history.rows if row.baseline != history.baseline]
    for baseline, series in dict.fromkeys((row.baseline, row.series) for row in before):
        alike = [row for row in before if (row.baseline, row.series) == (baseline, series)]
        x, y = ([row for row in alike if row.direction == direction] for direction in ("x", "y"))
        for rows, beside in ((x, y), (y, ())):
            trend = build_series_history(rows, beside).frequency.trend if rows else None
            if trend is not None:
                yield SeriesScatterPrior(
                    estimate_scatter(trend.readings.y), estimate_scatter(trend.readings.mean_of_directions.y)
                )
