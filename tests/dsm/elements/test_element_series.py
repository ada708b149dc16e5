"""The series form of the beam element against the textbook form in 40-digit arithmetic.

Textbook form: e.g. R. W. Clough and J. Penzien, Dynamics of Structures, with x = L (m w^2/EI)^(1/4) and the divisor
1 - cos x cosh x.
"""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray

from dsm import Segment, Spindle
from dsm.matrix.assemble import assemble
from dsm.matrix.dynamic_stiffness import DynamicStiffness

pytestmark = pytest.mark.quick

LENGTH, RIGIDITY, MASS = 0.7, 3.0, 0.2


def one_element() -> DynamicStiffness:
    """Return a free beam of one element with the bending stiffness, mass per length and length above."""
    segment = Segment(LENGTH, 0.1)
    youngs_modulus, density = RIGIDITY / segment.second_moment, MASS / segment.area
    longest = 4 / LENGTH**2 * math.sqrt(RIGIDITY / MASS) / (2 * math.pi)
    return assemble(Spindle([segment], [], youngs_modulus, density), longest)


def textbook(w2: mpmath.mpf) -> mpmath.matrix:
    length, rigidity = mpmath.mpf(LENGTH), mpmath.mpf(RIGIDITY)
    x = length * (MASS * w2 / rigidity) ** mpmath.mpf("0.25")
    s, c, sh, ch = mpmath.sin(x), mpmath.cos(x), mpmath.sinh(x), mpmath.cosh(x)
    k11, k13 = x**3 * (s * ch + c * sh), -(x**3) * (s + sh)
    k12, k14 = x**2 * s * sh * length, x**2 * (ch - c) * length
    k22, k24 = x * (s * ch - c * sh) * length**2, x * (sh - s) * length**2
    rows = [[k11, k12, k13, k14], [k12, k22, -k14, k24], [k13, -k14, k11, -k12], [k14, k24, -k12, k22]]
    return mpmath.matrix(rows) * (rigidity / length**3 / (1 - c * ch))


def as_float(matrix: mpmath.matrix) -> NDArray[np.float64]:
    return np.array([[float(matrix[i, j]) for j in range(4)] for i in range(4)])


@pytest.mark.parametrize("x", [1e-4, 0.01, 0.3, 1.0, 1.6, 2.0])
def test_element_matches_the_transcendental_form(x: float) -> None:
    w2 = (x / LENGTH) ** 4 * RIGIDITY / MASS
    with mpmath.workdps(40):
        exact = as_float(textbook(mpmath.mpf(w2)))
    assert one_element().dense(np.array([w2]))[0] == pytest.approx(exact, rel=2e-14)


@pytest.mark.parametrize("x", [0.3, 1.0, 2.0])
def test_element_derivative_matches_the_transcendental_form(x: float) -> None:
    w2 = (x / LENGTH) ** 4 * RIGIDITY / MASS
    with mpmath.workdps(40):
        step = mpmath.mpf(w2) * mpmath.mpf("1e-12")
        exact = as_float((textbook(w2 + step) - textbook(w2 - step)) / (2 * step))
    assert one_element().dense(np.array([w2]), derivative=True)[0] == pytest.approx(exact, rel=2e-14)


def test_terms_0_and_1_are_hermite_stiffness_and_minus_consistent_mass() -> None:
    le = LENGTH
    stiffness = [[12, 6 * le, -12, 6 * le], [6 * le, 4 * le**2, -6 * le, 2 * le**2]]
    mass = [[156, 22 * le, 54, -13 * le], [22 * le, 4 * le**2, 13 * le, -3 * le**2]]
    model = one_element()
    static = model.dense(np.zeros(1))[0]
    inertia = -model.dense(np.zeros(1), derivative=True)[0]
    assert static[:2] == pytest.approx(np.array(stiffness) * RIGIDITY / le**3, rel=1e-14)
    assert inertia[:2] == pytest.approx(np.array(mass) * MASS * le / 420, rel=1e-14)
    mirror = np.diag([1, -1, 1, -1])[[2, 3, 0, 1]]
    assert static == pytest.approx(mirror @ static @ mirror.T, rel=1e-14)
    assert inertia == pytest.approx(mirror @ inertia @ mirror.T, rel=1e-14)


@pytest.mark.parametrize("x", [1.9, 2.1, 30.0])
def test_long_elements_are_split(x: float) -> None:
    spindle = Spindle([Segment(1.0, 0.1)], [])
    wave = (spindle.segments[0].area * 7850 / (210e9 * spindle.segments[0].second_moment)) ** 0.25
    model = assemble(spindle, (x / wave) ** 2 / (2 * math.pi))
    assert model.position.size - 1 == math.ceil(x / 2)
    assert np.diff(model.position) == pytest.approx(1 / math.ceil(x / 2))
