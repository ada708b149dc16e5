"""Send retained MQTT 5 messages and keep undelivered ones in an outbox."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Container, Iterable, Mapping
from pathlib import Path
from typing import Any

import msgspec

from acquisition import DataError
from acquisition.file_io import MAX_SETTINGS_FILE_SIZE, atomic_write, read_regular_file
from lobewatch.machine import MachineFolder
from lobewatch.machine.settings.notify_table import Broker

MQTT_TIMEOUT = 4.0
"""Time for all brokers together, from the lookup of their names to the last acknowledgement (s); chosen."""
MQTT_KEEP_ALIVE = 10
"""Time between signs of life (s); after half as long again without one the broker takes the sender for lost."""
SENDER_LOST_MESSAGE, SENDER_DONE_MESSAGE = (msgspec.json.encode({"sender": word}) for word in ("lost", "done"))
"""Messages at PREFIX/sender: the last will of a sender that broke off, and the word of one that has told all."""


def send_messages(batches: Mapping[Broker, Mapping[str, bytes]]) -> dict[Broker, str]:
    """Put messages, by broker and topic, where they stay: to all brokers at once, for PATIENCE at most.

    Returns why not, for each broker that has not acknowledged all.
    """
    end = time.monotonic() + MQTT_TIMEOUT
    sendings = {broker: BrokerThread(broker, messages, end) for broker, messages in batches.items()}
    for sending in sendings.values():
        sending.start()
    for sending in sendings.values():
        sending.join(max(end - time.monotonic(), 0.0))
    return {broker: why for broker, sending in sendings.items() if (why := sending.failure)}


class BrokerThread(threading.Thread):
    """One attempt to send to one broker; left behind where it does not end, for nothing ends a lookup that hangs."""

    def __init__(self, broker: Broker, messages: Mapping[str, bytes], end: float) -> None:
        """end: when nobody waits for it any more (monotonic clock, s)."""
        super().__init__(name=f"to {broker.address}", daemon=True)
        self._broker, self._end = broker, end
        self._messages = {**messages, f"{broker.prefix}/sender": SENDER_DONE_MESSAGE}
        self._n_left, self._rejection = len(self._messages), ""
        self._set_stage("cannot be reached")

    def run(self) -> None:
        """Send all, or set down why not; without its last word the broker publishes the last will."""
        client = None
        try:
            client = self._make_client()
            client.connect(self._broker.host, self._broker.port, MQTT_KEEP_ALIVE)
            self._exchange(client)
        except DataError as error:
            self.failure = f"{self._broker.address}: {error}"
        except Exception as error:  # noqa: BLE001  (what paho does with the bytes of a stranger is not for us to say)
            self.failure = f"{self._broker.address}: {self._stage} ({error})"
        finally:
            if client is not None and (connection := client.socket()) is not None:
                connection.close()

    def _set_stage(self, stage: str) -> None:
        """Set down what is to be said where it goes no further than this."""
        self._stage = stage
        self.failure = f"{self._broker.address}: {stage} within {MQTT_TIMEOUT:g} s"

    def _make_client(self) -> Any:
        """Client of paho, not connected yet; DataError without paho."""
        try:
            from paho.mqtt import client as paho
            from paho.mqtt.enums import CallbackAPIVersion
        except ImportError as error:
            raise DataError('MQTT needs paho-mqtt; install it with: pip install "lobewatch[mqtt]"') from error
        client = paho.Client(CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
        client.connect_timeout = (
            MQTT_TIMEOUT / 2
        )  # for each address of a name: the second has a chance where one is silent
        if self._broker.user:
            client.username_pw_set(self._broker.user, self._broker.password or None)
        if self._broker.scheme == "mqtts":
            client.tls_set()
        client.will_set(f"{self._broker.prefix}/sender", SENDER_LOST_MESSAGE, qos=1, retain=True)
        client.on_socket_open = self._on_socket_open
        client.on_connect, client.on_publish = self._on_connect, self._on_publish
        return client

    def _exchange(self, client: Any) -> None:
        """Read and write until all is acknowledged, or nobody waits any more; DataError where a message is refused."""
        from paho.mqtt.client import error_string

        while self._n_left:
            if (left := self._end - time.monotonic()) <= 0:
                return
            if code := client.loop(left):
                raise ConnectionError(error_string(code).rstrip("."))
        if self._rejection:
            raise DataError(self._rejection)
        client.disconnect()
        self.failure = ""

    def _on_socket_open(self, *_: Any) -> None:
        """Refuse to begin when another attempt may be under way already."""
        if time.monotonic() > self._end:
            raise TimeoutError
        self._set_stage("does not answer")

    def _on_connect(self, client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            raise DataError(f"refuses ({reason}); {self._broker.password_warning or 'see user and password'}")
        self._set_stage("has not acknowledged")
        for topic, content in self._messages.items():
            client.publish(topic, content, qos=1, retain=True)

    def _on_publish(self, _client: Any, _data: Any, _number: int, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            self._rejection = f"refuses a message ({reason}); see what the user may write"
        self._n_left -= 1


OUTBOX_FILE = "unsent.json"
"""Name of the file of such a message, in the folder of its machine."""


class OutboxMessage(msgspec.Struct, frozen=True):
    """The newest message of a machine; it stands for all before it."""

    topic: str
    """Topic that it is to stand at."""
    message: msgspec.Raw
    """Message as JSON."""
    broker: tuple[str, str, int]
    """Scheme, host and port of the broker."""


def deliver_messages(batches: Mapping[Broker, Mapping[Path, tuple[str, bytes]]]) -> dict[Broker, str]:
    """Send messages (topic and content, by broker and machine folder) with those left over beside.

    Returns why not, for each broker that did not take all. What does not go is kept beside its machine.
    """
    fresh = {folder.resolve() for messages in batches.values() for folder in messages}
    pending = {broker: _read_outboxes(broker, messages, fresh) | dict(messages) for broker, messages in batches.items()}
    failures = send_messages({broker: dict(messages.values()) for broker, messages in pending.items()})
    for broker in failures:
        for folder, (topic, content) in batches[broker].items():
            _write_outbox(folder, OutboxMessage(topic, msgspec.Raw(content), broker[:3]))
    for folder in (folder for broker in pending.keys() - failures.keys() for folder in pending[broker]):
        with contextlib.suppress(OSError):
            (folder / OUTBOX_FILE).unlink(missing_ok=True)
    return failures


def _read_outboxes(broker: Broker, folders: Iterable[Path], fresh: Container[Path]) -> dict[Path, tuple[str, bytes]]:
    """Messages to the same broker, of machines beside these but for those with a fresh one."""
    messages = {}
    places = {folder.resolve().parent for folder in folders}
    for path in sorted(path for place in places for path in place.glob(f"*/{OUTBOX_FILE}") if path.parent not in fresh):
        try:
            unsent = msgspec.json.decode(read_regular_file(path, MAX_SETTINGS_FILE_SIZE), type=OutboxMessage)
        except (OSError, ValueError, RecursionError):
            continue
        if tuple(unsent.broker) == tuple(broker[:3]):
            messages[path.parent] = unsent.topic, bytes(unsent.message)
    return messages


def _write_outbox(folder: Path, unsent: OutboxMessage) -> None:
    with contextlib.suppress(DataError, OSError), MachineFolder(folder).locked(patience=0):
        atomic_write(folder / OUTBOX_FILE, msgspec.json.encode(unsent))
