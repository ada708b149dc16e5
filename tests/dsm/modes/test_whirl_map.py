"""Whirl of a spinning shaft in the fixed and in the rotating frame.

Rigid rotor: G. Genta, Dynamics of Rotating Systems, 2005. Fixed and rotating frame of a round Euler-Bernoulli shaft:
O. Gaber and S. M. Hashemi, Effects of Machine Tool Spindle Decay on the Stability Lobe Diagram, 2015, figure 9.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsm import Bearing, LumpedMass, Segment, Spindle, natural_frequencies
from dsm.modes.find_modes import find_modes
from dsm.modes.whirl_map import critical_speed, whirl_map

PLAIN = Spindle([Segment(0.2, 0.05), Segment(0.3, 0.08, 0.02)], [Bearing(0.1, 1e8), Bearing(0.4, 2e8)])
THICK = replace(PLAIN, theory="timoshenko", masses=[LumpedMass(0.0, 5.0, 0.01, 0.019)])


def test_without_rotary_inertia_speed_changes_only_the_view_from_the_shaft() -> None:
    speed = np.array([0.0, 20e3, 90e3])
    found = whirl_map(PLAIN, speed, 2)
    at_rest = natural_frequencies(PLAIN, 2)[:, np.newaxis]
    assert found.forward == pytest.approx(np.broadcast_to(at_rest, (2, 3)), rel=1e-9)
    assert found.backward == pytest.approx(np.broadcast_to(at_rest, (2, 3)), rel=1e-9)
    assert found.rotating_forward == pytest.approx(np.abs(at_rest - speed / 60), abs=1e-5)
    assert found.rotating_backward == pytest.approx(at_rest + speed / 60, rel=1e-9)
    assert found.critical_rpm == pytest.approx(60 * natural_frequencies(PLAIN, 2), rel=1e-9)


def test_a_rigid_rotor_on_two_springs() -> None:
    """Pitch of a stiff symmetric rotor: I_d w^2 - I_p W w = k a^2/2 for springs k at +-a/2; bounce does not change."""
    span, stiffness, diametral, polar = 0.4, 1e4, 0.2, 0.3
    segments = [Segment(span, 0.05)]
    rotor = Spindle(
        segments,
        [Bearing(0.0, stiffness), Bearing(span, stiffness)],
        youngs_modulus=1e14,
        density=1e-3,
        masses=[LumpedMass(span / 2, 10.0, diametral, polar)],
    )
    spin = 300.0
    bounce = math.sqrt(2 * stiffness / 10.0)
    spring = stiffness * span**2 / 2
    half = polar * spin / (2 * diametral)
    root = math.sqrt(half**2 + spring / diametral)
    found = whirl_map(rotor, [spin * 30 / math.pi], 2)
    assert 2 * math.pi * found.forward[:, 0] == pytest.approx(sorted([bounce, root + half]), rel=1e-5)
    assert 2 * math.pi * found.backward[:, 0] == pytest.approx(sorted([bounce, root - half]), rel=1e-5)
    # With I_p > I_d pitch stays ahead of the speed, and only bounce has a critical speed.
    assert critical_speed(rotor) == pytest.approx(bounce * 30 / math.pi, rel=1e-5)
    with pytest.raises(ArithmeticError, match=r"mode 2 .*\d rpm"):
        critical_speed(rotor, 2)


def test_pitch_of_a_long_rotor_has_its_critical_speed() -> None:
    """I_d W^2 - I_p W^2 = k a^2/2 for I_p < I_d."""
    body = LumpedMass(0.2, 10.0, 0.3, 0.2)
    rotor = Spindle([Segment(0.4, 0.05)], [Bearing(0.0, 1e4), Bearing(0.4, 1e4)], 1e14, 1e-3, masses=[body])
    assert critical_speed(rotor, 2) == pytest.approx(math.sqrt(800 / 0.1) * 30 / math.pi, rel=1e-5)


def test_forward_whirl_counts_as_many_critical_speeds_as_modes_below_the_speed() -> None:
    speeds = [critical_speed(THICK, mode) for mode in (1, 2, 3)]
    assert speeds == sorted(speeds)
    for mode, speed in enumerate(speeds, 1):
        for beside, behind in ((0.999, mode - 1), (1.001, mode)):
            forward = find_modes(THICK, 5, spin=beside * speed * math.pi / 30).frequency
            assert np.sum(forward < beside * speed / 60) == behind


def test_the_map_lists_the_critical_speeds_within_it() -> None:
    speeds = [critical_speed(THICK, mode) for mode in (1, 2, 3)]
    between = [(speeds[0] + speeds[1]) / 2, (speeds[1] + speeds[2]) / 2]
    assert whirl_map(THICK, between[::-1], 3).critical_rpm == pytest.approx(speeds[1:2], rel=1e-12)
    assert whirl_map(THICK, [0.0, 1.01 * speeds[2]], 3).critical_rpm == pytest.approx(speeds, rel=1e-12)
    assert whirl_map(THICK, [0.0], 3).critical_rpm.size == 0


@settings(max_examples=15, deadline=None)
@given(st.floats(0.0, 30e3), st.floats(1e3, 30e3), st.floats(0.0, 0.02))
def test_forward_whirl_rises_and_backward_whirl_falls_with_speed(slow: float, more: float, polar: float) -> None:
    spindle = replace(THICK, masses=[LumpedMass(0.0, 5.0, 0.01, polar)])
    found = whirl_map(spindle, [slow, slow + more], 3)
    assert np.all(np.diff(found.forward) > 0)
    assert np.all(np.diff(found.backward) < 0)
    assert np.all(found.forward[:, 0] >= found.backward[:, 0] * (1 - 1e-9))


def test_polar_inertia_of_the_shaft_is_twice_its_diametral_inertia() -> None:
    """A ring much shorter than wide, as a shaft of Timoshenko theory and as a lumped body, on a light stiff stub."""
    width, outer, bore = 0.002, 0.3, 0.1
    ring = Segment(width, outer, bore)
    stub = Segment(0.2, 0.05, mass_diameter=0.001)
    mass = ring.area * width * 7850
    diametral = mass * (outer**2 + bore**2) / 16 + mass * width**2 / 12
    bearings = [Bearing(0.05, 1e8), Bearing(0.2, 1e8)]
    whole = Spindle([ring, stub], [replace(b, position=b.position + width) for b in bearings], theory="timoshenko")
    lumped = Spindle(
        [stub],
        bearings,
        theory="timoshenko",
        masses=[LumpedMass(0.0, mass, diametral, mass * (outer**2 + bore**2) / 8)],
    )
    for spin in (800.0, -800.0):
        frequency = [find_modes(spindle, 2, spin=spin).frequency for spindle in (whole, lumped)]
        assert frequency[0] == pytest.approx(frequency[1], rel=2e-2)
        still = [natural_frequencies(spindle, 2) for spindle in (whole, lumped)]
        assert frequency[0] / still[0] == pytest.approx(frequency[1] / still[1], rel=5e-3)


@pytest.mark.parametrize(
    ("speed", "message"),
    [
        ([-1.0], r"speed_rpm=-1\.0 rpm .*>= 0"),
        ([math.nan], "speed_rpm=nan"),
        ([], r"speed_rpm .*\(0,\)"),
        ([[1.0]], r"speed_rpm .*\(1, 1\)"),
    ],
)
def test_bad_speeds_are_rejected(speed: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        whirl_map(PLAIN, speed, 2)


def test_what_is_not_held_has_no_whirl_map_and_no_critical_speed() -> None:
    free = replace(PLAIN, bearings=PLAIN.bearings[:1])
    with pytest.raises(ValueError, match=r"1 bearing\(s\)"):
        whirl_map(free, [1000.0], 2)
    with pytest.raises(ValueError, match=r"mode=0 .*1"):
        critical_speed(PLAIN, 0)
    with pytest.raises(ValueError, match="0 modes"):
        whirl_map(PLAIN, [1000.0], 0)
