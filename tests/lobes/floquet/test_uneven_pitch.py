"""Teeth of unequal pitch: known limits, invariances, the kinship with even teeth, bad input."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lobes import Cut, average_angle_lobes, spectral_radius, stability_boundary, zero_order_lobes
from lobes.loop_limits import uneven_limits
from modal import Mode

X, Y = [Mode(1500.0, 0.03, 20e6)], [Mode(1575.0, 0.028, 22e6)]
SPEEDS = np.linspace(3000, 16000, 14)
EVEN = Cut(4, 1.0, "down", 800e6, 240e6)


def with_pitch(cut: Cut, *degrees: float) -> Cut:
    return replace(cut, pitch=tuple(math.radians(angle) for angle in degrees))


def limits(cut: Cut, speeds: NDArray[np.float64] = SPEEDS) -> NDArray[np.float64]:
    return stability_boundary(X, Y, cut, speeds, 0.03).depth


@pytest.mark.parametrize(
    ("pitch", "immersion", "lowest", "median", "highest"),
    [
        ((85, 95, 85, 95), 1.0, 1.03, 1.20, 1.69),
        ((85, 95, 85, 95), 0.25, 0.92, 1.16, 1.51),
        ((80, 100, 80, 100), 1.0, 0.69, 1.33, 2.15),
    ],
)
def test_gain_over_even_teeth_is_that_of_a_simulation_in_time(
    pitch: tuple[float, ...], immersion: float, lowest: float, median: float, highest: float
) -> None:
    """Ratios that a simulation in time, which shares nothing with this package, found at 14 speeds."""
    even = replace(EVEN, immersion=immersion)
    gain = limits(with_pitch(even, *pitch)) / limits(even)
    assert [np.min(gain), np.median(gain), np.max(gain)] == pytest.approx([lowest, median, highest], abs=0.006)


def test_a_pitch_can_halve_what_even_teeth_bear() -> None:
    speed = np.array([11000.0])
    assert limits(EVEN, speed)[0] == pytest.approx(2.76e-3, abs=5e-6)
    assert limits(with_pitch(EVEN, 80, 100, 80, 100), speed)[0] == pytest.approx(1.91e-3, abs=5e-6)


def test_pitches_that_are_alike_are_even_teeth() -> None:
    assert with_pitch(EVEN, 90, 90, 90, 90) == EVEN
    assert with_pitch(replace(EVEN, teeth=3), 120, 120, 120).pitch == ()


def test_which_tooth_is_the_first_does_not_matter() -> None:
    cut = replace(EVEN, immersion=0.3)
    depths = [limits(with_pitch(cut, *pitch)) for pitch in ((80, 90, 95, 95), (95, 80, 90, 95), (95, 95, 80, 90))]
    assert depths[1] == pytest.approx(depths[0], rel=1e-4)
    assert depths[2] == pytest.approx(depths[0], rel=1e-4)


def test_order_of_the_pitches_matters() -> None:
    cut = replace(EVEN, immersion=0.3)
    one, other = (limits(with_pitch(cut, *pitch)) for pitch in ((80, 100, 80, 100), (80, 80, 100, 100)))
    assert np.max(np.abs(one / other - 1)) > 0.05


def test_pitches_that_hardly_differ_are_almost_even() -> None:
    almost = with_pitch(EVEN, 89.99, 90.01, 89.99, 90.01)
    assert limits(almost) == pytest.approx(limits(EVEN), rel=2e-3)
    assert zero_order_lobes(X, Y, almost, SPEEDS).depth == pytest.approx(
        zero_order_lobes(X, Y, EVEN, SPEEDS).depth, rel=2e-3
    )
    assert average_angle_lobes(X, None, almost, SPEEDS).depth == pytest.approx(
        average_angle_lobes(X, None, EVEN, SPEEDS).depth, rel=2e-3
    )


def test_multipliers_are_those_over_the_whole_pattern() -> None:
    even = spectral_radius(X, Y, EVEN, [7000.0], [5e-4, 1.5e-3])
    almost = spectral_radius(X, Y, with_pitch(EVEN, 89.999, 90.001, 89.999, 90.001), [7000.0], [5e-4, 1.5e-3])
    assert almost == pytest.approx(even**2, rel=1e-3)


def test_chatter_sounds_near_a_natural_frequency() -> None:
    chart = stability_boundary(X, Y, with_pitch(EVEN, 80, 90, 95, 95), SPEEDS, 0.03)
    assert np.all((chart.chatter_frequency > 1450) & (chart.chatter_frequency < 1700))


def test_zero_order_closes_the_loop_of_the_mean_force() -> None:
    """One direction: 1 + b H0 G (1 - exp(-i w tau)) = 0 in the mean over the teeth, at each limit."""
    cut = with_pitch(replace(EVEN, teeth=3), 100, 120, 140)
    chart = zero_order_lobes(X, None, cut, SPEEDS)
    force = 3 / (2 * math.pi) * 240e6 * math.pi / 2
    mode = X[0]
    ratio = chart.chatter_frequency / mode.frequency
    flexibility = 1 / mode.stiffness / (1 - ratio**2 + 2j * mode.damping_ratio * ratio)
    turns = chart.chatter_frequency * 60 / SPEEDS
    regenerated = np.mean([1 - np.exp(-2j * math.pi * turns * angle / 360) for angle in (100, 120, 140)], axis=0)
    assert np.abs(1 + chart.depth * force * flexibility * regenerated) == pytest.approx(np.zeros(14), abs=1e-6)


def test_zero_order_of_uneven_teeth_has_no_lobes() -> None:
    assert zero_order_lobes(X, Y, with_pitch(EVEN, 80, 90, 95, 95), SPEEDS).lobes == ()


def test_a_loop_that_is_never_negative_has_no_limit() -> None:
    from lobes.tip_response import TipResponse

    grid = np.linspace(10, 1000, 100)
    quiet = TipResponse(grid, lambda frequency: np.full(frequency.shape, 1e-9 + 0j))
    cut = with_pitch(EVEN, 85, 95, 85, 95)
    depth, chatter = uneven_limits(quiet, cut, np.array([100.0]))
    assert (depth.tolist(), np.isnan(chatter).tolist()) == ([math.inf], [True])


@pytest.mark.parametrize(
    ("degrees", "said"),
    [
        ((85, 95, 85, 96), "361 degrees.* 360"),
        ((85, 95, 180), "3 angles for 4 "),
        ((0, 90, 90, 180), r"\[0, 90, .*> 0"),
        ((-85, 265, 85, 95), r"\[-85, .*> 0"),
        ((math.nan, 90, 90, 90), r"\[nan, .*> 0"),
    ],
)
def test_what_is_no_pitch_is_rejected(degrees: tuple[float, ...], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        with_pitch(EVEN, *degrees)
