"""Lowest crossing near flip lobes, and dependent checks, against dense scans of the spectral radius."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from lobes import Cut, Program, program_limit, spectral_radius, stability_boundary, zero_order_lobes
from lobes.floquet.crossings import (
    ESTIMATE_ACCURACY,
    GROWTH_SIGN_ACCURACY,
    converged_crossings,
    estimate_limits,
    find_crossings,
)
from lobes.floquet.milling_rows import rows_at_speeds
from lobes.milling_system import build_milling_system
from lobes.tip_response import TipModes
from modal import Mode

SPINDLE = [Mode(1713.0636, 0.029120, 3.53170e7)]
AGED = [Mode(1541.7569, 0.029123, 3.48023e7)]
FINISHING = Cut(4, 0.1, "down", 1400e6, 500e6)
LOOKS = 200
"""Depths of a dense scan."""


class Case(NamedTuple):
    x: list[Mode]
    y: TipModes
    cut: Cut
    speed_rpm: NDArray[np.float64]
    deepest: float


def cases(number: int, seed: int) -> Iterator[Case]:
    """Cuts of low immersion, at speeds around flip lobes: tooth frequency 2 f_n / (2 k + 1)."""
    random = np.random.default_rng(seed)
    for _ in range(number):
        frequency, k, teeth = random.uniform(500, 2500), random.integers(0, 3), int(random.integers(1, 6))
        x = [Mode(frequency, random.uniform(0.008, 0.05), 2e7)]
        if random.random() < 0.4:
            x.append(Mode(frequency * random.uniform(1.2, 2.5), random.uniform(0.01, 0.04), random.uniform(4e7, 4e8)))
        y = [Mode(frequency * random.uniform(0.8, 1.2), 0.02, 3e7)] if random.random() < 0.3 else None
        tangential, share = random.uniform(5e8, 2e9), random.uniform(0, 0.6)
        direction: Literal["up", "down"] = "up" if random.random() < 0.5 else "down"
        cut = Cut(teeth, float(np.exp(random.uniform(-3.5, -1.2))), direction, tangential, tangential * share)
        speed = 60 / teeth * 2 * frequency / (2 * k + 1) * random.uniform(0.88, 1.2, 12)
        lowest = zero_order_lobes(x, y, cut, np.linspace(30, 120, 50) * frequency / teeth).minimum.depth
        yield Case(x, y, cut, speed, float(lowest * np.exp(random.uniform(1.6, 3.7))))


def missed(case: Case) -> int:
    """Speeds at which the cut is unstable somewhere below its limit."""
    x, y, cut, speed, deepest = case
    limit = np.minimum(stability_boundary(x, y, cut, speed, deepest).depth, deepest)
    found = 0
    for rpm, deep in zip(speed, limit, strict=True):
        depths = deep * np.arange(1, LOOKS) / LOOKS
        found += bool(np.any(spectral_radius(x, y, cut, rpm, depths) > 1 + 1e-5))
    return found


@pytest.mark.parametrize(
    ("modes", "speed", "lowest"),
    [
        (SPINDLE, 15410.0, 23.35214e-3),
        (SPINDLE, 15430.0, 23.61731e-3),
        (AGED, 7900.0, 29.82067e-3),
    ],
)
def test_a_short_excursion_below_the_limit_is_seen(modes: list[Mode], speed: float, lowest: float) -> None:
    """A flip lobe that ends between two depths of the scan, below a limit that is a third deeper."""
    lobes = stability_boundary(modes, None, FINISHING, speed, 0.17)
    assert (lobes.depth[0], lobes.kind[0]) == (pytest.approx(lowest, rel=1e-4), "flip")
    below, above = spectral_radius(modes, None, FINISHING, speed, lobes.depth[0] * np.array([0.995, 1.005]))[0]
    assert below < 1 < above


def test_limits_around_flip_lobes_hold_against_a_dense_scan() -> None:
    assert sum(missed(case) for case in cases(8, 3)) == 0


def test_the_first_crossing_is_the_first_of_all() -> None:
    for case in cases(4, 8):
        system = build_milling_system(case.x, case.y)
        rows = rows_at_speeds(system, case.cut, case.speed_rpm)
        everything, _ = converged_crossings(rows, case.deepest)
        first, _ = converged_crossings(rows, case.deepest, first_only=True)
        assert first[:, 0] == pytest.approx(everything[:, 0], rel=1e-5)
        assert estimate_limits(rows, case.deepest) == pytest.approx(everything[:, 0], rel=5e-3)


def test_an_estimate_asks_for_growth_that_has_its_sign() -> None:
    asked = []

    def growth(row: NDArray[np.intp], depth: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
        asked.append(tolerance)
        return (depth - 0.3) * (0.5 - depth)

    found = find_crossings(growth, 1, 1.0, first_only=True, accuracy=ESTIMATE_ACCURACY)
    assert found[0] == pytest.approx([0.3], rel=ESTIMATE_ACCURACY)
    assert max(asked) <= GROWTH_SIGN_ACCURACY < ESTIMATE_ACCURACY


@pytest.mark.long
@pytest.mark.timeout(900)
def test_two_hundred_cuts_around_flip_lobes() -> None:
    assert sum(missed(case) for case in cases(200, 11)) == 0


@pytest.mark.parametrize("speed", [15390.0, 15410.0, 15420.0, 15430.0])
def test_a_check_agrees_with_the_multipliers(speed: float) -> None:
    program = Program(FINISHING, speed, 24e-3)
    radius = spectral_radius(SPINDLE, None, FINISHING, speed, program.depth)[0, 0]
    found = program_limit(program, SPINDLE, None)
    assert radius > 1
    assert not found.stable
    assert found.limit <= program.depth
