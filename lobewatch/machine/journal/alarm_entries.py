"""Journal lines for acknowledged alarms and fleet scatter, without numpy for a fast start."""

from datetime import datetime
from typing import Any

import msgspec


class Acknowledgement(msgspec.Struct, frozen=True):
    """Acknowledgement of an alarm by a person; it stops repeats but keeps the status."""

    code: str
    """Code of the reason of the alarm."""
    about: str
    """Series or program of the alarm."""
    raised_by: str
    """Tap test that triggered the alarm."""
    newest: datetime
    """Time of the newest tap test at the acknowledgement."""
    baseline: datetime | None
    """Baseline at the acknowledgement."""
    time: datetime
    """Time of the acknowledgement."""
    operator: str = ""
    """Name of the person."""
    until: datetime | None = None
    """Time from which the alarm repeats; None for as long as it is open."""
    note: str = ""
    """Reason or countermeasure."""

    @property
    def alarm_id(self) -> str:
        """Identity of the alarm."""
        return format_alarm_id(self.code, self.about, self.raised_by)

    def is_active_at(self, now: datetime) -> bool:
        """Tell whether the acknowledgement holds at a time."""
        return self.until is None or now < self.until

    @property
    def line(self) -> dict[str, Any]:
        """Journal line."""
        return {"kind": "ack", **msgspec.to_builtins(self)}

    def __str__(self) -> str:
        by = f" by {self.operator}" if self.operator else ""
        until = f" until {self.until.astimezone():%Y-%m-%d}" if self.until else ""
        return f"acknowledged {self.time.astimezone():%Y-%m-%d}{by}{until}{': ' if self.note else ''}{self.note}"


def format_alarm_id(code: str, about: str, raised_by: str) -> str:
    """Return the identity of an alarm without blanks: code, subject and tap test."""
    return f"{code}:{about.replace(', ', ':').replace(' ', '_')}:{raised_by}"


class FleetScatter(msgspec.Struct, frozen=True):
    """Reclamping scatter of the other machines of a fleet, as known when it was first needed.

    Each pair is a standard deviation (%) with its degrees of freedom.
    """

    time: datetime
    """Time of the tap test or the new baseline that needed it."""
    alone: tuple[float, float]
    """Scatter of one direction."""
    common: tuple[float, float]
    """Scatter of the mean of x and y."""
    series: int
    """Number of series behind it."""

    @property
    def line(self) -> dict[str, Any]:
        """Journal line."""
        return {"kind": "scatter", **msgspec.to_builtins(self)}
