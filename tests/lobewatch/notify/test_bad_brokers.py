"""Faulty brokers: a command ends soon with one sentence for each, and keeps unsent messages."""

from __future__ import annotations

import json
import re
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lobewatch.machine.settings.notify_table import parse_broker
from lobewatch.notify import mqtt
from tests.lobewatch.notify.conftest import Mosquitto, machine, received, run, started
from tests.lobewatch.notify.fake_broker import (
    CONNECT,
    PUBLISH,
    TAKEN,
    FakeBroker,
    acknowledge_the_first,
    answer_byte_by_byte,
    babble,
    hang_up,
    hang_up_later,
    never_acknowledge,
    obey,
    refuse,
    say_nothing,
    say_nothing_more,
    talk_rubbish,
)

PATIENCE = 9.0
"""Time for a plant (s): enough for what a slow computer has to do in it, less than KEEP_ALIVE."""
LATE = f" within {PATIENCE:g} s"
BAD = {
    say_nothing: f"does not answer{LATE}",
    answer_byte_by_byte: f"does not answer{LATE}",
    say_nothing_more: f"has not acknowledged{LATE}",
    never_acknowledge: f"has not acknowledged{LATE}",
    acknowledge_the_first: f"has not acknowledged{LATE}",
    babble: f"has not acknowledged{LATE}",
    refuse: r".*\(Not authorized\)",
    hang_up: r"(cannot be reached|does not answer) \(.*\)",
    hang_up_later: r"has not acknowledged \(.*\)",
    talk_rubbish: r"does not answer \(.*\)",
}
"""Finding for each way to be bad."""


@pytest.fixture
def unaccepted() -> Iterator[str]:
    """Address where the system takes connections that no program ever takes from it."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"mqtt://127.0.0.1:{server.getsockname()[1]}"


@pytest.fixture
def unused() -> str:
    """Address without a listener."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return f"mqtt://127.0.0.1:{server.getsockname()[1]}"


def test_a_command_ends_though_the_broker_never_acknowledges(tmp_path: Path) -> None:
    with FakeBroker(never_acknowledge) as broker:
        mill = machine(tmp_path / "a", broker.address)
        said = started("event", mill, "oiled")
        assert said.returncode == 0
        assert said.stdout.startswith("saved ")
        assert f"{broker.address}: has not acknowledged within 4 s" in said.stderr
        assert json.loads((mill / "unsent.json").read_text())["topic"] == "lobewatch/a/standing"


def test_a_fleet_of_bad_brokers_is_notified_in_parallel_and_the_good_one_too(
    tmp_path: Path, unaccepted: str, unused: str, mosquitto: Mosquitto
) -> None:
    mosquitto.start()
    plant = tmp_path / "plant"
    machine(plant / "good", mosquitto.address)
    with ExitStack() as stack:
        sentences = {unaccepted: f"does not answer{LATE}", unused: r"cannot be reached \(.*refused\)"}
        sentences |= {stack.enter_context(FakeBroker(talk)).address: text for talk, text in BAD.items()}
        encrypted = [unaccepted, stack.enter_context(FakeBroker(talk_rubbish)).address]
        sentences |= {address.replace("mqtt", "mqtts"): rf"cannot be reached({LATE}| \(.*\))" for address in encrypted}
        mills = [machine(plant / f"m{number}", address) for number, address in enumerate(sentences)]
        said = started(
            "status", plant, "--notify", before=f"from lobewatch.notify import mqtt; mqtt.MQTT_TIMEOUT = {PATIENCE}"
        )
    assert said.returncode == 2  # everything else is done
    notes = [line for line in said.stderr.splitlines() if line.startswith("note: ")]
    assert len(notes) == len(sentences)
    for address, text in sentences.items():
        assert re.search(f"^note: .*{address}: {text}", said.stderr, re.MULTILINE)
    assert all((mill / "unsent.json").exists() for mill in mills)
    assert json.loads(received(mosquitto, "lobewatch/good/standing").payload)["machine"] == "good"


def test_no_broker_waits_for_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mqtt, "MQTT_TIMEOUT", 30.0)
    together = threading.Barrier(5)

    def wait_for_all(broker: FakeBroker, connection: socket.socket) -> None:
        together.wait(60)
        obey(broker, connection)

    with ExitStack() as stack:
        brokers = [stack.enter_context(FakeBroker(wait_for_all)) for _ in range(5)]
        for number, broker in enumerate(brokers):
            machine(tmp_path / "plant" / f"m{number}", broker.address)
        said = run("status", tmp_path / "plant", "--notify")
        assert "note: " not in said.stderr
        assert [sum(kind == PUBLISH for kind, _ in broker.received) for broker in brokers] == 5 * [2]


def test_a_name_that_is_looked_up_for_ever_keeps_no_command(tmp_path: Path) -> None:
    hang = "import socket, time\nsocket.getaddrinfo = lambda *_, **__: time.sleep(3600)"
    said = started("event", machine(tmp_path / "a", "mqtt://nowhere.example"), "oiled", before=hang)
    assert said.returncode == 0
    assert "mqtt://nowhere.example:1883: cannot be reached within 4 s" in said.stderr


def test_what_is_looked_up_too_late_is_not_sent_over_newer_messages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mqtt, "MQTT_TIMEOUT", 0.5)
    look_up, is_up = socket.getaddrinfo, threading.Event()

    def look_up_late(*arguments: Any, **more: Any) -> Any:
        is_up.wait()
        return look_up(*arguments, **more)

    monkeypatch.setattr(socket, "getaddrinfo", look_up_late)
    with FakeBroker(obey) as broker:
        target = parse_broker(broker.address)
        assert mqtt.send_messages({target: {"a": b"{}"}}) == {
            target: f"{broker.address}: cannot be reached within 0.5 s"
        }
        sending = next(thread for thread in threading.enumerate() if thread.name == f"to {broker.address}")
        is_up.set()
        sending.join()
    assert broker.received == []


def test_a_message_left_over_does_not_go_with_a_newer_one_of_its_machine(tmp_path: Path) -> None:
    with FakeBroker(obey) as broker:
        machine(tmp_path / "a", f"{broker.address}/one")
        later = machine(tmp_path / "b", f"{broker.address}/two")
        old = {"topic": "two/b/standing", "message": {}, "broker": parse_broker(broker.address)[:3]}
        (later / "unsent.json").write_text(json.dumps(old))
        assert "note: " not in run("status", tmp_path, "--notify").stderr
        assert sum(b"two/b/standing" in content for kind, content in broker.received if kind == PUBLISH) == 1
    assert not (later / "unsent.json").exists()


def test_a_message_that_the_broker_does_not_take_is_kept_and_the_others_arrive(
    tmp_path: Path, mosquitto: Mosquitto
) -> None:
    rights = tmp_path / "rights"
    rights.write_text("topic readwrite lobewatch/sender\ntopic readwrite lobewatch/b/#\n")
    mosquitto.start(more=[f"acl_file {rights}"])
    mills = [machine(tmp_path / "plant" / name, mosquitto.address) for name in "ab"]
    said = run("status", tmp_path / "plant", "--notify")
    assert "(Not authorized)" in said.stderr
    assert all((mill / "unsent.json").exists() for mill in mills)
    assert json.loads(received(mosquitto, "lobewatch/b/standing").payload)["machine"] == "b"
    assert json.loads(received(mosquitto, "lobewatch/sender").payload) == {"sender": "lost"}


class Parrot:
    """Send a fixed answer to each connection, then close it."""

    words = b""

    def __call__(self, broker: FakeBroker, connection: socket.socket) -> None:
        assert next(broker.packets(connection))[0] == CONNECT
        connection.sendall(self.words)


PACKETS = st.builds(
    lambda head, body: bytes([head, len(body)]) + body,
    st.sampled_from([0x20, 0x30, 0x32, 0x34, 0x40, 0x50, 0x62, 0x70, 0x90, 0xB0, 0xD0, 0xE0, 0xF0]),
    st.binary(max_size=20),
)
RUBBISH = st.one_of(st.binary(max_size=300), st.lists(PACKETS, max_size=6).map(b"".join))


@pytest.fixture(scope="module")
def parrot() -> Iterator[tuple[Parrot, FakeBroker]]:
    talk = Parrot()
    with FakeBroker(talk) as broker:
        yield talk, broker


def nothing_but_a_sentence(parrot: tuple[Parrot, FakeBroker], words: bytes, is_taken: bool) -> None:
    talk, broker = parrot
    talk.words = TAKEN * is_taken + words
    target = parse_broker(broker.address)
    assert mqtt.send_messages({target: {"a": b"{}", "b": b"{}"}})[target].startswith(f"{broker.address}: ")


@given(words=RUBBISH, is_taken=st.booleans())
@settings(max_examples=100, deadline=None)
def test_rubbish_is_one_sentence(parrot: tuple[Parrot, FakeBroker], words: bytes, is_taken: bool) -> None:
    nothing_but_a_sentence(parrot, words, is_taken)


@pytest.mark.long
@given(words=RUBBISH, is_taken=st.booleans())
@settings(max_examples=5_000, deadline=None)
def test_much_rubbish_is_one_sentence(parrot: tuple[Parrot, FakeBroker], words: bytes, is_taken: bool) -> None:
    nothing_but_a_sentence(parrot, words, is_taken)
