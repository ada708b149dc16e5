"""Dynamic stiffness of one uniform beam element as a power series."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from math import factorial

import numpy as np
from numpy.typing import NDArray

TERMS = 12
"""Terms kept: the first pole is at z = 4.7300^4 = 500.56, so that the rest is below 1e-17 for z <= MAX_X^4."""
POLE = 500.5639
"""Lowest pole in z = x^4: where the element with clamped ends resonates, 4.7300^4."""
MAX_X = 2.0
"""Largest x = L (m w^2/EI)^(1/4) of an element: longer ones are split, and no clamped frequency is left below w."""

_Series = list[Fraction]


def element_series(
    bending_stiffness: NDArray[np.float64], mass_per_length: NDArray[np.float64], length: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Coefficients of the element matrices in powers of w^2, shape (6, n_elements, TERMS).

    bending_stiffness EI (N m^2), mass_per_length m (kg/m), length L (m): shape (n_elements,). With u the deflection
    and t = du/dz the slope at both ends, the six rows are k(u1,u1), k(u1,t1), k(t1,t1), k(u1,u2), k(u1,t2), k(t1,t2);
    the others follow from symmetry and from the mirror image. Terms 0 and 1 are the Hermite stiffness matrix and
    minus the consistent mass matrix. Unlike the closed form, which divides by 1 - cos x cosh x, nothing is lost at
    small x.
    """
    z_per_w2 = mass_per_length * length**4 / bending_stiffness
    force = bending_stiffness / length**3
    sizes = np.stack([force, force * length, force * length**2])
    powers = np.vander(z_per_w2, TERMS, increasing=True)
    return np.asarray(sizes[[0, 1, 2, 0, 1, 2], :, np.newaxis] * powers * _unit_series()[:, np.newaxis])


@cache
def _unit_series() -> NDArray[np.float64]:
    """The six series in z = m w^2 L^4/EI for EI = L = 1, shape (6, TERMS), rounded once from exact fractions.

    The solutions of u'''' = z u with one unit derivative at s = 0 are c_j(s) = sum z^n s^(4n+j)/(4n+j)!, and at
    s = 1 c_3' = c_2, c_2' = c_1, c_1' = c_0, c_0' = z c_3. Solving for the end forces gives the fractions below.
    """
    c0, c1, c2, c3 = ([Fraction(1, factorial(4 * n + j)) for n in range(TERMS)] for j in range(4))
    z_c3 = [Fraction(0), *c3[:-1]]
    determinant = _minus(_times(c2, c2), _times(c1, c3))
    numerators = [
        _minus(_times(c0, c1), _times(z_c3, c2)),
        _minus(_times(c1, c1), _times(c0, c2)),
        _minus(_times(c1, c2), _times(c0, c3)),
        [-term for term in c1],
        c2,
        c3,
    ]
    return np.array([[float(term) for term in _divide(top, determinant)] for top in numerators])


def _minus(a: _Series, b: _Series) -> _Series:
    return [x - y for x, y in zip(a, b, strict=True)]


def _times(a: _Series, b: _Series) -> _Series:
    return [sum((a[i] * b[n - i] for i in range(n + 1)), Fraction(0)) for n in range(TERMS)]


def _divide(a: _Series, b: _Series) -> _Series:
    quotient: _Series = []
    for n in range(TERMS):
        earlier = sum((quotient[i] * b[n - i] for i in range(n)), Fraction(0))
        quotient.append((a[n] - earlier) / b[0])
    return quotient
