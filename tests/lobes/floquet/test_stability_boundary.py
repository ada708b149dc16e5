"""Semi-discretisation: brute-force integration of the delay equation, scaling laws, helix, islands, bad input."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from acquisition import Frf
from lobes import Cut, radial_lobes, spectral_radius, stability_boundary, zero_order_lobes
from lobes.tip_response import TipModes
from lobes.tooth_force import mean_force
from modal import Mode

X = [Mode(603.0, 0.039, 5.59e6), Mode(1450.0, 0.02, 2.1e7)]
Y = [Mode(666.0, 0.035, 5.715e6)]
CUT = Cut(3, 0.4, "up", 600e6, 200e6)
SPEEDS = np.array([4000.0, 6500.0, 9000.0, 13000.0])


def force_matrix(cut: Cut, turned: float, depth: float, slices: int = 40) -> NDArray[np.float64]:
    """Depth times H of all teeth at the angle of tooth 0, summed over slices along the axis."""
    total: NDArray[np.float64] = np.zeros((2, 2))
    heights = (np.arange(slices) + 0.5) * depth / slices if cut.helix_lag else np.zeros(1)
    for height in heights:
        for tooth in range(cut.teeth):
            phi = (turned + 2 * math.pi * tooth / cut.teeth - cut.helix_lag * height) % (2 * math.pi)
            if cut.entry_angle < phi < cut.exit_angle:
                s, c, kt, kr = math.sin(phi), math.cos(phi), cut.tangential, cut.radial
                total += [
                    [(kt * c + kr * s) * s, (kt * c + kr * s) * c],
                    [(-kt * s + kr * c) * s, (-kt * s + kr * c) * c],
                ]
    return total * depth / len(heights)


def growth_by_integration(cut: Cut, speed: float, depth: float, steps: int = 600, periods: int = 80) -> float:
    """Growth per tooth period of a disturbance, by symplectic Euler steps through the delay equation of X and Y."""
    modes = [(mode, 0) for mode in X] + [(mode, 1) for mode in Y]
    w = np.array([2 * math.pi * mode.frequency for mode, _ in modes])
    zeta = np.array([mode.damping_ratio for mode, _ in modes])
    shape = np.zeros((2, len(modes)))
    for i, (mode, axis) in enumerate(modes):
        shape[axis, i] = w[i] / math.sqrt(mode.stiffness)
    period = 60 / (cut.teeth * speed)
    h = period / steps
    forces = [force_matrix(cut, 2 * math.pi * (i + 0.5) / (steps * cut.teeth), depth) for i in range(steps)]
    q, v = np.ones(len(modes)), np.zeros(len(modes))
    before: NDArray[np.float64] = np.zeros((steps, 2))
    sizes = []
    for _ in range(periods):
        now = np.empty((steps, 2))
        for i in range(steps):
            now[i] = shape @ q
            force = -forces[i] @ (now[i] - before[i])
            v = (v + h * (shape.T @ force - w**2 * q)) / (1 + 2 * h * zeta * w)
            q = q + h * v
        before = now
        sizes.append(math.sqrt(float(np.sum(now**2))))
    half = periods // 2
    return float(np.exp(np.polyfit(np.arange(half), np.log(sizes[half:]), 1)[0]))


@pytest.mark.parametrize(
    ("cut", "speed", "factor"),
    [
        (CUT, 6500.0, 0.9),
        (CUT, 6500.0, 1.15),
        (replace(CUT, direction="down"), 6500.0, 1.15),
        (replace(CUT, immersion=0.1, direction="down"), 9000.0, 1.2),
        (replace(CUT, helix_lag=180.0), 9000.0, 1.2),
    ],
)
def test_growth_is_that_of_the_integrated_delay_equation(cut: Cut, speed: float, factor: float) -> None:
    depth = factor * stability_boundary(X, Y, cut, speed, 30e-3).depth[0]
    expected = spectral_radius(X, Y, cut, speed, depth)[0, 0]
    assert (expected > 1) == (factor > 1)
    assert growth_by_integration(cut, speed, depth) == pytest.approx(expected, rel=0.01)


def test_limits_are_where_the_radius_is_one() -> None:
    lobes = stability_boundary(X, Y, CUT, SPEEDS, 20e-3)
    for speed, depth in zip(SPEEDS, lobes.depth, strict=True):
        around = spectral_radius(X, Y, CUT, speed, [0.999 * depth, depth, 1.001 * depth])[0]
        assert around[0] < 1 < around[2]
        assert around[1] == pytest.approx(1, abs=1e-5)


def test_without_a_cut_only_the_damping_is_left() -> None:
    period = 60 / (3 * SPEEDS)
    expected = np.exp(-0.035 * 2 * np.pi * 666 * period)
    np.testing.assert_allclose(spectral_radius(None, Y, CUT, SPEEDS, 0.0)[:, 0], expected, rtol=1e-6)


@pytest.mark.parametrize("mode", [Mode(603.0, 0.039, 5.59e6), Mode(603.0, 1.4, 5.59e6), Mode(60300.0, 0.01, 5.59e6)])
def test_damped_and_fast_modes_without_a_cut(mode: Mode) -> None:
    """The slowest decay of q'' + 2 zeta w q' + w^2 q = 0, below and above critical damping."""
    w, zeta, period = 2 * math.pi * mode.frequency, mode.damping_ratio, 60 / (3 * 9000)
    rate = zeta * w - math.sqrt(max(zeta**2 - 1, 0)) * w
    radius = spectral_radius([mode], None, CUT, 9000.0, 0.0)
    assert radius[0, 0] == pytest.approx(math.exp(-rate * period), rel=1e-5 if zeta < 1 else 0.5)


def test_growth_and_decay_beyond_what_a_number_holds() -> None:
    """A metre of depth at 300 rpm pulls the tool in without bounds; without a cut all is forgotten within a turn."""
    mode, cut = [Mode(900.0, 0.02, 1e6)], Cut(1, 0.5, "up", 600e6, 200e6)
    radius = spectral_radius(None, mode, cut, 300.0, [0.0, 1.0])[0]
    assert radius[0] == pytest.approx(math.exp(-0.2 * 0.02 * 2 * math.pi * 900), rel=1e-5)
    assert radius[1] > 1e50
    assert 1e-5 < stability_boundary(None, mode, cut, 300.0, 1.0).depth[0] < 1.0


def test_a_creeping_mode() -> None:
    """Without inertia c q' + (k + b H) q = b H q(t - tau): ln mu = -tau/c (k + b H0 (1 - 1/mu)), H0 the mean of H."""
    cut, mode = Cut(3, 1.0, "up", 100e6, 600e6), Mode(1000.0, 5.0, 1e7)
    time = 10 / (2 * math.pi * 1000.0) / (60 / (3 * 1200.0))
    push = 1e-2 * mean_force(cut)[0, 0] / mode.stiffness
    mu = brentq(lambda mu: time * math.log(mu) + 1 + push * (1 - 1 / mu), 0.05, 1.0)
    radius = spectral_radius([mode], None, cut, 1200.0, 1e-2)
    assert radius[0, 0] == pytest.approx(mu, rel=0.01)


def test_depth_goes_with_stiffness_and_against_cutting_force() -> None:
    base = stability_boundary(X, Y, CUT, SPEEDS, 10e-3)
    x, y = ([replace(m, stiffness=3 * m.stiffness) for m in modes] for modes in (X, Y))
    np.testing.assert_allclose(stability_boundary(x, y, CUT, SPEEDS, 30e-3).depth, 3 * base.depth, rtol=1e-5)
    harder = replace(CUT, tangential=2 * CUT.tangential, radial=2 * CUT.radial)
    np.testing.assert_allclose(stability_boundary(X, Y, harder, SPEEDS, 5e-3).depth, base.depth / 2, rtol=1e-5)


def test_speeds_go_with_the_frequencies() -> None:
    base = stability_boundary(X, Y, CUT, SPEEDS, 10e-3)
    x, y = ([replace(m, frequency=1.7 * m.frequency) for m in modes] for modes in (X, Y))
    again = stability_boundary(x, y, CUT, 1.7 * SPEEDS, 10e-3)
    np.testing.assert_allclose(again.depth, base.depth, rtol=1e-5)
    np.testing.assert_allclose(again.chatter_frequency, 1.7 * base.chatter_frequency, rtol=1e-5)
    assert list(again.kind) == list(base.kind)


def up_over_down(cut: Cut) -> NDArray[np.float64]:
    up, down = (stability_boundary(X, Y, replace(cut, direction=d), SPEEDS, 20e-3).depth for d in ("up", "down"))
    return np.asarray(up / down)


def test_mirroring_the_feed_exchanges_up_and_down() -> None:
    """(x, phi) -> (-x, pi - phi) with only Kr in the force turns up-milling into down-milling; with Kt it does not."""
    assert up_over_down(Cut(3, 0.4, "up", 1.0, 600e6)) == pytest.approx(1, abs=1e-3)
    assert np.all(np.abs(up_over_down(CUT) - 1) > 0.05)


def test_a_slot_is_the_same_up_and_down() -> None:
    assert up_over_down(replace(CUT, immersion=1.0)) == pytest.approx(1, abs=1e-6)


def test_a_mode_may_be_split_in_two_of_twice_the_stiffness() -> None:
    halves = [replace(m, stiffness=2 * m.stiffness) for m in X] * 2
    base, split = (spectral_radius(x, Y, CUT, SPEEDS, [1e-3, 3e-3]) for x in (X, halves))
    np.testing.assert_allclose(split, base, rtol=1e-8)


def test_a_very_stiff_direction_is_a_rigid_one() -> None:
    stiff = [Mode(666.0, 0.5, 1e14)]
    np.testing.assert_allclose(
        spectral_radius(X, stiff, CUT, SPEEDS, 2e-3), spectral_radius(X, None, CUT, SPEEDS, 2e-3), rtol=1e-3
    )


def test_a_tiny_helix_is_none_and_a_whole_lag_leaves_the_mean_force() -> None:
    straight = spectral_radius(X, Y, CUT, SPEEDS, 2e-3)
    np.testing.assert_allclose(spectral_radius(X, Y, replace(CUT, helix_lag=1e-3), SPEEDS, 2e-3), straight, rtol=1e-5)
    depth = zero_order_lobes(X, Y, CUT, SPEEDS).depth
    for speed, limit in zip(SPEEDS, depth, strict=True):
        pitch = replace(CUT, helix_lag=2 * np.pi / (3 * limit))
        radius = spectral_radius(X, Y, pitch, speed, limit)
        assert radius[0, 0] == pytest.approx(1, abs=2e-3)


def test_the_island_between_two_scanned_depths_is_found() -> None:
    """a/D 0.1 at 18 000 rpm: stable again from 3.118 to 3.831 mm, a step of the scan to 60 mm is 0.4 to 3 mm."""
    benchmark = [Mode(922.0, 0.011, 0.03993 * (2 * math.pi * 922) ** 2)]
    low = Cut(2, 0.1, "down", 6e8, 2e8)
    crossings = stability_boundary(benchmark, None, low, 18000.0, 60e-3).crossings[0, :3] * 1e3
    assert crossings == pytest.approx([0.815657, 3.117990, 3.831038], rel=0.01)


def test_pieces_follow_the_fastest_mode_that_can_chatter() -> None:
    slow, fast = (stability_boundary(X, Y, CUT, speed, 2e-3) for speed in (500.0, 8000.0))
    assert slow.method == "semi-discretisation"
    assert slow.method_text == f"semi-discretisation, {slow.detail}"
    cycles = 1450 * 60 / (3 * 500)
    assert int(slow.detail.split()[0]) == pytest.approx(cycles / 0.75, rel=0.01)
    assert int(fast.detail.split()[0]) == pytest.approx(cycles / 12, abs=1)
    rigid = [*X, Mode(9000.0, 0.02, 1e11)]
    assert stability_boundary(rigid, Y, CUT, 500.0, 2e-3).detail == slow.detail


ROBOT, TOOL = Mode(18.0, 0.015, 8e5), Mode(2500.0, 0.035, 4e7)
WALL = Mode(240.0, 0.008, 6e5)


def limit_of_a_constant_force(x: TipModes, y: TipModes, cut: Cut, speed: float) -> float:
    """Lowest b with det(I + b (1 - exp(-i w tau)) H G(w)) = 0 by a dense scan over w, H constant."""
    f = np.linspace(1.0, 6000.0, 3_000_001)
    loop = np.zeros((f.size, 2, 2), dtype=complex)
    for axis, modes in enumerate((x, y)):
        for mode in modes or ():
            ratio = f / mode.frequency
            loop[:, :, axis] += (1 / mode.stiffness / (1 - ratio**2 + 2j * mode.damping_ratio * ratio))[:, np.newaxis]
    loop *= mean_force(cut) * (1 - np.exp(-2j * np.pi * f * 60 / (cut.teeth * speed)))[:, np.newaxis, np.newaxis]
    trace, det = np.trace(loop, axis1=1, axis2=2), loop[:, 0, 0] * loop[:, 1, 1] - loop[:, 0, 1] * loop[:, 1, 0]
    found = []
    for side in (1, -1):
        with np.errstate(divide="ignore", invalid="ignore"):
            b = -1 / (trace / 2 + side * np.sqrt(trace**2 / 4 - det))
        turns = (np.sign(b[1:].imag) != np.sign(b[:-1].imag)) & (np.abs(np.diff(b.imag)) < np.abs(b[1:].real))
        found += [value for value in b[1:][turns].real if value > 0]
    return float(min(found))


@pytest.mark.parametrize("coefficients", [(700e6, 250e6), (600e6, 180e6), (2000e6, 600e6)])
@pytest.mark.parametrize(
    ("x", "y"), [([TOOL], [ROBOT]), ([ROBOT, TOOL], None), ([TOOL, WALL], [ROBOT, TOOL]), ([WALL], [TOOL])]
)
def test_a_soft_slow_mode_does_not_hide_the_fast_one_that_chatters(
    x: list[Mode], y: TipModes, coefficients: tuple[float, float]
) -> None:
    """Robots and thin walls: 18 and 240 Hz next to 2500 Hz. The force of four teeth in a slot is constant."""
    cut = Cut(4, 1.0, "down", *coefficients)
    found = stability_boundary(x, y, cut, 3000.0, 60e-3)
    assert found.depth[0] == pytest.approx(limit_of_a_constant_force(x, y, cut, 3000.0), rel=0.005)


def test_limits_over_radial_depth() -> None:
    found = radial_lobes(lambda cut: stability_boundary(X, Y, cut, SPEEDS, 10e-3), CUT, [0.2, 0.4])
    np.testing.assert_array_equal(found.depth[1], stability_boundary(X, Y, CUT, SPEEDS, 10e-3).depth)
    np.testing.assert_array_equal(found.speed_rpm, SPEEDS)
    assert (found.depth.shape, found.remarks) == ((2, 4), ())
    mean = radial_lobes(lambda cut: zero_order_lobes(X, Y, cut, SPEEDS), CUT, [0.4, 0.2])
    (remark,) = mean.remarks
    assert remark.code == "low-immersion"
    assert "immersion 0.2" in remark.text


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"x": None, "y": None}, "x and y .*None"),
        ({"y": []}, "y .*modes"),
        ({"x": [Mode(600.0, 0.02, -1e7)]}, r"600 Hz .*-1e\+07 N/m"),
        ({"x": Frf(np.arange(1.0, 9.0), np.ones(8, complex))}, r"x is an FRF.*modal.fit_modes"),
        ({"speed_rpm": 0.0}, "speed_rpm"),
        ({"depth": -1e-3}, r"depth\[0\]=-0.001"),
        ({"depth": [1e-3, math.nan]}, r"depth\[1\]=nan"),
        ({"depth": []}, r"depth .*\(0,\)"),
    ],
)
def test_bad_input_of_the_chart_is_rejected(change: dict[str, Any], message: str) -> None:
    good = {"x": X, "y": Y, "cut": CUT, "speed_rpm": 6000.0, "depth": 1e-3}
    with pytest.raises(ValueError, match=message):
        spectral_radius(**{**good, **change})


@pytest.mark.parametrize("depth", [0.0, -1.0, math.nan, math.inf])
def test_bad_deepest_depths_are_rejected(depth: float) -> None:
    with pytest.raises(ValueError, match="max_depth"):
        stability_boundary(X, Y, CUT, 6000.0, depth)


@pytest.mark.parametrize("immersion", [0.0, 1.1, [], [[0.5]]])
def test_bad_immersions_are_rejected(immersion: Any) -> None:
    with pytest.raises(ValueError, match="immersion"):
        radial_lobes(lambda cut: zero_order_lobes(X, Y, cut, SPEEDS), CUT, immersion)
