"""lobewatch export: the tap tests of all machines as one table."""

from __future__ import annotations

import csv
import gzip
import json
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pytest
from typer.testing import CliRunner, Result

from acquisition import Conditions, DataError
from lobewatch.cli import app
from lobewatch.logbook import Logbook
from lobewatch.show.fleet.export_files import round_significant
from tests.lobewatch.commands.invoke import invoke

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


def run(*arguments: object) -> Result:
    return invoke(["export", *map(str, arguments)])


@pytest.fixture
def mills(shop: Shop, tmp_path: Path) -> Path:
    """Two machines alike, tapped in x and y, then in x with the temperature; one test of one of them is excluded."""
    shop.put("")
    shop.tap_both()
    shop.tap(30, 1700.0, conditions=Conditions(temperature_c=24.5, hours=5120.0))
    for name in ("a, b", "c"):
        shutil.copytree(shop.path, tmp_path / "mills" / name)
    taps = Logbook.open(tmp_path / "mills" / "c").taps
    CliRunner().invoke(app, ["exclude", str(tmp_path / "mills" / "c"), taps[1].id, "--reason", "trial"])
    return tmp_path / "mills"


def test_a_line_a_tap_test_that_counts_with_all_its_numbers(mills: Path) -> None:
    assert run(mills, mills / "fleet.csv").exit_code == 0
    rows = [*csv.DictReader((mills / "fleet.csv").read_text("utf-8").splitlines())]
    assert [(row["folder"], row["direction"], row["series"]) for row in rows] == [
        ("a, b", "x", "1"),
        ("a, b", "y", "2"),
        ("a, b", "x", "1"),
        ("c", "x", "1"),
        ("c", "x", "1"),
    ]
    assert [row["time"] for row in rows[:3]] == ["2026-01-15T09:00:00Z", "2026-01-15T11:24:00Z", "2026-02-14T09:00:00Z"]
    assert [row["temperature_c"] for row in rows[:3]] == ["", "", "24.5"]
    assert [row["hours"] for row in rows[:3]] == ["", "", "5120.0"]
    history = Logbook.open(mills / "a, b").history
    for told, row in zip(rows[:3], history.rows, strict=True):
        assert float(told["frequency_hz"]) == pytest.approx(row.frequency.value, rel=1e-6)
        assert float(told["damping_ratio"]) == pytest.approx(row.damping_ratio.value, rel=1e-6)
        assert float(told["stiffness_n_per_m"]) == pytest.approx(row.stiffness.value, rel=1e-6)
        assert float(told["bearing_stiffness_n_per_m"]) == pytest.approx(row.bearing_stiffness.value, rel=1e-6)
        assert told["tap_id"] == row.tap_id
        assert told["remarks"].split() == [*dict.fromkeys(one.code for one in row.remarks)]


def test_sqlite_has_the_same_in_a_view(mills: Path) -> None:
    run(mills, mills / "fleet.csv")
    told = json.loads(run(mills, mills / "fleet.sqlite", "--json").stdout)
    assert (told["tap_tests"], told["machines"], told["left_out"]) == (5, 2, {})
    with closing(sqlite3.connect(mills / "fleet.sqlite")) as base:
        base.row_factory = sqlite3.Row
        found = base.execute("SELECT * FROM taps ORDER BY folder, time").fetchall()
    rows = [*csv.DictReader((mills / "fleet.csv").read_text("utf-8").splitlines())]
    for line, row in zip(found, rows, strict=True):
        assert set(line.keys()) == row.keys()
        assert (line["folder"], line["tap_id"], line["time"], line["tool"]) == tuple(
            row[name] for name in ("folder", "tap_id", "time", "tool")
        )
        for name in ("frequency_hz", "stiffness_n_per_m", "modal_tip_stiffness_n_per_m"):
            assert line[name] == pytest.approx(float(row[name]), rel=1e-6)
        assert (line["temperature_c"] is None) == (row["temperature_c"] == "")


def test_packed_csv_is_the_same_csv(mills: Path) -> None:
    run(mills, mills / "fleet.csv")
    assert run(mills, mills / "fleet.csv.gz").exit_code == 0
    assert gzip.decompress((mills / "fleet.csv.gz").read_bytes()) == (mills / "fleet.csv").read_bytes()


def test_numbers_in_csv_have_the_digits_that_they_are_reported_to_have() -> None:
    random = np.random.default_rng(0)
    values = random.normal(size=(500, 2)) * 10.0 ** random.integers(-12, 14, (500, 2))
    told = round_significant(values, np.array([7, 3]))
    for digits, before, after in zip((7, 3), values.T, told.T, strict=True):
        assert after.tolist() == [float(f"{one:.{digits - 1}e}") for one in before.tolist()]
    special = round_significant(np.array([[0.0, np.nan]]), np.array([7, 3]))
    assert special[0, 0] == 0
    assert np.isnan(special[0, 1])


def test_parquet_is_read_by_duckdb(mills: Path) -> None:
    run(mills, mills / "fleet.parquet")
    with closing(duckdb.connect()) as base:
        query = (
            f"SELECT folder, count(*), max(frequency_hz), max(time) FROM '{mills}/fleet.parquet' GROUP BY 1 ORDER BY 1"
        )
        (first, second) = base.sql(query).fetchall()
    assert (first[:2], second[:2]) == (("a, b", 3), ("c", 2))
    assert first[2] == pytest.approx(1713.0, abs=0.01)
    assert f"{first[3]:%Y-%m-%d %H:%M}" == "2026-02-14 09:00"


@pytest.mark.parametrize("kind", ["csv", "csv.gz", "sqlite", "parquet"])
def test_the_same_again_gives_the_same_bytes(mills: Path, kind: str) -> None:
    run(mills, mills / f"one.{kind}")
    run(mills, mills / f"two.{kind}")
    assert (mills / f"one.{kind}").read_bytes() == (mills / f"two.{kind}").read_bytes()


def test_a_damaged_machine_costs_only_its_own_lines(mills: Path) -> None:
    run(mills, mills / "fleet.csv")
    (mills / "a, b" / "machine.toml").write_text("x", "utf-8")
    told = run(mills, mills / "fleet.csv", "--json")
    assert told.exit_code == 2
    assert "machine.toml" in json.loads(told.stdout)["left_out"]["a, b"]
    assert len((mills / "fleet.csv").read_text("utf-8").splitlines()) == 1 + 2


@pytest.mark.parametrize("kind", ["csv", "sqlite", "parquet"])
def test_a_machine_that_was_never_tapped_has_no_line(mills: Path, shop: Shop, kind: str) -> None:
    type(shop)(mills / "new")
    for again in (False, True):  # from its files, then from its standing
        told = json.loads(run(mills, mills / f"fleet.{kind}", "--json").stdout)
        assert (told["tap_tests"], told["machines"]) == (5, 3), again
    told = json.loads(run(mills / "new", mills / f"none.{kind}", "--json").stdout)
    assert (told["tap_tests"], told["machines"]) == (0, 1)


def test_another_ending_is_rejected_and_nothing_is_left(mills: Path) -> None:
    with pytest.raises(DataError, match=r"\.xlsx.*\.sqlite, \.csv, \.csv\.gz, \.parquet"):
        run(mills, mills / "fleet.xlsx")
    assert {path.name for path in mills.iterdir()} == {"a, b", "c"}
