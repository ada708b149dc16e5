"""Modes that a person adds, leaves out or holds: of a file only shown, of a tap test kept."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from acquisition import Circumstances, Remark, TapTest, from_accelerance, new_tap_id
from lobewatch.cli import app
from lobewatch.show.modes import sort_modes
from lobewatch.show.terminal.option_names import with_option_names
from modal import Mode, Trust, assess_trust, synthesize_frf

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
LINES = np.arange(4.0, 4000.0, 4.0)
MODES = [Mode(900.0, 0.03, 9e7), Mode(1713.0, 0.03, 3.5e7), Mode(2500.0, 0.02, 2e8)]


@pytest.fixture
def shop(shop: Shop) -> Shop:
    """Without programs, which take their time."""
    shop.put("")
    return shop


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [*map(str, arguments)])


def frequencies(shop: Shop) -> list[float]:
    """Modes of the newest tap test, whatever is kept of them."""
    logbook = shop.logbook
    return [round(mode.frequency) for mode in logbook.measurement(logbook.taps[-1].id).modes]


def tapped(shop: Shop) -> str:
    """Store a tap test with three modes, and return its identity."""
    about = Circumstances("m", shop.start, "reference", "x", "", shop.folder.toml_text)
    tap = TapTest(new_tap_id(about), about, from_accelerance(LINES, synthesize_frf(MODES, LINES).accelerance))
    shop.folder.commit(tap)
    return tap.id


@pytest.fixture
def file(tmp_path: Path) -> Path:
    values = synthesize_frf(MODES, LINES).receptance * 1e6
    rows = "".join(f"{f:.6g},{v.real:.9e},{v.imag:.9e}\n" for f, v in zip(LINES, values, strict=True))
    path = tmp_path / "frf.csv"
    path.write_text(f"Freq (Hz),Real (um/N),Imag (um/N)\n{rows}", encoding="utf-8")
    return path


def test_of_a_file_they_are_shown_and_nothing_else(file: Path) -> None:
    said = run("modes", file, "--drop", "2500", "--fix", "1713:0.031", "--json")
    shown = json.loads(said.stdout)
    assert [round(mode["frequency_hz"]) for mode in shown["modes"]] == [900, 1713]
    assert shown["modes"][1]["damping_ratio"] == 0.031
    assert shown["by_hand"] == {"add": [], "drop": [2500.0], "fix": [[1713.0, 0.031]]}
    text = run("modes", file, "--drop", "2500", "--fix", "1713:0.031").stdout
    assert "drop 2500, fix 1713:0.031: " in text
    assert text.count("1713 Hz: ") >= 1


def test_a_mode_by_hand_is_shown_though_it_is_rejected() -> None:
    mode = Mode(900.0, 0.5, 9e7, remarks=(Remark("by-hand", "900 Hz", "added by hand"),))
    assert assess_trust(mode) is Trust.REJECTED
    assert sort_modes([mode, Mode(1000.0, 0.5, 9e7)], rejected=False) == [mode]


def test_of_a_tap_test_they_are_kept_in_the_journal_and_hold_for_all_that_follows(shop: Shop) -> None:
    tap_id = tapped(shop)
    assert frequencies(shop) == [900, 1713, 2500]
    said = run("modes", shop.path, tap_id[:15], "--drop", "2500", "--fix", "1713:0.031")
    assert "drop 2500, fix 1713:0.031: " in said.stdout
    assert frequencies(shop) == [900, 1713]
    assert shop.logbook.history.rows[-1].damping_ratio == (0.031, 0.0)
    line = json.loads((shop.path / "journal.jsonl").read_text("utf-8").splitlines()[-1])
    named = {name: line[name] for name in ("kind", "tap", "add", "drop", "fix")}
    assert named == {"kind": "modes", "tap": tap_id, "add": [], "drop": [2500.0], "fix": [[1713.0, 0.031]]}
    assert "drop 2500" in run("modes", shop.path, tap_id).stdout
    remarks = shop.logbook.history.rows[-1].remarks
    assert ("modes-by-hand", "drop 2500, fix 1713:0.031") in [(remark.code, remark.about) for remark in remarks]


def test_the_newest_word_counts_and_can_be_withdrawn(shop: Shop) -> None:
    tap_id = tapped(shop)
    run("modes", shop.path, tap_id, "--drop", "1713")
    run("modes", shop.path, tap_id, "--drop", "900")
    assert frequencies(shop) == [1713, 2500]
    run("modes", shop.path, tap_id, "--by-fit")
    assert frequencies(shop) == [900, 1713, 2500]
    assert "drop 2500" not in run("modes", shop.path, tap_id).stdout


def test_they_outlast_rebuild_and_a_lost_history(shop: Shop) -> None:
    run("modes", shop.path, tapped(shop), "--drop", "1713", "--fix", "900:0.025")
    (shop.path / "history.rows").unlink()
    assert run("rebuild", shop.path).exit_code == 0
    assert run("verify", shop.path).exit_code == 0
    logbook = shop.logbook
    modes = logbook.measurement(logbook.taps[-1].id).modes
    assert [(round(mode.frequency), round(mode.damping_ratio, 3)) for mode in modes] == [(900, 0.025), (2500, 0.02)]


def test_rows_of_others_stay_as_they_are(shop: Shop) -> None:
    first = shop.tap(-1.0, 1713.0)
    run("history", shop.path)
    tap_id = tapped(shop)
    before = shop.logbook.history.rows
    run("modes", shop.path, tap_id, "--drop", "2500")
    after = shop.logbook.history.rows
    assert after[0].tap_id == first
    assert after[0].modes == before[0].modes
    assert len(after[1].modes) == len(before[1].modes) - 1


def test_replay_keeps_them_with_each_test(shop: Shop, file: Path) -> None:
    said = run("replay", shop.path, file, "--date", "2024-05-01", "--drop", "2500")
    assert said.exit_code == 0, said.output
    assert frequencies(shop) == [900, 1713]
    assert "drop 2500: " in said.output
    again = run("replay", shop.path, file, "--date", "2024-05-01", "--drop", "900")
    assert again.exit_code == 0
    assert frequencies(shop) == [1713, 2500]


def test_what_cannot_be_done_is_reported_and_nothing_is_kept(shop: Shop, file: Path) -> None:
    tap_id = tapped(shop)
    lines = (shop.path / "journal.jsonl").read_bytes()
    for options, words in (
        (("--drop", "1200"), ["drop 1200 Hz", "1 %", "900, 1713"]),
        (("--add", "9000"), ["add 9000 Hz", "4 to 3996 Hz"]),
        (("--add", "298,5"), ["--add 298,5", "298.5"]),
        (("--fix", "1500"), ["--fix 1500", "1500:0.03"]),
        (("--drop", "900", "--drop", "900"), ["900 Hz", "drop"]),
        (("--drop", "900", "--by-fit"), ["--by-fit", "--drop"]),
        (("--drop", "900", "--band", "10", "2000"), ["--band"]),
        (("--drop", "900", "--unit", "m/N"), ["--unit"]),
    ):
        said = run("modes", shop.path, tap_id, *options)
        assert [word for word in words if word not in with_option_names(str(said.exception))] == []
    assert (shop.path / "journal.jsonl").read_bytes() == lines
    assert "zz" in str(run("modes", shop.path, "zz", "--drop", "900").exception)
    assert "lobewatch modes MACHINE TAP" in str(run("modes", shop.path).exception)
    assert "--by-fit" in str(run("modes", file, "--by-fit").exception)
    dry = run("replay", shop.path, file, "--dry-run", "--date", "2024-05-01", "--drop", "900")
    assert "--dry-run" in str(dry.exception)


def test_a_replayed_file_that_it_cannot_be_done_of_is_stored_without(shop: Shop, file: Path) -> None:
    said = run("replay", shop.path, file, "--date", "2024-05-01", "--drop", "1200")
    assert "drop 1200" in str(said.exception)
    assert "1 %" in str(said.exception)
    assert frequencies(shop) == [900, 1713, 2500]
    assert "hand-not-applied" not in [remark.code for remark in shop.logbook.history.rows[-1].remarks]


def test_a_choice_that_no_longer_fits_is_reported_and_the_fit_counts(shop: Shop) -> None:
    tap_id = tapped(shop)
    line = {"kind": "modes", "tap": tap_id, "add": [], "drop": [1200.0], "fix": [], "time": "2026-01-15T09:00:00+00:00"}
    shop.folder.journal.append(line)
    assert frequencies(shop) == [900, 1713, 2500]
    assert "hand-not-applied" in [remark.code for remark in shop.logbook.history.rows[-1].remarks]
    assert len(shop.logbook.history.rows) == 1
