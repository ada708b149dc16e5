"""The two-disk rotor of M. I. Friswell, J. E. T. Penny, S. D. Garvey, A. W. Lees, Dynamics of Rotating Machines, 2010.

Steel shaft 1.5 m x 50 mm, disks 280 x 70 mm at 0.5 m and 350 x 70 mm at 1.0 m, springs of 1 MN/m at the ends,
shear and gyroscopic moments included. The book gives six elements; "converged" is the limit of many.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from dsm import Bearing, LumpedMass, Segment, Spindle, natural_frequencies
from dsm.modes.find_modes import find_modes
from dsm.modes.whirl_map import critical_speed, whirl_map

DENSITY = 7810.0


def disk(position: float, diameter: float) -> LumpedMass:
    bore, thickness = 0.05, 0.07
    mass = DENSITY * math.pi * (diameter**2 - bore**2) * thickness / 4
    square = diameter**2 + bore**2
    return LumpedMass(position, mass, mass * (square / 16 + thickness**2 / 12), mass * square / 8)


def rotor() -> Spindle:
    bearings = [Bearing(0.0, 1e6), Bearing(1.5, 1e6)]
    masses = [disk(0.5, 0.28), disk(1.0, 0.35)]
    return Spindle([Segment(1.5, 0.05)], bearings, 211e9, DENSITY, "timoshenko", 81.2e9, masses)


def test_at_rest() -> None:
    w = 2 * math.pi * natural_frequencies(rotor(), 3)
    assert w == pytest.approx([86.658, 274.307, 716.56], rel=1e-5)
    assert w[2] == pytest.approx(716.78, rel=4e-4)  # book, six elements


def test_at_4000_rpm() -> None:
    spin = 4000 * math.pi / 30
    forward, backward = (2 * math.pi * find_modes(rotor(), 2, spin=s).frequency for s in (spin, -spin))
    assert forward == pytest.approx([87.80, 294.71], rel=1e-4)
    assert backward == pytest.approx([85.39, 251.78], rel=1e-4)
    third = 2 * math.pi * find_modes(rotor(), 3, spin=-spin).frequency[2]
    assert third == pytest.approx(600.18, rel=1e-3)


def test_whirl_map_has_the_published_column() -> None:
    found = whirl_map(rotor(), [0.0, 4000.0], 2)
    assert 2 * math.pi * found.forward[:, 1] == pytest.approx([87.80, 294.71], rel=1e-4)
    assert 2 * math.pi * found.backward[:, 1] == pytest.approx([85.39, 251.78], rel=1e-4)
    assert found.forward[:, 0] == pytest.approx(found.backward[:, 0], rel=1e-10)
    assert found.critical_rpm == pytest.approx([critical_speed(rotor(), mode) for mode in (1, 2)], rel=1e-12)


@pytest.mark.parametrize("mode", [1, 2])
def test_at_a_critical_speed_forward_whirl_runs_as_fast_as_the_shaft(mode: int) -> None:
    speed = critical_speed(rotor(), mode)
    forward = find_modes(rotor(), mode, spin=speed * math.pi / 30).frequency[-1]
    assert 60 * forward == pytest.approx(speed, rel=1e-10)
    assert speed > 60 * natural_frequencies(rotor(), mode)[-1] * 1.002
    assert np.all(np.diff(whirl_map(rotor(), np.linspace(0.0, speed, 5), 2).forward) > 0)
