"""Table [notify] of machine.toml: the MQTT broker for alarms."""

import os
from typing import NamedTuple
from urllib.parse import quote, unquote, urlsplit

from lobewatch.machine.settings.toml import TomlTable

DEFAULT_MQTT_PORTS = {"mqtt": 1883, "mqtts": 8883}
"""Default port by scheme; mqtts is encrypted."""
PASSWORD_VARIABLE = "LOBEWATCH_MQTT_PASSWORD"
"""Environment variable of the password, which keeps it out of machine.toml and of its copies in tap files."""
PASSWORD_HOST_VARIABLE = "LOBEWATCH_MQTT_HOST"
"""Environment variable of the host, or host:port, that may get the password."""


class Broker(NamedTuple):
    """MQTT broker with the prefix of all topics."""

    scheme: str
    """Scheme of the address, "mqtt" or "mqtts"."""
    host: str
    """Name or address of the computer."""
    port: int
    """Port of the broker."""
    user: str
    """User name; empty without login."""
    password: str
    """Password; empty without login."""
    prefix: str
    """First levels of all topics."""

    def __repr__(self) -> str:
        """Return the address without the password, for logs and tracebacks."""
        return f"Broker({self.without_password!r})"

    @property
    def address(self) -> str:
        """Address without the password."""
        return f"{self.scheme}://{self.host_port}"

    @property
    def host_port(self) -> str:
        """Host and port."""
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"

    @property
    def without_password(self) -> str:
        """Address with user and prefix, for storage."""
        user = f"{quote(self.user, safe='')}@" if self.user else ""
        return f"{self.scheme}://{user}{self.host_port}/{self.prefix}"

    @property
    def password_warning(self) -> str:
        """Reason why the password of the environment is not used; empty otherwise."""
        if not self.user or self.password or not os.environ.get(PASSWORD_VARIABLE):
            return ""
        host = os.environ.get(PASSWORD_HOST_VARIABLE) or "not set"
        cure = f"Set {PASSWORD_HOST_VARIABLE} to {self.host_port} to use the password for this broker."
        return f"{PASSWORD_VARIABLE} is not used, because {PASSWORD_HOST_VARIABLE} is {host}. {cure}"


class NotifyTable(TomlTable, frozen=True):
    """Table [notify]."""

    mqtt: str = ""
    """Address of the MQTT broker; empty without one."""

    def __post_init__(self) -> None:
        if self.mqtt:
            parse_broker(self.mqtt)

    @property
    def broker(self) -> Broker | None:
        """Broker of `mqtt`; None without one."""
        return parse_broker(self.mqtt) if self.mqtt else None


def parse_broker(address: str) -> Broker:
    """Parse mqtt://[user[:password]@]host[:port][/prefix]; ValueError for any other text."""
    hidden = address if "@" not in address else "...@" + address.rpartition("@")[2]
    allowed = "Give mqtt://HOST or mqtt://USER@HOST:PORT/PREFIX, with mqtts:// for encryption and %XX for other signs."
    refusal = f"mqtt={hidden!r} is not the address of a broker. {allowed}"
    url = urlsplit(address)
    is_encoded = not set(address) & set("#?\"'<> \t") and "@" not in url.path
    try:
        port = url.port
    except ValueError:
        raise ValueError(refusal) from None
    prefix = url.path.strip("/") or "lobewatch"
    if url.scheme not in DEFAULT_MQTT_PORTS or not url.hostname or not is_encoded or "+" in prefix:
        raise ValueError(refusal)
    port = port or DEFAULT_MQTT_PORTS[url.scheme]
    password = unquote(url.password or "") or (_find_password(url.hostname, port) if url.username else "")
    return Broker(url.scheme, url.hostname, port, unquote(url.username or ""), password, prefix)


def _find_password(host: str, port: int) -> str:
    """Return the password of the environment if it is for this host, else an empty text."""
    try:
        named = urlsplit(f"//{os.environ.get(PASSWORD_HOST_VARIABLE, '')}")
        is_for_it = named.hostname == host and named.port in (None, port)
    except ValueError:
        is_for_it = False
    return os.environ.get(PASSWORD_VARIABLE, "") if is_for_it else ""
