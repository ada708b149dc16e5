"""Alarms: triggered and closed by what was measured, acknowledged by a person.

Imported with every look at a plant, so without numpy.
"""

from __future__ import annotations

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

    def is_about(self, remark: Remark) -> bool:
        """Return whether it belongs to a remark."""
        return (self.code, self.about) == (remark.code, remark.about)

    def is_acknowledged(self, now: datetime) -> bool:
        """Return whether it is acknowledged at a time."""
        return self.acknowledgement is not None and self.acknowledgement.is_active_at(now)

    def to_row(self, now: datetime) -> dict[str, Any]:
        """Return the fields for other programs; times are ISO 8601, `acknowledged` is null if it is not."""
        word = self.acknowledgement if self.is_acknowledged(now) else None
        return {
            "id": self.id,
            "code": self.code,
            "about": self.about,
            "raised_by": self.triggered_by,
            "raised": self.triggered_at.isoformat(),
            "acknowledged": word
            and {
                "time": word.time.isoformat(),
                "operator": word.operator,
                "until": word.until and word.until.isoformat(),
                "note": word.note,
            },
        }


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
        given = [
            word
            for word in acknowledgements
            if (word.code, word.about, word.baseline) == (code, about, baseline) and self.time <= word.newest
        ]
        return Alarm(code, about, self.tap_id, self.time, given[-1] if given else None)


def add_acknowledgements(remarks: Iterable[Remark], alarms: Sequence[Alarm], now: datetime) -> tuple[Remark, ...]:
    """Add acknowledgements to the text of remarks."""
    return tuple(_add_acknowledgement(remark, alarms, now) for remark in remarks)


def _add_acknowledgement(remark: Remark, alarms: Sequence[Alarm], now: datetime) -> Remark:
    words = [alarm.acknowledgement for alarm in alarms if alarm.is_about(remark) and alarm.is_acknowledged(now)]
    return replace(remark, text=f"{remark.text} ({words[0]})") if words else remark


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
