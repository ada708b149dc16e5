"""All machines of a folder in a list."""

from __future__ import annotations

import csv
import io
import json
import shutil
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from lobewatch.cli import app
from tests.lobewatch.commands.invoke import invoke

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


def run(*arguments: object) -> Result:
    return invoke(["status", *map(str, arguments)])


@pytest.fixture
def mills(shop: Shop, tmp_path: Path) -> Path:
    """Make a good machine, a worn one, one never tapped, and one with a broken machine.toml."""
    shop.put("")
    new, worn, good, bad = (tmp_path / "mills" / name for name in ("new", "worn", "good", "bad"))
    shutil.copytree(shop.path, new)
    shutil.copytree(shop.path, bad)
    (bad / "machine.toml").write_text("x", "utf-8")
    shop.tap_both(0.0)
    shutil.copytree(shop.path, worn)
    days = (datetime.now(UTC) - shop.start) / timedelta(days=1)
    shop.tap_both(days - 0.2)
    shutil.copytree(shop.path, good)
    shop.path = worn
    shop.tap_both(days - 0.3, 0.88)
    return tmp_path / "mills"


def test_what_cannot_be_evaluated_is_first_then_the_worst_and_an_alarm_ends_with_1(mills: Path) -> None:
    told = run(mills, "--json")
    found = json.loads(told.stdout)["machines"]
    assert told.exit_code == 1
    assert [(one["key"], one["light"]) for one in found] == [
        ("bad", "unknown"),
        ("worn", "alarm"),
        ("new", "unknown"),
        ("good", "good"),
    ]
    assert found[1]["fall"] == pytest.approx(12.0, abs=0.01)
    text = run(mills).stdout
    assert "4 machines: 1 alarm, 2 unknown, 1 good" in text
    assert text.index("bad") < text.index("worn") < text.index("new") < text.index("good ")


def test_without_an_alarm_it_ends_with_0_but_not_where_a_machine_cannot_be_evaluated(mills: Path) -> None:
    assert [run(mills / name).exit_code for name in ("good", "new", "bad")] == [0, 0, 1]


def test_due_shows_those_to_be_tapped_alone(mills: Path) -> None:
    rows = [*csv.DictReader(io.StringIO(run(mills, "--due", "--csv").stdout))]
    assert [row["key"] for row in rows] == ["bad", "new"]
    (mills / "good" / "machine.toml").write_text(
        (mills / "good" / "machine.toml")
        .read_text("utf-8")
        .replace("# tap_interval_days = 30", "tap_interval_days = 0.1"),
        "utf-8",
    )
    assert "good" in run(mills, "--due").stdout


def test_a_folder_without_machines_is_rejected(tmp_path: Path) -> None:
    told = CliRunner().invoke(app, ["status", str(tmp_path)])
    assert str(tmp_path) in str(told.exception)
