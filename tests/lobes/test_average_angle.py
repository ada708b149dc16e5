"""Average tooth angle: scaling laws, modes against FRF, independent search for the limit, bad input."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from acquisition import Frf
from lobes import Cut, StabilityLobes, average_angle_lobes
from modal import Mode

SPEEDS = np.linspace(1500.0, 24000.0, 40)
CUT = Cut(3, 0.6, "up", 600e6, 200e6)
X = [Mode(603.0, 0.039, 5.59e6), Mode(1450.0, 0.02, 2.1e7)]
Y = [Mode(666.0, 0.035, 5.715e6)]

MODES = st.lists(
    st.builds(Mode, st.floats(200, 3000), st.floats(0.01, 0.15), st.floats(1e6, 1e8)), min_size=1, max_size=3
)
CUTS = st.builds(
    Cut,
    st.integers(1, 8),
    st.floats(0.02, 1.0),
    st.sampled_from(["up", "down"]),
    st.floats(1e8, 3e9),
    st.floats(2e7, 1e9),
)
"""With Kr = 0 mu_x = -mu_y: equal directions cancel and only rounding is left. All others are good."""
FACTORS = st.floats(0.1, 10.0)


def frf(modes: list[Mode], line: float, highest: float = 6000.0) -> Frf:
    frequency = np.arange(line, highest, line)
    return Frf(frequency, np.sum([mode.receptance(frequency) for mode in modes], axis=0))


def scaled(modes: list[Mode], frequency: float = 1.0, stiffness: float = 1.0) -> list[Mode]:
    return [Mode(m.frequency * frequency, m.damping_ratio, m.stiffness * stiffness) for m in modes]


def assert_same(one: StabilityLobes, other: StabilityLobes, depth: float = 1.0, frequency: float = 1.0) -> None:
    """Depths of `other` are `depth` times those of `one`, its chatter frequencies `frequency` times."""
    np.testing.assert_allclose(other.depth, depth * one.depth, rtol=1e-6)
    np.testing.assert_allclose(other.chatter_frequency, frequency * one.chatter_frequency, rtol=1e-6)


def scanned_depth(x: list[Mode], y: list[Mode], cut: Cut, speed: float) -> float:
    """Lowest limit by brute force: sign changes of Re[G exp(-i pi f/f_t)] on a fine and even frequency scale."""
    tooth = cut.teeth * speed / 60
    frequency = np.arange(0.02, 3 * max(m.frequency for m in x + y) + 3 * tooth, 0.05)
    mu_x, mu_y = cut.orientation_factors
    response: NDArray[np.complex128] = np.zeros(frequency.size, dtype=np.complex128)
    for weight, modes in ((mu_x, x), (mu_y, y)):
        for mode in modes:
            response += weight * mode.receptance(frequency)
    turned = (response * np.exp(-1j * np.pi * frequency / tooth)).real
    crossing = np.flatnonzero(turned[1:] * turned[:-1] < 0)
    share = turned[crossing] / (turned[crossing] - turned[crossing + 1])
    real = response.real[crossing] + share * (response.real[crossing + 1] - response.real[crossing])
    return float(np.min(-1 / (2 * cut.specific_force * cut.teeth_in_cut * real[real < 0]), initial=np.inf))


@settings(max_examples=40, deadline=None)
@given(x=MODES, y=MODES, cut=CUTS, speed=st.floats(500, 60000))
def test_limit_is_the_lowest_of_all_crossings(x: list[Mode], y: list[Mode], cut: Cut, speed: float) -> None:
    depth = average_angle_lobes(x, y, cut, speed).depth[0]
    scan = scanned_depth(x, y, cut, speed)
    assert depth == pytest.approx(scan, rel=1e-3)


@settings(max_examples=25, deadline=None)
@given(x=MODES, y=MODES, cut=CUTS)
def test_chatter_closes_the_loop_with_a_whole_number_of_waves(x: list[Mode], y: list[Mode], cut: Cut) -> None:
    """Ks Nt* b G_or (1 - exp(-2 pi i f/f_t)) = -1 at every limit, and on every point of every lobe."""
    lobes = average_angle_lobes(x, y, cut, SPEEDS)
    points = [(lobes.speed_rpm, lobes.depth, lobes.chatter_frequency)]
    points += [(lobe.speed_rpm, lobe.depth, lobe.chatter_frequency) for lobe in lobes.lobes]
    mu_x, mu_y = cut.orientation_factors
    for speed, depth, chatter in points:
        usual = depth < 1e4 * np.min(lobes.depth)
        f = chatter[usual]
        response = mu_x * sum(m.receptance(f) for m in x) + mu_y * sum(m.receptance(f) for m in y)
        loop = cut.specific_force * cut.teeth_in_cut * depth[usual] * response
        np.testing.assert_allclose(loop * (1 - np.exp(-120j * np.pi * f / (cut.teeth * speed[usual]))), -1, atol=1e-6)


@settings(max_examples=25, deadline=None)
@given(x=MODES, cut=CUTS, factor=FACTORS)
def test_depth_goes_with_stiffness_and_against_cutting_force(x: list[Mode], cut: Cut, factor: float) -> None:
    base = average_angle_lobes(x, None, cut, SPEEDS)
    assert_same(base, average_angle_lobes(scaled(x, stiffness=factor), None, cut, SPEEDS), depth=factor)
    harder = Cut(cut.teeth, cut.immersion, cut.direction, factor * cut.tangential, factor * cut.radial)
    assert_same(base, average_angle_lobes(x, None, harder, SPEEDS), depth=1 / factor)


@settings(max_examples=25, deadline=None)
@given(x=MODES, y=MODES, cut=CUTS, factor=FACTORS)
def test_speeds_go_with_the_frequencies(x: list[Mode], y: list[Mode], cut: Cut, factor: float) -> None:
    base = average_angle_lobes(x, y, cut, SPEEDS)
    other = average_angle_lobes(scaled(x, factor), scaled(y, factor), cut, factor * SPEEDS)
    assert_same(base, other, frequency=factor)


def test_twice_the_teeth_at_half_the_speed_halve_the_depth() -> None:
    base = average_angle_lobes(X, Y, CUT, SPEEDS)
    twice = average_angle_lobes(X, Y, Cut(6, 0.6, "up", 600e6, 200e6), SPEEDS / 2)
    assert_same(base, twice, depth=0.5)


def test_a_mode_may_be_split_in_two_of_twice_the_stiffness() -> None:
    halves = scaled(X, stiffness=2) * 2
    assert_same(average_angle_lobes(X, Y, CUT, SPEEDS), average_angle_lobes(halves, Y, CUT, SPEEDS))


@pytest.mark.parametrize(("line", "error"), [(5.0, 5e-4), (1.0, 1e-6)])
def test_frf_and_its_modes_give_the_same_lobes(line: float, error: float) -> None:
    speeds = np.linspace(1500.0, 24000.0, 2000)
    lobes = average_angle_lobes(X, Y, CUT, speeds)
    measured = average_angle_lobes(frf(X, line), frf(Y, line), CUT, speeds)
    np.testing.assert_allclose(measured.depth, lobes.depth, rtol=error)
    np.testing.assert_allclose(measured.chatter_frequency, lobes.chatter_frequency, rtol=error)


def test_frfs_of_different_lines_and_modes_may_be_mixed() -> None:
    lobes = average_angle_lobes(X, Y, CUT, SPEEDS)
    for x, y in ((frf(X, 1.0), frf(Y, 0.7, 5000.0)), (frf(X, 1.0), Y), (X, frf(Y, 1.0))):
        np.testing.assert_allclose(average_angle_lobes(x, y, CUT, SPEEDS).depth, lobes.depth, rtol=1e-4)


def test_noise_outside_the_usable_band_does_not_count() -> None:
    clean = frf(X, 1.0)
    noise = np.where(clean.frequency < 50, -1e-4, 0)
    noisy = Frf(clean.frequency, clean.receptance + noise, usable_band=(100.0, 5000.0))
    np.testing.assert_allclose(
        average_angle_lobes(noisy, None, CUT, SPEEDS).depth, average_angle_lobes(X, None, CUT, SPEEDS).depth, rtol=1e-4
    )


def test_a_symmetric_slot_feels_only_the_feed_direction() -> None:
    """At the mean angle of 90 deg mu_y = 0: exchanging x and y is another chart, changing y is the same one."""
    slot = Cut(4, 1.0, "up", 695e6, 281e6)
    lobes = average_angle_lobes(X, Y, slot, SPEEDS)
    assert_same(lobes, average_angle_lobes(X, scaled(Y, 0.7, 0.3), slot, SPEEDS))
    assert_same(lobes, average_angle_lobes(X, None, slot, SPEEDS))
    exchanged = average_angle_lobes(Y, X, slot, SPEEDS)
    assert np.all(np.abs(exchanged.depth / lobes.depth - 1) > 1e-3)


def test_a_slot_has_no_limit_where_only_y_gives_way() -> None:
    assert np.all(np.isinf(average_angle_lobes(None, Y, Cut(4, 1.0, "up", 695e6, 281e6), SPEEDS).depth))


def test_none_is_a_rigid_direction() -> None:
    rigid = scaled(Y, stiffness=1e12)
    assert_same(average_angle_lobes(rigid, Y, CUT, SPEEDS), average_angle_lobes(None, Y, CUT, SPEEDS))
    assert_same(average_angle_lobes(X, rigid, CUT, SPEEDS), average_angle_lobes(X, None, CUT, SPEEDS))


def test_equal_directions_add_their_orientation_factors() -> None:
    mu_x, mu_y = CUT.orientation_factors
    both = average_angle_lobes(X, X, CUT, SPEEDS)
    assert_same(average_angle_lobes(scaled(X, stiffness=mu_x / (mu_x + mu_y)), None, CUT, SPEEDS), both)


def test_many_lobes_at_low_speed() -> None:
    """The crossings stand less than a tooth frequency apart: one of them is that near to the absolute minimum."""
    mode, speed = Mode(500.0, 0.02, 8e6), np.geomspace(0.5, 60.0, 50)
    lobes = average_angle_lobes([mode], None, CUT, speed)
    gain = CUT.specific_force * CUT.orientation_factors[0] * CUT.teeth_in_cut
    lowest, tooth = 500 * np.sqrt(1.04), 3 * speed / 60
    bound = [-1 / (2 * gain * mode.receptance(lowest + side * tooth).real) for side in (-1, 1)]
    assert np.all(lobes.depth >= 2 * 8e6 * 0.02 * 1.02 / gain * (1 - 1e-12))
    assert np.all(lobes.depth <= np.maximum(*bound) * (1 + 1e-4))
    assert max(lobe.number for lobe in lobes.lobes) > 10000


def test_far_above_the_mode_its_mass_alone_is_left() -> None:
    """There chatter runs at half the tooth frequency, and b = (m (2 pi f)^2 - k) / (2 Ks mu_x Nt*)."""
    mode, speed = Mode(20.0, 0.002, 1e4), np.array([30000.0, 240000.0])
    lobes = average_angle_lobes([mode], None, CUT, speed)
    half = 3 * speed / 120
    gain = CUT.specific_force * CUT.orientation_factors[0] * CUT.teeth_in_cut
    np.testing.assert_allclose(lobes.chatter_frequency, half, rtol=1e-3)
    np.testing.assert_allclose(lobes.depth, 1e4 * ((half / 20) ** 2 - 1) / (2 * gain), rtol=1e-3)


def test_lobe_curves_pass_through_the_limits_of_the_range() -> None:
    lobes = average_angle_lobes(X, Y, CUT, SPEEDS)
    lower = np.full(SPEEDS.size, np.inf)
    for lobe in lobes.lobes:
        assert np.all((lobe.speed_rpm[1:-1] >= SPEEDS[0]) & (lobe.speed_rpm[1:-1] <= SPEEDS[-1]))
        middle = (lobe.chatter_frequency[1:] + lobe.chatter_frequency[:-1]) / 2
        mu_x, mu_y = CUT.orientation_factors
        response = mu_x * sum(m.receptance(middle) for m in X) + mu_y * sum(m.receptance(middle) for m in Y)
        assert np.all(response.real < 0)
        assert np.all(np.diff(lobe.chatter_frequency) > 0)
        turn = np.flatnonzero(np.diff(np.sign(np.diff(lobe.speed_rpm)))) + 1
        for run in np.split(np.arange(lobe.speed_rpm.size), turn):
            order = run[np.argsort(lobe.speed_rpm[run])]
            here = np.interp(SPEEDS, lobe.speed_rpm[order], lobe.depth[order], left=np.inf, right=np.inf)
            lower = np.minimum(lower, here)
    np.testing.assert_allclose(lower, lobes.depth, rtol=5e-3)


def test_an_frf_without_negative_real_part_has_no_limit() -> None:
    stiff = Frf(np.arange(1.0, 100.0), np.full(99, 1e-8 - 1e-9j))
    lobes = average_angle_lobes(stiff, None, CUT, SPEEDS)
    assert np.all(np.isinf(lobes.depth))
    assert np.all(np.isnan(lobes.chatter_frequency))
    assert set(lobes.kind) == {""}
    assert lobes.lobes == ()
    assert lobes.minimum.depth == np.inf


def test_speeds_keep_their_order() -> None:
    order = np.random.default_rng(1).permutation(SPEEDS.size)
    np.testing.assert_array_equal(
        average_angle_lobes(X, Y, CUT, SPEEDS[order]).depth, average_angle_lobes(X, Y, CUT, SPEEDS).depth[order]
    )


@pytest.mark.parametrize("speed", [0.0, -100.0, np.nan, np.inf, [], [[1000.0]]])
def test_bad_speeds_are_rejected(speed: Any) -> None:
    with pytest.raises(ValueError, match="speed_rpm"):
        average_angle_lobes(X, None, CUT, speed)


def test_two_rigid_directions_are_rejected() -> None:
    with pytest.raises(ValueError, match=r"x and y .*None"):
        average_angle_lobes(None, None, CUT, SPEEDS)


def test_no_modes_are_rejected() -> None:
    with pytest.raises(ValueError, match=r"y .*modes"):
        average_angle_lobes(X, [], CUT, SPEEDS)


def test_a_mode_of_no_driving_point_is_rejected() -> None:
    with pytest.raises(ValueError, match=r"3671 Hz of x .*-1e\+07 N/m.*driving point"):
        average_angle_lobes([Mode(3671.0, 0.002, -1e7)], None, CUT, SPEEDS)


def test_frfs_without_a_common_band_are_rejected() -> None:
    low, high = frf(X, 1.0).in_band((1, 500)), frf(Y, 1.0).in_band((600, 900))
    with pytest.raises(ValueError, match=r"band.* 500 Hz.* 600 Hz"):
        average_angle_lobes(low, high, CUT, SPEEDS)
