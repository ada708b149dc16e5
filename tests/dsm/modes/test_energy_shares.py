"""Strain energy shares and mode shapes inside elements, on random spindles with all their parts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from dsm import MATERIALS, Bearing, Joint, LumpedMass, Segment, Spindle, Theory, mode_shapes
from dsm.modes.energy_shares import EnergyShares, energy_shares
from dsm.modes.find_modes import find_modes

RANDOM = settings(max_examples=25, deadline=None)
STEP = 3e-3


@st.composite
def segments(draw: st.DrawFn) -> Segment:
    outer = draw(st.floats(0.03, 0.12))
    bore = outer * draw(st.floats(0.0, 0.6))
    length = draw(st.floats(0.04, 0.2))
    material = MATERIALS[draw(st.sampled_from(sorted(MATERIALS)))]
    kind = draw(st.sampled_from(["uniform", "cone", "heavy"]))
    if kind == "cone":
        return Segment(length, outer, bore, material=material, end_outer_diameter=outer * draw(st.floats(0.7, 1.5)))
    return Segment(length, outer, bore, material=material, mass_diameter=1.2 * outer if kind == "heavy" else None)


@st.composite
def rich_spindles(draw: st.DrawFn) -> Spindle:
    """Three segments with materials and cones, two bearings with housings, a mass at each end and a joint."""
    parts = [draw(segments()) for _ in range(3)]
    parts[1] = replace(parts[1], end_outer_diameter=None)
    start, end, length = (math.fsum(part.length for part in parts[:n]) for n in (1, 2, 3))
    stiffness = st.floats(7.5, 9.5).map(lambda power: float(10**power))
    bearings = [
        Bearing(
            place,
            draw(stiffness),
            rotational_stiffness=draw(st.sampled_from([0.0, 1e5])),
            housing_stiffness=draw(st.sampled_from([math.inf, 5e8])),
        )
        for place in (start, end)
    ]
    masses = [LumpedMass(place, draw(st.floats(0.0, 3.0)), 1e-3) for place in (0.0, length)]
    joints = [Joint((start + end) / 2, draw(stiffness), draw(st.floats(1e4, 1e7)))]
    theory: Theory = draw(st.sampled_from(["euler-bernoulli", "timoshenko"]))
    return Spindle(parts, bearings, theory=theory, masses=masses, joints=joints)


def log_slope(scaled: Callable[[float], Spindle], count: int) -> NDArray[np.float64]:
    """Return d ln f^2 / d ln k of each mode by a central difference."""
    low, high = (find_modes(scaled(math.exp(d)), count).frequency for d in (-STEP, STEP))
    return np.asarray(np.log(high / low) / STEP)


def total(shares: EnergyShares) -> NDArray[np.float64]:
    parts = (shares.segments, shares.bearings, shares.housings, shares.joints)
    return np.asarray(np.hstack(parts).sum(axis=1))


@RANDOM
@given(rich_spindles())
def test_shares_lie_in_0_to_1_and_add_up_to_1(spindle: Spindle) -> None:
    shares = energy_shares(spindle, 4)
    assert total(shares) == pytest.approx(1, abs=1e-6)
    for part in (shares.segments, shares.bearings, shares.housings, shares.joints):
        assert np.all((part >= -1e-7) & (part <= 1 + 1e-7))
    assert shares.frequency == pytest.approx(find_modes(spindle, 4).frequency, rel=1e-12)


@RANDOM
@given(rich_spindles(), st.sampled_from(["segment", "bearing", "housing", "joint"]), st.integers(0, 1))
def test_a_share_is_the_slope_of_the_frequency(spindle: Spindle, kind: str, index: int) -> None:
    frequency = find_modes(spindle, 4).frequency
    assume(np.min(np.diff(frequency) / frequency[:-1]) > 0.05)
    share = getattr(energy_shares(spindle, 3), f"{kind}s")
    part = index % share.shape[1]
    slope = log_slope(lambda factor: stiffened(spindle, kind, part, factor), 3)
    assert slope == pytest.approx(share[:, part], rel=1e-3, abs=1e-4)


def stiffened(spindle: Spindle, kind: str, index: int, factor: float) -> Spindle:
    """Return the spindle with one of its parts stiffer by a factor."""
    segments, bearings, joints = list(spindle.segments), list(spindle.bearings), list(spindle.joints)
    if kind == "segment":
        stuff = segments[index].material or spindle.material
        stiff = replace(stuff, youngs_modulus=factor * stuff.youngs_modulus, shear_modulus=factor * stuff.shear_modulus)
        segments[index] = replace(segments[index], material=stiff)
    elif kind == "housing":
        bearings[index] = replace(bearings[index], housing_stiffness=factor * bearings[index].housing_stiffness)
    elif kind == "bearing":
        old = bearings[index]
        tilting = factor * old.rotational_stiffness
        bearings[index] = replace(old, stiffness=factor * old.stiffness, rotational_stiffness=tilting)
    else:
        joint = joints[index]
        tilting = factor * joint.rotational_stiffness
        joints[index] = replace(joint, stiffness=factor * joint.stiffness, rotational_stiffness=tilting)
    return replace(spindle, segments=segments, bearings=bearings, joints=joints)


def test_two_springs_in_series_share_by_their_compliance() -> None:
    bearings = [Bearing(0.0, 3e6, housing_stiffness=1e6), Bearing(0.4, 3e6, housing_stiffness=1e6)]
    shares = energy_shares(Spindle([Segment(0.4, 0.1)], bearings), 1)
    assert shares.housings / shares.bearings == pytest.approx(3.0, rel=1e-12)
    assert (shares.housings + shares.bearings).sum() == pytest.approx(1, abs=5e-3)
    assert shares.joints.shape == (1, 0)


def test_a_rigid_bearing_takes_no_energy_and_leaves_it_to_its_housing() -> None:
    segments = [Segment(0.4, 0.05)]
    rigid = energy_shares(Spindle(segments, [Bearing(0.1, math.inf), Bearing(0.3, math.inf)]), 2)
    assert not np.any(rigid.bearings)
    assert rigid.segments == pytest.approx(1, abs=1e-8)
    soft = [Bearing(0.1, math.inf, housing_stiffness=1e7), Bearing(0.3, 1e7)]
    shares = energy_shares(Spindle(segments, soft), 1)
    assert shares.housings[0, 0] == pytest.approx(shares.bearings[0, 1], rel=1e-6)
    assert shares.bearings[0, 0] == shares.housings[0, 1] == 0


def test_a_pinned_beam_holds_its_energy_evenly_about_its_middle() -> None:
    """Mode 1 bends as sin: of a pinned beam's energy 1/2 + 1/pi lies in the middle half."""
    beam = Spindle([Segment(0.25, 0.01), Segment(0.5, 0.01), Segment(0.25, 0.01)], [Bearing(0.0, math.inf)])
    beam = replace(beam, bearings=[*beam.bearings, Bearing(1.0, math.inf)])
    outer = (0.5 - 1 / math.pi) / 2
    assert energy_shares(beam, 1).segments[0] == pytest.approx([outer, 1 - 2 * outer, outer], rel=1e-9)


def test_a_shaft_not_held_has_no_shares() -> None:
    with pytest.raises(ValueError, match=r"0 bearing\(s\)"):
        energy_shares(Spindle([Segment(0.4, 0.05)], []), 2)


@RANDOM
@given(rich_spindles(), st.floats(0.0, 1.0))
def test_shapes_inside_elements_are_those_of_a_node_there(spindle: Spindle, share: float) -> None:
    place = share * spindle.length
    steps = np.abs(find_modes(spindle, 1).position - place)
    assume(np.min(steps) > 1e-3)  # nearer, rounding spoils the model with a node there, not the shape
    inside = mode_shapes(spindle, 3, [place])
    noded = find_modes(spindle, 3, places=[place])
    frequency = find_modes(spindle, 4).frequency
    assume(np.min(np.diff(frequency) / frequency[:-1]) > 0.05)
    node = np.argmin(np.abs(noded.position - place))
    sign = np.sign(np.sum(noded.deflection[:, [0, -1]] * find_modes(spindle, 3).deflection[:, [0, -1]], axis=1))
    for found, expected in ((inside.deflection, noded.deflection), (inside.slope, noded.slope)):
        scale = np.max(np.abs(expected), axis=1)
        assert (found[:, 0] - sign * expected[:, node]) / scale == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
def test_shapes_inside_long_elements_to_nine_digits(theory: Theory) -> None:
    spindle = Spindle(
        [Segment(0.5, 0.05), Segment(0.4, 0.09, 0.03)], [Bearing(0.2, 1e8), Bearing(0.7, 2e8)], theory=theory
    )
    places = [0.07, 0.31, 0.44, 0.63, 0.83]
    noded, inside = find_modes(spindle, 4, places=places), mode_shapes(spindle, 4, places)
    nodes = np.searchsorted(noded.position, np.array(places) - 1e-9)
    for expected, found in ((noded.deflection[:, nodes], inside.deflection), (noded.slope[:, nodes], inside.slope)):
        sign = np.sign(np.sum(expected * found, axis=1, keepdims=True))
        assert sign * found == pytest.approx(expected, abs=1e-9 * float(np.max(np.abs(expected))))


def test_shape_of_a_pinned_beam_is_a_sine_everywhere() -> None:
    beam = Spindle([Segment(1.0, 0.02)], [Bearing(0.0, math.inf), Bearing(1.0, math.inf)])
    z = np.linspace(0.0, 1.0, 101)
    modes = mode_shapes(beam, 3, z)
    size = math.sqrt(2 / beam.mass)
    for mode in (1, 2, 3):
        shape, slope = modes.deflection[mode - 1], modes.slope[mode - 1]
        sign = np.sign(slope[0])
        assert sign * shape == pytest.approx(size * np.sin(mode * math.pi * z), abs=1e-9 * size)
        assert sign * slope == pytest.approx(size * mode * math.pi * np.cos(mode * math.pi * z), abs=1e-8 * size)
    assert modes.position == pytest.approx(z)


def test_places_may_come_in_any_order_and_a_joint_has_two_sides() -> None:
    spindle = Spindle([Segment(0.5, 0.05)], [Bearing(0.1, 1e8), Bearing(0.4, 1e8)], joints=[Joint(0.25, 1e7, 1e4)])
    z = [0.5, 0.0, 0.25, 0.25 - 1e-5]
    modes, nodes = mode_shapes(spindle, 2, z), find_modes(spindle, 2)
    joint = np.flatnonzero(nodes.position == 0.25)
    assert modes.deflection[:, :2] == pytest.approx(nodes.deflection[:, [-1, 0]], rel=1e-12)
    assert modes.slope[:, 2] == pytest.approx(nodes.slope[:, joint[1]], rel=1e-12)
    assert modes.slope[:, 3] == pytest.approx(nodes.slope[:, joint[0]], rel=1e-3)
    assert abs(modes.slope[0, 2] - modes.slope[0, 3]) > 0.1 * np.max(np.abs(modes.slope[0]))


@pytest.mark.parametrize(("places", "message"), [([0.6], r"places .*0\.6 m"), ([math.nan], "nan"), (0.1, "1-D")])
def test_places_off_the_shaft_are_rejected(places: object, message: str) -> None:
    spindle = Spindle([Segment(0.5, 0.05)], [Bearing(0.1, 1e8), Bearing(0.4, 1e8)])
    with pytest.raises(ValueError, match=message):
        mode_shapes(spindle, 1, places)  # type: ignore[arg-type]
