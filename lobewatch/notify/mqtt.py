"""Retained messages to an MQTT 5 broker, each acknowledged; a broker that is away costs a few seconds and no error."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import Any

import msgspec

from acquisition import DataError
from lobewatch.machine.settings.notify_table import Broker

PATIENCE = 3.0
"""Time for the connection, and for the acknowledgements of all messages (s)."""
KEEP_ALIVE = 10
"""Time between signs of life (s); after half as long again without one the broker takes the sender for lost."""
LOST, DONE = ({"sender": word} for word in ("lost", "done"))
"""Messages at PREFIX/sender: the last will of a sender that broke off, and the word of one that has told all."""


def connect(broker: Broker) -> Any:
    """Client of paho, connected, its last will deposited.

    DataError with the reason where the broker cannot be reached in time or refuses, and without paho.
    """
    try:
        from paho.mqtt import client as paho
        from paho.mqtt.enums import CallbackAPIVersion
    except ImportError as error:
        raise DataError('MQTT needs paho-mqtt; install it with: pip install "lobewatch[mqtt]"') from error
    client = paho.Client(CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
    client.connect_timeout = PATIENCE
    if broker.user:
        client.username_pw_set(broker.user, broker.password or None)
    if broker.scheme == "mqtts":
        client.tls_set()
    client.will_set(f"{broker.prefix}/sender", msgspec.json.encode(LOST), qos=1, retain=True)
    answered, answer = threading.Event(), list[Any]()

    def on_connect(_client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        answer.append(reason)
        answered.set()

    client.on_connect = on_connect
    try:
        client.connect(broker.host, broker.port, KEEP_ALIVE)
    except (OSError, ValueError) as error:
        raise DataError(f"{broker.address}: cannot be reached ({error})") from error
    client.loop_start()
    if not answered.wait(PATIENCE) or answer[0].is_failure:
        client.loop_stop()
        why = f"refuses ({answer[0]}); see user and password" if answer else f"does not answer within {PATIENCE:g} s"
        raise DataError(f"{broker.address}: {why}")
    return client


def send(broker: Broker, messages: Mapping[str, bytes]) -> None:
    """Put messages, by topic, where they stay; DataError with the reason where not all were acknowledged in time."""
    client = connect(broker)
    try:
        sent = [client.publish(topic, content, qos=1, retain=True) for topic, content in messages.items()]
        sent.append(client.publish(f"{broker.prefix}/sender", msgspec.json.encode(DONE), qos=1, retain=True))
        end = time.monotonic() + PATIENCE
        for message in sent:
            message.wait_for_publish(max(end - time.monotonic(), 0.0))
        if not all(message.is_published() for message in sent):
            raise DataError(f"{broker.address}: has not acknowledged within {PATIENCE:g} s")
        client.disconnect()
    except (RuntimeError, ValueError) as error:  # paho: the connection is gone, the queue is full
        raise DataError(f"{broker.address}: {error}") from error
    finally:
        client.loop_stop()
