"""The simulation that checks `lobes`, against exact Floquet theory, a closed form, a plain simulation, and `lobes`.

Exact numbers: tests/data/milling_stability/SOURCE.txt.
"""

from __future__ import annotations

import ast
import csv
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from milling_simulation import Case, chatters, judge
from milling_steps import Floats, Stepper
from plain_milling import plain_cut
from random_milling import RandomMilling, random_case

from lobes import Cut, Program, program_limit, spectral_radius
from modal import Mode

DATA = Path(__file__).parents[1] / "data" / "milling_stability"
BENCHMARK = ((922.0, 0.011, 0.03993 * (2 * math.pi * 922) ** 2),)
UNEQUAL_X = ((603.0, 0.039, 5.59e6),)
UNEQUAL_Y = ((666.0, 0.035, 5.715e6),)

Row = dict[str, str]


def table(name: str) -> list[Row]:
    lines = (DATA / name).read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


FLOQUET = table("floquet_reference.csv")
CROSSINGS = table("stability_boundary_reference.csv")


def benchmark(row: Row, share: float = 1.0) -> Case:
    direction: Any = row["mode"]
    depth = float(row["w_mm"]) / 1e3 * share
    y = BENCHMARK if row["dof"] == "2" else ()
    return Case(BENCHMARK, y, 0.0, 2, float(row["a_over_D"]), direction, 6e8, 2e8, 0.0, float(row["rpm"]), depth)


def unequal(speed_rpm: float, depth: float, **changes: Any) -> Case:
    case = Case(UNEQUAL_X, UNEQUAL_Y, 0.0, 3, 0.5, "up", 6e8, 0.42e8, 0.0, speed_rpm, depth)
    return replace(case, **changes)


def errors(rows: Sequence[Row], fineness: float = 1.0) -> Floats:
    """Return errors of the largest multipliers, relative to the exact ones."""
    exact = np.array([float(row["mu_exact"]) for row in rows])
    return np.asarray(np.exp(judge([benchmark(row) for row in rows], fineness).growth) / exact - 1)


def test_multipliers_are_those_of_exact_floquet_theory() -> None:
    assert len(FLOQUET) == 90
    assert np.max(np.abs(errors(FLOQUET))) < 2e-3


def test_growth_in_the_slot_of_the_benchmark() -> None:
    rows = [row for row in FLOQUET if (row["dof"], row["a_over_D"], row["rpm"]) == ("1", "1.0", "5000")][:4]
    exact = np.log([0.8197428, 1.0739756, 1.2215561, 1.4064735])
    judged = judge([benchmark(row) for row in rows])
    assert judged.chatters.tolist() == [False, True, True, True]
    assert judged.growth == pytest.approx(exact, rel=0.01)


def test_the_error_is_of_second_order() -> None:
    rows = [row for row in FLOQUET if row["a_over_D"] == "1.0" and row["w_mm"] == "2.0"]
    coarse, fine = (errors(rows, fineness) for fineness in (1.0, 2.0))
    assert coarse / fine == pytest.approx(np.full(len(rows), 4.0), rel=0.2)


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_sides_of_the_crossings_flip_hopf_and_island(share: float) -> None:
    after = [row["direction"] == "into unstable" for row in CROSSINGS]
    wanted = after if share > 1 else [not is_unstable for is_unstable in after]
    assert chatters([benchmark(row, share) for row in CROSSINGS]).tolist() == wanted


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_sides_of_the_limits_of_weck_altintas_budak(share: float) -> None:
    """First crossings by exact Floquet theory, half immersion up, unequal modes in x and y."""
    limits = {4000.0: 1.4818e-3, 7000.0: 1.4178e-3, 10000.0: 1.3650e-3, 13000.0: 5.2100e-3}
    cases = [unequal(speed, share * depth) for speed, depth in limits.items()]
    assert chatters(cases).tolist() == [share > 1] * len(cases)


def test_a_helix_of_one_pitch_cuts_with_the_mean_force() -> None:
    """The force is then the same at all times, and the lowest limit b = 2 K zeta (1 + zeta) / H at its speed exact."""
    (f, zeta, k), teeth = (500.0, 0.03, 8e6), 3
    mean = teeth / (2 * math.pi) * (6e8 / 2 + 3e8 * math.pi / 4)
    limit = 2 * k * zeta * (1 + zeta) / mean
    ratio = math.sqrt(1 + 2 * zeta)
    phase = 2 * math.atan2(1 - ratio**2, -2 * zeta * ratio) + math.pi
    period = (phase % (2 * math.pi) + 4 * math.pi) / (2 * math.pi * f * ratio)
    cases = [
        Case(((f, zeta, k),), (), 0.0, teeth, 0.5, "up", 6e8, 3e8, pitch_lag, 60 / teeth / period, depth)
        for depth in (0.99 * limit, 1.01 * limit)
        for pitch_lag in (2 * math.pi / teeth / depth,)
    ]
    assert chatters(cases).tolist() == [False, True]


@pytest.mark.parametrize("direction", ["up", "down"])
def test_a_quarter_turn_of_the_feed_swaps_the_axes(direction: str) -> None:
    case = unequal(7000.0, 1.4e-3, direction=direction, feed_angle=0.3, helix_lag=100.0)
    turned = replace(case, x=case.y, y=case.x, feed_angle=0.3 + math.pi / 2)
    growth = judge([case, turned, replace(case, feed_angle=0.3 + math.pi), replace(case, feed_angle=-0.3)]).growth
    assert growth[1:3] == pytest.approx(growth[[0, 0]], abs=1e-6)
    assert abs(growth[3] - growth[0]) > 1e-3


def test_a_machine_alike_all_round_does_not_mind_the_feed() -> None:
    cases = [unequal(7000.0, 1.4e-3, y=UNEQUAL_X, feed_angle=angle) for angle in (0.0, 0.4, 1.9, 4.0)]
    growth = judge(cases).growth
    assert growth[1:] == pytest.approx(np.full(3, growth[0]), abs=1e-6)


def spread(motion: Floats) -> float:
    """Largest displacement less the smallest at any one phase of the tooth, of a motion (periods, phases)."""
    return float(np.max(np.ptp(motion, axis=0)))


def pushed(case: Case) -> Floats:
    """Displacement along the feed in the last of 400 periods after a push of a hundredth of the feed."""
    return Stepper([case], case.steps, 0.01, np.random.default_rng(0)).run(400)[0, -150:, :, 0]


@pytest.mark.parametrize(
    ("case", "size"),
    [
        (unequal(7000.0, 2.5e-3, feed_angle=-0.5), 0.70),
        (unequal(9000.0, 5e-3, immersion=0.2, direction="down", feed_angle=1.2), 2.53),
        pytest.param(unequal(7000.0, 2.5e-3, feed_angle=0.5), 2.97, marks=pytest.mark.long),
        pytest.param(unequal(7000.0, 1.2e-3, immersion=1.0, feed_angle=-0.7), 0.47, marks=pytest.mark.long),
    ],
    ids=["turned back", "low immersion", "turned", "slot"],
)
def test_chatter_with_loss_of_contact_is_as_large_as_in_a_plain_simulation(case: Case, size: float) -> None:
    assert spread(plain_cut(case, 400, 180).motion[-80:]) == pytest.approx(size, rel=0.02)
    assert spread(pushed(case)) == pytest.approx(size, rel=0.02)


def test_a_push_of_a_hundredth_of_the_feed_dies_below_the_limit() -> None:
    assert spread(pushed(unequal(7000.0, 0.9 * 1.4178e-3))) < 1e-4


@pytest.mark.parametrize(
    "change",
    [{"x": (), "y": ()}, {"x": ((500.0, 1.0, 1e7),)}, {"immersion": 1.2}, {"direction": "both"}, {"depth": 0.0}],
)
def test_what_cannot_be_simulated_is_rejected(change: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"need frequency|is no cut|must be > 0"):
        replace(unequal(7000.0, 1e-3), **change)


def test_random_machines_and_programs_are_such_as_promised() -> None:
    drawn = [random_case(np.random.default_rng(seed)) for seed in range(300)]
    for one in drawn:
        case = one.case(1e-3, one.feed_angles[0])
        assert 1 <= len(one.x) <= 6
        assert 1 <= len(one.y) <= 6
        assert 1500 <= one.speed_rpm <= 24000
        assert max(f for f, _, _ in one.x + one.y) * case.tooth_period <= 25.001
        assert all(0.01 <= zeta <= 0.06 for _, zeta, _ in one.x + one.y)
    assert {one.feed for one in drawn} == {"x", "y", "both"}
    assert {one.teeth for one in drawn} == set(range(1, 9))
    assert random_case(np.random.default_rng(3)) == drawn[3]


@pytest.mark.parametrize("name", ["milling_simulation", "milling_steps", "late_growth", "random_milling"])
def test_nothing_of_lobes_is_used(name: str) -> None:
    tree = ast.parse(Path(__file__).with_name(f"{name}.py").read_text(encoding="utf-8"))
    imported = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    imported |= {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    ours = {"milling_simulation", "milling_steps", "late_growth", "random_milling"}
    assert imported <= ours | {
        "__future__",
        "collections.abc",
        "dataclasses",
        "math",
        "numpy",
        "numpy.typing",
        "typing",
    }


def limit_and_growth(one: RandomMilling) -> tuple[float, Floats]:
    """Limit by `lobes` of a program fed along its first axis (m, 0.1 at most), and growth at 0.9 and 1.1 of it."""
    along, normal = ([Mode(*mode) for mode in modes] for modes in one.modes("y" if one.feed == "y" else "x"))
    cut = Cut(one.teeth, one.immersion, one.direction, one.tangential, one.radial, one.helix_lag)
    limit = min(0.1, program_limit(Program(cut, one.speed_rpm, 5e-3), along, normal).limit)
    return limit, np.log(spectral_radius(along, normal, cut, one.speed_rpm, [0.9 * limit, 1.1 * limit])[0])


def compare(seed: int, number: int) -> None:
    """Random programs: stable at 0.9 of their limit, at 1.1 what the multipliers say (it may be beyond an island)."""
    rng = np.random.default_rng(seed)
    drawn = [random_case(rng) for _ in range(number)]
    limits, growth = zip(*map(limit_and_growth, drawn), strict=True)
    pairs = zip(drawn, limits, strict=True)
    judged = judge([one.case(share * b, one.feed_angles[0]) for one, b in pairs for share in (0.9, 1.1)])
    assert not np.any(judged.chatters[::2])
    assert judged.chatters.tolist() == (np.ravel(growth) > 0).tolist()
    assert judged.growth == pytest.approx(np.ravel(growth), rel=0.02, abs=3e-3)


def test_random_programs_are_evaluated_as_by_semi_discretisation() -> None:
    compare(seed=1, number=16)


@pytest.mark.long
def test_many_random_programs_are_evaluated_as_by_semi_discretisation() -> None:
    compare(seed=2, number=200)
