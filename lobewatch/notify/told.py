"""Who was told last how a machine stands, and what, without the password: beside the machine and in its plant folder.

So a machine whose files cannot be read, or are gone, can still be told of, and what has not changed is told once a day.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Mapping
from datetime import datetime, timedelta
from pathlib import Path
from typing import Self

import msgspec

from acquisition import DataError
from acquisition.atomic import atomic_write
from acquisition.regular_file import SMALL, read_regular
from lobewatch.machine import MachineFolder
from lobewatch.machine.settings.notify_table import Broker, broker_of
from lobewatch.notify.message import content_of, topic_of
from lobewatch.plant.plant import MachineStanding

TOLD, OF_PLANT = "told.json", ".lobewatch-told.json"
"""Names of the file beside a machine, and of that of all machines in a plant folder."""
REPEAT = timedelta(hours=23)
"""Time after which the same is told again, by what runs once a day; chosen."""


class Told(msgspec.Struct, frozen=True):
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
    def of(cls, standing: MachineStanding, broker: Broker, now: datetime) -> Self:
        """The message that a machine calls for."""
        content = hashlib.sha256(msgspec.json.encode(content_of(standing))).hexdigest()
        return cls(broker.without_password, topic_of(broker.prefix, standing.key), content, now)

    def stands_for(self, other: Told) -> bool:
        """Whether the other one need not be sent."""
        same = (self.broker, self.topic, self.content) == (other.broker, other.topic, other.content)
        return same and timedelta(0) <= other.time - self.time < REPEAT

    @property
    def to(self) -> Broker:
        """Broker, with the password of the environment where it may have it."""
        return broker_of(self.broker)


def told_of_machine(folder: Path) -> Told | None:
    """What was told of a machine; None where nobody was, or nothing can be read."""
    try:
        return msgspec.json.decode(read_regular(folder / TOLD, SMALL), type=Told)
    except (OSError, ValueError, RecursionError):
        return None


def told_of_plant(folder: Path) -> dict[str, Told]:
    """What was told of the machines of a plant folder, by name of their folders."""
    try:
        return msgspec.json.decode(read_regular(folder / OF_PLANT, SMALL), type=dict[str, Told])
    except (OSError, ValueError, RecursionError):
        return {}


def keep_told_of_machine(folder: Path, told: Told) -> None:
    """Keep it beside a machine, where that can be written."""
    with contextlib.suppress(DataError, OSError), MachineFolder(folder).locked(patience=0):
        atomic_write(folder / TOLD, msgspec.json.encode(told), lasting=False)


def keep_told_of_plant(folder: Path, told: Mapping[str, Told]) -> None:
    """Keep it in a plant folder, where that can be written."""
    with contextlib.suppress(OSError):
        atomic_write(folder / OF_PLANT, msgspec.json.encode(told), lasting=False)
