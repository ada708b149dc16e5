"""Defective machines: what remains readable, without effect on the other machines."""

from __future__ import annotations

import shutil
import urllib.request
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from acquisition import DataError
from lobewatch.cli import app
from lobewatch.fleet.fleet import Fleet, find_machines
from lobewatch.logbook import Logbook
from lobewatch.monitoring.status_rules import StatusLevel
from lobewatch.screen import DashboardServer

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


def codes(shop: Shop, days: float) -> set[str]:
    """Return the codes of the reasons at a time."""
    ((_, _, _, dated),) = Fleet({"m": shop.path}).assess_machines(shop.start + timedelta(days=days))
    return {one.code for one in dated.remarks}


@pytest.mark.parametrize("count", [1, 9])
def test_equal_frequencies_are_good_however_many(shop: Shop, count: int) -> None:
    shop.put("")
    for number in range(count):
        shop.tap(number, 1713.0)
    assert codes(shop, count) <= {"one-direction"}


@pytest.mark.quick
def test_an_event_before_the_first_tap_takes_nothing_away(shop: Shop) -> None:
    shop.put("")
    for number in range(2):
        shop.tap(number, 1713.0 * 0.88**number)
    assert "frequency-alarm" in codes(shop, 2)
    command = ["event", str(shop.path), "delivered", "--date", "2020-01-01", "--new-baseline"]
    assert CliRunner().invoke(app, command, catch_exceptions=False).exit_code == 0
    assert "frequency-alarm" in codes(shop, 2)


def test_one_damaged_machine_among_many_costs_its_own_line_alone(shop: Shop, tmp_path: Path) -> None:
    shop.put("")
    shop.tap_both()
    assert codes(shop, 1) == set()
    for number in range(30):
        shutil.copytree(shop.path, tmp_path / "mills" / f"{number:03d}")
    (tmp_path / "mills" / "017" / "machine.toml").write_bytes(b"\0" * 100)
    (tmp_path / "mills" / "021" / "standing.json").write_bytes(b"")
    (tmp_path / "mills" / "022" / "history.rows").write_bytes(b"x")
    found = Fleet(find_machines(tmp_path / "mills")).assess_machines(shop.start + timedelta(days=1))
    assert [one.key for one in found if one.current.status is not StatusLevel.GOOD] == ["017"]
    assert len(found) == 30


def test_a_folder_whose_name_is_no_text_is_rejected_and_costs_the_others_nothing(shop: Shop, tmp_path: Path) -> None:
    shop.put("")
    shop.tap_both()
    for name in ("good", "b\udcff"):
        shutil.copytree(shop.path, tmp_path / "mills" / name)
    with pytest.raises(DataError, match=r"b\\udcff: .*UTF-8"):
        Logbook.open(tmp_path / "mills" / "b\udcff")
    with DashboardServer(tmp_path / "mills") as server:
        for path in ("machines", "metrics"):
            headers = {"Authorization": f"Bearer {server.token}"}
            with urllib.request.urlopen(urllib.request.Request(f"{server.origin}/{path}", headers=headers)) as answer:
                told = answer.read().decode()
            assert "good" in told
            assert r"b\\udcff" in told
    found = Fleet(find_machines(tmp_path / "mills")).assess_machines()
    assert [(one.key, one.current.is_readable) for one in found] == [(r"b\udcff", False), ("good", True)]


def test_a_fleet_without_machines_is_rejected_and_one_in_itself_stands_once(shop: Shop, tmp_path: Path) -> None:
    mills = tmp_path / "mills"
    mills.mkdir()
    with pytest.raises(DataError, match=rf"{mills}.*make_machine_folder"):
        find_machines(mills)
    (mills / "again").symlink_to(mills)
    with pytest.raises(DataError, match="make_machine_folder"):
        find_machines(mills)
    shutil.copytree(shop.path, mills / "m")
    assert [*find_machines(mills)] == ["m"]
    assert [*find_machines(mills / "again")] == ["m"]
