"""[notify]: who is told how the machine stands."""

from __future__ import annotations

import os
from typing import NamedTuple
from urllib.parse import unquote, urlsplit

from lobewatch.machine.settings.toml_table import Table

PORTS = {"mqtt": 1883, "mqtts": 8883}
"""Where none is named; mqtts is encrypted."""
PASSWORD = "LOBEWATCH_MQTT_PASSWORD"
"""Variable of the environment: machine.toml is copied into each tap file, so the password need not stand in it."""


class Broker(NamedTuple):
    """An MQTT broker, and where in it."""

    scheme: str
    """"mqtt" or "mqtts"."""
    host: str
    """Name or address."""
    port: int
    """Of the broker."""
    user: str
    """Empty where none is asked for."""
    password: str
    """Empty where none is asked for."""
    prefix: str
    """Of all topics."""

    @property
    def address(self) -> str:
        """For people: without the password."""
        return f"{self.scheme}://{self.host}:{self.port}"


class NotifyTable(Table, frozen=True):
    """[notify]: nobody is told where nothing stands."""

    mqtt: str = ""

    def __post_init__(self) -> None:
        """Refuse an address that is none."""
        if self.mqtt:
            broker_of(self.mqtt)

    @property
    def broker(self) -> Broker | None:
        """That of `mqtt`; None where there is none."""
        return broker_of(self.mqtt) if self.mqtt else None


def broker_of(address: str) -> Broker:
    """From mqtt://[user[:password]@]host[:port][/prefix]; ValueError for what is none."""
    hidden = address if "@" not in address else "...@" + address.rpartition("@")[2]
    allowed = "give mqtt://HOST, mqtt://USER@HOST:PORT/PREFIX, or mqtts:// where it is encrypted"
    wrong = f"mqtt={hidden!r} is no address of a broker; {allowed}"
    found = urlsplit(address)
    try:
        port = found.port
    except ValueError:
        raise ValueError(wrong) from None
    prefix = found.path.strip("/") or "lobewatch"
    if found.scheme not in PORTS or not found.hostname or set(address) & set("#?") or "+" in prefix:
        raise ValueError(wrong)
    password = unquote(found.password or "") or (os.environ.get(PASSWORD, "") if found.username else "")
    user = unquote(found.username or "")
    return Broker(found.scheme, found.hostname, port or PORTS[found.scheme], user, password, prefix)
