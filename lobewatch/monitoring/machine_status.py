"""Assess the status of a machine from its series and programs.

Pure: rows in, records out.
"""

import math
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path

from acquisition import CROSS_TAP, Remark
from acquisition.errors import join_sentences
from dsm import format_with_error
from lobewatch.history.history import History, HistoryRow
from lobewatch.machine import LimitsTable, Machine
from lobewatch.machine.journal.alarm_entries import Acknowledgement, FleetScatter
from lobewatch.measurement.recording_questions import question_remarks
from lobewatch.measurement.tap_age import is_too_old, too_old_remark
from lobewatch.monitoring import status_rules as rules
from lobewatch.monitoring.alarm_estimate import ChangeKind, SeriesChange
from lobewatch.monitoring.change_detection import MIN_MONITORED_POINTS
from lobewatch.monitoring.drop_text import format_below_start
from lobewatch.monitoring.series_drop import SeriesDrop
from lobewatch.monitoring.series_history import SeriesHistory, ValueHistory, build_series_history
from lobewatch.monitoring.series_points import ScatterPrior, SeriesScatterPrior
from lobewatch.monitoring.status_rules import Alarm, StatusLevel, TriggeredAlarm, add_acknowledgements
from lobewatch.monitoring.trend import Trend
from lobewatch.verdicts.verdict import Stability

OTHER_VALUES = {"damping_ratio": "damping ratio", "stiffness": "stiffness K"}
"""Labels of the values monitored besides the frequency; bearing stiffness follows from the frequency."""
MIN_REPORTED_CHANGE = 0.1
"""Smallest reported change of these values (%), above that of computed data and too small for any verdict."""
RUN_IN_TEXT = " (dropped early, slower since: may be run-in)"
"""Text for a drop as by bearings that run in; it triggers an alarm like any other."""


def _newest_remarks(name: str, newest: HistoryRow, drop: SeriesDrop, limits: LimitsTable) -> Iterator[Remark]:
    """Remark on a newest test without the followed mode, and a frequency drop that has reached a limit."""
    if not newest.frequency.is_known and newest.direction != CROSS_TAP:
        yield rules.MODE_LOST.remark(name)
    text = format_below_start(drop.value, drop.half_width)
    if drop.value >= limits.frequency_alarm_percent:
        yield rules.FREQUENCY_ALARM.remark(name, drop=text, limit=limits.frequency_alarm_percent)
    elif drop.value >= limits.frequency_warn_percent:
        yield rules.FREQUENCY_WARNING.remark(name, drop=text, limit=limits.frequency_warn_percent)


def _trend_remarks(name: str, trend: Trend, drop: SeriesDrop, path: Path | str = "MACHINE") -> Iterator[Remark]:
    """Remark on drops, doubtful drops and rises of the frequency; path: of the machine folder."""
    text = format_below_start(drop.value, drop.half_width)
    folder = shlex.quote(str(path))
    event = rules.EVENT_CALL.format(folder=folder)
    if trend.open_drop is not None:
        texts = {"kind": _describe_change(trend.open_drop.change), "run_in": RUN_IN_TEXT if trend.is_run_in else ""}
        yield rules.FREQUENCY_DECAY.remark(name, since=trend.drop_since, drop=text, event=event, folder=folder, **texts)
    elif trend.needs_repeat:
        yield rules.DOUBTFUL_DECAY.remark(name, folder=folder)
    elif trend.is_newest_high:
        yield rules.NEWEST_HIGH.remark(name, folder=folder)
    if trend.detection.rise is not None:
        yield rules.FREQUENCY_ROSE.remark(name, event=event, drop=text)


def _first_test_remarks(name: str, history: ValueHistory, path: Path | str) -> Iterator[Remark]:
    """Remark on a first test that counts as badly clamped: a drop right after it would look the same."""
    if history.trend is not None and history.trend.drop_model.first_distance:
        model, folder = history.trend.drop_model, shlex.quote(str(path))
        texts = {"tap_id": history.first_row_of(model.first_outlier).tap_id, "folder": folder}
        calls = {key: call.format(**texts) for key, call in rules.OUTLIER_CALLS.items()}
        side, distance = "above" if model.first_distance > 0 else "below", abs(model.first_distance)
        yield rules.FIRST_TEST_DIFFERS.remark(name, distance=distance, side=side, **texts, **calls)


def scatter_remarks(name: str, trend: Trend) -> Iterator[Remark]:
    """Remark on scatter that is not independent; two groups ask for the operator only if one is missing."""
    check = trend.scatter_check
    if check is not None and check.is_correlated:
        yield rules.SCATTER_CORRELATED.remark(name, correlation=check.correlation, share=check.false_alarm_share)
    if check is not None and check.group_distance:
        remedy = rules.CLAMP_ALIKE if all(trend.readings.operators) else ""
        yield rules.SCATTER_GROUPS.remark(name, remedy, distance=check.group_distance)


def _value_change_remarks(name: str, series: SeriesHistory) -> Iterator[Remark]:
    """Remark on changes of damping ratio and stiffness."""
    for value, label in OTHER_VALUES.items():
        newest = series.values[value].find_newest_change()
        if newest is not None and abs(newest[1].size) >= MIN_REPORTED_CHANGE:
            time, change = newest
            size = _describe_size(change)
            yield rules.VALUE_CHANGED.remark(name, value=label, since=time, kind=_describe_change(change), change=size)


def _describe_change(change: SeriesChange) -> str:
    """Describe the kind of a change."""
    past, present = ("dropped", "dropping") if change.size > 0 else ("rose", "rising")
    texts: dict[ChangeKind, str] = {
        "step": f"{past} suddenly before",
        "slope": f"has been {present} since",
        "mixed": f"{past} suddenly and steadily since",
        "dropped": f"{past} since",
    }
    return texts[change.kind]


def _describe_size(change: SeriesChange) -> str:
    """Describe the size of a change (%), logarithmic in the series, with its 95 % interval."""
    ratio = math.exp(-change.size / 100)
    return f"{format_with_error(100 * abs(1 - ratio), change.half_width * ratio)} %"


@dataclass(frozen=True)
class SeriesStatus:
    """Status of one tool in one direction."""

    tool: str
    """Tool in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    time: datetime
    """Time of its newest test."""
    first_time: datetime
    """Time of the test it is compared with."""
    drop: SeriesDrop
    """Drop of the followed frequency from the start of the series to the last test that shows it (%)."""
    trend: Trend | None = field(compare=False)
    """Points, changes and forecast; None without comparable tests."""
    remarks: tuple[Remark, ...]
    """Remarks on the series."""
    triggered: tuple[TriggeredAlarm, ...]
    """Triggered alarms."""
    history: SeriesHistory = field(compare=False, repr=False)
    """Rows of the series, and the history of their values."""

    @property
    def name(self) -> str:
        """Tool and direction."""
        return f"{self.tool}, {self.direction}"

    @property
    def is_change_proven(self) -> bool:
        """True if the frequency has changed for certain."""
        return self.trend is not None and self.trend.is_change_proven

    @property
    def is_baseline(self) -> bool:
        """True if there is no earlier test to compare with."""
        return self.time == self.first_time


@dataclass(frozen=True)
class MachineStatus:
    """Status of one machine."""

    time: datetime
    """Time of the assessment."""
    reasons: tuple[Remark, ...]
    """Remarks in order of severity, without acknowledgements."""
    next_step: str
    """Next step."""
    remarks: tuple[Remark, ...]
    """Remarks in order of severity, with acknowledgements in their text."""
    alarms: tuple[Alarm, ...] = ()
    """Open alarms, in order of severity."""
    series: tuple[SeriesStatus, ...] = ()
    """Series, that of the most severe remark first, then that of the largest drop."""
    last_tap: datetime | None = None
    """Time of the newest tap test; None if there is none."""
    days_left: float | None = None
    """Days until the next test is due; negative if overdue; None before the first."""

    @property
    def status(self) -> StatusLevel:
        """Status of the most severe remark."""
        return rules.worst_status(self.remarks)

    @property
    def is_early(self) -> bool:
        """True if the only alarm is a detected drop within every limit."""
        return rules.is_early_alarm(self.remarks)

    def series_of(self, tool: str, direction: str) -> SeriesStatus | None:
        """Return the status of one series, or None.

        Parameters
        ----------
        tool
            Name of the tool.
        direction
            Direction at the tool tip, "x" or "y".

        Returns
        -------
        SeriesStatus or None
            Status of the series; None if it was never tapped.
        """
        return next((series for series in self.series if (series.tool, series.direction) == (tool, direction)), None)


def assess_status(
    machine: Machine,
    history: History,
    now: datetime,
    path: Path | str = "MACHINE",
    files: Sequence[Remark] = (),
    acknowledgements: Sequence[Acknowledgement] = (),
    scatter: FleetScatter | None = None,
    chain: Sequence[Remark] = (),
) -> MachineStatus:
    """Assess the status of a machine at a time; the last row has the verdict on every program.

    path: of the folder, for commands; files: what is wrong with those in it; acknowledgements: oldest first;
    scatter: that of other machines; chain: on newest tap tests whose sensors nothing has checked.
    """
    rows = history.current
    if not rows and files:
        reason = join_sentences(*map(str, files))
        return _build_status(now, [rules.unreadable_remark(reason)], rules.UNREADABLE_NEXT_STEP)
    if not rows:
        since = "yet" if history.baseline is None else f"since the new baseline of {history.baseline:%Y-%m-%d}"
        return _build_status(now, [rules.NEVER_TAPPED.remark("", since=since)])
    pairs = dict.fromkeys((row.tool, row.direction) for row in rows)
    series = [_assess_series(_series_history_of(history, *pair, scatter), machine, now, path) for pair in pairs]
    newest, interval = rows[-1], machine.machine.interval_days
    series.sort(key=_severity_of_series)
    remarks = [remark for one in series for remark in one.remarks]
    raised = [alarm for one in series for alarm in one.triggered]
    remarks += [rules.add_file_remedy(remark) for remark in files if remark.code in rules.STATUS_BY_CODE]
    remarks += question_remarks({row.tap_id: row.questions for row in history.rows}, path, [row.tap_id for row in rows])
    remarks += chain
    programs = [*_program_remarks(rows, machine)]
    raised += [_trigger_program_alarm(remark, rows) for remark in programs if rules.is_alarm(remark)]
    remarks += [*programs, *rules.date_remarks(newest.tap_id, newest.time, interval, now, path)]
    remarks += _old_program_remarks(history, machine, now)
    remarks += _direction_remarks(rows)
    left = rules.count_days_left(newest.time, interval, now)
    alarms = [alarm.build_alarm(acknowledgements, history.baseline) for alarm in raised]
    status = _build_status(now, remarks, rules.next_tap_step(newest.time, interval), alarms)
    return replace(status, series=tuple(series), last_tap=newest.time, days_left=left)


def _build_status(
    now: datetime, remarks: Sequence[Remark], default_step: str = "", alarms: Sequence[Alarm] = ()
) -> MachineStatus:
    """Build the status from its remarks; default_step: next step if no remark has one."""
    ordered, alarms = rules.sort_by_severity(remarks), rules.sort_by_severity(alarms)
    acknowledged = add_acknowledgements(ordered, alarms, now)
    return MachineStatus(now, ordered, rules.find_next_step(ordered, default_step), acknowledged, alarms)


def _series_history_of(history: History, tool: str, direction: str, scatter: FleetScatter | None) -> SeriesHistory:
    rows, other_rows = (history.series(tool, one) for one in (direction, {"x": "y", "y": "x"}.get(direction, "")))
    if scatter is None or sum(row.time <= scatter.time for row in rows) >= MIN_MONITORED_POINTS:
        return build_series_history(rows, other_rows)
    prior = SeriesScatterPrior(ScatterPrior(*scatter.alone), ScatterPrior(*scatter.common))
    return build_series_history(rows, other_rows, prior)


def _assess_series(series: SeriesHistory, machine: Machine, now: datetime, path: Path | str) -> SeriesStatus:
    newest, frequency, drop = series.rows[-1], series.frequency, series.drop
    first = (frequency.reference_rows or frequency.known_rows or series.rows)[0]
    trend = None if frequency.trend is None else frequency.trend.at_day(now)
    name = f"{newest.tool}, {newest.direction}"
    limit_remarks = [*_newest_remarks(name, newest, drop, machine.limits)]
    trend_remarks = [*_trend_remarks(name, trend, drop, path)] if trend else []
    remarks = [*limit_remarks, *trend_remarks, *_value_change_remarks(name, series)]
    remarks += _first_test_remarks(name, frequency, path)
    remarks += scatter_remarks(name, trend) if trend else []
    below, falling = series.first_below(machine.limits.frequency_alarm_percent), series.first_falling
    pairs = [(remark, below) for remark in limit_remarks] + [(remark, falling) for remark in trend_remarks]
    raised = [TriggeredAlarm(remark, at.tap_id, at.time) for remark, at in pairs if at and rules.is_alarm(remark)]
    times = newest.time, first.time
    return SeriesStatus(newest.tool, newest.direction, *times, drop, trend, tuple(remarks), tuple(raised), series)


def _severity_of_series(series: SeriesStatus) -> tuple[int, float]:
    """Return the place of a series in the status: by its most severe remark, then by its drop."""
    codes = [remark.code for remark in series.remarks if rules.STATUS_BY_CODE[remark.code] is not StatusLevel.GOOD]
    places = map([*rules.STATUS_BY_CODE].index, codes)
    return min(places, default=len(rules.STATUS_BY_CODE)), -series.drop.value if series.drop.is_known else math.inf


def _program_remarks(rows: Sequence[HistoryRow], machine: Machine) -> Iterator[Remark]:
    to_tap = {remark.about: remark.cure for remark in _direction_remarks(rows)}
    tools = {program.name: program.tool for program in machine.program}
    for name, verdict in (rows[-1].verdicts or {}).items():
        tap, stability = to_tap.get(tools[name], ""), verdict.stability.value
        if verdict.stability is Stability.NOT_STABLE:
            cure = tap and f"Do not run this program. {tap}."
            yield rules.PROGRAM_NOT_STABLE.remark(name, cure, stability=stability)
        elif verdict.stability is Stability.UNKNOWN:
            yield rules.PROGRAM_UNKNOWN.remark(name, stability=stability)
        elif verdict.stability is Stability.DOUBTFUL:
            yield rules.PROGRAM_DOUBTFUL.remark(name, tap, stability=stability)


def _old_program_remarks(history: History, machine: Machine, now: datetime) -> Iterator[Remark]:
    """Yield a remark for each stable program whose tap tests are too old for the agreed interval."""
    interval, verdicts = machine.machine.tap_interval_days, history.current[-1].verdicts or {}
    for program in machine.program:
        time = history.tapped_since(program.tool)
        is_stable = program.name in verdicts and verdicts[program.name].stability is Stability.STABLE
        if is_stable and interval is not None and time is not None and is_too_old(time, now, interval):
            yield too_old_remark(program.name, time, now, interval)


def _trigger_program_alarm(remark: Remark, rows: Sequence[HistoryRow]) -> TriggeredAlarm:
    """Build the alarm of a program that is not stable, triggered by the first of the consecutive tests that show it."""
    first = rows[-1]
    for row in reversed(rows):
        verdict = (row.verdicts or {}).get(remark.about)
        if verdict is None or verdict.stability is not Stability.NOT_STABLE:
            break
        first = row
    return TriggeredAlarm(remark, first.tap_id, first.time)


def _direction_remarks(rows: Sequence[HistoryRow]) -> Iterator[Remark]:
    direct = [row for row in rows if row.direction != CROSS_TAP]
    for tool in dict.fromkeys(row.tool for row in direct):
        tapped = {row.direction for row in direct if row.tool == tool and row.frequency.is_known}
        if len(tapped) == 1:
            direction = tapped.pop()
            yield rules.ONE_DIRECTION.remark(tool, direction=direction, missing="y" if direction == "x" else "x")
