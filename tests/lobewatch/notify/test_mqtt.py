"""Standings by MQTT, to a real broker: there, away, killed, refusing, silent."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from acquisition import DataError
from lobewatch.machine import MachineFolder
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.machine.settings.notify_table import parse_broker
from lobewatch.notify import mqtt
from tests.lobewatch.notify.conftest import Mosquitto, received, run

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


@pytest.fixture
def mill(shop: Shop, mosquitto: Mosquitto) -> Path:
    """Tapped two days ago, fallen by 12 %; it tells the broker."""
    shop.put("")
    days = (datetime.now(shop.start.tzinfo) - shop.start) / timedelta(days=1)
    shop.tap_both(days - 40)
    shop.tap_both(days - 2, 0.88)
    shop.edit("[limits]", f'[notify]\nmqtt = "{mosquitto.address}/hall/1"\n\n[limits]')
    return Path(shop.path)


def test_a_command_that_alters_a_machine_tells_how_it_stands(mill: Path, mosquitto: Mosquitto) -> None:
    mosquitto.start()
    assert run("event", mill, "oiled").exit_code == 0
    told = received(mosquitto, "hall/1/m/standing")
    assert (told.retain, told.qos) == (True, 1)
    found = json.loads(told.payload)
    assert (found["machine"], found["light"], found["is_overdue"]) == ("m", "alarm", False)
    assert found["fall_percent"] == pytest.approx(12.0, abs=0.05)
    assert found["reasons"][0]["code"] == "frequency-alarm"
    assert json.loads(received(mosquitto, "hall/1/sender").payload) == {"sender": "done"}
    assert not (mill / "unsent.json").exists()


def test_what_a_killed_broker_was_not_sent_goes_with_the_next_command(mill: Path, mosquitto: Mosquitto) -> None:
    shutil.copytree(mill, mill.parent / "n")
    mosquitto.start()
    assert run("event", mill, "oiled").exit_code == 0
    mosquitto.kill()
    begun = time.monotonic()
    told = run("exclude", mill, MachineFolder(mill).taps()[-1].id, "--reason", "another tool")
    assert told.exit_code == 0
    assert f"{mosquitto.address}: " in told.stderr
    assert time.monotonic() - begun < 90
    assert json.loads((mill / "unsent.json").read_text())["topic"] == "hall/1/m/standing"
    mosquitto.start()
    assert run("event", mill.parent / "n", "oiled").exit_code == 0
    assert json.loads(received(mosquitto, "hall/1/n/standing").payload)["folder"] == "n"
    assert json.loads(received(mosquitto, "hall/1/m/standing").payload)["folder"] == "m"
    assert not (mill / "unsent.json").exists()


def test_a_wrong_password_is_reported_and_fails_nothing(
    mill: Path, mosquitto: Mosquitto, monkeypatch: pytest.MonkeyPatch
) -> None:
    mosquitto.start("lobewatch", "right-one")
    toml = mill / "machine.toml"
    toml.write_text(toml.read_text("utf-8").replace("mqtt://", "mqtt://lobewatch@"), "utf-8")
    monkeypatch.setenv("LOBEWATCH_MQTT_HOST", "127.0.0.1")
    monkeypatch.setenv("LOBEWATCH_MQTT_PASSWORD", "wrong-one")
    told = run("event", mill, "oiled")
    assert (told.exit_code, "(Not authorized)" in told.stderr) == (0, True)
    assert "wrong-one" not in told.stderr + (mill / "unsent.json").read_text()
    monkeypatch.setenv("LOBEWATCH_MQTT_PASSWORD", "right-one")
    assert run("status", mill, "--notify").exit_code == 1  # it is on alarm
    known = {"username": "lobewatch", "password": "right-one"}
    assert json.loads(received(mosquitto, "hall/1/m/standing", auth=known).payload)["light"] == "alarm"


def test_a_sender_that_breaks_off_leaves_its_last_will(mosquitto: Mosquitto) -> None:
    mosquitto.start()
    program = (
        "import os, sys; from paho.mqtt.client import Client\n"
        "from lobewatch.machine.settings.notify_table import parse_broker\n"
        "from lobewatch.notify import mqtt\n"
        "Client.publish = lambda *_, **__: os._exit(1)\n"
        "mqtt.send_messages({parse_broker(sys.argv[1]): {}})"
    )
    subprocess.run([sys.executable, "-c", program, mosquitto.address], check=False)
    assert json.loads(received(mosquitto, "lobewatch/sender").payload) == {"sender": "lost"}
    assert mqtt.send_messages({parse_broker(mosquitto.address): {"lobewatch/a/standing": b"{}"}}) == {}
    assert json.loads(received(mosquitto, "lobewatch/sender").payload) == {"sender": "done"}


@pytest.mark.parametrize(
    "address", ["mqtt://", "http://host", "mqtt://host:99999", "mqtt://host/a/#", "host", "mqtt://me:secret@/x"]
)
@pytest.mark.quick
def test_what_is_no_address_is_rejected_without_telling_the_password(address: str) -> None:
    with pytest.raises(DataError, match="mqtt://HOST") as refused:
        parse_machine_file(f'[machine]\nname = "m"\n[notify]\nmqtt = "{address}"\n')
    assert "secret" not in str(refused.value)


@pytest.mark.quick
def test_user_password_port_and_prefix_are_in_the_address() -> None:
    found = parse_broker("mqtts://me:p%40ss@broker.example/hall/")
    assert found == ("mqtts", "broker.example", 8883, "me", "p@ss", "hall")
    assert "p@ss" not in found.address
