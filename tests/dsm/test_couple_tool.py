"""A tool coupled to the condensed spindle is the whole shaft, model against model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsm import MATERIALS, Bearing, Joint, LumpedMass, Segment, Spindle, Theory, natural_frequencies, receptance
from dsm.response import couple_tool, spindle_side
from dsm.spindle.spindle import change_tool

pytestmark = pytest.mark.quick

F = np.array([0.0, 0.01, *np.linspace(5.0, 6000.0, 100)])
THEORIES: tuple[Theory, ...] = ("euler-bernoulli", "timoshenko")


def spindle(theory: Theory = "euler-bernoulli") -> Spindle:
    """One with all that a spindle can have but cones; beyond 0.11 m dampers, a housing, a mass and a joint."""
    return Spindle(
        [
            Segment(0.06, 0.02, material=MATERIALS["carbide"]),
            Segment(0.05, 0.035),
            Segment(0.06, 0.05, 0.01),
            Segment(0.3, 0.07, 0.02, mass_diameter=0.08),
            Segment(0.2, 0.06, 0.02),
        ],
        [
            Bearing(0.05, 1e7),
            Bearing(0.17, 2e8, damping=300.0, housing_stiffness=1e9),
            Bearing(0.25, 3e8, rotational_stiffness=2e4),
            Bearing(0.6, 1.5e8, damping=100.0),
        ],
        theory=theory,
        masses=[LumpedMass(0.02, 0.05), LumpedMass(0.5, 1.2, 1e-3, 2e-3)],
        joints=[Joint(0.1, 1e9, 1e6), Joint(0.21, 2e9, 1e7)],
    )


def tool(theory: Theory = "euler-bernoulli") -> Spindle:
    return Spindle(
        [
            Segment(0.05, 0.018, mass_diameter=0.02, material=MATERIALS["stainless steel"]),
            Segment(0.016, 0.019),
            Segment(0.09, 0.02),
        ],
        (),
        youngs_modulus=580e9,
        density=14500.0,
        theory=theory,
        shear_modulus=238e9,
        masses=[LumpedMass(0.05, 0.02, 1e-6)],
        joints=[Joint(0.11, 5e8, 1e5)],
    )


def error(found: np.ndarray, exact: np.ndarray) -> float:
    return float(np.max(np.abs(found / exact - 1)))


def with_cones(shaft: Spindle, number: int, outer: float, bore: float = 0.0) -> Spindle:
    """Return the shaft with a segment that widens to these diameters."""
    segments = list(shaft.segments)
    segments[number] = replace(segments[number], end_outer_diameter=outer, end_bore_diameter=bore)
    return replace(shaft, segments=segments)


@pytest.mark.parametrize("theory", THEORIES)
@pytest.mark.parametrize(("loss_factor", "tolerance"), [(0.03, 1e-10), (0.0, 1e-8)])  # resonances magnify rounding
@pytest.mark.parametrize("position", [0.0, 0.11, 0.13, 0.23])  # at the tip, at a segment's end, inside segments
def test_coupled_tool_is_the_whole_shaft(theory: Theory, loss_factor: float, tolerance: float, position: float) -> None:
    side = spindle_side(spindle(theory), F, position, loss_factor)
    whole = change_tool(spindle(theory), position, tool(theory))
    assert error(couple_tool(side, tool(theory)), receptance(whole, F, loss_factor=loss_factor)) < tolerance


@pytest.mark.parametrize(("theory", "tolerance"), [("timoshenko", 1e-9), ("euler-bernoulli", 1e-6)])
@pytest.mark.parametrize("position", [0.11, 0.13])
def test_cones_on_both_sides_and_through_the_cut(theory: Theory, tolerance: float, position: float) -> None:
    """The tolerance is the rounding in the short pieces of the cones, which are stiffer without shear."""
    given, cutter = with_cones(spindle(theory), 2, 0.055, 0.012), with_cones(tool(theory), 1, 0.02)
    whole = change_tool(given, position, cutter)
    found = couple_tool(spindle_side(given, F, position, 0.03), cutter)
    assert error(found, receptance(whole, F, loss_factor=0.03)) < tolerance
    blunt = replace(whole, segments=change_tool(spindle(theory), position, tool(theory)).segments)
    assert error(found, receptance(blunt, F, loss_factor=0.03)) > 1e-2


def test_the_same_tool_put_back_changes_nothing() -> None:
    given = replace(spindle(), bearings=spindle().bearings[1:])
    same = replace(given, segments=given.segments[:2], bearings=(), masses=given.masses[:1], joints=given.joints[:1])
    assert change_tool(given, 0.11, same).segments == given.segments
    coupled = couple_tool(spindle_side(given, F, 0.11, 0.02), same)
    assert error(coupled, receptance(given, F, loss_factor=0.02)) < 1e-10


def test_bearing_and_mass_at_the_cut_stay_with_the_spindle() -> None:
    given = spindle()
    given = replace(
        given, bearings=[*given.bearings, Bearing(0.11, 7e7)], masses=[*given.masses, LumpedMass(0.11, 2.0)]
    )
    whole = change_tool(given, 0.11, tool())
    assert [bearing.position for bearing in whole.bearings] == pytest.approx([0.216, 0.296, 0.646, 0.156])
    assert [mass.position for mass in whole.masses] == pytest.approx([0.05, 0.546, 0.156])
    assert error(couple_tool(spindle_side(given, F, 0.11), tool()), receptance(whole, F)) < 1e-10


def test_joint_where_the_tool_begins_stays_with_the_spindle() -> None:
    given = replace(spindle(), joints=[*spindle().joints, Joint(0.11, 3e8, 4e4)])
    whole = change_tool(given, 0.11, tool())
    assert [joint.position for joint in whole.joints] == pytest.approx([0.11, 0.156, 0.256])
    assert (whole.joints[1].stiffness, whole.joints[1].rotational_stiffness) == (3e8, 4e4)
    exact = receptance(whole, F, loss_factor=0.03)
    assert error(couple_tool(spindle_side(given, F, 0.11, 0.03), tool()), exact) < 1e-10
    rigid = couple_tool(spindle_side(spindle(), F, 0.11, 0.03), tool())
    hard = replace(given, joints=[*spindle().joints, Joint(0.11, 1e16, 1e13)])
    assert error(couple_tool(spindle_side(hard, F, 0.11, 0.03), tool()), rigid) < 1e-5
    assert error(exact, rigid) > 0.1


def test_cantilever_tool_on_an_unyielding_spindle() -> None:
    """Tip deflection of a clamped beam under a steady force: L^3/(3 EI)."""
    block = Spindle([Segment(0.2, 1.0)], [Bearing(0.0, 1e14), Bearing(0.2, 1e14)])
    beam = Spindle([Segment(0.1, 0.01)], ())
    expected = 0.1**3 / (3 * 210e9 * beam.segments[0].second_moment)
    assert couple_tool(spindle_side(block, 0.0, 0.0), beam)[0].real == pytest.approx(expected, rel=1e-5)


def test_a_long_cone_is_stepped_for_the_shaft_it_is_part_of() -> None:
    cone = Spindle([Segment(0.1, 0.02, end_outer_diameter=0.04)], ())
    coupled = couple_tool(spindle_side(spindle(), F, 0.11, 0.05), cone)
    whole = receptance(change_tool(spindle(), 0.11, cone), F, loss_factor=0.05)
    assert error(coupled, whole) < 1e-3


def test_material_of_the_tool_goes_with_it() -> None:
    whole = change_tool(spindle(), 0.11, tool())
    carbide = tool().material
    assert [segment.material for segment in whole.segments[:3]] == [MATERIALS["stainless steel"], carbide, carbide]
    assert whole.mass == pytest.approx(change_tool(spindle(), 0.11, replace(tool(), masses=())).mass + 0.02)
    steel = replace(tool(), youngs_modulus=210e9, density=7850.0, shear_modulus=None)
    assert change_tool(spindle(), 0.11, steel).segments[2].material is None


@settings(max_examples=20, deadline=None)
@given(st.floats(0.001, 0.245), st.floats(0.01, 0.2), st.floats(0.008, 0.05))  # two bearings stay
def test_any_cut_and_any_tool(position: float, length: float, diameter: float) -> None:
    given = replace(spindle(), joints=())
    rod = Spindle([Segment(length, diameter)], ())
    whole = receptance(change_tool(given, position, rod), F[2:], loss_factor=0.03)
    assert error(couple_tool(spindle_side(given, F[2:], position, 0.03), rod), whole) < 1e-6


def test_longer_tool_lowers_the_frequency() -> None:
    longer = replace(tool(), segments=[*tool().segments[:2], Segment(0.12, 0.02)])
    first = [natural_frequencies(change_tool(spindle(), 0.11, part), 1)[0] for part in (tool(), longer)]
    assert first[1] < first[0]


def test_refusals() -> None:
    given, side = spindle(), spindle_side(spindle(), F, 0.11)
    for position in (-0.01, 0.67, np.nan):
        with pytest.raises(ValueError, match="position="):
            change_tool(given, position, tool())
    with pytest.raises(ValueError, match=r"tool .*theory='timoshenko'.* 'euler-"):
        couple_tool(side, tool("timoshenko"))
    with pytest.raises(ValueError, match=r"tool .*theory='timoshenko'"):
        change_tool(given, 0.11, tool("timoshenko"))
    with pytest.raises(ValueError, match=r"the tool has 1 bearing\(s\)"):
        couple_tool(side, replace(tool(), bearings=[Bearing(0.0, 1e6)]))
    with pytest.raises(ValueError, match=r"loss_factor=-0\.1"):
        spindle_side(given, F, 0.11, -0.1)
    with pytest.raises(ValueError, match=r"position=.*rigid"):
        spindle_side(replace(given, bearings=[*given.bearings, Bearing(0.11, np.inf)]), F, 0.11)
    with pytest.raises(ValueError, match="1 bearing"):
        spindle_side(replace(given, bearings=given.bearings[-1:]), F, 0.11)
