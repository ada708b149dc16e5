"""Stick-out and state divide tap tests into series; unknown values do not divide."""

from __future__ import annotations

import csv
import io
import json
import re
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from acquisition import Conditions, DataError, read_tap
from lobewatch.cli import app
from lobewatch.history import HistoryRow
from lobewatch.logbook import Logbook

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
WARM = Conditions(stick_out_mm=80.0, state="warm")


@pytest.fixture
def shop(shop: Shop) -> Shop:
    """Without programs, which take their time."""
    shop.put("")
    return shop


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=False)


def rows_of(shop: Shop, *conditions: Conditions) -> tuple[HistoryRow, ...]:
    """Return the history of a spindle whose frequency drops by 12 % at each test."""
    for number, stated in enumerate(conditions):
        shop.tap(30 * number, 2100.0 * 0.88**number, conditions=stated)
    rows: tuple[HistoryRow, ...] = shop.logbook.history.rows
    return rows


def series_of(rows: tuple[HistoryRow, ...]) -> list[int]:
    """Return the number of the first test of the series of each row."""
    ids = [row.tap_id for row in rows]
    return [ids.index(row.series) for row in rows]


def codes(row: HistoryRow) -> set[str]:
    return {remark.code for remark in row.remarks} & {"new-series", "earlier-series", "drawbar-changed"}


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (Conditions(stick_out_mm=95.0, state="warm"), ("stick-out", "95 mm", "80 mm")),
        (Conditions(stick_out_mm=80.0, state="cold"), ("state", "'cold'", "'warm'")),
    ],
)
def test_another_stick_out_or_state_begins_a_new_series(shop: Shop, changed: Conditions, said: tuple[str, ...]) -> None:
    first, _, last = rows = rows_of(shop, WARM, WARM, changed)
    assert series_of(rows) == [0, 0, 2]
    assert codes(first) == set()
    (remark,) = [remark for remark in last.remarks if remark.code == "new-series"]
    assert all(fact in remark.text for fact in said)
    assert not last.questions
    standing = shop.logbook.status(shop.start + timedelta(days=61))
    assert [series.is_baseline for series in standing.series] == [True]
    assert "frequency-alarm" not in [remark.code for remark in standing.remarks]


def test_a_series_that_is_not_divided_alarms(shop: Shop) -> None:
    rows_of(shop, WARM, WARM)
    assert shop.logbook.status(shop.start + timedelta(days=31)).status == "alarm"


def test_what_is_unknown_divides_nothing(shop: Shop) -> None:
    stick_out = Conditions(stick_out_mm=80.0)
    rows = rows_of(shop, Conditions(), stick_out, Conditions(), Conditions(state="warm"), WARM)
    assert series_of(rows) == [0] * 5
    assert [codes(row) for row in rows] == [set()] * 5


def test_a_test_that_says_nothing_belongs_to_the_newest_series(shop: Shop) -> None:
    long = Conditions(stick_out_mm=95.0)
    assert series_of(rows_of(shop, Conditions(), WARM, long, Conditions())) == [0, 0, 2, 2]


def test_an_earlier_series_goes_on(shop: Shop) -> None:
    cold = Conditions(stick_out_mm=80.0, state="cold")
    rows = rows_of(shop, WARM, cold, WARM, cold)
    assert series_of(rows) == [0, 1, 0, 1]
    assert [codes(row) for row in rows[1:]] == [{"new-series"}, {"earlier-series"}, {"earlier-series"}]
    (series,) = shop.logbook.status(shop.start + timedelta(days=91)).series
    assert series.drop.value == pytest.approx(100 * (1 - 0.88**2), abs=0.1)


def test_directions_of_two_series_are_no_assembly(shop: Shop) -> None:
    shop.tap(0, 1713.0, conditions=WARM)
    shop.tap(0.1, 1690.0, "y", conditions=WARM)
    assert shop.logbook.assembly().directions == ("x", "y")
    shop.tap(1, 1500.0, conditions=Conditions(stick_out_mm=95.0))
    assert shop.logbook.assembly().directions == ("x",)


def test_another_tool_has_series_of_its_own(shop: Shop) -> None:
    shop.tap(0, 1713.0, conditions=WARM)
    shop.tap(1, 1500.0, tool="other", conditions=Conditions(stick_out_mm=95.0))
    shop.tap(2, 1713.0, conditions=WARM)
    assert series_of(shop.logbook.history.rows) == [0, 1, 0]


def test_another_drawbar_force_is_remarked_only(shop: Shop) -> None:
    force = [Conditions(drawbar_kn=kn) for kn in (18.0, 18.0, 15.0, 15.0)]
    rows = rows_of(shop, *force[:1], Conditions(), *force[1:])
    assert series_of(rows) == [0] * 5
    assert [codes(row) for row in rows] == [set(), set(), set(), {"drawbar-changed"}, set()]
    (remark,) = [remark for remark in rows[3].remarks if remark.code == "drawbar-changed"]
    assert all(fact in remark.text for fact in ("15 kN", "18 kN"))


def test_conditions_of_command_and_machine_file_reach_file_journal_and_history(shop: Shop, beam: Path) -> None:
    shop.edit("[tap]\n", '[tap]\nstick_out_mm = 80\ndrawbar_kn = 18\nstate = "warm"\n')
    options = ("--temperature", "24.5", "--note", "after a crash", "--reclamped")
    result = run("replay", shop.path, beam, *options, "--json")
    wanted = Conditions(24.5, 80.0, 18.0, "warm", True, "after a crash")
    assert json.loads(result.stdout)["measurements"][0]["conditions"] == wanted.specified
    (entry,) = shop.folder.taps()
    assert shop.folder.read(entry).circumstances.conditions == entry.conditions == wanted
    for _ in range(2):
        (row,) = Logbook.open(shop.path).history.rows
        assert row.conditions == wanted
    (row,) = json.loads(run("history", shop.path, "--json").stdout)["taps"]
    assert (row["conditions"], row["series"]) == (wanted.specified, entry.id)
    (line,) = csv.DictReader(io.StringIO(run("history", shop.path, "--csv").stdout))
    assert (line["temperature_c"], line["state"], line["note"]) == ("24.5", "warm", "after a crash")
    text = run("history", shop.path).stdout
    assert all(fact in text for fact in ("24.5 °C", "80 mm", "18 kN", "warm", "after a crash"))


def test_the_stick_out_is_that_of_one_tool_and_a_tap_file_says_its_own(shop: Shop, beam: Path, tmp_path: Path) -> None:
    run("replay", shop.path, beam, "--temperature", "24.5")
    shop.edit("[tap]\n", "[tap]\nstick_out_mm = 80\ndrawbar_kn = 18\n")
    (file,) = (shop.path / "taps").iterdir()
    copy = tmp_path / "copy.h5"
    copy.write_bytes(file.read_bytes())
    (entry,) = shop.folder.taps()
    shop.folder.journal.path.unlink()
    shop.folder.journal.copy_path.unlink()
    file.unlink()
    run("replay", shop.path, copy, "--date", "2026-02-01", "--note", "x")
    (again,) = shop.folder.taps()
    assert again.conditions == Conditions(temperature_c=24.5, note="x")
    assert entry.conditions == Conditions(temperature_c=24.5)
    assert shop.folder.machine.tap.conditions("other tool") == Conditions(drawbar_kn=18.0)


def test_of_a_file_of_version_1_nothing_is_known() -> None:
    for file in (Path(__file__).parents[2] / "data" / "version_1" / "machine" / "taps").iterdir():
        assert read_tap(file).circumstances.conditions.specified == {}


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("stick_out_mm = -3", r"machine.toml: tap: stick_out_mm=-3 .*0\.1 to 5000"),
        ("drawbar_kn = 0", r"machine.toml: tap: drawbar_kn=0 .*0\.1 to 1000"),
        ("stick_out_mm = nan", "machine.toml: tap: stick_out_mm=nan "),
        ("state = 3", "machine.toml: tap state: .*whole number"),
        ('stick_out_mm = "80"', "machine.toml: tap stick_out_mm: .*a text"),
        ('state = "a\\u001b"', "machine.toml: tap: state='a.*control"),
    ],
)
def test_a_machine_file_with_other_values_is_rejected_in_a_sentence(shop: Shop, line: str, message: str) -> None:
    shop.edit("[tap]\n", f"[tap]\n{line}\n")
    with pytest.raises(DataError, match=message):
        run("history", shop.path)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--temperature", "500"), "temperature_c=500 .*-40 to 150"),
        (("--temperature", "nan"), "temperature_c=nan "),
        (("--note", "a\x1b"), "note='a.*control"),
    ],
)
@pytest.mark.parametrize("command", ["tap", "replay"])
def test_other_conditions_are_rejected_before_anything_is_done(
    shop: Shop, beam: Path, command: str, options: tuple[str, ...], message: str
) -> None:
    source = ("--port", "x") if command == "tap" else (beam,)
    with pytest.raises(ValueError, match=message):
        run(command, shop.path, *source, *options)
    assert shop.folder.taps() == []


def test_one_clear_error_and_exit_code_2(shop: Shop, beam: Path) -> None:
    shop.edit("[tap]\n", "[tap]\nstick_out_mm = -3\n")
    result = CliRunner().invoke(app, ["replay", str(shop.path), str(beam), "--temperature", "warm"])
    assert result.exit_code == 2
    assert re.search("Invalid value for '--temperature'", result.output)
