"""The MK7702 grinding spindle: facts and static rigidities published with an open spindle-design program.

Outer diameter x length (mm) from the nose, bores, bearings and rigidities are the published ones. The natural
frequencies (rho = 7850 kg/m^3) are roots of the determinant of the transcendental stiffness matrix in 60-digit
arithmetic. The same arithmetic puts the static rigidity 5e-10 below the published one, whose diameters are rounded.
"""

from __future__ import annotations

import numpy as np
import pytest

from dsm import Bearing, Segment, Spindle, critical_speed, natural_frequencies, static_stiffness
from dsm.matrix.assemble import assemble

OUTER_MM = (106, 170, 150, 117, 110, 110, 107.5, 103.0833, 101.541667, 100, 95, 97, 92, 97)
LENGTH_MM = (14, 29, 9, 19, 38, 75, 222, 15, 37, 79, 6, 144, 8, 16)
BORE_MM = (81,) * 5 + (74,) * 9


def mk7702(third_bearing_mm: float = 131.0) -> Spindle:
    segments = [
        Segment(length / 1e3, outer / 1e3, bore / 1e3)
        for length, outer, bore in zip(LENGTH_MM, OUTER_MM, BORE_MM, strict=True)
    ]
    bearings = [Bearing(z / 1e3, 226.3e6) for z in (81.0, 101.0, third_bearing_mm)]
    return Spindle(segments, [*bearings, Bearing(439.5e-3, 2170e6)])


def test_mass_and_length() -> None:
    assert mk7702().length == pytest.approx(0.711, rel=1e-12)
    assert mk7702().mass == pytest.approx(26.7409, abs=5e-5)


@pytest.mark.parametrize(("third_bearing_mm", "published"), [(131.0, 260.9192641748797), (121.0, 267.7310940130633)])
def test_published_static_nose_rigidity(third_bearing_mm: float, published: float) -> None:
    assert static_stiffness(mk7702(third_bearing_mm)) / 1e6 == pytest.approx(published, rel=1e-9)


@pytest.mark.parametrize(("console", "published"), [(0.1, 105.32109304165355), (0.2, 53.54847866884522)])
def test_published_rigidity_with_rigid_console(console: float, published: float) -> None:
    """Force at z = 0, moment -F a at z = 1 mm; deflection u(0) - a theta(0), theta taken at 1 mm as well."""
    model = assemble(mk7702(), 0.0, places=[1e-3])
    load = np.zeros(model.held.size)
    slope = 2 * model.node(1e-3) + 1
    load[0], load[slope] = 1.0, -console
    response = np.linalg.solve(model.dense(np.zeros(1))[0], load)
    assert 1e-6 / (response[0] - console * response[1]) == pytest.approx(published, rel=1e-8)


def test_natural_frequencies() -> None:
    exact = [771.86402904243528, 1107.98928334342099, 1863.5177664843293, 3787.92802445315462, 6214.6767899126597]
    assert natural_frequencies(mk7702(), 5) == pytest.approx(exact, rel=2e-10)


def test_critical_speed_is_sixty_times_the_first_frequency() -> None:
    assert critical_speed(mk7702()) == pytest.approx(60 * 771.86402904243528, rel=1e-9)
