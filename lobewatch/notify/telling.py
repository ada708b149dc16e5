"""How machines stand, told to those whom machine.toml names: after a command has altered one, and when asked to."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from acquisition.errors import failure_text
from lobewatch.logbook import Logbook
from lobewatch.machine import Machine
from lobewatch.machine.settings.machine_file import read_machine
from lobewatch.machine.settings.notify_table import Broker
from lobewatch.notify.message import message_of
from lobewatch.notify.mqtt import send
from lobewatch.notify.told import (
    Told,
    keep_told_of_machine,
    keep_told_of_plant,
    told_of_machine,
    told_of_plant,
)
from lobewatch.notify.unsent import UNSENT, deliver
from lobewatch.plant.learn_scatter import learn_scatter
from lobewatch.plant.plant import MachineStanding
from lobewatch.plant.summarise import summarise
from lobewatch.plant.summary import Summary, unreadable_summary
from lobewatch.show.terminal.output import notes

GONE = "its folder is gone; `lobewatch status {plant} --notify --forget {key}` takes it out of the broker"
"""Reason for a machine that was told of and is not there any more."""


def tell(logbook: Logbook) -> None:
    """Make the standing with what other machines tell of this one, keep it, send it; nothing is raised, for what was to
    be stored is stored already."""
    now, path, machines = datetime.now(UTC), logbook.folder.path, dict[Path, Machine]()
    try:
        learn_scatter(logbook if logbook.is_current else Logbook.open(path))
        current = logbook if logbook.is_current else Logbook.open(path)
        summary = summarise(current, now)
        machines[path] = current.machine
    except Exception as error:  # noqa: BLE001 - a machine that cannot be judged is told as one
        summary = unreadable_summary(path.resolve().name, failure_text(error))
    notify([_standing(path.resolve().name, path, summary, now)], machines, now=now)


def notify_folder(
    folder: Path, machines: Mapping[str, Path], standings: Iterable[MachineStanding], gone: str = ""
) -> dict[Broker, str]:
    """As `notify`, of the machine or all machines in a folder; gone: machine that is to be forgotten first."""
    if gone:
        forget(folder, gone, machines)
    return notify(standings, plant=None if (folder / "machine.toml").exists() else folder)


def notify(
    standings: Iterable[MachineStanding],
    machines: Mapping[Path, Machine] | None = None,
    plant: Path | None = None,
    now: datetime | None = None,
) -> dict[Broker, str]:
    """Send the standings that have changed, or were sent a day ago, of machines whose machine.toml names a broker.

    A machine whose machine.toml cannot be read goes to the broker that was told last, and so does one of the plant
    folder that is gone. machines: those that are read already. Returns why not, by broker, which a note says too.
    """
    now, before = now or datetime.now(UTC), told_of_plant(plant) if plant else {}
    due: dict[Broker, dict[Path, tuple[str, bytes]]] = {}
    words: dict[Path, tuple[str, Told]] = {}
    standings = [*standings]
    for standing in [*standings, *_gone(plant, before, standings, now)]:
        told = told_of_machine(standing.path) or before.get(standing.key)
        broker = _broker(standing.path, machines or {}, told)
        if broker is None:
            continue
        word = Told.of(standing, broker, now)
        if told is None or not told.stands_for(word) or (standing.path / UNSENT).exists():
            due.setdefault(broker, {})[standing.path] = word.topic, message_of(standing, now)
            words[standing.path] = standing.key, word
    failures = deliver(due)
    sent = {path: words[path] for broker in due.keys() - failures.keys() for path in due[broker]}
    for path, (_, word) in sent.items():
        keep_told_of_machine(path, word)
    if plant and sent:
        keep_told_of_plant(plant, before | dict(sent.values()))
    _say(due, failures)
    return failures


def forget(plant: Path, key: str, known: Iterable[str]) -> None:
    """Take the message on a machine that is gone out of its broker; known: names of the folders that are there.

    ValueError where it is there, nobody was told of it, or the broker does not take it.
    """
    told = told_of_plant(plant)
    if key in known:
        raise ValueError(f"--forget {key}: is there; move its folder out of {plant} first")
    if key not in told:
        gone = ", ".join(sorted(told.keys() - set(known))) or "none"
        raise ValueError(f"--forget {key}: nobody was told of it; gone and not forgotten: {gone}")
    broker = told[key].to
    failure = send({broker: {told[key].topic: b""}}).get(broker)
    if failure:
        raise ValueError(f"--forget {key}: {failure}")
    keep_told_of_plant(plant, {name: word for name, word in told.items() if name != key})


def _gone(
    plant: Path | None, told: Mapping[str, Told], standings: Iterable[MachineStanding], now: datetime
) -> Iterator[MachineStanding]:
    """Machines of a plant folder that were told of and are not there any more."""
    if plant is None:
        return
    for key in sorted(told.keys() - {standing.key for standing in standings}):
        summary = unreadable_summary(key, GONE.format(plant=plant, key=key))
        yield _standing(key, plant / key, summary, now)


def _standing(key: str, path: Path, summary: Summary, now: datetime) -> MachineStanding:
    return MachineStanding(key, path, summary, summary.at(now, path))


def _broker(path: Path, machines: Mapping[Path, Machine], told: Told | None) -> Broker | None:
    """Whom machine.toml names; where it cannot be read, who was told last."""
    try:
        machine: Machine = machines.get(path) or read_machine(path / "machine.toml")
    except (ValueError, OSError):
        return told.to if told else None
    return machine.notify.broker


def _say(brokers: Iterable[Broker], failures: Mapping[Broker, str]) -> None:
    for broker in brokers:
        why = failures.get(broker, "")
        if why:
            notes.print(f"note: nobody was told by MQTT: {why}; it goes with the next command", markup=False)
        if broker.withheld and broker.withheld not in why:
            notes.print(f"note: {broker.address}: {broker.withheld}", markup=False)


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
