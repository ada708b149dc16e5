"""The standing of a machine: one light from all its series and all its programs, the reasons, one next step.

Pure: rows in, records out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from acquisition import ACROSS, Remark
from lobewatch.decay.alarm import Alarm, Raised, with_acknowledgements
from lobewatch.decay.change_point import FIRST_JUDGED
from lobewatch.decay.light import (
    LIGHTS,
    UNREADABLE,
    Light,
    about_dates,
    about_unreadable,
    all_well,
    days_left,
    in_order,
    is_early,
    light_of,
    next_step,
    of_files,
)
from lobewatch.decay.readings import KnownSpread, SeriesScatter
from lobewatch.decay.series_history import SeriesHistory, series_history
from lobewatch.decay.series_remarks import about_fall, about_loss, about_others, about_trend
from lobewatch.decay.trend import Trend
from lobewatch.history.history import History, Row
from lobewatch.machine import Machine
from lobewatch.machine.journal.acknowledgement import Acknowledgement
from lobewatch.machine.journal.known_scatter import KnownScatter
from lobewatch.measuring.estimate import Estimate
from lobewatch.measuring.questions import about_questions
from lobewatch.verdicts.verdict import Word


@dataclass(frozen=True)
class SeriesStanding:
    """The standing of one tool in one direction."""

    tool: str
    """Tool in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    time: datetime
    """Time of its newest test."""
    first: datetime
    """Time of the test that it is compared with."""
    fall: Estimate
    """Fall of the followed frequency from the start of the series to the last test that shows it (%)."""
    trend: Trend | None = field(compare=False)
    """Points, alarm and forecast; None where no test of it can be compared with."""
    remarks: tuple[Remark, ...]
    """Reasons that it gives."""
    raised: tuple[Raised, ...]
    """Those that ring."""
    history: SeriesHistory = field(compare=False, repr=False)
    """Rows that all this follows from, and the history of their values."""

    @property
    def name(self) -> str:
        """Tool and direction."""
        return f"{self.tool}, {self.direction}"

    @property
    def is_first(self) -> bool:
        """Whether there is nothing to compare with yet."""
        return self.time == self.first


@dataclass(frozen=True)
class Standing:
    """The standing of one machine."""

    time: datetime
    """Time that it is the standing at."""
    reasons: tuple[Remark, ...]
    """Reasons in order of harm, without what a person has said to them."""
    next_step: str
    """Next step, one sentence."""
    remarks: tuple[Remark, ...]
    """Reasons, those that are acknowledged with that in their text."""
    alarms: tuple[Alarm, ...] = ()
    """Alarms that are open, in the order of their reasons."""
    series: tuple[SeriesStanding, ...] = ()
    """Series, the one that fell most first."""
    last_tap: datetime | None = None
    """Time of the newest tap test; None where there is none."""
    days_left: float | None = None
    """Days until the next test is due; negative where it is overdue; None before the first."""

    @property
    def light(self) -> Light:
        """Light of the worst reason."""
        return light_of(self.remarks)

    @property
    def is_early(self) -> bool:
        """Whether its alarm is that of a fall short of every limit."""
        return is_early(self.remarks)

    def series_of(self, tool: str, direction: str) -> SeriesStanding | None:
        """The standing of one series; None where there is none."""
        fits = (series for series in self.series if (series.tool, series.direction) == (tool, direction))
        return next(fits, None)


def stand(
    machine: Machine,
    history: History,
    now: datetime,
    path: Path | str = "MACHINE",
    files: Sequence[Remark] = (),
    acknowledgements: Sequence[Acknowledgement] = (),
    scatter: KnownScatter | None = None,
) -> Standing:
    """The standing at a time; the last row holds the word on every program.

    path: of the folder, for commands; files: what is wrong with those in it; acknowledgements: oldest first; scatter:
    what other machines told of it.
    """
    rows = history.current
    if not rows and files:
        return _standing(now, [about_unreadable("; ".join(map(str, files)))], UNREADABLE)
    if not rows:
        cure = "Take the first tap test: all others are compared with it."
        since = "yet" if history.baseline is None else f"since the new baseline of {history.baseline:%Y-%m-%d}"
        return _standing(now, [Remark("never-tapped", "", f"no tap test {since}", cure)])
    pairs = dict.fromkeys((row.tool, row.direction) for row in rows)
    series = [_stand_of(_series_of(history, *pair, scatter), machine, now, path) for pair in pairs]
    newest, interval = rows[-1], machine.machine.tap_interval_days
    remarks = [remark for standing in series for remark in standing.remarks]
    raised = [alarm for standing in series for alarm in standing.raised]
    remarks += [of_files(remark) for remark in files if remark.code in LIGHTS]
    asked = {row.tap_id: row.questions for row in history.rows}
    remarks += about_questions(asked, path, [row.tap_id for row in rows])
    programs = [*_about_programs(rows, machine)]
    raised += [_raised_of_program(remark, rows) for remark in programs if LIGHTS[remark.code] is Light.ALARM]
    remarks += [
        *programs,
        *about_dates(newest.tap_id, newest.time, interval, now, path),
        *_about_directions(rows),
    ]
    series.sort(key=lambda standing: -standing.fall.value if standing.fall.is_known else math.inf)
    left = days_left(newest.time, interval, now)
    alarms = [alarm.alarm(acknowledgements, history.baseline) for alarm in raised]
    return _standing(now, remarks, all_well(newest.time, interval), series, newest.time, left, alarms)


def _standing(
    now: datetime,
    remarks: Sequence[Remark],
    well: str = "",
    series: Sequence[SeriesStanding] = (),
    last_tap: datetime | None = None,
    left: float | None = None,
    alarms: Sequence[Alarm] = (),
) -> Standing:
    """The standing with these reasons; well: the next step where none says another."""
    ordered = in_order(remarks)
    said = with_acknowledgements(ordered, alarms, now)
    return Standing(now, ordered, next_step(ordered, well), said, in_order(alarms), tuple(series), last_tap, left)


def _series_of(history: History, tool: str, direction: str, scatter: KnownScatter | None) -> SeriesHistory:
    rows, beside = (history.series(tool, one) for one in (direction, {"x": "y", "y": "x"}.get(direction, "")))
    if scatter is None or sum(row.time <= scatter.time for row in rows) >= FIRST_JUDGED:
        return series_history(rows, beside)
    return series_history(rows, beside, SeriesScatter(KnownSpread(*scatter.alone), KnownSpread(*scatter.common)))


def _stand_of(series: SeriesHistory, machine: Machine, now: datetime, path: Path | str) -> SeriesStanding:
    newest, frequency, fall = series.rows[-1], series.frequency, series.fall
    first = (frequency.sure or frequency.known or series.rows)[0]
    trend = None if frequency.trend is None else frequency.trend.on(now)
    name = f"{newest.tool}, {newest.direction}"
    of_limits, of_watch = [*about_fall(name, fall, machine.limits)], [*about_trend(name, trend, path)] if trend else []
    remarks = [*about_loss(name, newest), *of_limits, *of_watch, *about_others(name, series)]
    raised = [
        Raised(remark, row.tap_id, row.time)
        for remarks, row in (
            (of_limits, series.below_since(machine.limits.frequency_alarm_percent)),
            (of_watch, series.falling_since),
        )
        for remark in remarks
        if LIGHTS[remark.code] is Light.ALARM and row is not None
    ]
    return SeriesStanding(
        newest.tool, newest.direction, newest.time, first.time, fall, trend, tuple(remarks), tuple(raised), series
    )


def _about_programs(rows: Sequence[Row], machine: Machine) -> Iterator[Remark]:
    to_tap = {remark.about: remark.cure for remark in _about_directions(rows)}
    tools = {program.name: program.tool for program in machine.program}
    for name, ruling in (rows[-1].rulings or {}).items():
        tap = to_tap.get(tools[name])
        if ruling.word is Word.NOT_STABLE:
            cure = "Change these programs before the next part: lobewatch check names a safe speed and depth."
            cure = f"Do not run these programs. {tap}" if tap else cure
            yield Remark("program-not-stable", name, ruling.word.value, cure)
        elif ruling.word is Word.UNKNOWN:
            yield Remark("program-unknown", name, ruling.word.value, "See why with lobewatch check.")
        elif ruling.word is Word.DOUBTFUL:
            cure = tap or "See with lobewatch check what would settle it, and where to go until then."
            yield Remark("program-doubtful", name, ruling.word.value, cure)


def _raised_of_program(remark: Remark, rows: Sequence[Row]) -> Raised:
    """The alarm of a program that is not stable: raised by the first of the newest tap tests that all say so."""
    first = rows[-1]
    for row in reversed(rows):
        ruling = (row.rulings or {}).get(remark.about)
        if ruling is None or ruling.word is not Word.NOT_STABLE:
            break
        first = row
    return Raised(remark, first.tap_id, first.time)


def _about_directions(rows: Sequence[Row]) -> Iterator[Remark]:
    pairs = dict.fromkeys((row.tool, row.direction) for row in rows if row.direction != ACROSS)
    for tool in dict.fromkeys(tool for tool, _ in pairs):
        tapped = {direction for name, direction in pairs if name == tool and _is_known(rows, name, direction)}
        if len(tapped) == 1:
            direction = tapped.pop()
            missing = "y" if direction == "x" else "x"
            cure = f"Tap direction {missing} of the same tool too: no program is sure with one direction alone."
            yield Remark("one-direction", tool, f"tapped in direction {direction} alone", cure)


def _is_known(rows: Sequence[Row], tool: str, direction: str) -> bool:
    return any(row.frequency.is_known for row in rows if (row.tool, row.direction) == (tool, direction))
