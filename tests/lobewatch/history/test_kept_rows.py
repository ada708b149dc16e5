"""History of an older version: computed again, or kept with a remark."""

from __future__ import annotations

import csv
import io
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from acquisition import TapTest
from lobewatch.cli import app
from lobewatch.history import History
from lobewatch.measurement import Measurement, measure
from lobewatch.measurement.software import CURRENT_SOFTWARE

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
OLDER = "lobewatch 0.0.1"


@pytest.fixture
def tapped(shop: Shop, monkeypatch: pytest.MonkeyPatch) -> Shop:
    """Three tap tests without programs, and their history by an older version, every frequency a hundred too high."""
    shop.put("")
    for month in range(3):
        shop.tap(30 * month, 1713.0 - month)

    def otherwise(tap: TapTest, *others: Any) -> Measurement:
        found = measure(tap, *others)
        assert found.followed is not None
        return replace(found, followed=found.followed.scaled(1 + 100 / found.followed.frequency, 1.0, "older"))

    with monkeypatch.context() as patch:
        patch.setattr("lobewatch.history.history.CURRENT_SOFTWARE", CURRENT_SOFTWARE._replace(lobewatch="0.0.1"))
        patch.setattr("lobewatch.history.tap_measurements.measure", otherwise)
        assert frequencies(shop.logbook.history) == [1813, 1812, 1811]
    return shop


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=False)


def frequencies(history: History) -> list[int]:
    return [round(row.frequency.value) for row in history.rows]


def refuse(monkeypatch: pytest.MonkeyPatch, tap_id: str) -> None:
    """Have the analysis fail at a tap test."""

    def refusing(tap: TapTest, *others: Any) -> Measurement:
        if tap.id == tap_id:
            raise ArithmeticError("no convergence")
        return measure(tap, *others)

    monkeypatch.setattr("lobewatch.history.tap_measurements.measure", refusing)


def file_of(shop: Shop, number: int) -> Path:
    path: Path = shop.path / shop.folder.taps()[number].file
    return path


def test_all_is_computed_again(tapped: Shop) -> None:
    history = tapped.logbook.history
    assert frequencies(history) == [1713, 1712, 1711]
    assert (history.kept, tapped.logbook.remarks) == ((), [])
    assert OLDER.encode() not in tapped.folder.history_path.read_bytes()


def test_what_the_analysis_rejects_keeps_its_row_and_counts(tapped: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    tap_id = tapped.folder.taps()[1].id
    refuse(monkeypatch, tap_id)
    for _ in range(2):
        logbook = tapped.logbook
        assert frequencies(logbook.history) == [1713, 1812, 1711]
        (remark,) = logbook.remarks
        assert (remark.code, remark.about) == ("row-of-older-version", f"tap test {tap_id}")
        assert OLDER in remark.text
        assert "no convergence" in remark.text
        assert len({row.series for row in logbook.history.rows}) == 1


def test_without_an_older_row_the_refusal_is_an_error(tapped: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    tapped.folder.history_path.unlink()
    refuse(monkeypatch, tapped.folder.taps()[1].id)
    with pytest.raises(ArithmeticError, match="no convergence"):
        _ = tapped.logbook.history


@pytest.mark.parametrize("missing", [True, False])
def test_what_has_lost_its_file_is_listed_and_counts_for_nothing(tapped: Shop, missing: bool) -> None:
    bad = file_of(tapped, 1)
    content = bad.read_bytes()
    if missing:
        bad.unlink()
    else:
        bad.write_bytes(content[:-100])
    for _ in range(2):
        history = tapped.logbook.history
        assert frequencies(history) == [1713, 1711]
        assert [round(row.frequency.value) for row in history.kept] == [1812]
    said = run("history", tapped.path, "--csv")
    assert [row["kind"] for row in csv.DictReader(io.StringIO(said.stdout))] == ["tap", "kept", "tap"]
    assert re.search(rf"note: taps/{bad.name}: .*{re.escape(OLDER)}", said.stderr)
    (kept,) = json.loads(run("history", tapped.path, "--json").stdout)["kept"]
    assert kept["software"] == OLDER
    bad.write_bytes(content)
    history = tapped.logbook.history
    assert frequencies(history) == [1713, 1712, 1711]
    assert history.kept == ()
