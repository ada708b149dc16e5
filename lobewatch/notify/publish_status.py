"""Publish the status of machines to MQTT brokers when it has changed.

The last published message is stored with each machine and in the folder of the fleet. So an unreadable or missing
machine can still be reported, and an unchanged status is published once a day only.
"""

import contextlib
import hashlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Self

import msgspec

from acquisition import DataError, atomic_write
from acquisition.errors import format_error, join_sentences
from lobewatch.fleet.fleet import FleetMachine
from lobewatch.fleet.machine_summary import MachineSummary, software_version, summarize_unreadable
from lobewatch.fleet.summarize import learn_scatter, summarize_machine
from lobewatch.logbook import Logbook
from lobewatch.machine import MachineFolder
from lobewatch.machine.settings.machine_file import read_machine_file
from lobewatch.machine.settings.notify_table import Broker, parse_broker
from lobewatch.monitoring.threshold_dates import build_forecast_rows, build_limit_row, find_next_limit
from lobewatch.notify.mqtt import OUTBOX_FILE, deliver_messages, read_json, send_messages
from lobewatch.show.terminal.option_names import with_option_names, with_option_names_inside
from lobewatch.show.terminal.output import notes, print_remarks

TOPIC_REPLACEMENTS = str.maketrans("+#/\0", "____")
"""Replacement of characters that a topic level must not contain."""
LAST_PUBLISHED_FILE, FLEET_LAST_PUBLISHED_FILE = "told.json", ".lobewatch-told.json"
"""Files of the last published messages, in a machine folder and in the folder of a fleet."""
REPUBLISH_INTERVAL = timedelta(hours=23)
"""Time after which an unchanged status is published again, for daily jobs; chosen."""
MISSING_FOLDER_REASON = (
    "the machine folder is missing (to forget this machine: lobewatch status {folder} --notify --forget {key})"
)
"""Reason for a machine that was published and is missing now."""


def publish_status(logbook: Logbook) -> None:
    """Learn scatter from other machines, summarize the machine and publish its status. Raises nothing."""
    now, path = datetime.now(UTC), logbook.folder.path
    try:
        learn_scatter(logbook if logbook.is_current else Logbook.open(path))
        summary = summarize_machine(logbook if logbook.is_current else Logbook.open(path), now, with_option_names)
    except Exception as error:  # noqa: BLE001 - an unreadable machine is published as one
        summary = summarize_unreadable(path.resolve().name, format_error(error))
    publish_machines([_assess_summary(path.resolve().name, path, summary, now)], now=now)


@contextmanager
def publish_on_change(logbook: Logbook) -> Iterator[Logbook]:
    """Publish the status after work that has changed the machine folder, even if the work fails later.

    Files and entries of other computers in a synced folder are named first.
    """
    print_remarks(logbook.folder.sync_remarks)
    before = logbook.folder.change_mark
    try:
        yield logbook
    except (ValueError, OSError):
        if logbook.folder.change_mark != before:
            publish_status(logbook)
        raise
    if logbook.folder.change_mark != before:
        publish_status(logbook)


def publish_folder(folder: Path, assessed: Sequence[FleetMachine], forget: str = "") -> dict[Broker, str]:
    """Publish the machine or all machines in a folder, after forgetting a missing one. See `publish_machines`."""
    if forget:
        _forget_machine(folder, forget, {machine.key for machine in assessed})
    return publish_machines(assessed, fleet_folder=None if (folder / "machine.toml").exists() else folder)


def publish_machines(
    assessed: Sequence[FleetMachine], fleet_folder: Path | None = None, now: datetime | None = None
) -> dict[Broker, str]:
    """Publish each status that has changed or was published a day ago, if machine.toml names a broker.

    A machine with an unreadable machine.toml, or missing in the folder of the fleet, goes to the broker of its last
    message. Returns the reason for each broker that did not take all; a note shows it too.
    """
    now, before = now or datetime.now(UTC), _read_fleet_published(fleet_folder) if fleet_folder else {}
    due: dict[Broker, dict[Path, tuple[str, bytes]]] = {}
    new: dict[Path, tuple[str, PublishedMessage]] = {}
    missing = _find_missing_machines(fleet_folder, before, assessed, now) if fleet_folder else ()
    for machine in [*assessed, *missing]:
        last = read_json(machine.path / LAST_PUBLISHED_FILE, PublishedMessage) or before.get(machine.key)
        broker = _choose_broker(machine.path, last)
        if broker is None:
            continue
        published = PublishedMessage.of(machine, broker, now)
        if last is None or not last.covers(published) or (machine.path / OUTBOX_FILE).exists():
            due.setdefault(broker, {})[machine.path] = published.topic, make_message(machine, now)
            new[machine.path] = machine.key, published
    failures = deliver_messages(due)
    sent = {path: new[path] for broker in due.keys() - failures.keys() for path in due[broker]}
    for path, (_, published) in sent.items():
        with contextlib.suppress(DataError, OSError), MachineFolder(path).locked(patience=0):
            atomic_write(path / LAST_PUBLISHED_FILE, msgspec.json.encode(published), lasting=False)
    if fleet_folder and sent:
        _write_fleet_published(fleet_folder, before | dict(sent.values()))
    _print_failures(due, failures)
    return failures


def _forget_machine(fleet_folder: Path, key: str, present: Collection[str]) -> None:
    """Remove the message on a missing machine from its broker.

    ValueError if its folder is present, if it was never published, or if the broker does not accept the removal.
    """
    published = _read_fleet_published(fleet_folder)
    if key in present:
        raise ValueError(f"--forget {key}: this machine exists. Move its folder out of {fleet_folder} first.")
    if key not in published:
        gone = ", ".join(sorted(published.keys() - present)) or "none"
        raise ValueError(f"--forget {key}: this machine was never published. Missing machines: {gone}.")
    broker = published[key].target
    failure = send_messages({broker: {published[key].topic: b""}}).get(broker)
    if failure:
        raise ValueError(f"--forget {key}: {failure}")
    _write_fleet_published(fleet_folder, {name: message for name, message in published.items() if name != key})


def _find_missing_machines(
    fleet_folder: Path, published: Mapping[str, "PublishedMessage"], assessed: Iterable[FleetMachine], now: datetime
) -> Iterator[FleetMachine]:
    """Yield machines that were published and are missing in the folder of the fleet."""
    for key in sorted(published.keys() - {machine.key for machine in assessed}):
        summary = summarize_unreadable(key, MISSING_FOLDER_REASON.format(folder=fleet_folder, key=key))
        yield _assess_summary(key, fleet_folder / key, summary, now)


def _assess_summary(key: str, path: Path, summary: MachineSummary, now: datetime) -> FleetMachine:
    return FleetMachine(key, path, summary, summary.status_at(now, path))


def _choose_broker(path: Path, last: "PublishedMessage | None") -> Broker | None:
    """Return the broker of machine.toml, or that of the last message if machine.toml cannot be read."""
    try:
        return read_machine_file(path / "machine.toml").notify.broker
    except (ValueError, OSError):
        return last.target if last else None


def _print_failures(brokers: Iterable[Broker], failures: Mapping[Broker, str]) -> None:
    for broker in brokers:
        failure = failures.get(broker, "")
        if failure:
            text = join_sentences(f"note: status not published to {failure}", "The next command publishes the status")
            notes.print(text, markup=False)
        if broker.password_warning and broker.password_warning not in failure:
            notes.print(f"note: {broker.address}: {broker.password_warning}", markup=False)


def make_message(machine: FleetMachine, now: datetime) -> bytes:
    """Make the message on a machine as JSON, null for unknown values."""
    sent = {"time": now.isoformat(), "software": f"lobewatch {software_version()}"}
    return msgspec.json.encode(make_message_content(machine) | sent)


def make_message_content(machine: FleetMachine) -> dict[str, Any]:
    """Make the message on a machine without the time of sending."""
    summary, current = machine.summary, machine.current
    worst = summary.series[0] if summary.series else None
    due = None if summary.time is None else summary.time + timedelta(days=summary.interval_days)
    content = {
        "folder": machine.key,
        "machine": summary.name,
        "light": current.status,
        "is_early": current.is_early,
        "reasons": [{"code": remark.code, "about": remark.about, "text": remark.text} for remark in current.remarks],
        "alarms": [alarm.to_row(current.time) for alarm in summary.alarms],
        "next_step": current.next_step,
        "fall_percent": worst.drop if worst else None,
        "fall_percent_std": worst.drop_std if worst else None,
        "fall_percent_interval": worst.drop_interval if worst else None,
        "is_change_proven": worst.is_proven if worst else None,
        "series": worst.name if worst else None,
        "frequency_hz": worst.frequency if worst else None,
        "next_limit": build_limit_row(find_next_limit(summary.limits)),
        "forecast": build_forecast_rows(summary.forecasts, summary.limits),
        "programs": summary.programs_at(current.time),
        "last_tap": summary.last_tap or None,
        "due": due and due.isoformat(),
        "is_overdue": current.days_left is not None and current.days_left < 0,
    }
    return {key: with_option_names_inside(value) for key, value in content.items()}


class PublishedMessage(msgspec.Struct, frozen=True):
    """Last published message on a machine."""

    broker: str
    """Address of the broker, without the password."""
    topic: str
    """Topic of the message."""
    content: str
    """SHA-256 of the message without its time."""
    time: datetime
    """Time of sending."""

    @classmethod
    def of(cls, machine: FleetMachine, broker: Broker, now: datetime) -> Self:
        """Make the record of the message on a machine."""
        content = hashlib.sha256(msgspec.json.encode(make_message_content(machine))).hexdigest()
        topic = f"{broker.prefix}/{machine.key.translate(TOPIC_REPLACEMENTS)}/standing"
        return cls(broker.without_password, topic, content, now)

    def covers(self, other: Self) -> bool:
        """Return whether another message need not be sent."""
        is_same = (self.broker, self.topic, self.content) == (other.broker, other.topic, other.content)
        return is_same and timedelta(0) <= other.time - self.time < REPUBLISH_INTERVAL

    @property
    def target(self) -> Broker:
        """Broker, with the password from the environment if it may have it."""
        return parse_broker(self.broker)


def _read_fleet_published(folder: Path) -> dict[str, PublishedMessage]:
    return read_json(folder / FLEET_LAST_PUBLISHED_FILE, dict[str, PublishedMessage]) or {}


def _write_fleet_published(folder: Path, published: Mapping[str, PublishedMessage]) -> None:
    with contextlib.suppress(OSError):
        atomic_write(folder / FLEET_LAST_PUBLISHED_FILE, msgspec.json.encode(published), lasting=False)
