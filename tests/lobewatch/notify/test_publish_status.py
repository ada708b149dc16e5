"""Publishing on changes only, with failures included: a real broker, machines that break."""

from __future__ import annotations

import json
import shutil
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from tests.lobewatch.notify.conftest import Mosquitto, received, run

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


@pytest.fixture
def plant(shop: Shop, mosquitto: Mosquitto, tmp_path: Path) -> Path:
    """Two healthy machines, tapped two days ago, that tell the broker."""
    shop.put("")
    days = (datetime.now(shop.start.tzinfo) - shop.start) / timedelta(days=1)
    shop.tap_both(days - 2)
    shop.edit("[limits]", f'[notify]\nmqtt = "{mosquitto.address}"\n\n[limits]')
    for name in ("a", "b"):
        shutil.copytree(shop.path, tmp_path / "mills" / name)
    mosquitto.start()
    assert run("status", tmp_path / "mills", "--notify").exit_code == 0
    return tmp_path / "mills"


def standing(mosquitto: Mosquitto, key: str) -> dict[str, Any]:
    message: dict[str, Any] = json.loads(received(mosquitto, f"lobewatch/{key}/standing").payload)
    return message


def test_what_has_not_changed_is_reported_once_a_day(plant: Path, mosquitto: Mosquitto) -> None:
    first = standing(mosquitto, "a")
    assert (first["light"], first["alarms"]) == ("good", [])
    assert run("status", plant, "--notify").exit_code == 0
    assert standing(mosquitto, "a")["time"] == first["time"]
    told = json.loads((plant / "a" / "told.json").read_text())
    told["time"] = (datetime.fromisoformat(told["time"]) - timedelta(hours=24)).isoformat()
    (plant / "a" / "told.json").write_text(json.dumps(told))
    assert run("status", plant, "--notify").exit_code == 0
    assert standing(mosquitto, "a")["time"] > first["time"]
    assert standing(mosquitto, "b")["time"] == json.loads(received(mosquitto, "lobewatch/b/standing").payload)["time"]


@pytest.mark.parametrize("damage", ["torn", "missing"])
def test_a_machine_that_cannot_be_evaluated_is_reported_as_unknown(
    plant: Path, mosquitto: Mosquitto, damage: str
) -> None:
    toml = plant / "a" / "machine.toml"
    if damage == "torn":
        toml.write_text(toml.read_text("utf-8")[:-200] + "= torn", "utf-8")
    else:
        toml.unlink()
    said = run("status", plant, "--notify", "--json")
    assert said.exit_code == 1
    rows = json.loads(said.stdout)["machines"]
    assert [(row["key"], row["light"], row["can_be_judged"]) for row in rows] == [
        ("a", "unknown", False),
        ("b", "good", True),
    ]
    assert standing(mosquitto, "a")["light"] == "unknown"
    assert standing(mosquitto, "b")["light"] == "good"


def test_a_machine_that_is_gone_is_reported_as_unknown_until_it_is_forgotten(plant: Path, mosquitto: Mosquitto) -> None:
    with pytest.raises(ValueError, match=f"--forget a: .*{plant}"):
        run("status", plant, "--notify", "--forget", "a")
    shutil.rmtree(plant / "a")
    assert run("status", plant, "--notify").exit_code == 0
    gone = standing(mosquitto, "a")
    assert (gone["light"], "--forget a" in gone["reasons"][0]["text"]) == ("unknown", True)
    assert run("status", plant, "--notify", "--forget", "a").exit_code == 0
    left = received(mosquitto, ["lobewatch/+/standing", "lobewatch/sender"], msg_count=2)
    assert {message.topic for message in left} == {"lobewatch/b/standing", "lobewatch/sender"}
    assert standing(mosquitto, "b")["light"] == "good"
    with pytest.raises(ValueError, match=r"--forget a: .*none"):
        run("status", plant, "--notify", "--forget", "a")


def test_a_dead_broker_ends_with_2_after_all_else_is_done(plant: Path, mosquitto: Mosquitto, tmp_path: Path) -> None:
    mosquitto.kill()
    (plant / "a" / "told.json").unlink()
    (plant / ".lobewatch-told.json").unlink()
    said = run("status", plant, "--notify", "--prometheus", tmp_path / "all.prom")
    assert (said.exit_code, mosquitto.address in said.stderr) == (2, True)
    assert 'folder="b"' in (tmp_path / "all.prom").read_text()
    assert "2 machines: 2 good" in said.stdout


def test_no_password_is_kept(plant: Path) -> None:
    for path in (plant / ".lobewatch-told.json", plant / "a" / "told.json"):
        assert "password" not in path.read_text()
    with pytest.raises(ValueError, match="--notify"):
        run("status", plant, "--forget", "a")
