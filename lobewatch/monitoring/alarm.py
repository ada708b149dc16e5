"""Alarms: triggered and closed by what was measured, acknowledged by a person.

Imported with every look at a plant, so without numpy.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any, NamedTuple

import msgspec

from acquisition import Remark
from lobewatch.machine.journal.alarm_entries import Acknowledgement, format_alarm_id


class Alarm(msgspec.Struct, frozen=True, rename={"triggered_by": "raised_by", "triggered_at": "raised"}):
    """Open alarm. Its identity is its code, its series or program, and the tap test that first triggered it."""

    code: str
    """Code of the remark."""
    about: str
    """Series or program."""
    triggered_by: str = msgspec.field(name="raised_by")
    """Id of the tap test that triggered it."""
    triggered_at: datetime = msgspec.field(name="raised")
    """Time of that tap test."""
    acknowledgement: Acknowledgement | None = None
    """Newest acknowledgement; None without one."""

    @property
    def id(self) -> str:
        """Id of the alarm for people and other programs, without blanks."""
        return format_alarm_id(self.code, self.about, self.triggered_by)

    def is_acknowledged(self, now: datetime) -> bool:
        """Return whether it is acknowledged at a time."""
        return self.acknowledgement is not None and self.acknowledgement.is_active_at(now)

    def to_row(self, now: datetime) -> dict[str, Any]:
        """Return the fields for other programs; times are ISO 8601, `acknowledged` is null if it is not."""
        word, acknowledged = self.acknowledgement, None
        if word is not None and word.is_active_at(now):
            until = word.until and word.until.isoformat()
            acknowledged = {"time": word.time.isoformat(), "operator": word.operator, "until": until, "note": word.note}
        row = {"id": self.id, "code": self.code, "about": self.about, "raised_by": self.triggered_by}
        return row | {"raised": self.triggered_at.isoformat(), "acknowledged": acknowledged}


class TriggeredAlarm(NamedTuple):
    """Remark with an active alarm, and the tap test that first triggered it."""

    remark: Remark
    """Remark of the alarm."""
    tap_id: str
    """Id of the tap test."""
    time: datetime
    """Time of the tap test."""

    def build_alarm(self, acknowledgements: Iterable[Acknowledgement], baseline: datetime | None) -> Alarm:
        """Build the alarm, with its newest acknowledgement since it was triggered."""
        code, about = self.remark.code, self.remark.about
        given = None
        for word in acknowledgements:
            if (word.code, word.about, word.baseline) == (code, about, baseline) and self.time <= word.newest:
                given = word
        return Alarm(code, about, self.tap_id, self.time, given)


def add_acknowledgements(remarks: Iterable[Remark], alarms: Sequence[Alarm], now: datetime) -> tuple[Remark, ...]:
    """Add acknowledgements to the text of remarks."""
    active = [alarm for alarm in reversed(alarms) if alarm.is_acknowledged(now)]
    words = {(alarm.code, alarm.about): alarm.acknowledgement for alarm in active}
    known = [(remark, words.get((remark.code, remark.about))) for remark in remarks]
    return tuple(replace(remark, text=f"{remark.text} ({word})") if word else remark for remark, word in known)


def select_alarms(alarms: Sequence[Alarm], name: str, now: datetime) -> list[Alarm]:
    """Select the alarm of this identity or part of one, or all that are not acknowledged."""
    if not alarms:
        raise ValueError("nothing rings on this machine: there is nothing to acknowledge")
    exact = [alarm for alarm in alarms if alarm.id == name]
    fitting = exact or [alarm for alarm in alarms if (name in alarm.id if name else not alarm.is_acknowledged(now))]
    names = ", ".join(alarm.id for alarm in alarms)
    if not fitting and not name:
        raise ValueError(f"all is acknowledged already; name the alarm to say something else of it: {names}")
    if not fitting or (name and len(fitting) > 1):
        what = f"part of {len(fitting)} alarms" if fitting else "no such alarm"
        raise ValueError(f"{name!r}: {what}; open are {names}")
    return fitting
