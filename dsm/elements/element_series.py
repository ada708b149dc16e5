"""Power series of beam elements: stiffness, transfer matrix, rotary inertia."""

from fractions import Fraction
from functools import cache
from math import comb, factorial

import numpy as np
from numpy.typing import NDArray

from dsm.arrays import Floats, Indices
from dsm.spindle.sections import Sections
from dsm.spindle.spindle import Theory

SERIES_TERMS = 12
"""Number of terms: the first pole is at z = 500.56, so that the rest is below 1e-17 for z <= MAX_ELEMENT_X^4."""
FIRST_SERIES_POLE = 500.5639
"""Lowest pole in z = x^4: resonance of the element with clamped ends, 4.7300^4."""
MAX_ELEMENT_X = 2.0
"""Largest x = L (m w^2/EI)^(1/4) of an element: longer ones are divided, and no clamped frequency is below w."""


def element_series(bending_stiffness: Floats, mass_per_length: Floats, length: Floats) -> Floats:
    """Return the coefficients of the element matrices in powers of w^2, shape (6, n_elements, SERIES_TERMS).

    bending_stiffness EI (N m^2), mass_per_length m (kg/m), length L (m): shape (n_elements,). With u the deflection
    and t = du/dz the slope at both ends, the six rows are k(u1,u1), k(u1,t1), k(t1,t1), k(u1,u2), k(u1,t2), k(t1,t2);
    the others follow from symmetry and from the mirror image. Terms 0 and 1 are the Hermite stiffness matrix and
    minus the consistent mass matrix. Unlike the closed form, which divides by 1 - cos x cosh x, nothing is lost at
    small x.
    """
    z_per_w2 = mass_per_length * length**4 / bending_stiffness
    force = bending_stiffness / length**3
    sizes = np.stack([force, force * length, force * length**2])
    powers = np.vander(z_per_w2, SERIES_TERMS, increasing=True)
    return np.asarray(sizes[[0, 1, 2, 0, 1, 2], :, np.newaxis] * powers * _unit_series()[:, np.newaxis])


@cache
def _unit_series() -> Floats:
    """Return the six series in z = m w^2 L^4/EI for EI = L = 1, shape (6, SERIES_TERMS), from exact fractions.

    The solutions of u'''' = z u with one unit derivative at s = 0 are c_j(s) = sum z^n s^(4n+j)/(4n+j)!, and at
    s = 1 c_3' = c_2, c_2' = c_1, c_1' = c_0, c_0' = z c_3. Solving for the end forces gives the fractions below.
    """
    c0, c1, c2, c3 = np.array([[Fraction(1, factorial(4 * n + j)) for n in range(SERIES_TERMS)] for j in range(4)])
    z_c3 = np.array([Fraction(0), *c3[:-1]])
    products = ((c2, c2, c1, c3), (c0, c1, z_c3, c2), (c1, c1, c0, c2), (c1, c2, c0, c3))
    determinant, *numerators = (np.convolve(a, b) - np.convolve(c, d) for a, b, c, d in products)
    return np.array([_divide_series(top, determinant) for top in (*numerators, -c1, c2, c3)], dtype=np.float64)


def _divide_series(a: NDArray[np.object_], b: NDArray[np.object_]) -> list[Fraction]:
    quotient: list[Fraction] = []
    for n in range(SERIES_TERMS):
        earlier = sum((quotient[i] * b[n - i] for i in range(n)), Fraction(0))
        quotient.append((a[n] - earlier) / b[0])
    return quotient


def count_series_terms(apart: bool) -> int:
    """Return the number of terms of each series."""
    return SERIES_TERMS * SERIES_TERMS if apart else SERIES_TERMS


def combine_rotary_terms(series: Floats, spin: float) -> Floats:
    """Combine a series with separate rotary inertia to one in powers of w, at a speed of rotation W = `spin` (rad/s).

    Term SERIES_TERMS n + j of the series (..., SERIES_TERMS^2) belongs to w^2 to the power n - j times r to the power j
    <= n, r the factor of rotary inertia: products of such series are those of their terms, cut off alike. In the
    circular whirl u exp(i w t), forward for w > 0, of a round shaft gyroscopic moments make r = w^2 - 2 W w. Result:
    (..., 2 SERIES_TERMS - 1). Source: M. I. Friswell et al., Dynamics of Rotating Machines, 2010, section 5.4.
    """
    kept, lowered, binomial = _rotary_terms()
    weight = binomial * (-2 * spin) ** lowered
    return series[..., kept] @ weight


@cache
def _rotary_terms() -> tuple[Indices, Indices, Floats]:
    """Return the indices of non-zero terms, and exponents and factors of (w^2 - 2 W w)^j w^(2n - 2j) in powers of w."""
    pairs = [(n, j) for n in range(SERIES_TERMS) for j in range(n + 1)]
    lowered = np.zeros((len(pairs), 2 * SERIES_TERMS - 1), dtype=int)
    binomial = np.zeros(lowered.shape)
    for row, (n, j) in enumerate(pairs):
        for k in range(j + 1):
            lowered[row, 2 * n - k], binomial[row, 2 * n - k] = k, comb(j, k)
    return np.array([SERIES_TERMS * n + j for n, j in pairs]), lowered, binomial


GAUSS_POINTS = 16
"""Gauss points of an element: cross-sections that change by MAX_TAPER_RATIO are integrated to rounding."""


def transfer_series(
    shaft: Sections, theory: Theory, segment: Indices, start: Floats, end: Floats, apart: bool = False
) -> Floats:
    """Return the state (u, t, Q, M) at `end` from that at `start`, in powers of w^2: (n, 4, 4, n_terms).

    segment, start, end (m): shape (n,), elements inside one segment each. With u the deflection, t the rotation of the
    cross-section, Q the shear force and M the bending moment: EI t' = M, kappa G A (u' - t) = Q, Q' = -m w^2 u and M' =
    -Q - rho I r t with r = w^2; Euler-Bernoulli theory has neither 1/(kappa G A) nor rho I. apart: r stays a separate
    variable, see combine_rotary_terms. Each term follows from those below it by integration (Picard), exact but for
    rounding as long as the cross-section is smooth. Source: S. P. Timoshenko, On the correction for shear ..., Phil.
    Mag. 41 (1921).
    """
    place, weight, running = _quadrature()
    length = (end - start)[:, np.newaxis, np.newaxis]
    section = shaft.at(segment[:, np.newaxis], start[:, np.newaxis] + place * length[..., 0])
    rigidity, mass = section.rigidity[..., np.newaxis], section.mass[..., np.newaxis]
    softness, turning = np.zeros((2, *rigidity.shape))
    if theory == "timoshenko":
        softness, turning = 1 / section.shear[..., np.newaxis], section.rotary[..., np.newaxis]
    terms, back = count_series_terms(apart), (SERIES_TERMS, SERIES_TERMS + 1) if apart else (1, 1)
    found = np.zeros((terms, segment.size, 4, 4))
    nothing = np.zeros((segment.size, GAUSS_POINTS, 4))
    deflections, rotations = [nothing] * terms, [nothing] * terms
    for power in range(terms):
        if apart and power % SERIES_TERMS > power // SERIES_TERMS:
            continue
        given = np.eye(4)[:, np.newaxis, np.newaxis] * (power == 0)
        q_slope = -mass * deflections[power - back[0]]
        q = given[2] + length * (running @ q_slope)
        m_slope = -turning * rotations[power - back[1]] - q
        m = given[3] + length * (running @ m_slope)
        t_slope = m / rigidity
        rotations[power] = given[1] + length * (running @ t_slope)
        u_slope = rotations[power] + softness * q
        deflections[power] = given[0] + length * (running @ u_slope)
        for row, slope in enumerate((u_slope, t_slope, q_slope, m_slope)):
            found[power, :, row] += length[..., 0] * (weight @ slope)
    found[0] += np.eye(4)
    return np.moveaxis(found, 0, -1)


@cache
def _quadrature() -> tuple[Floats, Floats, Floats]:
    """Return Gauss points and weights on 0 to 1, and the matrix that integrates from 0 to each point."""
    point, weight = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    order = np.arange(GAUSS_POINTS)
    to_legendre = (order[:, np.newaxis] + 0.5) * np.polynomial.legendre.legvander(point, GAUSS_POINTS - 1).T * weight
    integrals = np.polynomial.legendre.legint(np.eye(GAUSS_POINTS), lbnd=-1)
    running = np.polynomial.legendre.legvander(point, GAUSS_POINTS) @ integrals @ to_legendre
    return (point + 1) / 2, weight / 2, running / 2
