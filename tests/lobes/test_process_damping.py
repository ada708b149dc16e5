"""Process damping: closed forms, the published iteration, kinship of the methods, and bad input."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from lobes import (
    Cut,
    build_milling_system,
    count_pieces,
    growth_rate,
    rows_at_speeds,
    spectral_radius,
    stability_boundary,
    zero_order_lobes,
)
from lobewatch.verdicts.zero_order_batch import ZeroOrderBatch
from modal import Mode

DIAMETER = 0.0127
SLOT = Cut(4, 1.0, "up", 1500e6, 450e6)
SPEEDS = np.array([900.0, 2000.0, 5000.0, 13500.0])
X = [Mode(900.0, 0.03, 9e6), Mode(1400.0, 0.02, 3e7)]
Y = [Mode(960.0, 0.025, 1.1e7)]


def damped(cut: Cut, coefficient: float) -> Cut:
    """Return a cut with C (N/m)."""
    return replace(cut, process_damping=coefficient / DIAMETER)


def turned(mode: Mode) -> float:
    """Return the natural frequency (rad/s)."""
    return 2 * math.pi * mode.frequency


def surface_speed(speed_rpm: float) -> float:
    return math.pi * DIAMETER * speed_rpm / 60


@pytest.mark.parametrize("coefficient", [2e4, 2.5e5])
@pytest.mark.parametrize("speed", [900.0, 8000.0])
def test_in_a_slot_of_a_round_spindle_it_is_viscous_damping_of_the_tip(coefficient: float, speed: float) -> None:
    """The mean of n n' is N / 4 in both directions: b N C / (4 V) is added to 2 K zeta / w."""
    mode = Mode(900.0, 0.03, 9e6)
    limit = float(stability_boundary([mode], [mode], damped(SLOT, coefficient), [speed], 0.02).depth[0])
    added = limit * SLOT.teeth / 4 * coefficient / surface_speed(speed) * turned(mode) / (2 * mode.stiffness)
    stiff = replace(mode, damping_ratio=mode.damping_ratio + added)
    assert limit == pytest.approx(stability_boundary([stiff], [stiff], SLOT, [speed], 0.02).depth[0], rel=1e-6)
    assert limit > 1.02 * stability_boundary([mode], [mode], SLOT, [speed], 0.02).depth[0] or speed > 5000


def test_the_lowest_limit_is_that_of_turning() -> None:
    """With one direction and constant force, b = 2 K zeta' (1 + zeta') / H, zeta' = zeta + b C' w / (2 K V).

    Tyler & Schmitz, J. Manuf. Process. 15 (2013) 69-76, with H = N Kr / 4 and C' = N C / 4 in a slot.
    """
    mode, coefficient, speed = Mode(900.0, 0.03, 9e6), 5e4, 1500.0
    force, damping = 1.0 * SLOT.radial, coefficient / surface_speed(speed)
    depth = 0.0
    for _ in range(200):
        zeta = mode.damping_ratio + depth * damping * turned(mode) / (2 * mode.stiffness)
        depth = 2 * mode.stiffness * zeta * (1 + zeta) / force
    speeds = speed * np.linspace(0.98, 1.02, 81)
    cuts = [replace(damped(SLOT, coefficient * n / speed), feed_angle=0.0) for n in speeds]  # C / V of the middle
    limits = [float(zero_order_lobes([mode], None, cut, [n]).depth[0]) for n, cut in zip(speeds, cuts, strict=True)]
    assert min(limits) == pytest.approx(depth, rel=2e-4)
    assert depth > 1.15 * 2 * mode.stiffness * 0.03 * 1.03 / force


def test_the_iteration_of_tyler_and_schmitz_finds_the_same_limit() -> None:
    mode, coefficient, speed = Mode(900.0, 0.03, 9e6), 5e4, 2100.0
    depth = 0.0
    for _ in range(60):
        damping = SLOT.teeth / 4 * coefficient / surface_speed(speed) * turned(mode) / (2 * mode.stiffness)
        stiff = replace(mode, damping_ratio=mode.damping_ratio + depth * damping)
        depth = float(zero_order_lobes([stiff], None, SLOT, [speed]).depth[0])
    found = zero_order_lobes([mode], None, damped(SLOT, coefficient), [speed])
    assert found.depth[0] == pytest.approx(depth, rel=1e-5)


@pytest.mark.parametrize("teeth", [4, 6])
def test_the_mean_force_is_exact_where_the_force_is_constant(teeth: int) -> None:
    cut = damped(replace(SLOT, teeth=teeth), 2.5e5)
    exact, mean = stability_boundary(X, Y, cut, SPEEDS, 0.05), zero_order_lobes(X, Y, cut, SPEEDS)
    assert mean.depth == pytest.approx(exact.depth, rel=1e-6)
    assert mean.chatter_frequency == pytest.approx(exact.chatter_frequency, rel=1e-6)


def test_many_spindles_at_once_have_the_limits_and_the_growth_of_each() -> None:
    cut = damped(SLOT, 2e5)
    rows = rows_at_speeds(build_milling_system(X, Y), cut, SPEEDS)
    batch = ZeroOrderBatch.of(rows)
    limit, chatter = batch.limits(rows.speed_rpm[:, np.newaxis])
    exact = zero_order_lobes(X, Y, cut, SPEEDS)
    assert limit[:, 0] == pytest.approx(exact.depth, rel=1e-5)
    assert chatter[:, 0] == pytest.approx(exact.chatter_frequency, rel=1e-5)
    growth, _ = batch.fastest_growth(SPEEDS, 3e-3)
    log = growth_rate(rows, np.full((SPEEDS.size, 1), 3e-3), count_pieces(rows, 3e-3), 1e-6)[:, 0]
    assert growth * rows.tooth_period == pytest.approx(log, abs=1e-5)


def test_mixed_spindles_keep_their_limits() -> None:
    rows = rows_at_speeds(build_milling_system(X, Y), SLOT, SPEEDS)
    mixed = replace(rows, process_damping=np.array([0.0, 2e5, 0.0, 2e5]) / DIAMETER)
    limit = ZeroOrderBatch.of(mixed).limits(SPEEDS[:, np.newaxis])[0][:, 0]
    without = ZeroOrderBatch.of(rows).limits(SPEEDS[:, np.newaxis])[0][:, 0]
    assert (limit == without).tolist() == [True, False, True, False]


def test_teeth_of_nearly_equal_pitch_are_damped_as_even_ones() -> None:
    even = damped(replace(SLOT, immersion=0.2), 2e5)
    uneven = replace(even, pitch=tuple(np.radians([89.99, 90.01, 89.99, 90.01])))
    limits = [stability_boundary(X, Y, cut, SPEEDS[1:3], 0.05).depth for cut in (even, uneven)]
    assert limits[1] == pytest.approx(limits[0], rel=1e-3)


def test_only_the_surface_speed_counts() -> None:
    """Half the diameter and half of C are the same cut."""
    cut = replace(SLOT, immersion=0.3)
    one, other = (replace(cut, process_damping=c / d) for c, d in ((2e5, 0.02), (1e5, 0.01)))
    assert one == other
    assert np.all(spectral_radius(X, Y, one, SPEEDS, 2e-3) < spectral_radius(X, Y, cut, SPEEDS, 2e-3))


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_a_coefficient_that_is_none_is_rejected(value: float) -> None:
    with pytest.raises(ValueError, match="process_damping"):
        replace(SLOT, process_damping=value)


def random_slot(seed: int) -> tuple[list[Mode], list[Mode], Cut, float]:
    """Return complex modes in x and y, a slot of constant force with process damping, and its speed (rpm)."""
    rng = np.random.default_rng(seed)
    x, y = ([Mode(rng.uniform(700, 2500), rng.uniform(0.015, 0.05), 3e7, phase_deg=rng.uniform(-15, 15))] for _ in "xy")
    kt, kr, c = rng.uniform(0.7e9, 2.5e9), rng.uniform(0.1e9, 1e9), rng.uniform(1e6, 2e7)
    cut = Cut(4, 1.0, "down", kt, kr, feed_angle=rng.uniform(0, 3), process_damping=c)
    return x, y, cut, 60 * 1500 / (4 * rng.uniform(8, 20))


@pytest.mark.parametrize("seed", range(6))
def test_zero_order_is_exact_for_a_constant_force_with_complex_modes_at_high_lobes(seed: int) -> None:
    x, y, cut, speed = random_slot(seed)
    exact = stability_boundary(x, y, cut, [speed], 0.03).depth
    rows = rows_at_speeds(build_milling_system(x, y), cut, np.array([speed]))
    limit = ZeroOrderBatch.of(rows).limits(np.array([speed]), 0.06)[0][:, 0]
    assert np.minimum(limit, 0.03) == pytest.approx(np.minimum(exact, 0.03), rel=1e-4)
