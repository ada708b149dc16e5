"""Recordings that are implausible for a machine: stored, questioned, never silently good, accepted by --accept."""

from __future__ import annotations

import json
import re
import shlex
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from lobewatch.cli import app
from lobewatch.logbook import Logbook
from lobewatch.monitoring import MachineStatus
from lobewatch.show.report.report import render_report
from lobewatch.show.terminal.option_names import with_option_names
from lobewatch.tap.session import build_outcome
from lobewatch.verdicts.verdict import Stability
from tests.lobewatch.commands.invoke import invoke

SPINDLE = "# The spindle of the example"
SAFE = """
[[program]]
name = "A"
teeth = 4
tool_diameter_mm = 20
radial_depth_mm = 20
direction = "down"
tangential_n_per_mm2 = 1400
radial_n_per_mm2 = 500
speed_rpm = 12900
depth_mm = 0.2

"""
Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


@pytest.fixture
def shop(shop: Shop) -> Shop:
    """Without programs, which take their time."""
    shop.put("")
    return shop


def run(*arguments: object) -> Result:
    return invoke([*map(str, arguments)])


def refused(*arguments: object) -> str:
    """Return the one sentence of an error."""
    with pytest.raises(ValueError, match="--accept") as said:
        run(*arguments)
    return str(said.value)


def standing(shop: Shop, days: float = 1.0) -> MachineStatus:
    found: MachineStatus = shop.logbook.status(shop.start + timedelta(days=days))
    return found


def codes(found: MachineStatus) -> list[str]:
    return [remark.code for remark in found.remarks]


def tap_file(shop: Shop, tap_id: str) -> Path:
    path: Path = shop.path / "taps" / f"{tap_id}.h5"
    return path


def newest(logbook: Logbook) -> str:
    return logbook.newest_tap().id


def words(shop: Shop) -> set[Stability]:
    return {found.stability for found in shop.logbook.verdicts()}


def test_a_beam_is_stored_and_never_the_baseline_of_a_mill(shop: Shop, beam: Path) -> None:
    shop.edit("band_hz = [1200, 2200]", "band_hz = [1200, 1800]")
    said = run("replay", shop.path, beam, "--date", "2026-01-10")
    assert said.exit_code == 0
    assert "(no-mode-in-band)" in said.output
    shop.edit(SPINDLE, SAFE + SPINDLE)
    shop.tap_both()
    found = standing(shop)
    assert (found.status, codes(found)) == ("warn", ["no-mode-in-band", "one-hit"])
    series = found.series_of("reference", "x")
    assert series is not None
    assert series.is_baseline
    assert words(shop) == {Stability.STABLE}


def test_a_beam_with_a_mode_in_the_band_is_never_silently_the_first_tap(shop: Shop, beam: Path) -> None:
    said = run("replay", shop.path, beam, "--date", "2026-01-10")
    assert all(fact in said.stdout for fact in ("(stiffness-off-model)", "305 N/um", " 8.5 ", "35.9 N/um"))
    shop.tap_both()
    found = standing(shop)
    assert (found.status, codes(found)) == ("warn", ["stiffness-off-model", "one-hit"])
    series = found.series_of("reference", "x")
    assert series is not None
    assert series.is_baseline


@pytest.mark.parametrize(("ratio", "asked"), [(1 / 5, True), (1 / 3, False), (3.0, False), (5.0, True)])
def test_k_of_the_first_tap_is_compared_with_the_model(shop: Shop, ratio: float, asked: bool) -> None:
    shop.tap(0, 1713.0, stiffness=3.23e7 * ratio)
    shop.tap(30, 1713.0, stiffness=3.23e7 * ratio)
    rows = shop.logbook.history.rows
    assert ["stiffness-off-model" in [one.code for one in row.questions] for row in rows] == [asked, asked]


@pytest.mark.parametrize(
    ("stiffer", "slower", "asked"),
    [
        (2.0, 1.0, True),
        (0.5, 1.0, True),
        (0.5, 0.95, True),
        (1 / 1.6, 0.98, True),
        (1.3, 1.0, False),
        (0.75, 1.0, False),
        (1.0, 0.87, False),
        (0.87**2, 0.87, False),
        (1 / 1.6, 0.87, False),
    ],
)
def test_a_gain_that_is_another_is_asked_about_and_a_fall_is_not(
    shop: Shop, stiffer: float, slower: float, asked: bool
) -> None:
    shop.tap_both()
    shop.tap(30, 1713.0 * slower, stiffness=3.5e7 * stiffer)
    questions = [question.code for question in shop.logbook.history.rows[-1].questions]
    assert questions == (["stiffness-jump"] if asked else [])


def test_a_limit_from_a_gain_that_is_another_is_no_stable_program(shop: Shop) -> None:
    shop.edit(SPINDLE, SAFE + SPINDLE)
    shop.tap_both()
    assert words(shop) == {Stability.STABLE}
    for day, direction in ((30.0, "x"), (30.1, "y")):
        shop.tap(day, 1713.0 if direction == "x" else 1690.0, direction, stiffness=2 * 3.5e7)
    assert words(shop) == {Stability.DOUBTFUL}
    assert "stiffness-jump" in str(run("check", shop.path).output)


def test_a_beam_between_the_taps_of_a_mill_is_asked_about(shop: Shop, beam: Path) -> None:
    shop.edit("band_hz", "# band_hz")
    shop.tap_both()
    assert standing(shop).status == "good"
    run("replay", shop.path, beam, "--date", "2026-01-20")
    found = standing(shop, 6)
    assert found.status != "good"
    assert set(codes(found)) & {"frequency-jump", "no-mode-to-follow"}
    shop.tap(10, 1713.0)
    shop.tap(10.1, 1690.0, "y")
    again = standing(shop, 11)
    assert again.status == "warn"
    assert "frequency-alarm" not in codes(again)


def test_the_lines_of_a_recording_must_cover_the_band(shop: Shop) -> None:
    shop.tap_both()
    shop.edit("band_hz = [1200, 2200]", "band_hz = [1200, 5000]")
    found = standing(shop)
    assert found.status == "warn"
    assert codes(found).count("other-band") == 1
    assert found.remarks[0].about.startswith("2 tap tests, ")
    assert all(fact in found.remarks[0].text for fact in ("4..3996 Hz", "[mode] band_hz", "1200..5000 Hz"))
    shop.edit("band_hz = [1200, 5000]", "band_hz = [1200, 4200]")
    assert "other-band" not in codes(standing(shop))


@pytest.mark.parametrize(
    ("share", "light", "asked"), [(0.8, "alarm", True), (1.2, "warn", True), (0.87, "alarm", False)]
)
def test_a_jump_alarms_downwards_and_is_asked_about(shop: Shop, share: float, light: str, asked: bool) -> None:
    shop.tap_both()
    shop.tap(30, 1713.0 * share)
    found = standing(shop, 31)
    assert found.status == light
    assert ("frequency-jump" in codes(found)) is asked
    assert ("frequency-alarm" in codes(found)) is (light == "alarm")


def test_an_upward_jump_hides_no_alarm(shop: Shop) -> None:
    for days, share in enumerate((1.0, 0.95, 0.89)):
        shop.tap(days, 1713.0 * share)
    assert standing(shop, 3).status == "alarm"
    shop.tap(3, 1713.0 * 1.1)
    found = standing(shop, 4)
    assert {"frequency-alarm", "frequency-jump"} <= set(codes(found))


def test_the_outcome_and_the_report_name_the_command_that_answers(shop: Shop) -> None:
    shop.edit(SPINDLE, SAFE + SPINDLE)
    shop.tap_both()
    shop.tap(30, 1713.0 * 1.2)
    logbook = shop.logbook
    tap_id = newest(logbook)
    command = shlex.join(
        ["lobewatch", "replay", str(shop.path), str(tap_file(shop, tap_id)), "--accept", "frequency-jump"]
    )
    outcome = build_outcome(logbook, logbook.measurement(tap_id))
    assert any(command in with_option_names(text) for text in outcome.texts)
    assert command in render_report(logbook, "reference", "x")
    (doubtful,) = logbook.verdicts()
    assert (doubtful.stability, doubtful.decisive_cause) == (Stability.DOUBTFUL, "question")
    _, *words_of_it = shlex.split(command)
    assert run(*words_of_it).exit_code == 0
    assert "frequency-jump" not in codes(standing(shop, 31))


def test_what_is_accepted_stays_so_and_counts(shop: Shop) -> None:
    shop.tap_both()
    shop.tap(30, 1713.0 * 0.8)
    shop.tap(60, 1713.0 * 0.79)
    logbook = shop.logbook
    jumped = logbook.taps[2].id
    assert [*logbook.questions] == [tap.id for tap in logbook.taps[2:]]
    said = run("replay", shop.path, tap_file(shop, jumped), "--accept", "frequency-jump", "--json")
    assert json.loads(said.stdout)["accepted"] == ["frequency-jump"]
    line = json.loads((shop.path / "journal.jsonl").read_text().splitlines()[-1])
    assert (line["kind"], line["tap"], line["code"]) == ("accept", jumped, "frequency-jump")
    for _ in range(2):
        found = standing(shop, 61)
        assert "frequency-jump" not in codes(found)
        assert "frequency-alarm" in codes(found)
        (shop.path / "history.rows").unlink()
    row = shop.logbook.history.rows[2]
    assert [(remark.code, remark.about) for remark in row.remarks if remark.code == "accepted"] == [
        ("accepted", "frequency-jump")
    ]


def test_accept_takes_open_questions_only(shop: Shop, beam: Path) -> None:
    shop.tap_both()
    logbook = shop.logbook
    file = tap_file(shop, newest(logbook))
    before = (shop.path / "journal.jsonl").read_bytes()
    nonsense = refused("replay", shop.path, beam, "--accept", "nonsense")
    assert "nonsense" in nonsense
    assert "frequency-jump, no-mode-in-band, other-band, no-mode-to-follow" in nonsense
    assert "nonsense" in refused("tap", shop.path, "--port", "x", "--accept", "nonsense")
    assert "frequency-jump" in refused("replay", shop.path, file, "--accept", "frequency-jump")
    assert (shop.path / "journal.jsonl").read_bytes() == before
    shop.tap(30, 1713.0 * 1.2)
    asked = newest(shop.logbook)
    sentence = refused("replay", shop.path, tap_file(shop, asked), "--accept", "other-band")
    assert f"{asked}: frequency-jump" in sentence


def test_a_replay_can_be_accepted_at_once(shop: Shop, beam: Path) -> None:
    shop.edit("band_hz = [1200, 2200]", "band_hz = [1200, 1800]")
    said = run("replay", shop.path, beam, "--accept", "no-mode-in-band", "--accept", "one-hit")
    assert said.exit_code == 0
    assert "no-mode-in-band" in said.output
    assert "(no-mode-in-band)" not in said.output
    assert shop.logbook.questions == {}


def test_no_other_tool_is_predicted_from_a_test_in_question(shop: Shop) -> None:
    shop.tap_both()
    sure = shop.logbook.calibrated_measurement.tap_id
    shop.tap(30, 1713.0 * 0.8)
    assert shop.logbook.calibrated_measurement.tap_id == sure


def test_what_an_ended_replay_has_stored_is_not_stored_twice(shop: Shop, beam: Path) -> None:
    CliRunner().invoke(app, ["replay", str(shop.path), str(beam)])
    for name in ("journal.jsonl", "journal.copy.jsonl"):
        (shop.path / name).unlink()
    said = CliRunner().invoke(app, ["replay", str(shop.path), str(beam)])
    assert said.exit_code == 0
    assert len(list((shop.path / "taps").iterdir())) == len(shop.folder.taps()) == 1


def test_what_many_tests_ask_is_one_sentence_with_one_answer(shop: Shop) -> None:
    for days in range(20):
        shop.tap(30.0 * days, 1713.0)
    shop.edit("band_hz = [1200, 2200]", "band_hz = [2000, 3000]")
    (asked,) = [remark for remark in standing(shop, 600.0).remarks if remark.code == "no-mode-in-band"]
    assert asked.about.startswith("20 tap tests, ")
    found = re.search(r"lobewatch replay .* --accept no-mode-in-band", with_option_names(str(asked)))
    assert found is not None
    command = shlex.split(found[0].rpartition("lobewatch")[1] + found[0].rpartition("lobewatch")[2])
    assert run(*command[1:]).exit_code == 0
    assert not any(remark.code == "no-mode-in-band" for remark in standing(shop, 600.0).remarks)
