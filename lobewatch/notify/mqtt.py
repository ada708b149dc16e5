"""Retained messages to MQTT 5 brokers, each acknowledged; brokers that are away cost a few seconds and no error."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import Any

import msgspec

from acquisition import DataError
from lobewatch.machine.settings.notify_table import Broker

PATIENCE = 4.0
"""Time for all brokers together, from the lookup of their names to the last acknowledgement (s); chosen."""
KEEP_ALIVE = 10
"""Time between signs of life (s); after half as long again without one the broker takes the sender for lost."""
LOST, DONE = (msgspec.json.encode({"sender": word}) for word in ("lost", "done"))
"""Messages at PREFIX/sender: the last will of a sender that broke off, and the word of one that has told all."""


def send(batches: Mapping[Broker, Mapping[str, bytes]]) -> dict[Broker, str]:
    """Put messages, by broker and topic, where they stay: to all brokers at once, for PATIENCE at most.

    Returns why not, for each broker that has not acknowledged all.
    """
    end = time.monotonic() + PATIENCE
    sendings = {broker: Sending(broker, messages, end) for broker, messages in batches.items()}
    for sending in sendings.values():
        sending.start()
    for sending in sendings.values():
        sending.join(max(end - time.monotonic(), 0.0))
    return {broker: why for broker, sending in sendings.items() if (why := sending.failure)}


class Sending(threading.Thread):
    """One attempt to send to one broker; left behind where it does not end, for nothing ends a lookup that hangs."""

    def __init__(self, broker: Broker, messages: Mapping[str, bytes], end: float) -> None:
        """end: when nobody waits for it any more (monotonic clock, s)."""
        super().__init__(name=f"to {broker.address}", daemon=True)
        self._broker, self._end = broker, end
        self._waiting = {**messages, f"{broker.prefix}/sender": DONE}
        self._n_left, self._refusal = len(self._waiting), ""
        self._reach("cannot be reached")

    def run(self) -> None:
        """Send all, or set down why not; without its last word the broker publishes the last will."""
        client = None
        try:
            client = self._make_client()
            client.connect(self._broker.host, self._broker.port, KEEP_ALIVE)
            self._exchange(client)
        except DataError as error:
            self.failure = f"{self._broker.address}: {error}"
        except Exception as error:  # noqa: BLE001  (what paho does with the bytes of a stranger is not for us to say)
            self.failure = f"{self._broker.address}: {self._stage} ({error})"
        finally:
            if client is not None and (connection := client.socket()) is not None:
                connection.close()

    def _reach(self, stage: str) -> None:
        """Set down what is to be said where it goes no further than this."""
        self._stage = stage
        self.failure = f"{self._broker.address}: {stage} within {PATIENCE:g} s"

    def _make_client(self) -> Any:
        """Client of paho, not connected yet; DataError without paho."""
        try:
            from paho.mqtt import client as paho
            from paho.mqtt.enums import CallbackAPIVersion
        except ImportError as error:
            raise DataError('MQTT needs paho-mqtt; install it with: pip install "lobewatch[mqtt]"') from error
        client = paho.Client(CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
        client.connect_timeout = PATIENCE / 2  # for each address of a name: the second has a chance where one is silent
        if self._broker.user:
            client.username_pw_set(self._broker.user, self._broker.password or None)
        if self._broker.scheme == "mqtts":
            client.tls_set()
        client.will_set(f"{self._broker.prefix}/sender", LOST, qos=1, retain=True)
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
        if self._refusal:
            raise DataError(self._refusal)
        client.disconnect()
        self.failure = ""

    def _on_socket_open(self, *_: Any) -> None:
        """Refuse to begin when another attempt may be under way already."""
        if time.monotonic() > self._end:
            raise TimeoutError
        self._reach("does not answer")

    def _on_connect(self, client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            raise DataError(f"refuses ({reason}); {self._broker.withheld or 'see user and password'}")
        self._reach("has not acknowledged")
        for topic, content in self._waiting.items():
            client.publish(topic, content, qos=1, retain=True)

    def _on_publish(self, _client: Any, _data: Any, _number: int, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            self._refusal = f"refuses a message ({reason}); see what the user may write"
        self._n_left -= 1
