"""Cones, materials, masses, joints, housings and groups against closed forms and exact limits.

Cones: the differential equations of the exact cone, integrated to 1e-10. Springs and masses: R. D. Blevins, Formulas
for Natural Frequency and Mode Shape, table 8-8 and chapter 6.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from dsm import (
    MATERIALS,
    Bearing,
    Joint,
    LumpedMass,
    Segment,
    Spindle,
    Theory,
    calibrate,
    natural_frequencies,
    receptance,
    static_stiffness,
)
from dsm.matrix.assemble import HeldDof
from dsm.modes.find_modes import find_modes
from dsm.spindle.segment import ring_area, ring_second_moment

STEEL = MATERIALS["steel"]
LENGTH = 0.5
SHAFT = [Segment(0.2, 0.05), Segment(0.3, 0.08, 0.02)]
HELD = [Bearing(0.1, 1e8), Bearing(0.4, 2e8)]
SPINDLE = Spindle(SHAFT, HELD)


def mismatch(cone: Segment, ends: str, theory: Theory, frequency: float) -> float:
    """Return the determinant of the end conditions at z = L; 0 at a natural frequency. State: u, t, moment, force."""
    w2 = (2 * math.pi * frequency) ** 2
    rigidity = STEEL.youngs_modulus * ring_second_moment(*cone.diameters_at(0.0))
    scale = np.array([1.0, 1 / LENGTH, rigidity / LENGTH**2, rigidity / LENGTH**3])[:, np.newaxis]

    def slope(z: float, state: NDArray[np.float64]) -> NDArray[np.float64]:
        outer, bore = cone.diameters_at(z / LENGTH)
        area, inertia = ring_area(outer, bore), ring_second_moment(outer, bore)
        u, t, moment, force = state.reshape(4, 2)
        exact = theory == "timoshenko"
        shear = force / (STEEL.shear_coefficient(bore / outer) * STEEL.shear_modulus * area) if exact else 0 * force
        turning = STEEL.density * inertia * w2 * t if exact else 0 * t
        bent = moment / (STEEL.youngs_modulus * inertia)
        return np.concatenate([t + shear, bent, -force - turning, -STEEL.density * area * w2 * u])

    given = {"clamped": [2, 3], "free": [0, 1], "pinned": [1, 3]}
    asked = {"clamped": [0, 1], "free": [2, 3], "pinned": [0, 2]}
    near, far = ends.split("-")
    start = np.zeros((4, 2))
    start[given[near], [0, 1]] = scale[given[near], 0]
    end = solve_ivp(slope, (0, LENGTH), start.ravel(), method="DOP853", rtol=1e-10, atol=1e-30).y[:, -1]
    return float(np.linalg.det((end.reshape(4, 2) / scale)[asked[far]]))


def held(ends: str) -> list[HeldDof]:
    dofs = {"clamped": [0, 1], "free": [], "pinned": [0]}
    return [(place, dof) for place, end in zip((0.0, LENGTH), ends.split("-"), strict=True) for dof in dofs[end]]


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("ends", ["clamped-free", "free-clamped", "pinned-pinned"])
@pytest.mark.parametrize(
    "cone",
    [
        Segment(LENGTH, 0.04, end_outer_diameter=0.048),
        Segment(LENGTH, 0.04, end_outer_diameter=0.08, end_bore_diameter=0.05),
        Segment(LENGTH, 0.04, 0.02, end_outer_diameter=0.12),
        Segment(LENGTH, 0.04, end_bore_diameter=0.03),
    ],
    ids=["1.2", "2 hollow", "3", "bore alone"],
)
def test_cones_are_exact(cone: Segment, ends: str, theory: Theory) -> None:
    """A determinant of opposite sign on both sides, 1e-8 away, holds the exact frequency between them."""
    found = find_modes(Spindle([cone], [], theory=theory), 6, held=held(ends)).frequency
    for frequency in found[[0, 2, 5]]:
        below, above = (mismatch(cone, ends, theory, frequency * (1 + side * 1e-8)) for side in (-1, 1))
        assert below * above < 0


def test_a_cone_of_no_taper_is_a_uniform_segment() -> None:
    cone = Spindle([replace(SHAFT[0], end_outer_diameter=0.05), replace(SHAFT[1], end_bore_diameter=0.02)], HELD)
    assert natural_frequencies(cone, 4) == pytest.approx(natural_frequencies(SPINDLE, 4), rel=1e-10)
    assert cone.mass == pytest.approx(SPINDLE.mass, rel=1e-12)


def test_static_deflection_of_a_clamped_cone() -> None:
    """Tip force on a cone of diameter d1 at the tip, d2 at the clamp: 64 F L^3/(3 pi E d1 d2^3)."""
    tip, clamp = 0.04, 0.1
    cone = Segment(LENGTH, tip, end_outer_diameter=clamp)
    stiff = [Bearing(LENGTH, 1e14, rotational_stiffness=1e14)]
    expected = 3 * math.pi * STEEL.youngs_modulus * tip * clamp**3 / (64 * LENGTH**3)
    assert static_stiffness(Spindle([cone], stiff)) == pytest.approx(expected, rel=1e-5)


def test_mass_diameter_adds_mass_and_no_stiffness() -> None:
    plain, heavy = Segment(0.5, 0.05, 0.02), Segment(0.5, 0.05, 0.02, mass_diameter=0.09)
    ratio = (0.09**2 - 0.02**2) / (0.05**2 - 0.02**2)
    assert Spindle([heavy], HELD).mass == pytest.approx(ratio * Spindle([plain], HELD).mass, rel=1e-12)
    slower = natural_frequencies(Spindle([plain], HELD), 3) / math.sqrt(ratio)
    assert natural_frequencies(Spindle([heavy], HELD), 3) == pytest.approx(slower, rel=1e-9)
    assert static_stiffness(Spindle([heavy], HELD)) == pytest.approx(static_stiffness(Spindle([plain], HELD)), rel=1e-9)


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("name", ["aluminium", "titanium", "carbide"])
def test_a_free_shaft_of_another_material(name: str, theory: Theory) -> None:
    """Frequencies go as the root of E/rho; with Timoshenko's theory the same Poisson's ratio is needed for that."""
    stuff = MATERIALS[name]
    if theory == "timoshenko":
        stuff = replace(stuff, shear_modulus=stuff.youngs_modulus * STEEL.shear_modulus / STEEL.youngs_modulus)
    other = Spindle([replace(part, material=stuff) for part in SHAFT], [], theory=theory)
    speed = math.sqrt(stuff.youngs_modulus / stuff.density * STEEL.density / STEEL.youngs_modulus)
    expected = speed * natural_frequencies(Spindle(SHAFT, [], theory=theory), 5)[2:]
    assert natural_frequencies(other, 5)[2:] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("place", "share"), [(0.5, 48.0), (0.25, 256 / 3)])
def test_a_mass_on_a_light_pinned_shaft(place: float, share: float) -> None:
    """Compare with k = 3 EI L/(a^2 b^2): 48 EI/L^3 at the middle."""
    segment = Segment(1.0, 0.05)
    pins = [Bearing(0.0, math.inf), Bearing(1.0, math.inf)]
    shaft = Spindle([segment], pins, density=1e-6, masses=[LumpedMass(place, 20.0)])
    stiffness = share * STEEL.youngs_modulus * segment.second_moment
    assert 2 * math.pi * natural_frequencies(shaft, 1)[0] == pytest.approx(math.sqrt(stiffness / 20.0), rel=1e-7)


def test_a_disk_that_only_tilts() -> None:
    """Diametral inertia at the middle of a light pinned shaft: 12 EI/L against tilting."""
    segment = Segment(1.0, 0.05)
    pins = [Bearing(0.0, math.inf), Bearing(1.0, math.inf)]
    shaft = Spindle([segment], pins, density=1e-6, masses=[LumpedMass(0.5, 0.0, 3.0)])
    stiffness = 12 * STEEL.youngs_modulus * segment.second_moment
    assert 2 * math.pi * natural_frequencies(shaft, 1)[0] == pytest.approx(math.sqrt(stiffness / 3.0), rel=1e-7)


def test_infinite_stiffness_is_the_limit_of_large_ones() -> None:
    rigid = Spindle(SHAFT, [replace(bearing, stiffness=math.inf) for bearing in HELD])
    stiff = Spindle(SHAFT, [replace(bearing, stiffness=1e14) for bearing in HELD])
    limit = natural_frequencies(SPINDLE, 4, rigid_bearings=True)
    assert natural_frequencies(rigid, 4) == pytest.approx(limit, rel=1e-12)
    assert natural_frequencies(stiff, 4) == pytest.approx(limit, rel=5e-5)
    assert np.all(natural_frequencies(stiff, 4) < limit)


def test_a_bearing_stiff_against_tilting_is_a_clamp() -> None:
    beam = Spindle([Segment(0.5, 0.05)], [Bearing(0.5, math.inf, rotational_stiffness=1e12)])
    clamped = find_modes(Spindle([Segment(0.5, 0.05)], []), 3, held=[(0.5, 0), (0.5, 1)]).frequency
    assert natural_frequencies(beam, 3) == pytest.approx(clamped, rel=1e-6)


def test_a_housing_is_a_spring_in_series() -> None:
    soft = Spindle(SHAFT, [replace(b, housing_stiffness=3 * b.stiffness) for b in HELD])
    expected = Spindle(SHAFT, [replace(b, stiffness=0.75 * b.stiffness) for b in HELD])
    assert natural_frequencies(soft, 4) == pytest.approx(natural_frequencies(expected, 4), rel=1e-12)
    assert receptance(soft, [300.0], loss_factor=0.1) == pytest.approx(
        receptance(expected, [300.0], loss_factor=0.1), rel=1e-9
    )
    rigid = Spindle(SHAFT, [Bearing(0.1, math.inf, housing_stiffness=1e8), HELD[1]])
    assert natural_frequencies(rigid, 4) == pytest.approx(natural_frequencies(SPINDLE, 4), rel=1e-12)


def test_calibration_looks_through_the_housing() -> None:
    """From the series stiffness that a frequency asks for to that of the bearing: 1/k - 1/k_housing."""
    housing = 4e8
    frequency = float(natural_frequencies(SPINDLE, 1)[0])
    behind = Spindle(SHAFT, [Bearing(z, 1e8, housing_stiffness=housing) for z in (0.1, 0.4)])
    plain = calibrate(Spindle(SHAFT, [Bearing(z, 1e8) for z in (0.1, 0.4)]), frequency).bearing_stiffness
    found = calibrate(behind, frequency)
    assert found.bearing_stiffness == pytest.approx(1 / (1 / plain - 1 / housing), rel=1e-8)
    assert found.residual == pytest.approx(0, abs=1e-6)


def test_a_stiff_joint_is_none() -> None:
    beam = Spindle([Segment(0.6, 0.05)], [Bearing(0.0, math.inf), Bearing(0.6, math.inf)])
    stiff = replace(beam, joints=[Joint(0.25, 1e13, 1e11)])
    assert natural_frequencies(stiff, 4) == pytest.approx(natural_frequencies(beam, 4), rel=1e-5)


def test_a_hinge_in_the_middle_of_a_symmetric_shaft() -> None:
    """Each half ends free (symmetric modes) or pinned (antisymmetric ones)."""
    ends = [Bearing(0.0, math.inf), Bearing(1.0, math.inf)]
    hinged = Spindle(
        [Segment(1.0, 0.05)], [*ends, Bearing(0.3, 1e7), Bearing(0.7, 1e7)], joints=[Joint(0.5, 1e12, 1e-3)]
    )
    half = Spindle([Segment(0.5, 0.05)], [ends[0], Bearing(0.3, 1e7)])
    free = find_modes(half, 3).frequency
    pinned = find_modes(half, 3, held=[(0.5, 0)]).frequency
    expected = np.sort(np.concatenate([free, pinned]))[:4]
    assert natural_frequencies(hinged, 4) == pytest.approx(expected, rel=2e-5)


def test_a_damper_under_a_stiff_bar() -> None:
    """A stiff bar on two springs and dampers bounces as one mass: x/F = 1/(2k - m w^2 + 2 i w c) at its middle."""
    bearings = [Bearing(0.0, 1e5, damping=40.0), Bearing(0.4, 1e5, damping=40.0)]
    bar = Spindle([Segment(0.4, 0.2)], bearings)
    frequency = np.array([0.0, 5.0, 7.12, 20.0])
    w = 2 * math.pi * frequency
    expected = 1 / (2e5 - bar.mass * w**2 + 2j * w * 40.0)
    found = receptance(bar, frequency, position=0.2)
    assert np.abs(found / expected - 1) == pytest.approx(0, abs=1e-3)


def test_a_damper_works_through_the_housing() -> None:
    """Spring and damper in parallel, both in series with the housing."""
    k, c, housing = 1e5, 300.0, 2e5
    bar = Spindle([Segment(0.4, 0.2)], [Bearing(z, k, damping=c, housing_stiffness=housing) for z in (0.0, 0.4)])
    w = 2 * math.pi * 6.0
    felt = 1 / (1 / (k + 1j * w * c) + 1 / housing)
    expected = 1 / (2 * felt - bar.mass * w**2)
    assert abs(receptance(bar, [6.0], position=0.2)[0] / expected - 1) < 1e-3


def test_calibration_moves_its_group_alone() -> None:
    bearings = [
        Bearing(0.05, 1e8, group="front"),
        Bearing(0.2, 2e8, group="front"),
        Bearing(0.3, 3e8, group="rear"),
        Bearing(0.45, 4e8, group=""),
    ]
    spindle = Spindle(SHAFT, bearings)
    target = 0.97 * float(natural_frequencies(spindle, 1)[0])
    front = calibrate(spindle, target, group="front")
    stiffness = [bearing.stiffness for bearing in front.spindle.bearings]
    assert stiffness == pytest.approx([1e8 * front.factor, 2e8 * front.factor, 3e8, 4e8], rel=1e-12)
    assert front.residual == pytest.approx(0, abs=1e-6)
    everything = calibrate(spindle, target)
    assert everything.spindle.bearings[3] == bearings[3]
    ratios = [a.stiffness / b.stiffness for a, b in zip(everything.spindle.bearings[:3], bearings[:3], strict=True)]
    assert ratios == pytest.approx([everything.factor] * 3, rel=1e-12)
    assert 1 > everything.factor > front.factor
    with pytest.raises(ValueError, match=r"group 'tail' .* 'front', 'rear'"):
        calibrate(spindle, target, group="tail")


@st.composite
def rich(draw: st.DrawFn) -> Spindle:
    outer = st.floats(0.03, 0.1)
    parts = [
        Segment(draw(st.floats(0.05, 0.2)), draw(outer), end_outer_diameter=draw(outer)),
        Segment(
            draw(st.floats(0.1, 0.3)), draw(outer), 0.015, material=draw(st.sampled_from([None, MATERIALS["titanium"]]))
        ),
        Segment(draw(st.floats(0.05, 0.2)), draw(outer), mass_diameter=0.11),
    ]
    start, end, length = (math.fsum(part.length for part in parts[:n]) for n in (1, 2, 3))
    stiffness = st.floats(7.0, 9.5).map(lambda power: float(10**power))
    bearings = [
        Bearing(start, draw(stiffness), housing_stiffness=draw(stiffness), rotational_stiffness=1e4),
        Bearing(end, draw(stiffness), housing_stiffness=draw(stiffness)),
    ]
    masses = [LumpedMass(length, draw(st.floats(0.1, 5.0)), draw(st.floats(1e-4, 1e-2)))]
    joints = [Joint((start + end) / 2, draw(stiffness), draw(st.floats(1e4, 1e7)))]
    theory: Theory = draw(st.sampled_from(["euler-bernoulli", "timoshenko"]))
    return Spindle(parts, bearings, theory=theory, masses=masses, joints=joints)


STIFFER = {
    "bearing": lambda s: replace(
        s, bearings=[replace(s.bearings[0], stiffness=2 * s.bearings[0].stiffness), s.bearings[1]]
    ),
    "tilting": lambda s: replace(s, bearings=[replace(s.bearings[0], rotational_stiffness=1e6), s.bearings[1]]),
    "housing": lambda s: replace(s, bearings=[s.bearings[0], replace(s.bearings[1], housing_stiffness=math.inf)]),
    "joint": lambda s: replace(s, joints=[replace(s.joints[0], stiffness=2 * s.joints[0].stiffness)]),
    "joint, tilting": lambda s: replace(s, joints=[replace(s.joints[0], rotational_stiffness=1e8)]),
    "material": lambda s: replace(s, youngs_modulus=1.3 * s.youngs_modulus),
    "lighter shaft": lambda s: replace(s, density=0.7 * s.density),
    "lighter body": lambda s: replace(s, masses=[]),
    "less inertia": lambda s: replace(s, masses=[replace(s.masses[0], diametral_inertia=0.0)]),
    "lighter segment": lambda s: (
        replace(s, segments=[*s.segments[:2], replace(s.segments[2], mass_diameter=None)])
        if s.segments[2].outer_diameter < 0.11
        else s
    ),
}


@settings(max_examples=60, deadline=None)
@given(rich(), st.sampled_from(sorted(STIFFER)))
def test_frequencies_rise_with_any_stiffness_and_fall_with_any_mass(spindle: Spindle, change: str) -> None:
    before, after = natural_frequencies(spindle, 4), natural_frequencies(STIFFER[change](spindle), 4)
    assert np.all(after >= before * (1 - 1e-7))
    assert np.any(after > before)


@settings(max_examples=20, deadline=None)
@given(rich(), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_response_between_any_two_points_is_the_same_both_ways(spindle: Spindle, near: float, far: float) -> None:
    one, two = near * spindle.length, far * spindle.length
    frequency = [0.0, 300.0, 2000.0]
    there = receptance(spindle, frequency, one, 0.05, force_position=two)
    back = receptance(spindle, frequency, two, 0.05, force_position=one)
    own = np.abs(receptance(spindle, frequency, one, 0.05) * receptance(spindle, frequency, two, 0.05)) ** 0.5
    assert np.abs(there - back) / own == pytest.approx(0, abs=1e-6)


def test_a_wall_may_thin_out_to_nothing() -> None:
    shaft = Spindle([Segment(0.3, 0.05, end_bore_diameter=0.049999)], [Bearing(0.02, 1e8), Bearing(0.2, 1e8)])
    thick = Spindle([Segment(0.3, 0.05, end_bore_diameter=0.049)], [Bearing(0.02, 1e8), Bearing(0.2, 1e8)])
    assert natural_frequencies(shaft, 2) == pytest.approx(natural_frequencies(thick, 2), rel=0.1)


def test_cone_between_bearings_of_its_own_keeps_the_bound_of_its_steps() -> None:
    """Modes with bearings inside the cone, against three times the steps."""
    cone = Segment(0.430926, 0.037288, end_outer_diameter=0.064384)
    bearings = [Bearing(0.008087, 2.90e9), Bearing(0.403962, 7.08e9)]
    ends = np.linspace(0.0, 1.0, 13)
    parts = [
        Segment(cone.length / 12, cone.diameters_at(a)[0], end_outer_diameter=cone.diameters_at(b)[0])
        for a, b in itertools.pairwise(ends)
    ]
    one, fine = (Spindle(shaft, bearings, theory="timoshenko") for shaft in ([cone], parts))
    assert natural_frequencies(one, 6) == pytest.approx(natural_frequencies(fine, 6), rel=1e-4)
