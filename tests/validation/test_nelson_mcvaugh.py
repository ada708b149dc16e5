"""Rotor of Nelson & McVaugh (18 elements) as an Euler-Bernoulli shaft with a point mass for its disk.

Source: H. D. Nelson and J. M. McVaugh, The Dynamics of Rotor-Bearing Systems Using Finite Elements,
Journal of Engineering for Industry 98 (1976). Reference speeds: 40-digit transfer matrices.
"""

from __future__ import annotations

from itertools import pairwise

import pytest

from dsm import Bearing, LumpedMass, Segment, Spindle, natural_frequencies
from dsm.modes.whirl_map import critical_speed

NODE_CM = "0 1.27 5.08 7.62 8.89 10.16 10.67 11.43 12.70 13.46 16.51 19.05 22.86 26.67 28.70 30.48 31.50 34.54 35.81"
OUTER_RADIUS_CM = "0.51 1.02 0.76 2.03 2.03 3.30 3.30 2.54 2.54 1.27 1.27 1.52 1.52 1.27 1.27 3.81 2.03 2.03"
INNER_RADIUS_CM = {6: 1.52, 7: 1.78, 17: 1.52}


def rotor() -> Spindle:
    nodes = [float(node) / 100 for node in NODE_CM.split()]
    segments = [
        Segment(end - start, float(outer) / 50, INNER_RADIUS_CM.get(index, 0.0) / 50)
        for index, ((start, end), outer) in enumerate(zip(pairwise(nodes), OUTER_RADIUS_CM.split(), strict=True))
    ]
    bearings = [Bearing(0.1651, 4.378e7), Bearing(0.2870, 4.378e7)]
    return Spindle(segments, bearings, 2.078e11, 7806.0, masses=[LumpedMass(0.0889, 1.401)])


def test_natural_frequencies() -> None:
    assert 60 * natural_frequencies(rotor(), 3) == pytest.approx(
        [16830.752292166, 48527.654970233, 87742.730607908], rel=1e-9
    )


@pytest.mark.parametrize("mode", [1, 2, 3])
def test_critical_speeds_are_sixty_times_them(mode: int) -> None:
    assert critical_speed(rotor(), mode) == pytest.approx(60 * natural_frequencies(rotor(), mode)[-1], rel=1e-9)
