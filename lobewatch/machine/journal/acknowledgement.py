"""Alarms that a person has acknowledged, as lines of the journal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

import msgspec


class Acknowledgement(msgspec.Struct, frozen=True):
    """Word of a person that an alarm is known; it quiets repeats, never the light."""

    code: str
    """Code of the reason that rings."""
    about: str
    """Series or program that it is about."""
    raised_by: str
    """Tap test that raised it, as it was then."""
    newest: datetime
    """Time of the newest tap test of the machine then."""
    baseline: datetime | None
    """Baseline of then."""
    time: datetime
    """Time at which it was acknowledged."""
    operator: str = ""
    """Name of the person."""
    until: datetime | None = None
    """Time from which it rings again; None for as long as it is open."""
    note: str = ""
    """Reason, or what is being done."""

    @property
    def alarm(self) -> str:
        """Identity of the alarm as it was then."""
        return alarm_id(self.code, self.about, self.raised_by)

    def quiets_at(self, now: datetime) -> bool:
        """Whether it still holds at a time."""
        return self.until is None or now < self.until

    @property
    def line(self) -> dict[str, Any]:
        """Line for the journal."""
        fields: dict[str, Any] = msgspec.to_builtins(self)
        return {"kind": "ack", **fields}

    def __str__(self) -> str:
        """In words."""
        by = f" by {self.operator}" if self.operator else ""
        until = f" until {self.until.astimezone():%Y-%m-%d}" if self.until else ""
        return f"acknowledged {self.time.astimezone():%Y-%m-%d}{by}{until}{': ' if self.note else ''}{self.note}"


def alarm_id(code: str, about: str, raised_by: str) -> str:
    """Name of an alarm for people and other programs, without blanks: what rings, of what, and the tap test."""
    return f"{code}:{about.replace(', ', ':').replace(' ', '_')}:{raised_by}"


def acknowledgements_of(entries: Sequence[Mapping[str, Any]]) -> tuple[Acknowledgement, ...]:
    """Acknowledgements of a journal, oldest first."""
    return tuple(msgspec.convert(line, Acknowledgement) for line in entries if line["kind"] == "ack")
