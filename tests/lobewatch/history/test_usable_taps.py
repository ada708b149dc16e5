"""One bad tap test does not block a machine: results from the rest, with a remark and their exit code."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from lobewatch.cli import app
from lobewatch.fleet.fleet import Fleet
from lobewatch.logbook import Logbook
from lobewatch.show.fleet.fleet_status import fleet_rows
from lobewatch.show.report.report import render_report
from lobewatch.tap.session import build_outcome
from lobewatch.verdicts import Stability

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=False)


@pytest.fixture
def tapped(shop: Shop) -> Shop:
    """Two tap tests in x and y each, and one program."""
    shop.run(("A", 12900, 1.0))
    shop.tap_both()
    shop.tap_both(30)
    return shop


def file_of(shop: Shop, number: int) -> Path:
    path: Path = shop.path / shop.logbook.taps[number].file
    return path


def test_an_old_one_is_left_out_and_reported(tapped: Shop) -> None:
    sound = json.loads(run("check", tapped.path, "--json").stdout)["programs"]
    bad = file_of(tapped, 0)
    flip(bad)
    said = run("check", tapped.path)
    assert said.exit_code == 0
    assert f"note: taps/{bad.name}: " in said.stdout
    logbook = Logbook.open(tapped.path)
    assert [row.tap_id for row in logbook.history.rows] == [tap.id for tap in logbook.taps]
    assert len(logbook.taps) == 3
    (program,) = logbook.verdicts()
    assert program.limit * 1e3 == pytest.approx(sound[0]["limit_mm"])
    assert bad.name in render_report(logbook, "reference", "x")
    (row,) = fleet_rows(Fleet({"m": tapped.path}).assess_machines())
    assert bad.name in row["note"]
    outcome = build_outcome(logbook, logbook.measurement(logbook.taps[-1].id))
    assert sum(bad.name in text for text in outcome.texts) == 1


def test_without_the_newest_nothing_is_stable_until_it_is_tapped_again(tapped: Shop) -> None:
    older = file_of(tapped, -2)
    content = older.read_bytes()
    flip(older)
    assert [one.stability for one in tapped.logbook.verdicts()] == [Stability.DOUBTFUL]
    older.write_bytes(content)
    bad = file_of(tapped, -1)
    assert run("check", tapped.path).exit_code == 0
    content = bad.read_bytes()
    flip(bad)
    said = run("check", tapped.path)
    assert said.exit_code == 1
    (remark,) = (one for one in tapped.logbook.verdicts()[0].remarks if one.code == "newest-damaged")
    assert " ".join(str(remark).split()) in " ".join(said.stdout.split())
    logbook = tapped.logbook
    assert [one.stability for one in logbook.verdicts()] == [Stability.DOUBTFUL]
    assert [one.stability for one in logbook.stored_verdicts(logbook.taps[-1].id).values()] == [Stability.DOUBTFUL]
    bad.write_bytes(content)
    assert [one.stability for one in tapped.logbook.verdicts()] == [Stability.STABLE]
    flip(bad)
    tapped.tap(60, 1690.0, "y")
    assert run("check", tapped.path).exit_code == 0


def test_one_that_is_found_damaged_late_is_left_out_too(tapped: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    tapped.logbook.status()
    monkeypatch.setattr("lobewatch.machine.folder.MAX_HASHED_BYTES", 0)
    bad = file_of(tapped, -1)
    flip(bad)
    logbook = tapped.logbook
    assert [one.stability for one in logbook.verdicts()] == [Stability.DOUBTFUL]
    assert [remark.about for remark in logbook.remarks if remark.code == "tap-damaged"] == [f"taps/{bad.name}"]


def test_where_none_is_left_that_is_reported(tapped: Shop) -> None:
    for path in (tapped.path / "taps").iterdir():
        path.unlink()
    said = CliRunner().invoke(app, ["check", str(tapped.path)])
    assert said.exit_code == 1
    assert "taps/" in said.output
    assert tapped.logbook.status().status == "unknown"


def test_a_damaged_journal_does_not_stop_reading(tapped: Shop) -> None:
    flip(tapped.path / "journal.jsonl")
    said = run("check", tapped.path)
    assert said.exit_code == 0
    assert "note: journal.jsonl: " in said.stdout
    assert "lobewatch rebuild" in said.stdout
    assert [one["code"] for one in json.loads(run("check", tapped.path, "--json").stdout)["remarks"]] == [
        "journal-damaged"
    ]
    assert len(tapped.logbook.taps) == 4
