"""Messages that a broker could not be told: kept beside the machine, and sent with the next command."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping
from pathlib import Path

import msgspec

from acquisition import DataError
from acquisition.atomic import atomic_write
from acquisition.regular_file import SMALL, read_regular
from lobewatch.machine import BusyError, MachineFolder
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


def deliver(broker: Broker, messages: Mapping[Path, tuple[str, bytes]]) -> str:
    """Send messages (topic and content by machine folder) with those left over beside; why not, empty where all went.

    What does not go is kept beside its machine.
    """
    left_over = _left_over(broker, {folder.resolve().parent for folder in messages})
    pending = left_over | dict(messages)
    try:
        send(broker, dict(pending.values()))
    except DataError as error:
        for folder, (topic, content) in messages.items():
            _keep(folder, Unsent(topic, msgspec.Raw(content), broker[:3]))
        return str(error)
    for folder in pending:
        with contextlib.suppress(OSError):
            (folder / UNSENT).unlink(missing_ok=True)
    return ""


def _left_over(broker: Broker, places: Iterable[Path]) -> dict[Path, tuple[str, bytes]]:
    """Messages to the same broker, beside machines in these folders."""
    messages = {}
    for path in sorted(path for place in places for path in place.glob(f"*/{UNSENT}")):
        try:
            unsent = msgspec.json.decode(read_regular(path, SMALL), type=Unsent)
        except (OSError, ValueError):
            continue
        if tuple(unsent.broker) == tuple(broker[:3]):
            messages[path.parent] = unsent.topic, bytes(unsent.message)
    return messages


def _keep(folder: Path, unsent: Unsent) -> None:
    with contextlib.suppress(BusyError, OSError), MachineFolder(folder).locked():
        atomic_write(folder / UNSENT, msgspec.json.encode(unsent))
