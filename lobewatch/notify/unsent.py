"""Messages that a broker could not be told: kept beside the machine, and sent with the next command."""

from __future__ import annotations

import contextlib
from collections.abc import Container, Iterable, Mapping
from pathlib import Path

import msgspec

from acquisition import DataError
from acquisition.atomic import atomic_write
from acquisition.regular_file import SMALL, read_regular
from lobewatch.machine import MachineFolder
from lobewatch.machine.settings.notify_table import Broker
from lobewatch.notify.mqtt import send

UNSENT = "unsent.json"
"""Name of the file of such a message, in the folder of its machine."""


class Unsent(msgspec.Struct, frozen=True):
    """The newest message of a machine; it stands for all before it."""

    topic: str
    """Topic that it is to stand at."""
    message: msgspec.Raw
    """Message as JSON."""
    broker: tuple[str, str, int]
    """Scheme, host and port of the broker."""


def deliver(batches: Mapping[Broker, Mapping[Path, tuple[str, bytes]]]) -> dict[Broker, str]:
    """Send messages (topic and content, by broker and machine folder) with those left over beside.

    Returns why not, for each broker that did not take all. What does not go is kept beside its machine.
    """
    fresh = {folder.resolve() for messages in batches.values() for folder in messages}
    pending = {broker: _left_over(broker, messages, fresh) | dict(messages) for broker, messages in batches.items()}
    failures = send({broker: dict(messages.values()) for broker, messages in pending.items()})
    for broker in failures:
        for folder, (topic, content) in batches[broker].items():
            _keep(folder, Unsent(topic, msgspec.Raw(content), broker[:3]))
    for folder in (folder for broker in pending.keys() - failures.keys() for folder in pending[broker]):
        with contextlib.suppress(OSError):
            (folder / UNSENT).unlink(missing_ok=True)
    return failures


def _left_over(broker: Broker, folders: Iterable[Path], fresh: Container[Path]) -> dict[Path, tuple[str, bytes]]:
    """Messages to the same broker, of machines beside these but for those with a fresh one."""
    messages = {}
    places = {folder.resolve().parent for folder in folders}
    for path in sorted(path for place in places for path in place.glob(f"*/{UNSENT}") if path.parent not in fresh):
        try:
            unsent = msgspec.json.decode(read_regular(path, SMALL), type=Unsent)
        except (OSError, ValueError, RecursionError):
            continue
        if tuple(unsent.broker) == tuple(broker[:3]):
            messages[path.parent] = unsent.topic, bytes(unsent.message)
    return messages


def _keep(folder: Path, unsent: Unsent) -> None:
    with contextlib.suppress(DataError, OSError), MachineFolder(folder).locked(patience=0):
        atomic_write(folder / UNSENT, msgspec.json.encode(unsent))
