"""[notify]: who is told how the machine stands."""

from __future__ import annotations

import os
from typing import NamedTuple
from urllib.parse import unquote, urlsplit

from lobewatch.machine.settings.toml_table import Table

PORTS = {"mqtt": 1883, "mqtts": 8883}
"""Port by scheme, where the address names none; mqtts is encrypted."""
PASSWORD = "LOBEWATCH_MQTT_PASSWORD"
"""Variable of the environment: machine.toml is copied into each tap file, so the password need not stand in it."""


class Broker(NamedTuple):
    """An MQTT broker, and the place of our topics in it."""

    scheme: str
    """Scheme of the address, "mqtt" or "mqtts"."""
    host: str
    """Name or address of the computer."""
    port: int
    """Port of the broker."""
    user: str
    """Name of the user; empty where none is asked for."""
    password: str
    """Password of the user; empty where none is asked for."""
    prefix: str
    """First levels of all topics."""

    @property
    def address(self) -> str:
        """Address for people: without the password."""
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
        """Broker of `mqtt`; None where nobody is told."""
        return broker_of(self.mqtt) if self.mqtt else None


def broker_of(address: str) -> Broker:
    """Broker of mqtt://[user[:password]@]host[:port][/prefix]; ValueError for what is none."""
    hidden = address if "@" not in address else "...@" + address.rpartition("@")[2]
    allowed = "give mqtt://HOST, mqtt://USER@HOST:PORT/PREFIX, or mqtts:// where it is encrypted"
    refusal = f"mqtt={hidden!r} is no address of a broker; {allowed}"
    url = urlsplit(address)
    try:
        port = url.port
    except ValueError:
        raise ValueError(refusal) from None
    prefix = url.path.strip("/") or "lobewatch"
    if url.scheme not in PORTS or not url.hostname or set(address) & set("#?") or "+" in prefix:
        raise ValueError(refusal)
    password = unquote(url.password or "") or (os.environ.get(PASSWORD, "") if url.username else "")
    user = unquote(url.username or "")
    return Broker(url.scheme, url.hostname, port or PORTS[url.scheme], user, password, prefix)
