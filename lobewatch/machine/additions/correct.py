"""The four corrections of a machine, each a line of its journal, saved for good when the function returns."""

from __future__ import annotations

from datetime import UTC, datetime

from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.journal.event import MaintenanceEvent, event_line, events_of, new_event, withdrawal
from lobewatch.machine.journal.exclusion import Excludable, exclusion, find_excludable, inclusion


def add_event(
    folder: MachineFolder, text: str, date: datetime | None = None, new_baseline: bool = False
) -> MaintenanceEvent:
    """Write down what was done to the machine; date: None for now, without a zone local time.

    ValueError for an event that makes no sense, BusyError where another program writes.
    """
    with folder.locked():
        now, entries = datetime.now(UTC), folder.journal.read().entries
        event = new_event(entries, folder.taps(), text, date, new_baseline, now)
        folder.journal.append(event_line(event, now))
    return event


def withdraw_event(folder: MachineFolder, event_id: str) -> MaintenanceEvent:
    """Take an event back; ValueError where there is none of that name."""
    with folder.locked():
        entries = folder.journal.read().entries
        line = withdrawal(entries, event_id, datetime.now(UTC))
        folder.journal.append(line)
    return next(event for event in events_of(entries) if event.id == event_id)


def exclude(folder: MachineFolder, name: str, reason: str) -> Excludable:
    """Take a tap test out of the series, or a test cut out of what is learnt from.

    name: its identity, file, or a part that no other has.
    """
    with folder.locked():
        entry = _find(folder, name)
        folder.journal.append(exclusion(entry, reason, datetime.now(UTC)))
    return entry


def include(folder: MachineFolder, name: str) -> Excludable:
    """Take a tap test back into the series, or a test cut back into what is learnt from."""
    with folder.locked():
        entry = _find(folder, name)
        folder.journal.append(inclusion(entry, datetime.now(UTC)))
    return entry


def _find(folder: MachineFolder, name: str) -> Excludable:
    contents = folder.contents()
    return find_excludable(name, [*contents.taps, *contents.lost], contents.cuts, str(folder.path))
