"""Limits with process damping against the simulation in time, which shares no code with `lobes`."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from milling_simulation import Case, chatters, judge
from random_milling import random_case

from lobes import Cut, stability_boundary
from modal import Mode

X, Y = ((900.0, 0.03, 9e6), (1600.0, 0.02, 4e7)), ((960.0, 0.025, 1.1e7),)
DIAMETER = 0.012
SIDES = (0.99, 1.01)
"""Shares of the limit on both sides of it."""


def limit(case: Case, coefficient: float) -> float:
    """Limit (m) of a case by `lobes`, with C (N/m)."""
    cut = Cut(case.teeth, case.immersion, case.direction, case.tangential, case.radial, case.helix_lag, case.feed_angle)
    cut = replace(cut, process_damping=coefficient / case.diameter)
    x, y = ([Mode(f, z, k, phase_deg=p[0] if p else 0.0) for f, z, k, *p in modes] for modes in (case.x, case.y))
    return float(stability_boundary(x, y, cut, [case.speed_rpm], 0.06).depth[0])


def sides(case: Case, coefficient: float, depth: float) -> list[Case]:
    return [replace(case, depth=share * depth, process_damping=coefficient) for share in SIDES]


SIDE = Case(X, Y, 0.4, 4, 0.25, "down", 1.8e9, 6e8, 0.0, 1700.0, 1e-3, diameter=DIAMETER)
CASES = [
    (SIDE, 1.5e5),
    (replace(SIDE, immersion=0.1, direction="up", helix_lag=80.0, feed_angle=1.9), 3e5),
    (replace(SIDE, x=((900.0, 0.03, 9e6, 12.0),), y=((960.0, 0.025, 1.1e7, -9.0),), immersion=0.5), 1e5),
]


@pytest.mark.parametrize("number", [0, *(pytest.param(i, marks=pytest.mark.long) for i in range(1, len(CASES)))])
def test_limits_are_those_of_a_simulation_in_time(number: int) -> None:
    """Lobes 5 to 14; straight teeth, helical ones, and complex modes."""
    case, coefficient = CASES[number]
    damped = limit(case, coefficient)
    assert damped > 1.2 * limit(case, 0.0)
    assert chatters(sides(case, coefficient, damped)).tolist() == [False, True]


def test_growth_of_a_damped_slot_is_that_of_its_closed_form() -> None:
    """The slot of four teeth adds b C / V to the damping of each direction."""
    mode, coefficient, speed, depth = (900.0, 0.03, 9e6), 1e5, 1500.0, 3e-4
    per_velocity = depth * coefficient / (math.pi * DIAMETER * speed / 60)
    stiff = (900.0, 0.03 + per_velocity * 2 * math.pi * 900.0 / (2 * 9e6), 9e6)
    slots = [
        Case((each,), (each,), 0.0, 4, 1.0, "up", 1.5e9, 4.5e8, 0.0, speed, depth, c, DIAMETER)
        for each, c in ((mode, coefficient), (stiff, 0.0), (mode, 0.0))
    ]
    damped, viscous, without = judge(slots).growth
    assert damped == pytest.approx(viscous, abs=2e-3)
    assert damped < without - 0.05


@pytest.mark.long
@pytest.mark.timeout(3000)
def test_limits_of_random_cuts_at_lobes_3_to_25() -> None:
    rng, wrong, found = np.random.default_rng(56), [], 0
    for number in range(24):
        drawn, coefficient = random_case(rng), rng.uniform(0, 5e5)
        speed = 60 * drawn.x[0][0] / (drawn.teeth * rng.uniform(3, 25))
        drawn = replace(drawn, speed_rpm=speed, helix=drawn.helix if number % 2 else 0.0)
        case = replace(drawn.case(1e-3, rng.uniform(0, math.pi)), diameter=drawn.diameter)
        depth = limit(case, coefficient)
        if depth < 0.03:
            found += 1
            wrong += [number] if chatters(sides(case, coefficient, depth)).tolist() != [False, True] else []
    assert found >= 15
    assert not wrong
