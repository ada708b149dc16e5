"""standing.json: the same as the standing itself at any time, and made again where it does not fit."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import threading
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from lobewatch.cli import app
from lobewatch.fleet.fleet import Fleet
from lobewatch.fleet.machine_summary import SUMMARY_LIFETIME, read_summary
from lobewatch.fleet.summarize import summarize_machine
from lobewatch.logbook import Logbook
from lobewatch.machine import MachineFolder
from lobewatch.machine.verify_files import DAMAGE_CODES
from lobewatch.monitoring.status_rules import STATUS_BY_CODE

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


PROGRAM = """
[[program]]
name = "A"
tool = "reference"
teeth = 4
tool_diameter_mm = 20
radial_depth_mm = 20
direction = "down"
tangential_n_per_mm2 = 1400
radial_n_per_mm2 = 500
speed_rpm = 6500
depth_mm = 1.0
"""


def run(*arguments: object) -> None:
    assert CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=False).exit_code == 0


@pytest.fixture
def tapped(shop: Shop) -> Shop:
    """Fallen by 6 % in three tests of each direction; it runs no programs."""
    shop.put("")
    for days, share in ((0, 1.0), (30, 0.97), (60, 0.94)):
        shop.tap_both(days, share)
    return shop


def now(shop: Shop, days: float = 61.0) -> datetime:
    return shop.start + timedelta(days=days)  # type: ignore[no-any-return]


def kept(shop: Shop) -> bool:
    return read_summary(shop.path, now(shop)) is not None


def test_it_says_at_any_time_what_the_status_says(tapped: Shop) -> None:
    summarize_machine(tapped.logbook, now(tapped))
    summary = read_summary(tapped.path, now(tapped, 62.0))
    assert summary is not None
    for days in (61.0, 89.9, 90.2, 400.0, 3.0):
        told, expected = summary.status_at(now(tapped, days), tapped.path), tapped.logbook.status(now(tapped, days))
        assert (told.status, told.remarks, told.next_step) == (expected.status, expected.remarks, expected.next_step)
        assert told.days_left == pytest.approx(expected.days_left)
    assert {"overdue", "frequency-warn"} <= {
        one.code for one in summary.status_at(now(tapped, 91.0), tapped.path).remarks
    }
    worst = summary.series[0]
    assert worst.drop == pytest.approx(6.0, abs=0.01)
    assert [percent for _, percent in worst.points] == pytest.approx([0.0, -3.0, -6.0], abs=0.01)
    assert [(percent, reach.is_measured) for percent, reach in summary.limits] == [(5.0, True), (10.0, False)]


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("standing.json", '"make":4', '"make":2'),
        ("standing.json", '"fall":6', '"fall":0'),
        ("machine.toml", "steps = 200", "steps = 300"),
    ],
)
def test_what_does_not_fit_is_made_again(tapped: Shop, name: str, old: str, new: str) -> None:
    summarize_machine(tapped.logbook, now(tapped))
    text = (tapped.path / name).read_text("utf-8")
    assert old in text
    (tapped.path / name).write_text(text.replace(old, new), "utf-8")
    assert not kept(tapped)
    ((_, _, summary, dated),) = Fleet({"m": tapped.path}).assess_machines(now(tapped))
    assert summary.series[0].drop == pytest.approx(6.0, abs=0.01)
    assert dated.status == "warn"
    assert kept(tapped)


def test_torn_at_any_byte_it_is_made_again(tapped: Shop) -> None:
    summarize_machine(tapped.logbook, now(tapped))
    whole = (tapped.path / "standing.json").read_bytes()
    assert json.loads(whole)["summary"]["name"]
    for size in (0, 1, 16, 17, 18, 40, len(whole) // 2, len(whole) - 1):
        (tapped.path / "standing.json").write_bytes(whole[:size])
        assert not kept(tapped), size


def test_that_of_another_folder_or_another_week_does_not_count(tapped: Shop, tmp_path: Path) -> None:
    summarize_machine(tapped.logbook, now(tapped))
    shutil.copytree(tapped.path, tmp_path / "other")
    assert read_summary(tmp_path / "other", now(tapped)) is None
    assert kept(tapped)
    assert read_summary(tapped.path, now(tapped) + SUMMARY_LIFETIME) is None
    newest = tapped.path / "taps" / f"{tapped.logbook.newest_tap().id}.h5"
    newest.write_bytes(newest.read_bytes()[:-1])
    assert not kept(tapped)


def test_a_change_of_a_machine_leaves_its_status_next_to_it(shop: Shop) -> None:
    days = (datetime.now(shop.start.tzinfo) - shop.start) / timedelta(days=1)
    shop.put("")
    shop.tap_both(days - 2)
    taps = shop.logbook.taps
    for command in (
        ("event", shop.path, "oiled"),
        ("exclude", shop.path, taps[1].id, "--reason", "trial"),
        ("include", shop.path, taps[1].id),
        ("rebuild", shop.path),
        ("replay", shop.path, shop.path / "taps" / f"{taps[0].id}.h5", "--date", "2026-01-20", "--tool", "other"),
    ):
        (shop.path / "standing.json").unlink(missing_ok=True)
        run(*command)
        if command[0] != "replay":  # that one is stored already
            assert read_summary(shop.path, datetime.now(shop.start.tzinfo)) is not None, command


def test_a_machine_whose_lock_is_held_is_reported_without_a_file(tapped: Shop) -> None:
    with MachineFolder(tapped.path).locked():
        ((_, _, summary, _),) = Fleet({"m": tapped.path}).assess_machines(now(tapped))
    assert summary.newest_tap_id == tapped.logbook.newest_tap().id
    assert not (tapped.path / "standing.json").exists()


def test_fresh_statuses_are_reported_without_numbers_being_read(tapped: Shop) -> None:
    """Hundreds of machines within a second: nothing that is slow to import is needed."""
    summarize_machine(tapped.logbook)
    program = (
        "import sys; from lobewatch.cli import main; sys.argv = ['lobewatch', 'status', sys.argv[1], '--csv']\n"
        "try:\n main()\nfinally:\n sys.exit(int('numpy' in sys.modules or 'scipy' in sys.modules))"
    )
    told = subprocess.run([sys.executable, "-c", program, str(tapped.path)], check=False, capture_output=True)
    assert (told.returncode, b"m," in told.stdout) == (0, True)


def test_rows_of_fresh_statuses_are_exported_without_a_logbook(tapped: Shop, tmp_path: Path) -> None:
    summarize_machine(tapped.logbook)
    program = (
        "import sys; from lobewatch.cli import main; sys.argv = ['lobewatch', 'export', *sys.argv[1:]]\n"
        "try:\n main()\nfinally:\n sys.exit(int('lobewatch.logbook.logbook' in sys.modules))"
    )
    table = tmp_path / "fleet.csv"
    done = subprocess.run([sys.executable, "-c", program, str(tapped.path), str(table)], check=False)
    assert (done.returncode, len(table.read_text("utf-8").splitlines())) == (0, 7)


def test_the_verdict_on_programs_is_in_it(tapped: Shop) -> None:
    toml = (tapped.path / "machine.toml").read_text("utf-8")
    (tapped.path / "machine.toml").write_text(toml + PROGRAM, "utf-8")
    ((_, _, summary, dated),) = Fleet({"m": tapped.path}).assess_machines(now(tapped))
    assert "program-" in dated.remarks[0].code
    found = Logbook.open(tapped.path).status(now(tapped))
    assert (dated.status, dated.remarks) == (found.status, found.remarks)
    stored = tapped.logbook.history.rows[-1].verdicts or {}
    assert summary.programs == {name: one.stability for name, one in stored.items()}


def test_every_byte_is_inspected_again_every_six_hours(tapped: Shop) -> None:
    waits = list[float]()

    class Third(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            waits.append(timeout or 0.0)
            return len(waits) == 3

    Fleet({"m": tapped.path}).verify_until(Third())
    assert waits == [6 * 3600.0] * 3


def test_a_recording_of_a_cut_that_is_in_no_journal_costs_its_machine_its_status_and_nobody_the_list(
    tapped: Shop,
) -> None:
    (tapped.path / "cuts").mkdir()
    (tapped.path / "cuts" / "c9.h5").write_bytes(b"of nobody")
    plant = Fleet({"m": tapped.path})
    plant.assess_machines(now(tapped))

    class Once(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:  # noqa: ARG002
            return True

    plant.verify_until(Once())
    ((_, _, _, dated),) = plant.assess_machines(now(tapped))
    assert "cut-unlisted" in [remark.code for remark in dated.remarks]
    assert {*DAMAGE_CODES} <= STATUS_BY_CODE.keys()
