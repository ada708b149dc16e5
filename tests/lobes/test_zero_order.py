"""Zero-order limits.

Y. Altintas, E. Budak, Analytical prediction of stability lobes in milling, CIRP Annals 44 (1995) 357-362, half
immersion up-milling with the modes of Weck, Altintas & Budak: frequency_domain_reference.csv in tests/data/.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition import Frf
from lobes import Cut, StabilityLobes, average_angle_lobes, stability_boundary, zero_order_lobes
from lobes.tooth_force import mean_force
from modal import Mode

X, Y = [Mode(603.0, 0.039, 5.59e6)], [Mode(666.0, 0.035, 5.715e6)]
CUT = Cut(3, 0.5, "up", 600e6, 42e6)
BENCHMARK = [Mode(922.0, 0.011, 0.03993 * (2 * math.pi * 922) ** 2)]
SPEEDS = np.linspace(3000.0, 20000.0, 50)


def frf(modes: list[Mode]) -> Frf:
    frequency = np.arange(1.0, 5000.0)
    return Frf(frequency, np.sum([mode.receptance(frequency) for mode in modes], axis=0))


def test_directional_coefficients() -> None:
    """Compare with alpha = -4 pi H0 / (N Kt)."""
    alpha = -4 * math.pi / (3 * 600e6) * mean_force(CUT)
    assert alpha.ravel() == pytest.approx([-1.109956, -1.640796, 1.500796, 0.890044], abs=5e-7)


@pytest.mark.parametrize(("speed", "depth_mm"), [(4000, 1.4193), (7000, 1.4614), (10000, 1.3396), (13000, 5.1905)])
def test_limits_of_half_immersion(speed: float, depth_mm: float) -> None:
    assert zero_order_lobes(X, Y, CUT, speed).depth[0] * 1e3 == pytest.approx(depth_mm, abs=5e-5)
    assert zero_order_lobes(frf(X), frf(Y), CUT, speed).depth[0] * 1e3 == pytest.approx(depth_mm, abs=5e-5)


def test_lowest_limit_of_half_immersion() -> None:
    low = zero_order_lobes(X, Y, CUT, np.linspace(5000, 5050, 5001)).minimum
    assert low.depth * 1e3 == pytest.approx(1.08683, abs=5e-6)
    assert low.chatter_frequency == pytest.approx(632.978, abs=0.01)
    assert low.speed_rpm == pytest.approx(5022.36, abs=0.1)


@pytest.mark.parametrize(
    ("immersion", "speeds", "depth_mm", "chatter"),
    [(0.05, (12100, 12200), 1.791579, 911.802), (1.0, (15900, 16000), 0.298054, 932.087)],
)
def test_lowest_limit_of_the_milling_benchmark(
    immersion: float, speeds: tuple[float, float], depth_mm: float, chatter: float
) -> None:
    low = zero_order_lobes(BENCHMARK, None, Cut(2, immersion, "down", 6e8, 2e8), np.linspace(*speeds, 10001)).minimum
    assert low.depth * 1e3 == pytest.approx(depth_mm, abs=5e-7)
    assert low.chatter_frequency == pytest.approx(chatter, abs=0.01)


@settings(max_examples=30, deadline=None)
@given(
    immersion=st.floats(0.05, 1.0),
    direction=st.sampled_from(["up", "down"]),
    speed=st.floats(2000, 30000),
    radial=st.floats(0, 6e8),
)
def test_the_loop_closes_at_the_limit(immersion: float, direction: str, speed: float, radial: float) -> None:
    """det(I + b (1 - exp(-2 pi i f/f_t)) H0 G(f)) = 0."""
    cut = Cut(3, immersion, "up" if direction == "up" else "down", 6e8, radial)
    found = zero_order_lobes(X, Y, cut, speed)
    f = found.chatter_frequency
    receptance = np.diag([X[0].receptance(f)[0], Y[0].receptance(f)[0]])
    loop = found.depth[0] * (1 - np.exp(-120j * np.pi * f[0] / (3 * speed))) * mean_force(cut) @ receptance
    assert abs(np.linalg.det(np.eye(2) + loop)) < 1e-6


TOOL, COLUMN = [Mode(2500.0, 0.035, 4e7)], [Mode(18.0, 0.015, 8e5)]
FOUR_TEETH = Cut(4, 1.0, "down", 600e6, 180e6)
"""Its force does not vary as it turns, so zero order is exact."""


def lowest_in_a_dense_scan(x: list[Mode], y: list[Mode], cut: Cut, speed: float) -> float:
    """Lowest depth b > 0 with det(I + b (1 - exp(-2 pi i f/f_t)) H0 G(f)) = 1 + b trace + b^2 det = 0.

    Real and imaginary part have a common root b where their resultant is zero; its changes of sign are looked for.
    """
    tooth_frequency = cut.teeth * speed / 60
    top = 4 * (max(mode.frequency for mode in (*x, *y)) + tooth_frequency)
    near = np.sinh(np.linspace(-12, 12, 24001))
    parts = [mode.frequency * (1 + mode.damping_ratio * near) for mode in (*x, *y)]
    f = np.unique(np.concatenate([np.arange(0.0, top, tooth_frequency / 400), *parts]))
    f = f[(f > 0) & (f < top)]
    gx, gy = (np.sum([mode.receptance(f) for mode in modes], axis=0) for modes in (x, y))
    force, waves = mean_force(cut), 1 - np.exp(-2j * np.pi * f / tooth_frequency)
    trace = waves * (force[0, 0] * gx + force[1, 1] * gy)
    det = waves**2 * np.linalg.det(force) * gx * gy
    resultant = det.imag**2 - trace.imag * det.imag * trace.real + trace.imag**2 * det.real
    step = np.flatnonzero(resultant[1:] * resultant[:-1] < 0)
    share = resultant[step] / (resultant[step] - resultant[step + 1])
    t, d = (values[step] + share * np.diff(values)[step] for values in (trace, det))
    loops = (t + np.array([[1], [-1]]) * np.sqrt(t**2 - 4 * d)) / 2
    real = np.where(np.abs(np.angle(loops[0] ** 2)) < np.abs(np.angle(loops[1] ** 2)), loops[0], loops[1]).real
    return float(np.min(-1 / real[real < 0], initial=np.inf))


def random_mode(random: np.random.Generator) -> Mode:
    frequency, stiffness = np.exp(random.uniform(np.log([15.0, 5e5]), np.log([5000.0, 2e8])))
    return Mode(float(frequency), random.uniform(0.008, 0.06), float(stiffness))


def test_the_lowest_limit_is_found_where_the_modes_of_x_and_y_lie_far_apart() -> None:
    random = np.random.default_rng(7)
    for _ in range(60):
        x, y = ([random_mode(random) for _ in range(random.integers(1, 3))] for _ in range(2))
        cut = Cut(4, 1.0, "down", 6e8, random.uniform(6e7, 4e8))
        speed = float(np.exp(random.uniform(np.log(800), np.log(20000))))
        limit = zero_order_lobes(x, y, cut, speed).depth[0]
        assert limit == pytest.approx(lowest_in_a_dense_scan(x, y, cut, speed), rel=2e-3), (x, y, cut, speed)


@pytest.mark.parametrize("measured", [False, True])
def test_a_fast_tool_on_a_slow_column(measured: bool) -> None:
    found = zero_order_lobes(frf(TOOL) if measured else TOOL, COLUMN, FOUR_TEETH, 3000.0)
    exact = stability_boundary(TOOL, COLUMN, FOUR_TEETH, 3000.0, 0.05)
    assert found.depth == pytest.approx(exact.depth, rel=1e-4)
    assert found.depth[0] == pytest.approx(lowest_in_a_dense_scan(TOOL, COLUMN, FOUR_TEETH, 3000.0), rel=1e-4)
    assert found.chatter_frequency == pytest.approx(exact.chatter_frequency, rel=1e-4)


@pytest.mark.parametrize("method", [zero_order_lobes, average_angle_lobes])
def test_a_slow_direction_that_hardly_gives_way_changes_nothing(method: Callable[..., StabilityLobes]) -> None:
    stiff = [Mode(3.0, 0.015, 1e14)]
    alone, beside = method(TOOL, None, CUT, SPEEDS), method(TOOL, stiff, CUT, SPEEDS)
    np.testing.assert_allclose(beside.depth, alone.depth, rtol=1e-4)
    np.testing.assert_allclose(beside.chatter_frequency, alone.chatter_frequency, rtol=1e-4)


def test_a_slot_is_unchanged_when_x_and_y_are_exchanged() -> None:
    slot = Cut(3, 1.0, "up", 6e8, 2e8)
    np.testing.assert_allclose(
        zero_order_lobes(X, Y, slot, SPEEDS).depth, zero_order_lobes(Y, X, slot, SPEEDS).depth, rtol=1e-9
    )


def test_depth_goes_with_stiffness_and_speeds_with_frequency() -> None:
    base = zero_order_lobes(X, Y, CUT, SPEEDS)
    x, y = ([Mode(m.frequency, m.damping_ratio, 3 * m.stiffness) for m in modes] for modes in (X, Y))
    np.testing.assert_allclose(zero_order_lobes(x, y, CUT, SPEEDS).depth, 3 * base.depth, rtol=1e-6)
    x, y = ([Mode(1.7 * m.frequency, m.damping_ratio, m.stiffness) for m in modes] for modes in (X, Y))
    again = zero_order_lobes(x, y, CUT, 1.7 * SPEEDS)
    np.testing.assert_allclose(again.depth, base.depth, rtol=1e-6)
    np.testing.assert_allclose(again.chatter_frequency, 1.7 * base.chatter_frequency, rtol=1e-6)


def test_one_direction_of_a_slot_is_the_average_angle_with_its_mean_share() -> None:
    """H0_xx = N Kr / 4 in a slot, mu_x Ks Nt* = N Kr / 2: the mean of sin^2 is half its largest value."""
    slot = Cut(3, 1.0, "up", 6e8, 2e8)
    one, other = zero_order_lobes(X, None, slot, SPEEDS), average_angle_lobes(X, None, slot, SPEEDS)
    np.testing.assert_allclose(one.depth, 2 * other.depth, rtol=1e-9)


def test_many_teeth_make_it_exact() -> None:
    """With many teeth the force hardly varies: semi-discretisation gives the same limits."""
    cut = Cut(24, 1.0, "up", 6e8, 2e8)
    speeds = np.array([500.0, 700.0, 1100.0, 1600.0])
    exact = stability_boundary(X, Y, cut, speeds, 2e-3)
    mean = zero_order_lobes(X, Y, cut, speeds)
    np.testing.assert_allclose(mean.depth, exact.depth, rtol=2e-3)
    np.testing.assert_allclose(mean.chatter_frequency, exact.chatter_frequency, rtol=1e-3)


def codes(found: StabilityLobes) -> list[str]:
    return [remark.code for remark in found.remarks]


def test_low_immersion_is_warned_of() -> None:
    low = Cut(2, 0.1, "down", 6e8, 2e8)
    for method in (zero_order_lobes, average_angle_lobes):
        (remark,) = method(BENCHMARK, None, low, 18000).remarks
        assert remark.code == "low-immersion"
        assert "0.1 " in remark.text
        assert "semi-discretisation" in remark.cure
    assert zero_order_lobes(BENCHMARK, None, Cut(2, 0.25, "down", 6e8, 2e8), 13000).remarks == ()
    assert stability_boundary(BENCHMARK, None, low, 18000, 2e-3).remarks == ()


@pytest.mark.parametrize("band", [(10.0, 590.0), (700.0, 3000.0)])
def test_an_frf_that_does_not_reach_the_chatter_band_says_so(band: tuple[float, float]) -> None:
    for method in (zero_order_lobes, average_angle_lobes):
        short = method(frf(X).in_band(band), frf(Y).in_band(band), CUT, SPEEDS)
        (remark,) = short.remarks
        assert remark.code == "chatter-band-missing"
        assert f"{band[0]:g} to {band[1]:g} Hz" in remark.text
        assert method(frf(X), frf(Y), CUT, SPEEDS / 4).remarks == ()


@pytest.mark.parametrize("direction", ["up", "down"])
def test_fast_teeth_are_warned_of_where_flip_lobes_make_the_limit_lower(direction: Literal["up", "down"]) -> None:
    """At fast teeth zero order is more than a tenth too deep somewhere, but for a slot."""
    mode, speeds = [Mode(1713.0, 0.029, 3.5e7)], np.linspace(24000.0, 64000.0, 40)
    for immersion, far_off in ((0.35, True), (0.5, True), (0.7, True), (1.0, False)):
        cut = Cut(4, immersion, direction, 1400e6, 500e6)
        mean = zero_order_lobes(mode, None, cut, speeds)
        deepest = 6 * mean.minimum.depth
        true = stability_boundary(mode, None, cut, speeds, deepest).depth
        assert bool(np.any(np.minimum(mean.depth, deepest) > 1.1 * true)) == far_off
        assert ("fast-teeth" in codes(mean), "above 1" in str(mean.remarks)) == (far_off, far_off)
        assert "fast-teeth" not in codes(zero_order_lobes(mode, None, cut, speeds / 6))


@pytest.mark.parametrize(
    ("axis", "direction", "immersion", "is_warned"),
    [("x", "down", 0.7, True), ("x", "up", 0.7, False), ("y", "up", 0.8, True), ("y", "down", 0.8, False)],
)
def test_a_force_that_cancels_in_the_one_direction_known_is_warned_of(
    axis: str, direction: Literal["up", "down"], immersion: float, is_warned: bool
) -> None:
    modes = [Mode(1000.0, 0.03, 3e7)]
    x, y = (modes, None) if axis == "x" else (None, modes)
    cut = Cut(4, immersion, direction, 8e8, 2.4e8)
    speeds = np.linspace(2500.0, 7000.0, 20)
    found = zero_order_lobes(x, y, cut, speeds)
    true = stability_boundary(x, y, cut, speeds, 6 * found.minimum.depth)
    too_deep = np.max(np.minimum(found.depth, 6 * found.minimum.depth) / true.depth)
    assert ("force-cancels" in codes(found)) == is_warned
    assert (f"of the force in {axis}" in str(found.remarks)) == is_warned
    assert (too_deep > 1.2) == is_warned
    assert "force-cancels" not in codes(zero_order_lobes(modes, modes, cut, speeds))


def test_a_cancelling_force_is_warned_of_at_every_speed_also_where_fast_teeth_are() -> None:
    """Zero order's limit is more than 10 times the true one far below the speeds of the flip lobes."""
    modes, cut = [Mode(1722.0, 0.029, 3.2e7)], Cut(4, 0.75, "down", 7e8, 2.1e8)
    fast = zero_order_lobes(modes, None, cut, np.linspace(4000.0, 20000.0, 20))
    assert codes(fast) == ["force-cancels", "fast-teeth"]
    assert "of the force in x" in fast.remarks[0].text
    assert "above 1" in fast.remarks[1].text
    slow = zero_order_lobes(modes, None, cut, np.linspace(4000.0, 5000.0, 5))
    true = stability_boundary(modes, None, cut, slow.speed_rpm, float(np.min(slow.depth)) / 10)
    assert np.max(true.depth) < np.min(slow.depth) / 10
