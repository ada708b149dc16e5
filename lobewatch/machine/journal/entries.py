"""Journal lines for events, exclusions, mode edits, acknowledged alarms and fleet scatter.

It is kept as it was known then, so that what is judged with it does not hang on the others later on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import msgspec

from acquisition import check_name
from lobewatch.machine.journal.cut_entry import CutEntry
from lobewatch.machine.journal.tap_entry import TapEntry
from modal import ModeEdits


@dataclass(frozen=True)
class MaintenanceEvent:
    """Something done to the machine."""

    id: str
    """Number in the journal, "e1" on."""
    time: datetime
    """Time at which it was done (UTC)."""
    text: str
    """Text that says what was done."""
    new_baseline: bool
    """Whether the tap tests after it are compared with none before it."""


def read_events(entries: Sequence[Mapping[str, Any]]) -> tuple[MaintenanceEvent, ...]:
    """Events of a journal that are not withdrawn, oldest first by their time."""
    events: dict[str, MaintenanceEvent] = {}
    for line in entries:
        if line["kind"] == "event" and "withdraws" in line:
            events.pop(line["withdraws"], None)
        elif line["kind"] == "event":
            time = datetime.fromisoformat(line["date"])
            events[line["id"]] = MaintenanceEvent(line["id"], time, line["text"], line["new_baseline"])
    return tuple(sorted(events.values(), key=lambda event: event.time))


def make_event(
    entries: Sequence[Mapping[str, Any]],
    taps: Sequence[TapEntry],
    text: str,
    date: datetime | None,
    new_baseline: bool,
    now: datetime,
) -> MaintenanceEvent:
    """An event to be written down; date: None for now, without a zone local time, at midnight the whole day.

    ValueError for an empty text, a date in the future, an event that is there already, and for a new baseline on a
    whole day with tap tests: nobody knows which of them were before it.
    """
    if not text.strip():
        raise ValueError('the event has no text; say what was done, such as "bearings replaced"')
    check_name(text, "event")
    time = now if date is None else _to_utc(date)
    if time - now > timedelta(days=1):
        raise ValueError(f"--date {date}: lies in the future; give the day on which it was done")
    same = [event.id for event in read_events(entries) if (event.time, event.text) == (time, text)]
    if same:
        raise ValueError(f"{text!r} of {date} is there already, as {same[0]}; lobewatch history lists all events")
    if new_baseline and date is not None and date.time() == datetime.min.time():
        _refuse_tapped_day(taps, time)
    number = sum(line["kind"] == "event" and "withdraws" not in line for line in entries) + 1
    return MaintenanceEvent(f"e{number}", time, text, new_baseline)


def _to_utc(date: datetime) -> datetime:
    try:
        return date.astimezone(UTC)
    except (OverflowError, ValueError) as error:
        raise ValueError(f"--date {date}: is out of range; give a date after 1970-01-01") from error


def _refuse_tapped_day(taps: Sequence[TapEntry], begin: datetime) -> None:
    times = [datetime.fromisoformat(tap.time) for tap in taps]
    tapped = [time for time in times if begin <= time < begin + timedelta(days=1)]
    if tapped:
        clock = ", ".join(f"{time.astimezone():%H:%M}" for time in tapped)
        raise ValueError(
            f"{begin.astimezone():%Y-%m-%d}: tapped on that day at {clock}; give the time of the new baseline too, "
            f"such as --date {tapped[-1].astimezone():%Y-%m-%d}T12:00:00"
        )


def make_event_line(event: MaintenanceEvent, now: datetime) -> dict[str, Any]:
    """Line of an event for the journal."""
    fields = {"id": event.id, "date": event.time.isoformat(), "text": event.text, "new_baseline": event.new_baseline}
    return {"kind": "event", **fields, "time": now.isoformat()}


def make_withdrawal_line(entries: Sequence[Mapping[str, Any]], event_id: str, now: datetime) -> dict[str, Any]:
    """Line that withdraws an event; ValueError where there is none of that name."""
    ids = [event.id for event in read_events(entries)]
    if event_id not in ids:
        raise ValueError(f"{event_id}: no such event; there are {', '.join(ids) or 'none'}")
    return {"kind": "event", "withdraws": event_id, "time": now.isoformat()}


ExcludableEntry = TapEntry | CutEntry
"""Entry of the journal that can be taken out."""


def find_excludable_entry(
    name: str, taps: Sequence[TapEntry], cuts: Sequence[CutEntry], folder: str
) -> ExcludableEntry:
    """Test cut of this identity, or tap test with this identity, file, or part of an identity.

    ValueError where it is none, or several have it.
    """
    for cut in cuts:
        if cut.id == name:
            return cut
    part = name.replace("\\", "/").rpartition("/")[2].removesuffix(".h5")
    exact = [tap for tap in taps if tap.id == part]
    fitting = exact or [tap for tap in taps if part and part in tap.id]
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        raise ValueError(
            f"{name}: part of {len(fitting)} tap tests ({fitting[0].id}, {fitting[1].id}, ...); give one whole"
        )
    raise ValueError(f"{name!r}: no such tap test in {folder}; lobewatch history {folder} lists all {len(taps)}")


def make_exclusion_line(entry: ExcludableEntry, reason: str, now: datetime) -> dict[str, Any]:
    """Line that takes one out; ValueError where it is out already, or there is no reason."""
    if entry.excluded:
        raise ValueError(f"{entry.id}: excluded already, for {entry.excluded!r}")
    if not reason.strip():
        raise ValueError(f"{entry.id}: no reason; say why it does not count with --reason")
    check_name(reason, "reason")
    return {"kind": "exclude", "tap": entry.id, "reason": reason, "time": now.isoformat()}


def make_inclusion_line(entry: ExcludableEntry, now: datetime) -> dict[str, Any]:
    """Line that takes one back; ValueError where it is not out."""
    if not entry.excluded:
        raise ValueError(f"{entry.id}: is not excluded; it counts already")
    return {"kind": "include", "tap": entry.id, "time": now.isoformat()}


def read_exclusion_reasons(entries: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Reasons why tap tests and test cuts are out, by identity."""
    reasons: dict[str, str] = {}
    for line in entries:
        if line["kind"] == "exclude":
            reasons[line["tap"]] = line["reason"]
        elif line["kind"] == "include":
            reasons.pop(line["tap"], None)
    return reasons


def make_mode_edits_line(tap_id: str, edits: ModeEdits, now: datetime) -> dict[str, Any]:
    """Line that says it; edits that say nothing take back what was said before."""
    return {"kind": "modes", "tap": tap_id, **asdict(edits), "time": now.isoformat()}


def read_mode_edits(entries: Sequence[Mapping[str, Any]]) -> dict[str, ModeEdits]:
    """What was said of the modes of tap tests, by identity."""
    return {line["tap"]: msgspec.convert(line, ModeEdits) for line in entries if line["kind"] == "modes"}


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
    def alarm_id(self) -> str:
        """Identity of the alarm as it was then."""
        return format_alarm_id(self.code, self.about, self.raised_by)

    def is_active_at(self, now: datetime) -> bool:
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


def format_alarm_id(code: str, about: str, raised_by: str) -> str:
    """Name of an alarm for people and other programs, without blanks: what rings, of what, and the tap test."""
    return f"{code}:{about.replace(', ', ':').replace(' ', '_')}:{raised_by}"


def read_acknowledgements(entries: Sequence[Mapping[str, Any]]) -> tuple[Acknowledgement, ...]:
    """Acknowledgements of a journal, oldest first."""
    return tuple(msgspec.convert(line, Acknowledgement) for line in entries if line["kind"] == "ack")


class FleetScatter(msgspec.Struct, frozen=True):
    """Standard deviation (%) from clamping to clamping, and the degrees of freedom that it is worth."""

    time: datetime
    """Time of the tap test, or of the new baseline, that it was asked for with."""
    alone: tuple[float, float]
    """That of one direction."""
    common: tuple[float, float]
    """That of the mean of x and y."""
    series: int
    """Number of the series that it follows from."""

    @property
    def line(self) -> dict[str, Any]:
        """Line for the journal."""
        fields: dict[str, Any] = msgspec.to_builtins(self)
        return {"kind": "scatter", **fields}


def read_fleet_scatters(entries: Sequence[Mapping[str, Any]]) -> tuple[FleetScatter, ...]:
    """Those of a journal, oldest first."""
    return tuple(msgspec.convert(line, FleetScatter) for line in entries if line["kind"] == "scatter")
