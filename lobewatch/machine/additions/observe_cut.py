"""What a person heard of a test cut, and whether it was heard otherwise before."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Literal

from lobewatch.machine.additions.keep_cut import software
from lobewatch.machine.journal.heard_cut import HeardCut
from lobewatch.machine.settings.cut_setting import CutSetting

NEAR_TOOTH = 0.005
"""Of a frequency: so near to a multiple of the tooth passing frequency it is the cut itself."""
SAME_SPEED, SAME_DEPTH = 2e-3, 1e-2
"""Relative differences of what is one point."""


def observed(
    setting: CutSetting,
    word: Literal["stable", "chatter"],
    frequency: float | None = None,
    at: datetime | None = None,
    now: datetime | None = None,
) -> HeardCut:
    """What a person has heard; at: None for now. Not written down yet: it has no identity.

    frequency: of the chatter (Hz). ValueError for one that cannot be, and for a date in the future.
    """
    when = when_cut(at, now or datetime.now(UTC))
    _check_frequency(setting, word, frequency)
    return HeardCut(
        "",
        when,
        **setting.told(),
        speed_rpm=setting.speed_rpm,
        word=word,
        chatter_frequency_hz=frequency,
        by="ear",
        software=software(),
    )


def when_cut(at: datetime | None, now: datetime) -> datetime:
    """When it was cut (UTC); at: None for now, without a zone local time. ValueError for a date in the future."""
    when = now if at is None else at.astimezone(UTC)
    if when - now > timedelta(days=1):
        raise ValueError(f"--date {at}: lies in the future; give the day on which it was cut")
    return when


def _check_frequency(setting: CutSetting, word: str, frequency: float | None) -> None:
    if frequency is None:
        return
    if word == "stable":
        raise ValueError(f"--frequency {frequency:g}: a stable cut has none; leave it out, or say --chatter")
    if not 0 < frequency < 1e5:
        raise ValueError(f"--frequency {frequency:g}: is not above 0 and below 100000; give what was heard, in Hz")
    tooth = setting.tooth_frequency
    times = round(frequency / tooth)
    if times and abs(frequency - times * tooth) <= NEAR_TOOTH * frequency:
        raise ValueError(
            f"--frequency {frequency:g}: is {times} times the tooth passing frequency of {tooth:g} Hz, which every cut "
            "sounds with; give the frequency of the chatter beside it, or leave --frequency out"
        )


def contradicted(cut: HeardCut, others: Sequence[HeardCut]) -> list[HeardCut]:
    """Those that count and were heard otherwise at the same point."""
    return [one for one in others if one.counts and _is_same_point(one, cut) and one.chatters != cut.chatters]


def _is_same_point(one: HeardCut, other: HeardCut) -> bool:
    same = (one.tool, one.cut, one.feed) == (other.tool, other.cut, other.feed)
    near_speed = abs(one.speed_rpm - other.speed_rpm) <= SAME_SPEED * other.speed_rpm
    return same and near_speed and abs(one.depth - other.depth) <= SAME_DEPTH * other.depth
