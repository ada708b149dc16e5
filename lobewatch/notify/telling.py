"""After a command has altered a machine: its standing beside it, and a message to those whom machine.toml names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec

from lobewatch.logbook import Logbook
from lobewatch.machine import Machine
from lobewatch.machine.settings.machine_file import read_machine
from lobewatch.machine.settings.notify_table import Broker
from lobewatch.notify.unsent import deliver
from lobewatch.plant.plant import MachineStanding
from lobewatch.plant.standing_file import software
from lobewatch.plant.summarise import summarise
from lobewatch.show.plant.plant_rows import next_limit
from lobewatch.show.terminal.output import notes

NOT_IN_TOPICS = str.maketrans("+#/\0", "____")
"""Characters that no level of a topic may hold, each replaced."""


def tell(logbook: Logbook) -> None:
    """Make the standing, keep it, send it; nothing is raised, for what was to be stored is stored already."""
    now = datetime.now(UTC)
    try:
        current = logbook if logbook.is_current else Logbook.open(logbook.folder.path)
        summary, path = summarise(current, now), current.folder.path
        if current.machine.notify.broker is not None:
            notify(
                [MachineStanding(path.resolve().name, path, summary, summary.at(now, path))],
                {path: current.machine},
                now,
            )
    except (ValueError, OSError, ArithmeticError, LookupError):
        return  # whoever looks at the machine next is told why


def notify(
    standings: Iterable[MachineStanding], machines: Mapping[Path, Machine] | None = None, now: datetime | None = None
) -> None:
    """Send the standings of machines whose machine.toml names a broker; a note says why where one is not told.

    machines: those that are read already.
    """
    now, machines = now or datetime.now(UTC), machines or {}
    batches: dict[Broker, dict[Path, tuple[str, bytes]]] = {}
    for standing in standings:
        try:
            machine: Machine = machines.get(standing.path) or read_machine(standing.path / "machine.toml")
        except (ValueError, OSError):
            continue  # who is to be told cannot be read
        if (broker := machine.notify.broker) is not None:
            message = topic_of(broker.prefix, standing.key), message_of(standing, now)
            batches.setdefault(broker, {})[standing.path] = message
    failures = deliver(batches)
    for broker in batches:
        why = failures.get(broker, "")
        if why:
            notes.print(f"note: nobody was told by MQTT: {why}; it goes with the next command", markup=False)
        if broker.withheld and broker.withheld not in why:
            notes.print(f"note: {broker.address}: {broker.withheld}", markup=False)


def topic_of(prefix: str, key: str) -> str:
    """Topic of the message of a machine; key: name of its folder."""
    return f"{prefix}/{key.translate(NOT_IN_TOPICS)}/standing"


def message_of(standing: MachineStanding, now: datetime) -> bytes:
    """Standing of a machine for other programs, as JSON; what is not known is null."""
    summary, dated = standing.summary, standing.dated
    worst = summary.series[0] if summary.series else None
    due = None if summary.time is None else summary.time + timedelta(days=summary.interval_days)
    return msgspec.json.encode(
        {
            "folder": standing.key,
            "machine": summary.name,
            "light": dated.light,
            "reasons": [{"code": remark.code, "about": remark.about, "text": remark.text} for remark in dated.remarks],
            "next_step": dated.next_step,
            "fall_percent": worst.fall if worst else None,
            "fall_percent_std": worst.fall_std if worst else None,
            "series": worst.name if worst else None,
            "frequency_hz": worst.frequency if worst else None,
            "next_limit": next_limit(summary.series),
            "programs": summary.programs,
            "last_tap": summary.last_tap or None,
            "due": due and due.isoformat(),
            "is_overdue": dated.days_left is not None and dated.days_left < 0,
            "time": now.isoformat(),
            "software": f"lobewatch {software()}",
        }
    )


@contextmanager
def telling(logbook: Logbook) -> Iterator[None]:
    """Tell at the end of work that may store something and then find fault with the rest."""
    before = logbook.folder.mark
    try:
        yield
    except (ValueError, OSError):
        if logbook.folder.mark != before:
            tell(logbook)
        raise
    if logbook.folder.mark != before:
        tell(logbook)
