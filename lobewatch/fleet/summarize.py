"""Summarize a machine, and learn its scatter from other machines.

This module imports the logbook and numpy. Modules that must start fast use it through `lobewatch.fleet`.
"""

import contextlib
import math
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from acquisition import CROSS_TAP, atomic_write
from lobewatch.fleet import machine_summary
from lobewatch.fleet.machine_summary import MachineSummary, SeriesSummary
from lobewatch.history.history import History, encode_row
from lobewatch.logbook.logbook import Logbook
from lobewatch.logbook.machine_forecast import MachineForecast, forecast_from_analysis
from lobewatch.machine import BusyError
from lobewatch.machine.folder_files import compute_change_mark
from lobewatch.machine.journal.alarm_entries import FleetScatter
from lobewatch.machine.settings.setting_questions import hash_programs
from lobewatch.measurement.share_work import Workers, share_work
from lobewatch.measurement.tap_age import TOO_OLD_CODE
from lobewatch.monitoring import SeriesStatus, series_points
from lobewatch.monitoring.change_detection import MIN_MONITORED_POINTS
from lobewatch.monitoring.series_history import build_series_history
from lobewatch.monitoring.series_points import ScatterPrior, SeriesScatterPrior
from lobewatch.monitoring.status_rules import next_tap_step
from lobewatch.monitoring.trend import Trend, point_days

MAX_SERIES_POINTS = 60
"""Number of points of a series that a summary keeps; chosen, more than a small chart shows."""
DATE_REMARK_CODES = ("overdue", "tap-in-future", TOO_OLD_CODE)
"""Codes of the reasons that `MachineSummary.status_at` adds."""
MAX_MACHINES_READ = 500
"""Number of other machines that scatter is learned from at most; chosen."""
RenderText = Callable[[str], str]
"""Function that replaces names of the library in a text."""


def summarize_folder(path: Path, now: datetime, render_text: RenderText = str) -> MachineSummary:
    """Summarize a machine folder and store the summary.

    Parameters
    ----------
    path
        Path of the machine folder.
    now
        Time of the summary.
    render_text
        Function that replaces names of the library in the texts.

    Returns
    -------
    MachineSummary
        Summary of the machine.

    Raises
    ------
    DataError
        If the path is no machine folder.
    """
    return summarize_machine(Logbook.open(path), now, render_text)


def summarize_in_parallel(
    folders: Sequence[Path], now: datetime, workers: Workers, render_text: RenderText = str
) -> Iterator[tuple[Path, tuple[int, ...], MachineSummary]]:
    """Summarize machine folders in workers, and yield each folder with its change mark and summary.

    Workers must see the folders under the same paths. Folders that fail are left out. Errors as `share_work`.
    """
    tasks = [(os.getcwd(), str(folder), now, render_text) for folder in folders]  # noqa: PTH109
    for folder, content in zip(folders, share_work(_make_summary_content, tasks, workers), strict=True):
        summary = machine_summary.decode_summary(folder, content, now)
        if summary is not None:
            yield folder, compute_change_mark(folder, summary.newest_file), summary


def _make_summary_content(task: tuple[str, str, datetime, RenderText]) -> bytes:
    """Make the content of standing.json. Empty if that fails or the files change meanwhile.

    `task` holds the directory that the path counts from, the path, and `now` and `render_text` of `summarize_folder`.
    """
    directory, path, now, render_text = task
    folder = Path(path)
    try:
        with contextlib.chdir(directory):
            mark = compute_change_mark(folder)
            summary = summarize_folder(folder, now, render_text)
            if mark != compute_change_mark(folder):
                return b""
            return machine_summary.encode_summary(summary, compute_change_mark(folder, summary.newest_file), now)
    except Exception:  # noqa: BLE001 - the next assessment shows what is wrong
        return b""


def summarize_with_rows(path: Path, now: datetime, render_text: RenderText = str) -> tuple[MachineSummary, list[bytes]]:
    """Summarize a machine folder, and encode its history.

    Parameters
    ----------
    path
        Path of the machine folder.
    now
        Time of the summary.
    render_text
        Function that replaces names of the library in the texts.

    Returns
    -------
    summary : MachineSummary
        Summary of the machine.
    rows : list of bytes
        Rows of the history as in history.rows.
    """
    logbook = Logbook.open(path)
    summary, hashes = summarize_machine(logbook, now, render_text), hash_programs(logbook.machine)
    return summary, [encode_row(number, row, hashes) for number, row in enumerate(logbook.history.rows)]


def summarize_machine(logbook: Logbook, now: datetime | None = None, render_text: RenderText = str) -> MachineSummary:
    """Summarize a machine, and store the summary if the lock is free. Errors as `Logbook.status`."""
    now = now or datetime.now(UTC)
    summary = _build_summary(logbook, logbook.query(forecast_from_analysis, now), render_text)
    mark = compute_change_mark(logbook.folder.path, summary.newest_file)
    if logbook.is_current:
        with contextlib.suppress(BusyError, OSError), logbook.folder.locked(patience=0):
            path = logbook.folder.path / machine_summary.SUMMARY_FILE_NAME
            atomic_write(path, machine_summary.encode_summary(summary, mark, now), lasting=False)
    return summary


def _build_summary(logbook: Logbook, forecast: MachineForecast, render_text: RenderText) -> MachineSummary:
    machine, rows, status = logbook.machine, logbook.checked_history.current, forecast.status
    last, interval = status.last_tap, machine.machine.interval_days
    return MachineSummary(
        name=machine.machine.name,
        remarks=tuple(
            replace(remark, text=render_text(remark.text), cure=render_text(remark.cure))
            for remark in status.reasons
            if remark.code not in DATE_REMARK_CODES
        ),
        alarms=status.alarms,
        default_next_step=render_text(status.next_step if last is None else next_tap_step(last, interval)),
        path=str(logbook.folder.path),
        interval_days=interval,
        has_port=bool(machine.daq.port),
        newest_tap_id=rows[-1].tap_id if last is not None else "",
        last_tap="" if last is None else last.isoformat(),
        tap_tests=len(logbook.history.rows),
        programs={name: verdict.stability.value for name, verdict in (rows[-1].verdicts or {}).items()} if rows else {},
        tap_times=_collect_tap_times(logbook) if machine.machine.tap_interval_days is not None else {},
        forecasts=dict(forecast.programs),
        limits=forecast.limits,
        series=tuple(map(_summarize_series, status.series)),
    )


def _collect_tap_times(logbook: Logbook) -> dict[str, datetime]:
    """Return the time that the age of the tap tests behind each program counts from."""
    times = {program.name: logbook.history.tapped_since(program.tool) for program in logbook.machine.program}
    return {name: time for name, time in times.items() if time is not None}


def _summarize_series(series: SeriesStatus) -> SeriesSummary:
    trend, drop, names = series.trend, series.drop, (series.name, series.tool, series.direction)
    value = drop.value if drop.is_known else None
    std, half_width = (part if math.isfinite(part) else None for part in (drop.std, drop.half_width))
    if trend is None:
        return SeriesSummary(*names, value, std, None, drop_half_width=half_width, is_proven=series.is_change_proven)
    frequency = trend.first_value * math.exp(trend.points[-1].percent / 100)
    alarm = trend.open_drop.change.kind if trend.open_drop is not None else ""
    scatter = series_points.estimate_scatter(trend.readings.y)
    common_scatter = series_points.estimate_scatter(trend.readings.mean_of_directions.y)
    points = tuple(_thin_out(trend))
    proven = series.is_change_proven
    return SeriesSummary(*names, value, std, frequency, alarm, scatter, common_scatter, points, half_width, proven)


def _thin_out(trend: Trend) -> Iterator[tuple[float, float]]:
    """Yield day and frequency change (%) of the points. Many points are averaged, but for the newest."""
    points = np.column_stack([point_days(trend.points), -trend.drops])
    if len(points) > MAX_SERIES_POINTS:
        size, larger = divmod(len(points) - 1, MAX_SERIES_POINTS - 1)
        begins = np.cumsum([0, *[size + 1] * larger, *[size] * (MAX_SERIES_POINTS - 1 - larger)])
        points = np.add.reduceat(points, begins) / np.diff(begins, append=len(points))[:, np.newaxis]
    for day, percent in points.tolist():
        yield round(day, 1), round(percent, 3)


def learn_scatter(logbook: Logbook) -> None:
    """Store in the journal the scatter learned from other machines and from before a repair.

    Once after each baseline of a young machine, as soon as there is anything to learn from. Raises BusyError, OSError
    and DataError, as any journal entry.
    """
    history = logbook.history
    rows = history.current
    counts = Counter((row.tool, row.direction) for row in rows if row.direction != CROSS_TAP)
    is_young = any(count < MIN_MONITORED_POINTS for count in counts.values())
    if not is_young or logbook.files.fleet_scatter is not None:
        return
    priors = [*_read_neighbor_scatters(logbook.folder.path), *_collect_earlier_scatters(history)]
    if not priors:
        return
    scatter, common = (series_points.pool_scatter(scatters) for scatters in zip(*priors, strict=True))
    if scatter.freedom:
        number = sum(prior.freedom > 0 for prior, _ in priors)
        with logbook.folder.locked():
            logbook.folder.journal.append(FleetScatter(rows[-1].time, scatter, common, number).line)


def _read_neighbor_scatters(folder: Path) -> Iterator[SeriesScatterPrior]:
    """Read the scatter of all machines in the same parent folder."""
    paths = sorted(folder.resolve().parent.glob(f"*/{machine_summary.SUMMARY_FILE_NAME}"))
    for path in paths[:MAX_MACHINES_READ]:
        summary = machine_summary.read_last_summary(path.parent)
        for series in () if summary is None else summary.series:
            common = series.common_scatter if series.direction == "x" else series_points.NO_SCATTER_PRIOR
            yield SeriesScatterPrior(ScatterPrior(*series.scatter), ScatterPrior(*common))


def _collect_earlier_scatters(history: History) -> Iterator[SeriesScatterPrior]:
    """Estimate the scatter of the series before the present baseline."""
    before = [row for row in history.rows if row.baseline != history.baseline]
    for baseline, series in dict.fromkeys((row.baseline, row.series) for row in before):
        same = [row for row in before if (row.baseline, row.series) == (baseline, series)]
        x, y = ([row for row in same if row.direction == direction] for direction in ("x", "y"))
        for rows, other_direction in ((x, y), (y, ())):
            trend = build_series_history(rows, other_direction).frequency.trend if rows else None
            if trend is not None:
                both = trend.readings.mean_of_directions
                yield SeriesScatterPrior(*map(series_points.estimate_scatter, (trend.readings.y, both.y)))
