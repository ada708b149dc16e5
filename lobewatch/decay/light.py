"""The light of a machine: what each reason means, in order of harm, and the reasons that the date alone gives.

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
from lobewatch.decay.alarm import Alarm
from lobewatch.measuring.clock import CLOCK_QUESTIONS, about_future

Coded = TypeVar("Coded", Remark, Alarm)
"""What has the code of a reason."""


class Light(StrEnum):
    """The light of a machine, worst first."""

    ALARM = "alarm"
    """Beyond a limit: a fall, a decay, or a program that is not stable any more."""
    UNKNOWN = "unknown"
    """Damaged, unreadable or never tapped: nothing can be said."""
    WARN = "warn"
    """In want of attention: a smaller fall, a doubt, damage, a test that is due."""
    GOOD = "good"
    """Nothing is known to be wrong."""


LIGHTS = {
    "frequency-alarm": Light.ALARM,
    "decay": Light.ALARM,
    "program-not-stable": Light.ALARM,
    "unreadable": Light.UNKNOWN,
    "never-tapped": Light.UNKNOWN,
    "journal-damaged": Light.WARN,
    "tap-damaged": Light.WARN,
    "tap-unreadable": Light.WARN,
    "tap-unlisted": Light.WARN,
    "file-damaged": Light.WARN,
    "cut-damaged": Light.WARN,
    "cut-unlisted": Light.WARN,
    "frequency-warn": Light.WARN,
    "decay-doubtful": Light.WARN,
    "frequency-jump": Light.WARN,
    "mode-lost": Light.WARN,
    "no-mode-in-band": Light.WARN,
    "no-mode-to-follow": Light.WARN,
    "other-band": Light.WARN,
    "stiffness-jump": Light.WARN,
    "stiffness-off-model": Light.WARN,
    **dict.fromkeys(CLOCK_QUESTIONS, Light.WARN),
    "tap-in-future": Light.WARN,
    "overdue": Light.WARN,
    "program-unknown": Light.WARN,
    "program-doubtful": Light.WARN,
    "frequency-rose": Light.GOOD,
    "value-changed": Light.GOOD,
    "one-direction": Light.GOOD,
}
"""Light of each reason by its code, in order of harm."""

PAST_A_LIMIT = ("frequency-alarm", "frequency-warn", "program-not-stable")
"""Reasons with which an alarm is not early."""
UNREADABLE = "Put its files right: the sentence above says which."
"""Next step of a machine that cannot be read."""


def about_unreadable(reason: str) -> Remark:
    """Remark on a machine whose files cannot be read."""
    return Remark("unreadable", "", reason)


def in_order(remarks: Iterable[Coded]) -> tuple[Coded, ...]:
    """Reasons, or their alarms, in order of harm."""
    order = list(LIGHTS)
    return tuple(sorted(remarks, key=lambda remark: order.index(remark.code)))


def light_of(ordered: Sequence[Remark]) -> Light:
    """Light of the worst reason."""
    return LIGHTS[ordered[0].code] if ordered else Light.GOOD


def is_early(ordered: Sequence[Remark]) -> bool:
    """Whether an alarm is of the watch alone: a fall that is sure, but short of every limit and of every program."""
    codes = {remark.code for remark in ordered}
    return light_of(ordered) is Light.ALARM and codes.isdisjoint(PAST_A_LIMIT)


def next_step(ordered: Sequence[Remark], well: str) -> str:
    """Next step, one sentence; well: that where no reason says another."""
    return ordered[0].cure if ordered and ordered[0].cure else well


def all_well(newest: datetime, interval_days: float) -> str:
    """Next step where nothing is wrong; newest: when it was tapped last."""
    return f"All is well: tap again by {newest + timedelta(days=math.floor(interval_days)):%Y-%m-%d}."


def days_left(newest: datetime, interval_days: float, now: datetime) -> float:
    """Days until the next tap test is due; newest: when the last one was."""
    return interval_days - (now - newest) / timedelta(days=1)


def about_dates(
    tap_id: str, newest: datetime, interval_days: float, now: datetime, path: Path | str
) -> Iterator[Remark]:
    """Remarks that the date alone gives: a test is overdue, or one of the future. path: of the folder, for commands."""
    left = days_left(newest, interval_days, now)
    if left < 0:
        days = math.ceil(-left)
        text = f"the next tap test is overdue by {days} day{'s' if days > 1 else ''}"
        yield Remark("overdue", "", text, "Take the tap test that is due.")
    yield from about_future(tap_id, newest, now, path)


def of_files(remark: Remark) -> Remark:
    """A remark on a file, with a cure that can be the next step."""
    return replace(remark, cure=f"{remark.about}: {remark.cure or remark.text}.")


def with_files(ordered: tuple[Remark, ...], damage: Sequence[Remark]) -> tuple[Remark, ...]:
    """The reasons with what else was found damaged in the folder."""
    named = {(remark.code, remark.about) for remark in ordered}
    new = [of_files(remark) for remark in damage if (remark.code, remark.about) not in named]
    return in_order([*ordered, *new])
