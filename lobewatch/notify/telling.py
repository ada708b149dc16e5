"""After a command has altered a machine: its standing beside it, and a message to those whom machine.toml names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from lobewatch.logbook import Logbook
from lobewatch.machine import Machine
from lobewatch.machine.settings.machine_file import read_machine
from lobewatch.machine.settings.notify_table import Broker
from lobewatch.notify.message import message_of, topic_of
from lobewatch.notify.unsent import deliver
from lobewatch.plant.plant import MachineStanding
from lobewatch.plant.summarise import summarise
from lobewatch.show.terminal.output import notes


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
    found: Iterable[MachineStanding], known: Mapping[Path, Machine] | None = None, now: datetime | None = None
) -> int:
    """Send the standings of machines whose machine.toml names a broker; how many brokers could not be told, and why
    stands in a note."""
    now, known = now or datetime.now(UTC), known or {}
    by_broker: dict[Broker, list[MachineStanding]] = {}
    for one in found:
        try:
            machine: Machine = known.get(one.path) or read_machine(one.path / "machine.toml")
        except (ValueError, OSError):
            continue  # who is to be told cannot be read
        if machine.notify.broker is not None:
            by_broker.setdefault(machine.notify.broker, []).append(one)
    failures = 0
    for broker, some in by_broker.items():
        why = deliver(broker, {one.path: (topic_of(broker.prefix, one.key), message_of(one, now)) for one in some})
        if why:
            failures += 1
            notes.print(f"note: nobody was told by MQTT: {why}; it goes with the next command", markup=False)
    return failures


@contextmanager
def telling(logbook: Logbook) -> Iterator[None]:
    """The same at the end of work that may store something and then find fault with the rest."""
    before = logbook.folder.mark
    try:
        yield
    except (ValueError, OSError):
        if logbook.folder.mark != before:
            tell(logbook)
        raise
    if logbook.folder.mark != before:
        tell(logbook)
