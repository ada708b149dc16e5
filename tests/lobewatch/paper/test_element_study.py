"""Element as printed in the paper, against the element of dsm, which is checked to 60 digits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dsm import SpinningSegment, spinning_element
from lobewatch.paper.element_study import fourth_powers, printed_element

pytestmark = pytest.mark.quick

BEAM = SpinningSegment(length=0.9, rigidity_xx=1.3, rigidity_yy=4.1, mass_per_length=0.7)


@pytest.mark.parametrize(("frequency", "speed_rpm"), [(0.4, 11.0), (1.1, 60.0), (1.1, 400.0)])
def test_with_its_signs_put_right_it_is_the_element_of_dsm(frequency: float, speed_rpm: float) -> None:
    right = printed_element(BEAM, frequency, speed_rpm, coupling=-1.0, one_sign=False)
    sections = BEAM.rigidity_xx, BEAM.rigidity_yy, BEAM.mass_per_length, BEAM.length
    assert right == pytest.approx(spinning_element(*sections, [frequency], speed_rpm)[0], rel=1e-9, abs=1e-9)


def test_what_the_printed_signs_change() -> None:
    right = printed_element(BEAM, 0.4, 11.0, coupling=-1.0, one_sign=False)
    planes = np.outer(*[np.tile([1.0, -1.0], 4)] * 2)
    assert printed_element(BEAM, 0.4, 11.0, 1.0, one_sign=False) == pytest.approx(planes * right, rel=1e-9)
    ends = np.repeat([-1.0, 1.0], 4)[:, np.newaxis]
    assert printed_element(BEAM, 0.4, 11.0, -1.0, one_sign=True) == pytest.approx(ends * right, rel=1e-9)


@pytest.mark.parametrize(("frequency", "speed_rpm"), [(0.4, 0.0), (0.4, 24.0)])
def test_it_does_not_exist_at_rest_and_where_speed_is_frequency(frequency: float, speed_rpm: float) -> None:
    assert not np.all(np.isfinite(printed_element(BEAM, frequency, speed_rpm)))


def test_its_roots_solve_the_determinant() -> None:
    w, spin = 0.8 * math.pi, 11 * math.pi / 30
    same, other = 0.7 * (w**2 + spin**2), 1.4 * w * spin
    for q in fourth_powers(BEAM, 0.4, 11.0):
        assert (4.1 * q - same) * (1.3 * q - same) == pytest.approx(other**2, rel=1e-9)
