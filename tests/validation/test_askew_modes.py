"""Modes with rotated principal directions, compared with a time simulation that shares nothing with `lobes`."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import pytest
from delayed_milling import DelayedCase, growth_per_turn

from lobes import Cut, stability_boundary
from modal import Mode

ASIDE = 0.005
"""The cut is to be stable this much below the limit, relative, and to chatter as much above it."""
DEEPEST = 0.03


def beside_the_limit(rng: np.random.Generator) -> list[DelayedCase]:
    """Return a random cut just below and just above its limit; spindle with up to four modes at any angles."""
    teeth, number = int(rng.integers(2, 6)), int(rng.integers(1, 5))
    teeth = teeth if 360 % teeth == 0 else 3
    immersion, lag = float(rng.choice([0.05, 0.1, 0.25, 0.5, 0.75, 1.0])), float(rng.choice([0, 0, 72.2]))
    direction: Literal["up", "down"] = "up" if rng.random() < 0.5 else "down"
    frequency, angles = rng.uniform(400, 2000), rng.uniform(0, math.pi, number)
    modes = [Mode(frequency * rng.uniform(0.85, 1.8), rng.uniform(0.015, 0.05), rng.uniform(1e7, 4e7)) for _ in angles]
    tangential = rng.uniform(600e6, 2e9)
    radial, speed = tangential * rng.uniform(0.1, 0.8), 60 * frequency / teeth / rng.uniform(0.4, 6)
    cut, vectors = Cut(teeth, immersion, direction, tangential, radial, lag), np.array([np.cos(angles), np.sin(angles)])
    limit = float(stability_boundary(modes, None, cut, [speed], DEEPEST, vectors.T).depth[0])
    if not math.isfinite(limit):
        return []
    along = tuple((m.frequency, m.damping_ratio, m.stiffness, a) for m, a in zip(modes, angles.tolist(), strict=True))
    pitch = (360 // teeth,) * teeth
    return [
        DelayedCase(along, pitch, immersion, direction, tangential, radial, lag, speed, limit * (1 + side * ASIDE))
        for side in (-1, 1)
    ]


@pytest.mark.parametrize(("seed", "spindles"), [(5, 8), pytest.param(6, 120, marks=pytest.mark.long)])
def test_limits_of_random_rotated_spindles_are_those_of_a_simulation(seed: int, spindles: int) -> None:
    rng = np.random.default_rng(seed)
    cases = list[DelayedCase]()
    while len(cases) < 2 * spindles:
        cases += beside_the_limit(rng)
    growth, cycles = np.empty(len(cases)), [max(mode[0] for mode in case.modes) / case.speed_rpm for case in cases]
    for part in np.array_split(np.argsort(cycles), -(-len(cases) // 50)):
        growth[part] = growth_per_turn([cases[i] for i in part])
    below, above = growth.reshape(-1, 2).T
    assert np.all(below < 0)
    assert np.all(above > 0)
