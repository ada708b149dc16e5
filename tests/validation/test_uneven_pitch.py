"""Cutters of unequal pitch, held against a simulation in time that shares nothing with `lobes`."""

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


def random_pitch(rng: np.random.Generator) -> tuple[int, ...]:
    """Return pitches of two to five teeth in whole degrees, up to 40 % unequal; some of four repeat after two."""
    teeth = int(rng.integers(2, 6))
    even = 360 // teeth
    while True:
        pitch = rng.integers(int(0.7 * even), int(1.3 * even) + 1, size=teeth)
        if teeth == 4 and rng.random() < 0.4:
            pitch = np.array([pitch[0], 180 - pitch[0]] * 2)
        pitch[-1] = 360 - np.sum(pitch[:-1])
        if 0.6 * even < pitch[-1] < 1.4 * even and np.ptp(pitch) > 0:
            return tuple(int(angle) for angle in pitch)


def random_modes(rng: np.random.Generator, frequency: float, number: int) -> list[Mode]:
    return [
        Mode(frequency * (1 + k / 2) * rng.uniform(0.9, 1.1), rng.uniform(0.015, 0.05), rng.uniform(1e7, 4e7))
        for k in range(number)
    ]


def beside_the_limit(rng: np.random.Generator) -> list[DelayedCase]:
    """Return a random cut just below and just above its limit; an empty list without a limit."""
    pitch = random_pitch(rng)
    immersion, lag = float(rng.choice([0.05, 0.1, 0.25, 0.5, 0.75, 1.0])), float(rng.choice([0, 0, 72.2]))
    direction: Literal["up", "down"] = "up" if rng.random() < 0.5 else "down"
    frequency, number = rng.uniform(400, 2000), int(rng.integers(1, 3))
    x, y = (random_modes(rng, frequency, number) for _ in "xy")
    tangential = rng.uniform(600e6, 2e9)
    radial, speed = tangential * rng.uniform(0.1, 0.8), 60 * frequency / len(pitch) / rng.uniform(0.4, 8)
    cut = Cut(len(pitch), immersion, direction, tangential, radial, lag, pitch=tuple(np.radians(pitch)))
    limit = float(stability_boundary(x, y, cut, [speed], DEEPEST).depth[0])
    if not math.isfinite(limit):
        return []
    along = [(mode, 0.0) for mode in x] + [(mode, math.pi / 2) for mode in y]
    modes = tuple((mode.frequency, mode.damping_ratio, mode.stiffness, angle) for mode, angle in along)
    return [
        DelayedCase(modes, pitch, immersion, direction, tangential, radial, lag, speed, limit * (1 + side * ASIDE))
        for side in (-1, 1)
    ]


def sides_missed(seed: int, cutters: int) -> tuple[int, int]:
    """Limits that the simulation finds elsewhere, and how many were asked for."""
    rng = np.random.default_rng(seed)
    cases = list[DelayedCase]()
    while len(cases) < 2 * cutters:
        cases += beside_the_limit(rng)
    growth, cycles = np.empty(len(cases)), [max(mode[0] for mode in case.modes) / case.speed_rpm for case in cases]
    for part in np.array_split(np.argsort(cycles), -(-len(cases) // 50)):
        growth[part] = growth_per_turn([cases[i] for i in part])
    below, above = growth.reshape(-1, 2).T
    return int(np.sum((below > 0) | (above < 0))), cutters


def test_limits_of_random_cutters_are_those_of_a_simulation() -> None:
    assert sides_missed(seed=5, cutters=3) == (0, 3)


@pytest.mark.long
def test_limits_of_300_random_cutters_are_those_of_a_simulation() -> None:
    assert sides_missed(seed=6, cutters=300) == (0, 300)


@pytest.mark.parametrize(("speed", "limit"), [(5000.0, 0.408624e-3), (9000.0, 3.009210e-3), (20000.0, 1.417506e-3)])
def test_the_simulation_finds_limits_of_exact_floquet_theory(speed: float, limit: float) -> None:
    """Slot of tests/data/milling_stability/stability_boundary_reference.csv, one direction."""
    mode = (922.0, 0.011, 0.03993 * (2 * math.pi * 922) ** 2, 0.0)
    cases = [
        DelayedCase((mode,), (180, 180), 1.0, "down", 6e8, 2e8, 0.0, speed, limit * side)
        for side in (1 - ASIDE, 1 + ASIDE)
    ]
    below, above = growth_per_turn(cases)
    assert below < 0 < above
