"""Static stiffness and mass by linearising the dynamic stiffness.

O. Gaber and S. M. Hashemi, Effects of machine tool spindle decay on the stability lobe diagram: an
analytical-experimental study, Shock and Vibration, 2015, eqs. (30)-(36), on a cantilever of EI = m = L = 1.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from dsm.elements.element_series import element_series
from dsm.response import linearized_stiffness

pytestmark = pytest.mark.quick

FIRST = 3.5160152685002


def cantilever() -> NDArray[np.float64]:
    """Coefficients of the stiffness at the free end, deflection and slope, shape (2, 2, n_terms)."""
    one = np.ones(1)
    uu, ut, tt = element_series(one, one, one)[:3, 0]
    return np.array([[uu, -ut], [-ut, tt]])


def stiffness(w2: float) -> NDArray[np.float64]:
    """Return the stiffness at w^2 from the textbook form."""
    x = w2**0.25
    s, c, sh, ch = math.sin(x), math.cos(x), math.sinh(x), math.cosh(x)
    rows = [[x**3 * (s * ch + c * sh), -(x**2) * s * sh], [-(x**2) * s * sh, x * (s * ch - c * sh)]]
    return np.array(rows) / (1 - c * ch)


def test_terms_0_and_1_at_wbar_0() -> None:
    static, mass = linearized_stiffness(cantilever(), 0.0)
    assert static == pytest.approx(np.array([[12, -6], [-6, 4]]), rel=1e-14)
    assert mass == pytest.approx(np.array([[156, -22], [-22, 4]]) / 420, rel=1e-14)


@pytest.mark.parametrize("wbar", [0.5, 2.0, 4.0])
def test_touches_the_dynamic_stiffness_at_wbar(wbar: float) -> None:
    static, mass = linearized_stiffness(cantilever(), wbar)
    step = 1e-3
    slope = (stiffness(wbar**2 + step) - stiffness(wbar**2 - step)) / (2 * step)
    assert static - wbar**2 * mass == pytest.approx(stiffness(wbar**2), rel=1e-10)
    assert -mass == pytest.approx(slope, rel=1e-6)
    assert np.array_equal(static, static.T)
    assert np.array_equal(mass, mass.T)


def test_error_of_the_static_stiffness_is_of_fourth_order() -> None:
    wbar = np.array([0.25, 0.5, 1.0])
    found = np.array([linearized_stiffness(cantilever(), w)[0] for w in wbar])
    error = found - np.array([[12, -6], [-6, 4]])
    order = np.log2(error[1:] / error[:-1])
    assert order == pytest.approx(4.0, abs=0.02)
    assert error[0] == pytest.approx(-cantilever()[..., 2] * wbar[0] ** 4, rel=1e-3)


def test_tip_stiffness_tends_to_the_static_one_with_an_error_of_fourth_order() -> None:
    error = []
    for wbar in (0.25, 0.5, 1.0):
        static, _ = linearized_stiffness(cantilever(), wbar)
        error.append(1 / np.linalg.inv(static)[0, 0] - 3.0)
    assert np.log2(np.array(error[1:]) / error[:-1]) == pytest.approx(4.0, abs=0.02)
    assert 0 < error[-1] < 0.01


def test_linearised_at_a_natural_frequency_it_keeps_that_frequency() -> None:
    static, mass = linearized_stiffness(cantilever(), FIRST)
    w2 = np.linalg.eigvals(np.linalg.solve(mass, static))
    assert np.sqrt(np.min(w2.real)) == pytest.approx(FIRST, rel=1e-12)


@pytest.mark.parametrize("wbar", [-1.0, math.nan, math.inf])
def test_rejects_a_frequency_that_is_none(wbar: float) -> None:
    with pytest.raises(ValueError, match="wbar"):
        linearized_stiffness(cantilever(), wbar)


@pytest.mark.parametrize("coefficients", [3.0, np.zeros((2, 2, 0))])
def test_rejects_coefficients_without_powers(coefficients: float) -> None:
    with pytest.raises(ValueError, match="shape"):
        linearized_stiffness(coefficients, 1.0)


def test_rejects_coefficients_that_are_not_finite() -> None:
    with pytest.raises(ValueError, match="not finite"):
        linearized_stiffness([1.0, math.nan], 1.0)
