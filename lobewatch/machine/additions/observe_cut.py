"""What a person heard of a test cut, and whether it was heard otherwise before."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Literal

from lobewatch.machine.additions.keep_cut import software
from lobewatch.machine.journal.heard_cut import HeardCut
from lobewatch.machine.settings.cut_setting import CutSetting

NEAR_TOOTH = 0.005
"""Share of a frequency: so near to a multiple of the tooth passing frequency it is the cut itself; chosen."""
SAME_SPEED, SAME_DEPTH = 2e-3, 1e-2
"""Relative differences up to which speeds and depths are one point; chosen."""


def observe_cut(
    setting: CutSetting,
    word: Literal["stable", "chatter"],
    frequency: float | None = None,
    at: datetime | None = None,
    now: datetime | None = None,
) -> HeardCut:
    """Test cut as a person has heard it; at: None for now. Not written down yet: it has no identity.

    frequency: of the chatter (Hz). ValueError for one that cannot be, and for a date in the future.
    """
    when = cutting_time(at, now or datetime.now(UTC))
    _check_frequency(setting, word, frequency)
    return HeardCut(
        "",
        when,
        **setting.heard_cut_fields(setting.speed_rpm),
        word=word,
        chatter_frequency_hz=frequency,
        by="ear",
        software=software(),
    )


def cutting_time(at: datetime | None, now: datetime) -> datetime:
    """Time of a cut (UTC); at: None for now, without a zone local time. ValueError for a date in the future."""
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


def contradicting_cuts(cut: HeardCut, earlier: Sequence[HeardCut]) -> list[HeardCut]:
    """Earlier cuts that count and were heard otherwise at the same point."""
    return [old for old in earlier if old.counts and _is_same_point(old, cut) and old.chatters != cut.chatters]


def _is_same_point(old: HeardCut, new: HeardCut) -> bool:
    same = (old.tool, old.cut, old.feed) == (new.tool, new.cut, new.feed)
    near_speed = abs(old.speed_rpm - new.speed_rpm) <= SAME_SPEED * new.speed_rpm
    return same and near_speed and abs(old.depth - new.depth) <= SAME_DEPTH * new.depth
