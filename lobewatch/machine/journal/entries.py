"""Journal lines for events and exclusions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from acquisition import check_name
from lobewatch.machine.journal.cut_entry import CutEntry
from lobewatch.machine.journal.tap_entry import TapEntry


@dataclass(frozen=True)
class MaintenanceEvent:
    """Maintenance of the machine."""

    id: str
    """Identity in the journal, "e1" on."""
    time: datetime
    """Time of the maintenance (UTC)."""
    text: str
    """Description of the work."""
    new_baseline: bool
    """True if later tap tests are compared with none before it."""


def read_events(entries: Sequence[Mapping[str, Any]]) -> tuple[MaintenanceEvent, ...]:
    """Read the events of a journal that are not withdrawn, oldest first."""
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
    """Make an event; date: None for now, local time without a zone, the whole day at midnight.

    Raises ValueError for an empty text, a date in the future, a duplicate, and a new baseline on a whole day with tap
    tests, whose order is then unknown.
    """
    if not text.strip():
        raise ValueError('the event has no text; say what was done, such as "bearings replaced"')
    check_name(text, "event")
    time = now if date is None else _to_utc(date)
    if time - now > timedelta(days=1):
        raise ValueError(f"MaintenanceEvent.time {date}: lies in the future; give the day on which it was done")
    same = [event.id for event in read_events(entries) if (event.time, event.text) == (time, text)]
    if same:
        raise ValueError(f"{text!r} of {date} is there already, as {same[0]}; MachineFolder.contents lists all events")
    if new_baseline and date is not None and date.time() == datetime.min.time():
        _refuse_tapped_day(taps, time)
    number = sum(line["kind"] == "event" and "withdraws" not in line for line in entries) + 1
    return MaintenanceEvent(f"e{number}", time, text, new_baseline)


def _to_utc(date: datetime) -> datetime:
    try:
        return date.astimezone(UTC)
    except (OverflowError, ValueError) as error:
        raise ValueError(f"MaintenanceEvent.time {date}: is out of range; give a date after 1970-01-01") from error


def _refuse_tapped_day(taps: Sequence[TapEntry], begin: datetime) -> None:
    tapped = [tap.created for tap in taps if begin <= tap.created < begin + timedelta(days=1)]
    if tapped:
        clock = ", ".join(f"{time.astimezone():%H:%M}" for time in tapped)
        cure = f"such as MaintenanceEvent.time {tapped[-1].astimezone():%Y-%m-%d}T12:00:00"
        problem = f"tapped on that day at {clock}; give the time of the new baseline too"
        raise ValueError(f"{begin.astimezone():%Y-%m-%d}: {problem}, {cure}")


ExcludableEntry = TapEntry | CutEntry
"""Entry that can be excluded."""


def find_excludable_entry(
    name: str, taps: Sequence[TapEntry], cuts: Sequence[CutEntry], folder: str
) -> ExcludableEntry:
    """Find the test cut of an identity, or the tap test of an identity, a part of it, or a file.

    Raises ValueError if there is none or there are several.
    """
    for cut in cuts:
        if cut.id == name:
            return cut
    part = name.replace("\\", "/").rpartition("/")[2].removesuffix(".h5")
    exact = [tap for tap in taps if tap.id == part]
    matches = exact or [tap for tap in taps if part and part in tap.id]
    if len(matches) == 1:
        return matches[0]
    if matches:
        examples = f"({matches[0].id}, {matches[1].id}, ...)"
        raise ValueError(f"{name}: part of {len(matches)} tap tests {examples}; give one whole")
    raise ValueError(f"{name!r}: no such tap test in {folder}; MachineFolder.contents {folder} lists all {len(taps)}")


def read_exclusion_reasons(entries: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Read the reasons of all exclusions, by identity."""
    reasons: dict[str, str] = {}
    for line in entries:
        if line["kind"] == "exclude":
            reasons[line["tap"]] = line["reason"]
        elif line["kind"] == "include":
            reasons.pop(line["tap"], None)
    return reasons
