"""Maintenance of a machine as lines of its journal; a line is never altered, a later one withdraws it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from acquisition import check_name
from lobewatch.machine.journal.tap_entry import TapEntry


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


def events_of(entries: Sequence[Mapping[str, Any]]) -> tuple[MaintenanceEvent, ...]:
    """Events of a journal that are not withdrawn, oldest first by their time."""
    events: dict[str, MaintenanceEvent] = {}
    for line in entries:
        if line["kind"] == "event" and "withdraws" in line:
            events.pop(line["withdraws"], None)
        elif line["kind"] == "event":
            time = datetime.fromisoformat(line["date"])
            events[line["id"]] = MaintenanceEvent(line["id"], time, line["text"], line["new_baseline"])
    return tuple(sorted(events.values(), key=lambda event: event.time))


def new_event(
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
    time = now if date is None else _universal(date)
    if time - now > timedelta(days=1):
        raise ValueError(f"--date {date}: lies in the future; give the day on which it was done")
    same = [event.id for event in events_of(entries) if (event.time, event.text) == (time, text)]
    if same:
        raise ValueError(f"{text!r} of {date} is there already, as {same[0]}; lobewatch history lists all events")
    if new_baseline and date is not None and date.time() == datetime.min.time():
        _refuse_tapped_day(taps, time)
    number = sum(line["kind"] == "event" and "withdraws" not in line for line in entries) + 1
    return MaintenanceEvent(f"e{number}", time, text, new_baseline)


def _universal(date: datetime) -> datetime:
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


def event_line(event: MaintenanceEvent, now: datetime) -> dict[str, Any]:
    """Line of an event for the journal."""
    fields = {"id": event.id, "date": event.time.isoformat(), "text": event.text, "new_baseline": event.new_baseline}
    return {"kind": "event", **fields, "time": now.isoformat()}


def withdrawal(entries: Sequence[Mapping[str, Any]], event_id: str, now: datetime) -> dict[str, Any]:
    """Line that withdraws an event; ValueError where there is none of that name."""
    ids = [event.id for event in events_of(entries)]
    if event_id not in ids:
        raise ValueError(f"{event_id}: no such event; there are {', '.join(ids) or 'none'}")
    return {"kind": "event", "withdraws": event_id, "time": now.isoformat()}
