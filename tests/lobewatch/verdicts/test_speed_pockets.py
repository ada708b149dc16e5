"""Speeds of pockets without a stiffness, against the same spindle tapped with force; depths known from cuts only."""

from __future__ import annotations

import json
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from acquisition import Circumstances, Hit, HitFlags, TapDirection, TapTest, estimate_frf, new_tap_id
from lobes import find_pockets, rank_pockets
from lobewatch.cli import app
from lobewatch.machine import ProgramTable
from lobewatch.tool import compute_lobes
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.speed_pockets import find_speed_pockets
from tests.lobewatch.commands.test_listen import recording
from tests.lobewatch.conftest import Shop
from tests.modal.test_hit_scatter import tap

PROGRAM = ("A", 12800.0, 2.0)


def commit(shop: Shop, direction: TapDirection, seed: int, *, force: bool, days: float = 0.0) -> None:
    """Commit a tap test of five hits on the demo spindle."""
    hits = tap(seed, hits=5)
    about = Circumstances("m", shop.start + timedelta(days=days), "reference", direction)
    kept = hits if force else [Hit(np.empty(0), hit.acceleration, hit.sample_rate, hit.pre_trigger) for hit in hits]
    frf = estimate_frf(hits) if force else None
    shop.folder.commit(TapTest(new_tap_id(about), about, frf, tuple(kept), (HitFlags.OK,) * 5))


def tapped(shop: Shop, *, force: bool) -> Assembly:
    shop.run(PROGRAM)
    commit(shop, "x", 1, force=force)
    commit(shop, "y", 2, force=force, days=0.1)
    return shop.logbook.assembly("reference")


@pytest.fixture
def without_force(shop: Shop) -> Shop:
    tapped(shop, force=False)
    return shop


def run(shop: Shop, *words: str) -> Any:
    result = CliRunner().invoke(app, [words[0], str(shop.path), *words[1:], "--json"])
    return json.loads(result.stdout)


def observe(shop: Shop, depth: float, word: str, speed: float = 12800.0) -> None:
    words = ["--program", "A", "--speed", f"{speed}", "--depth", f"{depth}", f"--{word}"]
    assert CliRunner().invoke(app, ["observe", str(shop.path), *words]).exit_code == 0


def test_pockets_are_where_they_are_with_force(shop: Shop, new_shop: type[Shop], tmp_path: Any) -> None:
    other = new_shop(tmp_path / "with-force")
    other.edit("high_rpm = 24000", "high_rpm = 24000\nsteps = 4000")
    without, with_force = tapped(shop, force=False), tapped(other, force=True)
    (program,) = shop.folder.machine.program
    found = find_speed_pockets(program, without, shop.folder.machine)
    lobes = compute_lobes(with_force, other.folder.machine)["A"]
    known = find_pockets(lobes, 20 * lobes.minimum.depth)
    assert len(found) == 3
    for pocket in found:
        nearest = min(known, key=lambda other: abs(other.speed_rpm - pocket.speed_rpm))
        assert pocket.speed_rpm == pytest.approx(nearest.speed_rpm, rel=0.01)
        assert pocket.gain == pytest.approx(nearest.depth / lobes.minimum.depth, rel=0.1)
        assert nearest.from_rpm < pocket.window_rpm[0] < pocket.window_rpm[1] <= nearest.to_rpm
    best = rank_pockets(known, 3, "removal")
    assert [pocket.speed_rpm for pocket in found] == pytest.approx([pocket.speed_rpm for pocket in best], rel=0.01)


def test_a_larger_uncertainty_of_the_frequency_narrows_windows_and_closes_pockets(without_force: Shop) -> None:
    machine, assembly = without_force.folder.machine, without_force.logbook.assembly("reference")
    (program,) = machine.program
    (best, *_), sure = find_speed_pockets(program, assembly, machine), machine.doubt
    without_force.edit("[speed]", "[doubt]\nfrequency_percent = 0.8\n\n[speed]")
    wide = find_speed_pockets(program, assembly, without_force.folder.machine)
    assert sure.frequency_percent is None
    assert wide[0].window_rpm[1] - wide[0].window_rpm[0] < best.window_rpm[1] - best.window_rpm[0]
    without_force.edit("frequency_percent = 0.8", "frequency_percent = 6.0")
    assert find_speed_pockets(program, assembly, without_force.folder.machine) == []


def test_nothing_is_known_of_pockets_without_such_a_tap(shop: Shop) -> None:
    assembly = tapped(shop, force=True)
    (program,) = shop.folder.machine.program
    assert assembly.without_stiffness == {}
    assert find_speed_pockets(program, assembly, shop.folder.machine) == []


def test_lobes_lists_speeds_without_depths(without_force: Shop) -> None:
    told = run(without_force, "lobes", "--cut", "A")
    assert [pocket["depth_mm"] for pocket in told["pockets"]] == [None] * 3
    assert told["pockets"][1]["speed_rpm"] == pytest.approx(12850, rel=0.01)
    assert {remark["code"] for remark in told["remarks"]} == {"force-not-measured", "same-direction"}


def test_no_depth_is_recommended_before_a_cut_and_one_is_within_five(without_force: Shop) -> None:
    true_limit, depths = 1.5, []
    assert all(
        pocket["heard_stable_mm"] is None for pocket in run(without_force, "suggest", "--program", "A")["pockets"]
    )
    for _ in range(6):
        suggested = run(without_force, "suggest", "--program", "A")["suggested"]
        if suggested is None:
            break
        depths.append(suggested["depth_mm"])
        observe(without_force, depths[-1], "stable" if depths[-1] < true_limit else "chatter", suggested["speed_rpm"])
    assert depths[:3] == [0.5, 1.0, 2.0]
    assert suggested is None
    assert len(depths) <= 5
    pocket = run(without_force, "suggest", "--program", "A")["pockets"][0]
    assert 0.8 * true_limit <= pocket["heard_stable_mm"] < true_limit <= pocket["heard_chatter_mm"]


@pytest.mark.parametrize(
    ("depth", "word", "speed", "verdict"),
    [
        (2.0, "stable", 12800.0, "doubtful"),
        (2.0, "chatter", 12800.0, "not stable"),
        (1.0, "chatter", 12800.0, "not stable"),
        (1.0, "stable", 12800.0, "unknown"),
        (3.0, "chatter", 12800.0, "unknown"),
        (2.0, "stable", 12500.0, "unknown"),
    ],
)
def test_a_program_is_at_best_doubtful(
    depth: float, word: str, speed: float, verdict: str, without_force: Shop
) -> None:
    observe(without_force, depth, word, speed)
    (program,) = run(without_force, "check")["programs"]
    codes = {remark["code"] for remark in program["remarks"]}
    assert program["verdict"] == verdict
    assert program["limit_mm"] is None
    assert "speeds-alone" in codes
    assert ("heard-alone" in codes) == (verdict != "unknown")
    for command in ("status", "report", "trend") if verdict == "doubtful" else ():
        assert CliRunner().invoke(app, [command, str(without_force.path)]).exit_code in (0, 1)


@pytest.mark.parametrize(("chatter", "verdict"), [(None, "doubtful"), (1712.3, "not stable")])
def test_a_cut_that_the_accelerometer_detected_counts_like_one_by_ear(
    chatter: float | None, verdict: str, without_force: Shop, tmp_path: Path
) -> None:
    without_force.edit("speed_rpm = 12800", "speed_rpm = 12077")
    words = [
        "listen",
        str(without_force.path),
        "--program",
        "A",
        "--file",
        str(recording(tmp_path / "cut.csv", chatter)),
    ]
    assert CliRunner().invoke(app, words).exit_code == 0
    (program,) = run(without_force, "check")["programs"]
    assert program["verdict"] == verdict


def test_the_report_names_the_pockets(without_force: Shop) -> None:
    assert CliRunner().invoke(app, ["report", str(without_force.path)]).exit_code in (0, 1)
    page = (without_force.path / "report.html").read_text("utf-8")
    (program,) = run(without_force, "check")["programs"]
    (pockets,) = (remark["text"] for remark in program["remarks"] if remark["code"] == "speeds-alone")
    assert pockets in page.replace("\u00a0", " ")


def test_a_program_of_another_cutter_learns_nothing(without_force: Shop) -> None:
    observe(without_force, 2.0, "stable")
    without_force.edit("teeth = 4", "teeth = 3")
    assert run(without_force, "check")["programs"][0]["verdict"] == "unknown"
    assert isinstance(without_force.folder.machine.program[0], ProgramTable)
