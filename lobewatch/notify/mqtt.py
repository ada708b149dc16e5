"""Send retained MQTT 5 messages and keep undelivered ones in an outbox."""

import contextlib
import threading
import time
from collections.abc import Container, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from acquisition import DataError
from acquisition.errors import join_sentences
from acquisition.file_io import MAX_SETTINGS_FILE_SIZE, atomic_write, delete, read_regular_file
from lobewatch.machine import MachineFolder
from lobewatch.machine.settings.notify_table import Broker

MQTT_TIMEOUT = 4.0
"""Time for all brokers together, from the name lookup to the last acknowledgement (s); chosen."""
MQTT_KEEP_ALIVE = 10
"""Keep-alive interval (s). The broker drops the sender after 1.5 intervals."""
SENDER_LOST_MESSAGE, SENDER_DONE_MESSAGE = (msgspec.json.encode({"sender": word}) for word in ("lost", "done"))
"""Messages at PREFIX/sender: last will of a lost sender, and end of a complete transmission."""

OUTBOX_FILE = "unsent.json"
"""File of an undelivered message in the folder of its machine."""
Content = TypeVar("Content")


def send_messages(batches: Mapping[Broker, Mapping[str, bytes]]) -> dict[Broker, str]:
    """Publish retained messages, by broker and topic, to all brokers at once within MQTT_TIMEOUT.

    Returns the reason for each broker that has not acknowledged all messages.
    """
    end = time.monotonic() + MQTT_TIMEOUT
    threads = {broker: _BrokerThread(broker, messages, end) for broker, messages in batches.items()}
    for thread in threads.values():
        thread.start()
    for thread in threads.values():
        thread.join(max(end - time.monotonic(), 0.0))
    return {broker: failure for broker, thread in threads.items() if (failure := thread.failure)}


class _BrokerThread(threading.Thread):
    """Attempt to send to one broker. A thread that hangs in a name lookup is left behind."""

    def __init__(self, broker: Broker, messages: Mapping[str, bytes], end: float) -> None:
        """Prepare the attempt. `end` is its deadline (monotonic clock, s)."""
        super().__init__(name=f"to {broker.address}", daemon=True)
        self._broker, self._end = broker, end
        self._messages = {**messages, f"{broker.prefix}/sender": SENDER_DONE_MESSAGE}
        self._n_left, self._rejection = len(self._messages), ""
        self._set_stage("cannot be reached")

    def run(self) -> None:
        """Send all messages or set `failure`. Without a disconnect the broker publishes the last will."""
        client = None
        try:
            client = self._make_client()
            client.connect(self._broker.host, self._broker.port, MQTT_KEEP_ALIVE)
            self._exchange(client)
        except DataError as error:
            self.failure = f"{self._broker.address}: {error}"
        except Exception as error:  # noqa: BLE001 - paho may raise anything for foreign bytes
            self.failure = f"{self._broker.address}: {self._stage} ({error})"
        finally:
            if client is not None and (connection := client.socket()) is not None:
                connection.close()

    def _set_stage(self, stage: str) -> None:
        """Set the failure that holds unless a later stage is reached."""
        self._stage = stage
        self.failure = f"{self._broker.address}: {stage} within {MQTT_TIMEOUT:g} s"

    def _make_client(self) -> Any:
        """Make an unconnected paho client. DataError without paho."""
        try:
            from paho.mqtt import client as paho
            from paho.mqtt.enums import CallbackAPIVersion
        except ImportError as error:
            raise DataError('MQTT needs paho-mqtt. Install this package with: pip install "lobewatch[mqtt]"') from error
        client = paho.Client(CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
        # For each address of a name: the second has a chance where one is silent.
        client.connect_timeout = MQTT_TIMEOUT / 2
        if self._broker.user:
            client.username_pw_set(self._broker.user, self._broker.password or None)
        if self._broker.scheme == "mqtts":
            client.tls_set()
        client.will_set(f"{self._broker.prefix}/sender", SENDER_LOST_MESSAGE, qos=1, retain=True)
        client.on_socket_open = self._on_socket_open
        client.on_connect, client.on_publish = self._on_connect, self._on_publish
        return client

    def _exchange(self, client: Any) -> None:
        """Read and write until all is acknowledged or the deadline is over. DataError for a rejected message."""
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
        """Give up after the deadline, when another attempt may have begun."""
        if time.monotonic() > self._end:
            raise TimeoutError
        self._set_stage("does not answer")

    def _on_connect(self, client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            cure = self._broker.password_warning or "Check user and password"
            raise DataError(join_sentences(f"rejects the connection ({reason})", cure))
        self._set_stage("has not acknowledged")
        for topic, content in self._messages.items():
            client.publish(topic, content, qos=1, retain=True)

    def _on_publish(self, _client: Any, _data: Any, _number: int, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            self._rejection = f"rejects a message ({reason}). Check the write permissions of the user."
        self._n_left -= 1


class OutboxMessage(msgspec.Struct, frozen=True):
    """Newest undelivered message of a machine. It replaces all earlier ones."""

    topic: str
    """Topic of the message."""
    message: msgspec.Raw
    """Message as JSON."""
    broker: tuple[str, str, int]
    """Scheme, host and port of the broker."""


def deliver_messages(batches: Mapping[Broker, Mapping[Path, tuple[str, bytes]]]) -> dict[Broker, str]:
    """Send messages (topic and content, by broker and machine folder) and those in the outboxes of other machines.

    Returns the reason for each broker that did not take all. Undelivered messages go to the outbox of their machine.
    """
    fresh = {folder.resolve() for messages in batches.values() for folder in messages}
    pending = {broker: _read_outboxes(broker, messages, fresh) | dict(messages) for broker, messages in batches.items()}
    failures = send_messages({broker: dict(messages.values()) for broker, messages in pending.items()})
    for broker in failures:
        for folder, (topic, content) in batches[broker].items():
            message = msgspec.json.encode(OutboxMessage(topic, msgspec.Raw(content), broker[:3]))
            with contextlib.suppress(DataError, OSError), MachineFolder(folder).locked(patience=0):
                atomic_write(folder / OUTBOX_FILE, message)
    for folder in (folder for broker in pending.keys() - failures.keys() for folder in pending[broker]):
        with contextlib.suppress(OSError):
            delete(folder / OUTBOX_FILE, missing_ok=True)
    return failures


def _read_outboxes(broker: Broker, folders: Iterable[Path], fresh: Container[Path]) -> dict[Path, tuple[str, bytes]]:
    """Read the outboxes for a broker in the parent folders, except of machines with a fresh message."""
    messages = {}
    parents = {folder.resolve().parent for folder in folders}
    for path in sorted(path for parent in parents for path in parent.glob(f"*/{OUTBOX_FILE}")):
        outbox = None if path.parent in fresh else read_json(path, OutboxMessage)
        if outbox is not None and tuple(outbox.broker) == tuple(broker[:3]):
            messages[path.parent] = outbox.topic, bytes(outbox.message)
    return messages


def read_json(path: Path, kind: type[Content]) -> Content | None:
    """Read a small JSON file of a type. None if it cannot be read."""
    try:
        return msgspec.json.decode(read_regular_file(path, MAX_SETTINGS_FILE_SIZE), type=kind)
    except (OSError, ValueError, RecursionError):
        return None
