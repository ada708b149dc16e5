"""Status of a machine by remark code, in order of severity, and remarks by date.

Imported with every look at a plant, so without numpy.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from enum import StrEnum
from pathlib import Path
from typing import TypeVar

from acquisition import Remark
from lobewatch.measurement.clock_questions import CLOCK_QUESTIONS, future_tap_remarks
from lobewatch.monitoring.alarm import Alarm

CodedT = TypeVar("CodedT", Remark, Alarm)
"""What has the code of a reason."""


class StatusLevel(StrEnum):
    """The light of a machine, worst first."""

    ALARM = "alarm"
    """Beyond a limit: a fall, a decay, or a program that is not stable any more."""
    UNKNOWN = "unknown"
    """Damaged, unreadable or never tapped: nothing can be said."""
    WARN = "warn"
    """In want of attention: a smaller fall, a doubt, damage, a test that is due."""
    GOOD = "good"
    """Nothing is known to be wrong."""


STATUS_BY_CODE = {
    "frequency-alarm": StatusLevel.ALARM,
    "decay": StatusLevel.ALARM,
    "program-not-stable": StatusLevel.ALARM,
    "unreadable": StatusLevel.UNKNOWN,
    "never-tapped": StatusLevel.UNKNOWN,
    "journal-damaged": StatusLevel.WARN,
    "tap-damaged": StatusLevel.WARN,
    "tap-unreadable": StatusLevel.WARN,
    "tap-unlisted": StatusLevel.WARN,
    "file-damaged": StatusLevel.WARN,
    "cut-damaged": StatusLevel.WARN,
    "cut-unlisted": StatusLevel.WARN,
    "frequency-warn": StatusLevel.WARN,
    "decay-doubtful": StatusLevel.WARN,
    "frequency-jump": StatusLevel.WARN,
    "mode-lost": StatusLevel.WARN,
    "no-mode-in-band": StatusLevel.WARN,
    "no-mode-to-follow": StatusLevel.WARN,
    "other-band": StatusLevel.WARN,
    "stiffness-jump": StatusLevel.WARN,
    "stiffness-off-model": StatusLevel.WARN,
    **dict.fromkeys(CLOCK_QUESTIONS, StatusLevel.WARN),
    "tap-in-future": StatusLevel.WARN,
    "overdue": StatusLevel.WARN,
    "program-unknown": StatusLevel.WARN,
    "program-doubtful": StatusLevel.WARN,
    "frequency-rose": StatusLevel.GOOD,
    "value-changed": StatusLevel.GOOD,
    "one-direction": StatusLevel.GOOD,
}
"""Light of each reason by its code, in order of harm."""

LIMIT_CODES = ("frequency-alarm", "frequency-warn", "program-not-stable")
"""Reasons with which an alarm is not early."""
UNREADABLE_NEXT_STEP = "Put its files right: the sentence above says which."
"""Next step of a machine that cannot be read."""


def unreadable_remark(reason: str) -> Remark:
    """Remark on a machine whose files cannot be read."""
    return Remark("unreadable", "", reason)


def sort_by_severity(remarks: Iterable[CodedT]) -> tuple[CodedT, ...]:
    """Reasons, or their alarms, in order of harm."""
    order = list(STATUS_BY_CODE)
    return tuple(sorted(remarks, key=lambda remark: order.index(remark.code)))


def worst_status(ordered: Sequence[Remark]) -> StatusLevel:
    """Light of the worst reason."""
    return STATUS_BY_CODE[ordered[0].code] if ordered else StatusLevel.GOOD


def is_early_alarm(ordered: Sequence[Remark]) -> bool:
    """Whether an alarm is of the watch alone: a fall that is sure, but short of every limit and of every program."""
    codes = {remark.code for remark in ordered}
    return worst_status(ordered) is StatusLevel.ALARM and codes.isdisjoint(LIMIT_CODES)


def find_next_step(ordered: Sequence[Remark], well: str) -> str:
    """Next step, one sentence; well: that where no reason says another."""
    return ordered[0].cure if ordered and ordered[0].cure else well


def next_tap_step(newest: datetime, interval_days: float) -> str:
    """Next step where nothing is wrong; newest: when it was tapped last."""
    return f"All is well: tap again by {newest + timedelta(days=math.floor(interval_days)):%Y-%m-%d}."


def count_days_left(newest: datetime, interval_days: float, now: datetime) -> float:
    """Days until the next tap test is due; newest: when the last one was."""
    return interval_days - (now - newest) / timedelta(days=1)


def date_remarks(
    tap_id: str, newest: datetime, interval_days: float, now: datetime, path: Path | str
) -> Iterator[Remark]:
    """Remarks that the date alone gives: a test is overdue, or one of the future. path: of the folder, for commands."""
    left = count_days_left(newest, interval_days, now)
    if left < 0:
        days = math.ceil(-left)
        text = f"the next tap test is overdue by {days} day{'s' if days > 1 else ''}"
        yield Remark("overdue", "", text, "Take the tap test that is due.")
    yield from future_tap_remarks(tap_id, newest, now, path)


def add_file_remedy(remark: Remark) -> Remark:
    """A remark on a file, with a cure that can be the next step."""
    return replace(remark, cure=f"{remark.about}: {remark.cure or remark.text}.")


def add_damage_remarks(ordered: tuple[Remark, ...], damage: Sequence[Remark]) -> tuple[Remark, ...]:
    """The reasons with what else was found damaged in the folder."""
    named = {(remark.code, remark.about) for remark in ordered}
    new = [add_file_remedy(remark) for remark in damage if (remark.code, remark.about) not in named]
    return sort_by_severity([*ordered, *new])
