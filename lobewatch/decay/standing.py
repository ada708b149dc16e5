"""How a machine stands: one light from all its series and all its programs, the reasons, one next step.

Pure: rows in, records out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from acquisition import Remark
from lobewatch.decay.fallen import about_fall, about_others, about_trend, fall_of, known_rows, rows_with, trend_in
from lobewatch.decay.light import (
    LIGHTS,
    UNREADABLE,
    Light,
    about_dates,
    about_unreadable,
    all_well,
    days_left,
    in_order,
    light_of,
    next_step,
    of_files,
)
from lobewatch.decay.trend import Trend
from lobewatch.history.history import History, Row
from lobewatch.machine import Machine
from lobewatch.measuring.estimate import Estimate
from lobewatch.measuring.questions import about_questions
from lobewatch.verdicts.verdict import Word


@dataclass(frozen=True)
class SeriesStanding:
    """One tool in one direction."""

    tool: str
    """What is in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    time: datetime
    """Of its newest test."""
    first: datetime
    """Of the test that it is compared with."""
    fall: Estimate
    """Fall of the followed frequency from the start of the series to the last test that shows it (%)."""
    trend: Trend | None = field(compare=False)
    """Points, alarm and forecast; None where no test of it can be compared with."""
    remarks: tuple[Remark, ...]
    """Reasons that it gives."""

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
    """How one machine stands."""

    remarks: tuple[Remark, ...]
    """The reasons, in order of harm."""
    next_step: str
    """What to do now, one sentence."""
    series: tuple[SeriesStanding, ...] = ()
    """The one that fell most first."""
    last_tap: datetime | None = None
    """When it was tapped last; None where it never was."""
    days_left: float | None = None
    """Until the next test is due; negative where it is overdue; None before the first test."""

    @property
    def light(self) -> Light:
        """That of the worst reason."""
        return light_of(self.remarks)

    def series_of(self, tool: str, direction: str) -> SeriesStanding | None:
        """How one series stands; None where there is none."""
        return next((one for one in self.series if (one.tool, one.direction) == (tool, direction)), None)


def unreadable(reason: str) -> Standing:
    """The standing of a machine whose files cannot be read."""
    return _of([about_unreadable(reason)], UNREADABLE)


def stand(
    machine: Machine,
    history: History,
    now: datetime,
    path: Path | str = "MACHINE",
    files: Sequence[Remark] = (),
    events: Sequence[datetime] = (),
) -> Standing:
    """The standing at a time; the last row holds the word on every program.

    path: of the folder, for commands; files: what is wrong with those in it; events: when something was done to it.
    """
    rows = history.current
    if not rows and files:
        return unreadable("; ".join(map(str, files)))
    if not rows:
        cure = "Take the first tap test: all others are compared with it."
        since = "yet" if history.baseline is None else f"since the new baseline of {history.baseline:%Y-%m-%d}"
        return _of([Remark("never-tapped", "", f"no tap test {since}", cure)])
    pairs = dict.fromkeys((row.tool, row.direction) for row in rows)
    series = [_series(history.series(*pair), machine, now, path, events) for pair in pairs]
    newest, interval = rows[-1], machine.machine.tap_interval_days
    remarks = [remark for one in series for remark in one.remarks]
    remarks += [of_files(remark) for remark in files if remark.code in LIGHTS]
    remarks += [asked for row in rows if row.questions for asked in about_questions(row.tap_id, row.questions, path)]
    remarks += [
        *_about_programs(rows, machine),
        *about_dates(newest.tap_id, newest.time, interval, now, path),
        *_about_directions(rows),
    ]
    series.sort(key=lambda one: -one.fall.value if one.fall.is_known else math.inf)
    left = days_left(newest.time, interval, now)
    return _of(remarks, all_well(newest.time, interval), tuple(series), newest.time, left)


def _of(remarks: Sequence[Remark], well: str = "", *others: object) -> Standing:
    worst = in_order(remarks)
    return Standing(worst, next_step(worst, well), *others)  # type: ignore[arg-type]


def _series(
    rows: Sequence[Row], machine: Machine, now: datetime, path: Path | str, events: Sequence[datetime]
) -> SeriesStanding:
    known = known_rows(rows, "frequency") or rows_with(rows, "frequency") or rows
    name, fall = f"{rows[-1].tool}, {rows[-1].direction}", fall_of(rows)
    trend = trend_in(rows, "frequency", now, events)
    remarks = [*_about_loss(name, rows[-1]), *about_fall(name, fall, machine.limits)]
    remarks += about_trend(name, trend, path) if trend else ()
    remarks += about_others(name, rows, trend)
    return SeriesStanding(rows[-1].tool, rows[-1].direction, rows[-1].time, known[0].time, fall, trend, tuple(remarks))


def _about_loss(name: str, newest: Row) -> Iterator[Remark]:
    if not newest.frequency.is_known:
        cure = "Tap again: the mode that is followed was not found in the newest test."
        yield Remark("mode-lost", name, "the newest test does not show the mode followed", cure)


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


def _about_directions(rows: Sequence[Row]) -> Iterator[Remark]:
    pairs = dict.fromkeys((row.tool, row.direction) for row in rows)
    for tool in dict.fromkeys(tool for tool, _ in pairs):
        known = {direction for one, direction in pairs if one == tool and _is_known(rows, one, direction)}
        if len(known) == 1:
            seen = known.pop()
            other = "y" if seen == "x" else "x"
            cure = f"Tap direction {other} of the same tool too: no program is sure with one direction alone."
            yield Remark("one-direction", tool, f"tapped in direction {seen} alone", cure)


def _is_known(rows: Sequence[Row], tool: str, direction: str) -> bool:
    return any(row.frequency.is_known for row in rows if (row.tool, row.direction) == (tool, direction))
