"""Receptance map against the receptance of each spindle; no motion at a rigid bearing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsm import Bearing, Joint, LumpedMass, Segment, Spindle, Theory, receptance, static_stiffness
from dsm.calibration.receptance_map import receptance_map

F = np.array([0.0, *np.linspace(10.0, 5000.0, 60)])
FACTORS = np.array([0.2, 0.5, 1.0, 1.7, 10.0])


def spindle(theory: Theory = "euler-bernoulli") -> Spindle:
    """Bearings with and without dampers, housings and stiffness against tilting, of two groups and of none."""
    return Spindle(
        [Segment(0.08, 0.03), Segment(0.1, 0.06, 0.01), Segment(0.2, 0.08, 0.02), Segment(0.12, 0.06, 0.02)],
        [
            Bearing(0.1, 1e8, damping=500.0, housing_stiffness=5e8, group="front"),
            Bearing(0.14, 2e8, housing_stiffness=1e9, rotational_stiffness=1e4, group="front"),
            Bearing(0.42, 1.5e8, damping=200.0, group="rear"),
            Bearing(0.3, 1e6, damping=50.0, group=""),
        ],
        theory=theory,
        masses=[LumpedMass(0.45, 1.0, 1e-3)],
        joints=[Joint(0.08, 1e9, 1e6)],
    )


def scaled(given: Spindle, factor: float, *groups: str) -> Spindle:
    bearings = [replace(b, stiffness=factor * b.stiffness) if b.group in groups else b for b in given.bearings]
    return replace(given, bearings=bearings)


def without_dampers(given: Spindle) -> Spindle:
    return replace(given, bearings=[replace(bearing, damping=0.0) for bearing in given.bearings])


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("loss_factor", [0.0, 0.03])
@pytest.mark.parametrize(("group", "groups"), [(None, ("front", "rear")), ("front", ("front",)), ("rear", ("rear",))])
def test_each_row_is_the_receptance(theory: Theory, loss_factor: float, group: str | None, groups: tuple[str]) -> None:
    found = receptance_map(spindle(theory), F, FACTORS, loss_factor=loss_factor, group=group)
    assert found.shape == (FACTORS.size, F.size)
    for row, factor in zip(found, FACTORS, strict=True):
        exact = receptance(scaled(spindle(theory), factor, *groups), F, loss_factor=loss_factor)
        assert np.max(np.abs(row / exact - 1)) < 1e-10


@pytest.mark.parametrize("position", [0.05, 0.1, 0.25])
def test_undamped_and_inside_the_shaft(position: float) -> None:
    given = without_dampers(spindle())
    found = receptance_map(given, F, FACTORS, position)
    assert not np.any(found.imag)
    for row, factor in zip(found, FACTORS, strict=True):
        exact = receptance(scaled(given, factor, "front", "rear"), F, position)
        assert np.max(np.abs(row / exact - 1)) < 1e-7  # resonances magnify rounding


def test_equal_bearings_on_a_symmetrical_shaft() -> None:
    """Double eigenvalues: two shafts' worth of bearings that do not feel each other."""
    long = Spindle([Segment(20.0, 0.05)], [Bearing(z, 1e8) for z in (0.5, 1.0, 19.0, 19.5)])
    found = receptance_map(long, [3000.0, 3100.0], [0.5, 3.0], 10.0, loss_factor=0.5)
    for row, factor in zip(found, (0.5, 3.0), strict=True):
        exact = receptance(scaled(long, factor, "bearings"), [3000.0, 3100.0], 10.0, loss_factor=0.5)
        assert np.max(np.abs(row / exact - 1)) < 1e-10


def test_many_frequencies_are_taken_in_chunks() -> None:
    frequency = np.linspace(100.0, 3000.0, 173)
    exact = receptance(scaled(spindle(), 2.0, "front", "rear"), frequency, loss_factor=0.05)
    assert receptance_map(spindle(), frequency, 2.0, loss_factor=0.05)[0] == pytest.approx(exact, rel=1e-10)


@settings(max_examples=20, deadline=None)
@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(0, 5e3), st.floats(7.5, 10))
def test_factors_far_apart(low: float, high: float, damping: float, housing: float) -> None:
    first = replace(spindle().bearings[0], damping=damping, housing_stiffness=10**housing)
    given = replace(spindle(), bearings=[first, *spindle().bearings[1:]])
    found = receptance_map(given, F, [10**low, 10**high], loss_factor=0.05)
    exact = receptance(scaled(given, 10**low, "front", "rear"), F, loss_factor=0.05)
    assert np.max(np.abs(found[0] / exact - 1)) < 1e-8


def test_nothing_moves_where_a_rigid_bearing_stands() -> None:
    rigid = replace(spindle(), bearings=[*spindle().bearings, Bearing(0.2, math.inf, group="")])
    assert not np.any(receptance(rigid, F, 0.2))
    assert not np.any(receptance(rigid, F, 0.0, force_position=0.2))
    assert not np.any(receptance_map(rigid, F, FACTORS, 0.2))
    assert static_stiffness(rigid, 0.2) == math.inf
    found = receptance_map(rigid, F, 3.0)[0]
    assert np.max(np.abs(found / receptance(scaled(rigid, 3.0, "front", "rear"), F) - 1)) < 1e-9


def test_refusals() -> None:
    for factor in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match=r"factor=.* > 0"):
            receptance_map(spindle(), F, [1.0, factor])
    for shape in ((0,), (2, 2)):
        with pytest.raises(ValueError, match=r"factor .*shape \("):
            receptance_map(spindle(), F, np.ones(shape))
    with pytest.raises(ValueError, match="group 'middle'"):
        receptance_map(spindle(), F, 1.0, group="middle")
    with pytest.raises(ValueError, match="stiffness=inf"):
        receptance_map(replace(spindle(), bearings=[*spindle().bearings, Bearing(0.2, math.inf)]), F, 1.0)
    with pytest.raises(ValueError, match="frequency=-1"):
        receptance_map(spindle(), [-1.0], 1.0)
    with pytest.raises(ValueError, match="loss_factor=-1"):
        receptance_map(spindle(), F, 1.0, loss_factor=-1.0)
    with pytest.raises(ValueError, match="1 bearing"):
        receptance_map(replace(spindle(), bearings=spindle().bearings[:1]), F, 1.0)
    assert receptance_map(spindle(), [], FACTORS).shape == (5, 0)
