"""The password of the environment goes to the broker that the environment names, whomever a machine.toml names."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from lobewatch.machine.settings.notify_table import parse_broker
from tests.lobewatch.notify.conftest import machine, run
from tests.lobewatch.notify.fake_broker import CONNECT, FakeBroker, obey, refuse


@pytest.fixture(autouse=True)
def password(monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.delenv("LOBEWATCH_MQTT_HOST", raising=False)
    monkeypatch.setenv("LOBEWATCH_MQTT_PASSWORD", "plant-secret")
    return "plant-secret"


@pytest.mark.parametrize(
    ("named", "address"),
    [
        ("broker.example", "mqtt://me@broker.example"),
        ("broker.example", "mqtts://me@broker.example:9999/hall"),
        ("broker.example:1883", "mqtt://me@broker.example"),
        ("Broker.Example:8883", "mqtts://me@broker.EXAMPLE"),
        ("[fd00::1]:1883", "mqtt://me@[fd00::1]"),
    ],
)
def test_the_named_host_gets_the_password(
    monkeypatch: pytest.MonkeyPatch, password: str, named: str, address: str
) -> None:
    monkeypatch.setenv("LOBEWATCH_MQTT_HOST", named)
    assert (parse_broker(address).password, parse_broker(address).password_warning) == (password, "")


@pytest.mark.parametrize(
    ("named", "address", "place"),
    [
        ("", "mqtt://me@broker.example", "broker.example:1883"),
        ("broker.example", "mqtt://me@other.example", "other.example:1883"),
        ("broker.example", "mqtt://me@broker.example.evil", "broker.example.evil:1883"),
        ("broker.example", "mqtt://broker.example@evil", "evil:1883"),
        ("broker.example:8883", "mqtt://me@broker.example", "broker.example:1883"),
        ("broker.example:x", "mqtt://me@broker.example", "broker.example:1883"),
        ("mqtt://broker.example", "mqtt://me@broker.example", "broker.example:1883"),
        ("[", "mqtt://me@[fd00::1]", "[fd00::1]:1883"),
    ],
)
def test_no_other_host_gets_it_and_what_to_set_is_reported(
    monkeypatch: pytest.MonkeyPatch, named: str, address: str, place: str
) -> None:
    monkeypatch.setenv("LOBEWATCH_MQTT_HOST", named)
    assert parse_broker(address).password == ""
    warning = parse_broker(address).password_warning
    assert all(fact in warning for fact in ("LOBEWATCH_MQTT_PASSWORD", "LOBEWATCH_MQTT_HOST", named, place))


def test_nothing_is_withheld_where_no_password_is_wanted_or_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    assert parse_broker("mqtt://broker.example").password_warning == ""
    own = parse_broker("mqtt://me:own@broker.example")
    assert (own.password, own.password_warning) == ("own", "")
    monkeypatch.delenv("LOBEWATCH_MQTT_PASSWORD")
    assert parse_broker("mqtt://me@broker.example").password_warning == ""


@pytest.mark.parametrize("named", ["", "broker.example"])
def test_a_copied_machine_does_not_take_the_password_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, password: str, named: str
) -> None:
    monkeypatch.setenv("LOBEWATCH_MQTT_HOST", named)
    with FakeBroker(obey) as stranger:
        said = run("event", machine(tmp_path / "a", stranger.address.replace("//", "//me@")), "oiled")
        assert re.search(rf"{stranger.address}: .*LOBEWATCH_MQTT_PASSWORD.*{named}.*{stranger.place}", said.stderr)
    assert [password.encode() in content for kind, content in stranger.received if kind == CONNECT] == [False]
    with FakeBroker(refuse) as stranger:
        said = run("event", machine(tmp_path / "b", stranger.address.replace("//", "//me@")), "oiled")
        refusal = rf"{stranger.address}: .*Not authorized.*LOBEWATCH_MQTT_PASSWORD.*{named}.*{stranger.place}"
        assert re.search(refusal, said.stderr)
        assert said.stderr.count("LOBEWATCH_MQTT_PASSWORD") == 1


def test_the_named_broker_is_notified_with_the_password(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, password: str
) -> None:
    with FakeBroker(obey) as ours:
        monkeypatch.setenv("LOBEWATCH_MQTT_HOST", ours.place)
        assert run("event", machine(tmp_path / "a", ours.address.replace("//", "//me@")), "oiled").stderr == ""
    assert [password.encode() in content for kind, content in ours.received if kind == CONNECT] == [True]
