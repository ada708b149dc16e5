"""lobewatch modes of a recording without force: natural frequencies and damping, no stiffness."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.lobewatch.commands.conftest import Run, refused
from tests.lobewatch.logbook.test_replay_without_force import record
from tests.modal.test_hit_scatter import TRUTH


@pytest.fixture
def decays(run: Run, tmp_path: Path) -> str:
    return record(tmp_path / "decays.csv").name


def test_frequency_and_damping_are_reported_and_no_stiffness(run: Run, decays: str) -> None:
    said = run("modes", decays, "--hammer", "none", "--json")
    assert said.code == 0, said.err
    mode = json.loads(said.out)["modes"][0]
    assert mode["frequency_hz"] == pytest.approx(TRUTH[0], abs=5 * mode["frequency_hz_std"])
    assert mode["damping_ratio"] == pytest.approx(TRUTH[1], abs=5 * mode["damping_ratio_std"])
    assert (mode["stiffness_n_per_m"], mode["trust"], mode["hits"]) == (None, "trusted", 5)


def test_people_read_that_the_stiffness_is_not_known(run: Run, decays: str) -> None:
    said = run("modes", decays, "--hammer", "none", "--figure", "modes.png").out
    assert "5 free decay" in said
    assert "force" in said
    assert "nan" not in said
    assert "peak picking" not in said
    assert Path("modes.png").stat().st_size > 10_000


def test_a_mode_is_left_out_and_a_band_kept_to(run: Run, decays: str) -> None:
    said = run("modes", decays, "--hammer", "none", "--band", "1000", "6000", "--drop", "1713", "--json")
    assert all(abs(mode["frequency_hz"] - TRUTH[0]) > 100 for mode in json.loads(said.out)["modes"])


def test_of_a_tap_test_of_a_machine_nothing_has_to_be_reported(run: Run, decays: str) -> None:
    run("init", "mill-3", "--yes", "--hammer", "none")
    assert run("replay", "mill-3", decays, "--date", "2026-03-01").code == 0
    said = run("modes", "mill-3", "20260301")
    assert (said.code, "nan" not in said.out) == (0, True), said.err


def test_what_needs_the_force_is_rejected(run: Run, decays: str) -> None:
    refused(run("modes", decays), "force", "hammer none")
    refused(run("modes", decays, "--hammer", "none", "--window", "0.1"), "--window")
