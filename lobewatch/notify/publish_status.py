"""Publish the status of machines to MQTT brokers when it has changed.

So a machine whose files cannot be read, or are gone, can still be told of, and what has not changed is told once a day.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Self

import msgspec

from acquisition import DataError
from acquisition.errors import format_error
from acquisition.file_io import MAX_SETTINGS_FILE_SIZE, atomic_write, read_regular_file
from lobewatch.fleet.fleet import FleetMachine
from lobewatch.fleet.machine_summary import MachineSummary, software_version, summarize_unreadable
from lobewatch.fleet.summarize import learn_scatter, summarize_machine
from lobewatch.logbook import Logbook
from lobewatch.machine import Machine, MachineFolder
from lobewatch.machine.settings.machine_file import read_machine_file
from lobewatch.machine.settings.notify_table import Broker, parse_broker
from lobewatch.monitoring.threshold_dates import build_forecast_rows, build_limit_row, find_next_limit
from lobewatch.notify.mqtt import OUTBOX_FILE, deliver_messages, send_messages
from lobewatch.show.terminal.output import notes

TOPIC_REPLACEMENTS = str.maketrans("+#/\0", "____")
"""Characters that no level of a topic may hold, each replaced."""


def make_topic(prefix: str, key: str) -> str:
    """Topic of the message of a machine; key: name of its folder."""
    return f"{prefix}/{key.translate(TOPIC_REPLACEMENTS)}/standing"


def make_message(standing: FleetMachine, now: datetime) -> bytes:
    """Standing of a machine for other programs, as JSON; what is not known is null."""
    return msgspec.json.encode(
        make_message_content(standing) | {"time": now.isoformat(), "software": f"lobewatch {software_version()}"}
    )


def make_message_content(standing: FleetMachine) -> dict[str, Any]:
    """The message without the time at which it is sent."""
    summary, dated = standing.summary, standing.current
    worst = summary.series[0] if summary.series else None
    due = None if summary.time is None else summary.time + timedelta(days=summary.interval_days)
    return {
        "folder": standing.key,
        "machine": summary.name,
        "light": dated.status,
        "is_early": dated.is_early,
        "reasons": [{"code": remark.code, "about": remark.about, "text": remark.text} for remark in dated.remarks],
        "alarms": [alarm.to_row(dated.time) for alarm in summary.alarms],
        "next_step": dated.next_step,
        "fall_percent": worst.drop if worst else None,
        "fall_percent_std": worst.drop_std if worst else None,
        "series": worst.name if worst else None,
        "frequency_hz": worst.frequency if worst else None,
        "next_limit": build_limit_row(find_next_limit(summary.limits)),
        "forecast": build_forecast_rows(summary.fates, summary.limits),
        "programs": summary.programs,
        "last_tap": summary.last_tap or None,
        "due": due and due.isoformat(),
        "is_overdue": dated.days_left is not None and dated.days_left < 0,
    }


LAST_PUBLISHED_FILE, FLEET_LAST_PUBLISHED_FILE = "told.json", ".lobewatch-told.json"
"""Names of the file beside a machine, and of that of all machines in a plant folder."""
REPUBLISH_INTERVAL = timedelta(hours=23)
"""Time after which the same is told again, by what runs once a day; chosen."""


class PublishedMessage(msgspec.Struct, frozen=True):
    """The message that was sent last."""

    broker: str
    """Address of the broker, without the password."""
    topic: str
    """Topic that it stands at."""
    content: str
    """SHA-256 of the message without its time."""
    time: datetime
    """Time of sending."""

    @classmethod
    def of(cls, standing: FleetMachine, broker: Broker, now: datetime) -> Self:
        """The message that a machine calls for."""
        content = hashlib.sha256(msgspec.json.encode(make_message_content(standing))).hexdigest()
        return cls(broker.without_password, make_topic(broker.prefix, standing.key), content, now)

    def covers(self, other: PublishedMessage) -> bool:
        """Whether the other one need not be sent."""
        same = (self.broker, self.topic, self.content) == (other.broker, other.topic, other.content)
        return same and timedelta(0) <= other.time - self.time < REPUBLISH_INTERVAL

    @property
    def target(self) -> Broker:
        """Broker, with the password of the environment where it may have it."""
        return parse_broker(self.broker)


def read_last_published(folder: Path) -> PublishedMessage | None:
    """What was told of a machine; None where nobody was, or nothing can be read."""
    try:
        return msgspec.json.decode(
            read_regular_file(folder / LAST_PUBLISHED_FILE, MAX_SETTINGS_FILE_SIZE), type=PublishedMessage
        )
    except (OSError, ValueError, RecursionError):
        return None


def read_fleet_last_published(folder: Path) -> dict[str, PublishedMessage]:
    """What was told of the machines of a plant folder, by name of their folders."""
    try:
        return msgspec.json.decode(
            read_regular_file(folder / FLEET_LAST_PUBLISHED_FILE, MAX_SETTINGS_FILE_SIZE),
            type=dict[str, PublishedMessage],
        )
    except (OSError, ValueError, RecursionError):
        return {}


def write_last_published(folder: Path, told: PublishedMessage) -> None:
    """Keep it beside a machine, where that can be written."""
    with contextlib.suppress(DataError, OSError), MachineFolder(folder).locked(patience=0):
        atomic_write(folder / LAST_PUBLISHED_FILE, msgspec.json.encode(told), lasting=False)


def write_fleet_last_published(folder: Path, told: Mapping[str, PublishedMessage]) -> None:
    """Keep it in a plant folder, where that can be written."""
    with contextlib.suppress(OSError):
        atomic_write(folder / FLEET_LAST_PUBLISHED_FILE, msgspec.json.encode(told), lasting=False)


MISSING_FOLDER_REASON = (
    "its folder is gone; `lobewatch status {plant} --notify --forget {key}` takes it out of the broker"
)
"""Reason for a machine that was told of and is not there any more."""


def publish_status(logbook: Logbook) -> None:
    """Make the standing with what other machines tell of this one, keep it, send it; nothing is raised, for what was to
    be stored is stored already."""
    now, path, machines = datetime.now(UTC), logbook.folder.path, dict[Path, Machine]()
    try:
        learn_scatter(logbook if logbook.is_current else Logbook.open(path))
        current = logbook if logbook.is_current else Logbook.open(path)
        summary = summarize_machine(current, now)
        machines[path] = current.machine
    except Exception as error:  # noqa: BLE001 - a machine that cannot be judged is told as one
        summary = summarize_unreadable(path.resolve().name, format_error(error))
    publish_machines([_assess_summary(path.resolve().name, path, summary, now)], machines, now=now)


def publish_folder(
    folder: Path, machines: Mapping[str, Path], standings: Iterable[FleetMachine], gone: str = ""
) -> dict[Broker, str]:
    """As `publish_machines`, of the machine or all machines in a folder; gone: machine that is to be forgotten first."""
    if gone:
        forget_machine(folder, gone, machines)
    return publish_machines(standings, plant=None if (folder / "machine.toml").exists() else folder)


def publish_machines(
    standings: Iterable[FleetMachine],
    machines: Mapping[Path, Machine] | None = None,
    plant: Path | None = None,
    now: datetime | None = None,
) -> dict[Broker, str]:
    """Send the standings that have changed, or were sent a day ago, of machines whose machine.toml names a broker.

    A machine whose machine.toml cannot be read goes to the broker that was told last, and so does one of the plant
    folder that is gone. machines: those that are read already. Returns why not, by broker, which a note says too.
    """
    now, before = now or datetime.now(UTC), read_fleet_last_published(plant) if plant else {}
    due: dict[Broker, dict[Path, tuple[str, bytes]]] = {}
    words: dict[Path, tuple[str, PublishedMessage]] = {}
    standings = [*standings]
    for standing in [*standings, *_find_missing_machines(plant, before, standings, now)]:
        told = read_last_published(standing.path) or before.get(standing.key)
        broker = _choose_broker(standing.path, machines or {}, told)
        if broker is None:
            continue
        word = PublishedMessage.of(standing, broker, now)
        if told is None or not told.covers(word) or (standing.path / OUTBOX_FILE).exists():
            due.setdefault(broker, {})[standing.path] = word.topic, make_message(standing, now)
            words[standing.path] = standing.key, word
    failures = deliver_messages(due)
    sent = {path: words[path] for broker in due.keys() - failures.keys() for path in due[broker]}
    for path, (_, word) in sent.items():
        write_last_published(path, word)
    if plant and sent:
        write_fleet_last_published(plant, before | dict(sent.values()))
    _print_failures(due, failures)
    return failures


def forget_machine(plant: Path, key: str, known: Iterable[str]) -> None:
    """Take the message on a machine that is gone out of its broker; known: names of the folders that are there.

    ValueError where it is there, nobody was told of it, or the broker does not take it.
    """
    told = read_fleet_last_published(plant)
    if key in known:
        raise ValueError(f"--forget {key}: is there; move its folder out of {plant} first")
    if key not in told:
        gone = ", ".join(sorted(told.keys() - set(known))) or "none"
        raise ValueError(f"--forget {key}: nobody was told of it; gone and not forgotten: {gone}")
    broker = told[key].target
    failure = send_messages({broker: {told[key].topic: b""}}).get(broker)
    if failure:
        raise ValueError(f"--forget {key}: {failure}")
    write_fleet_last_published(plant, {name: word for name, word in told.items() if name != key})


def _find_missing_machines(
    plant: Path | None, told: Mapping[str, PublishedMessage], standings: Iterable[FleetMachine], now: datetime
) -> Iterator[FleetMachine]:
    """Machines of a plant folder that were told of and are not there any more."""
    if plant is None:
        return
    for key in sorted(told.keys() - {standing.key for standing in standings}):
        summary = summarize_unreadable(key, MISSING_FOLDER_REASON.format(plant=plant, key=key))
        yield _assess_summary(key, plant / key, summary, now)


def _assess_summary(key: str, path: Path, summary: MachineSummary, now: datetime) -> FleetMachine:
    return FleetMachine(key, path, summary, summary.status_at(now, path))


def _choose_broker(path: Path, machines: Mapping[Path, Machine], told: PublishedMessage | None) -> Broker | None:
    """Whom machine.toml names; where it cannot be read, who was told last."""
    try:
        machine: Machine = machines.get(path) or read_machine_file(path / "machine.toml")
    except (ValueError, OSError):
        return told.target if told else None
    return machine.notify.broker


def _print_failures(brokers: Iterable[Broker], failures: Mapping[Broker, str]) -> None:
    for broker in brokers:
        why = failures.get(broker, "")
        if why:
            notes.print(f"note: nobody was told by MQTT: {why}; it goes with the next command", markup=False)
        if broker.password_warning and broker.password_warning not in why:
            notes.print(f"note: {broker.address}: {broker.password_warning}", markup=False)


@contextmanager
def publish_on_change(logbook: Logbook) -> Iterator[None]:
    """Tell at the end of work that may store something and then find fault with the rest."""
    before = logbook.folder.change_mark
    try:
        yield
    except (ValueError, OSError):
        if logbook.folder.change_mark != before:
            publish_status(logbook)
        raise
    if logbook.folder.change_mark != before:
        publish_status(logbook)
