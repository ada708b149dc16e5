"""Modes with rotated principal directions: invariances, agreement of methods, bad input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lobes import (
    Cut,
    Program,
    build_milling_system,
    program_limit,
    project_modes,
    spectral_radius,
    stability_boundary,
    zero_order_lobes,
)
from modal import Mode, synthesize_frf

PAIR = [Mode(1500.0, 0.03, 20e6), Mode(1575.0, 0.028, 22e6)]
SPEEDS = np.array([5000.0, 7000.0, 11000.0])
CUT = Cut(4, 0.25, "down", 800e6, 240e6)
SLOT = replace(CUT, immersion=1.0)


def turned_by(degrees: float) -> NDArray[np.float64]:
    """Axes of two modes square to each other, the first at an angle from x."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, s], [-s, c]])


@pytest.mark.parametrize(
    "cut", [CUT, SLOT, replace(CUT, helix_lag=60.0), replace(CUT, pitch=(1.4, 1.7, 1.6, 2 * np.pi - 4.7))]
)
def test_spindle_and_feed_turned_together_have_the_same_limits(cut: Cut) -> None:
    straight = stability_boundary(PAIR[:1], PAIR[1:], replace(cut, feed_angle=-0.6), SPEEDS, 0.02)
    askew = stability_boundary(PAIR, None, cut, SPEEDS, 0.02, turned_by(np.degrees(0.6)))
    assert askew.depth == pytest.approx(straight.depth, rel=1e-5)
    assert askew.chatter_frequency == pytest.approx(straight.chatter_frequency, rel=1e-5)


def test_two_modes_that_are_alike_have_no_axes() -> None:
    alike = [PAIR[0], PAIR[0]]
    depths = [stability_boundary(alike, None, CUT, SPEEDS, 0.02, turned_by(angle)).depth for angle in (0, 33, 80)]
    assert depths[1] == pytest.approx(depths[0], rel=1e-6)
    assert depths[2] == pytest.approx(depths[0], rel=1e-6)


def test_vectors_along_the_axes_change_nothing() -> None:
    kinds, program = (None, turned_by(0)), Program(CUT, 9000.0, 2e-3)
    radius = [spectral_radius(PAIR[:1], PAIR[1:], CUT, SPEEDS, [1e-3, 4e-3], kind) for kind in kinds]
    np.testing.assert_array_equal(radius[0], radius[1])
    cuts = [replace(program.cut, feed_angle=angle) for angle in (0.0, 0.5)]
    limits = [program_limit(program, PAIR[:1], PAIR[1:], cuts, kind).limits for kind in kinds]
    assert limits[0] == limits[1]


def test_stiffness_and_length_of_a_vector_count_together() -> None:
    """A mode with half the vector and a quarter of the stiffness is the same."""
    softer = [mode.scaled(1.0, 0.25, "") for mode in PAIR]
    whole, half = (
        stability_boundary(modes, None, CUT, SPEEDS, 0.02, share * turned_by(35)).depth
        for modes, share in ((PAIR, 1.0), (softer, 0.5))
    )
    assert half == pytest.approx(whole, rel=1e-9)


@pytest.mark.parametrize("angle", [20.0, 35.0, 70.0])
def test_zero_order_is_exact_in_a_slot_of_four_teeth(angle: float) -> None:
    """The force is constant there."""
    exact = stability_boundary(PAIR, None, SLOT, SPEEDS, 0.02, turned_by(angle))
    shown = project_modes(PAIR, turned_by(angle))
    mean = zero_order_lobes(shown.x, shown.y, SLOT, SPEEDS, shown.cross)
    assert mean.depth == pytest.approx(exact.depth, rel=1e-5)
    assert mean.chatter_frequency == pytest.approx(exact.chatter_frequency, rel=1e-5)


@pytest.mark.parametrize("angle", [20.0, 35.0, 70.0])
def test_zero_order_of_spindle_and_feed_turned_together_is_the_same(angle: float) -> None:
    """A sign of the cross term put wrong is seen at once."""
    straight = zero_order_lobes(PAIR[:1], PAIR[1:], replace(CUT, feed_angle=-np.radians(angle)), SPEEDS)
    shown = project_modes(PAIR, turned_by(angle))
    askew = zero_order_lobes(shown.x, shown.y, CUT, SPEEDS, shown.cross)
    assert askew.depth == pytest.approx(straight.depth, rel=1e-5)
    assert askew.chatter_frequency == pytest.approx(straight.chatter_frequency, rel=1e-5)
    against = zero_order_lobes(shown.x, shown.y, CUT, SPEEDS, [mode.scaled(1.0, -1.0, "") for mode in shown.cross])
    assert np.max(np.abs(against.depth / straight.depth - 1)) > 0.1


def test_zero_order_knows_cross_frfs_as_it_knows_their_modes() -> None:
    shown = project_modes(PAIR, turned_by(35))
    lines = np.arange(300.0, 4000.0, 2.0)
    x, y, cross = (synthesize_frf(modes, lines) for modes in shown)
    of_modes = zero_order_lobes(shown.x, shown.y, CUT, SPEEDS, shown.cross)
    assert zero_order_lobes(x, y, CUT, SPEEDS, cross).depth == pytest.approx(of_modes.depth, rel=1e-3)


def test_a_rotated_mode_can_halve_what_direct_taps_alone_promise() -> None:
    """At a/D 0.1 and 35 degrees: leaving the cross term out states 3.6 times the limit at 5000 rpm."""
    low = replace(CUT, immersion=0.1, direction="up")
    shown = project_modes(PAIR, turned_by(35))
    askew = stability_boundary(PAIR, None, low, SPEEDS[:1], 0.02, turned_by(35)).depth
    direct = stability_boundary(shown.x, shown.y, low, SPEEDS[:1], 0.02).depth
    assert direct / askew == pytest.approx([3.564], rel=1e-3)


def test_the_system_shows_the_receptance_of_its_vectors() -> None:
    at, shown = np.linspace(0.0, 3000.0, 31), project_modes(PAIR, turned_by(35))
    matrix = build_milling_system(PAIR, None, turned_by(35)).receptance(at)
    for (a, b), modes in zip([(0, 0), (1, 1), (0, 1), (1, 0)], (*shown, shown.cross), strict=True):
        assert matrix[:, a, b] == pytest.approx(sum(mode.receptance(at) for mode in modes), rel=1e-12)


@pytest.mark.parametrize(
    ("vectors", "problem"),
    [
        ([[1.0, 0.0]], r"vectors .*\(1, 2\).*\(2, 2\)"),
        ([1.0, 0.0, 0.0, 1.0], r"vectors .*\(4,\)"),
        ([[1.0, 0.0], [np.nan, 1.0]], "vectors .*finite"),
    ],
)
def test_vectors_that_fit_no_modes_are_rejected(vectors: list[list[float]], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        stability_boundary(PAIR, None, CUT, SPEEDS, 0.02, vectors)


def test_a_cross_frf_without_both_directions_is_rejected() -> None:
    with pytest.raises(ValueError, match=r"cross .*x or y"):
        zero_order_lobes(PAIR, None, CUT, SPEEDS, PAIR)
    with pytest.raises(ValueError, match=r"cross .*modes"):
        zero_order_lobes(PAIR, PAIR, CUT, SPEEDS, [])
