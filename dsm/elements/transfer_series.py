"""From one end of a beam element to the other, as a power series, for any cross-section along it."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from dsm.elements.element_series import TERMS
from dsm.elements.whirl_terms import number_of_terms
from dsm.spindle.sections import Sections
from dsm.spindle.spindle import Theory

_Float = NDArray[np.float64]
_Indices = NDArray[np.int_]

POINTS = 16
"""Gauss points of an element: cross-sections that change by MOST_TAPER are integrated to rounding."""


def transfer_series(
    shaft: Sections, theory: Theory, segment: _Indices, start: _Float, end: _Float, apart: bool = False
) -> _Float:
    """State (u, t, Q, M) at `end` from that at `start`, in powers of w^2: (n, 4, 4, number_of_terms(apart)).

    segment, start, end (m): shape (n,), elements inside one segment each. With u the deflection, t the rotation of
    the cross-section, Q the shear force and M the bending moment: EI t' = M, kappa G A (u' - t) = Q, Q' = -m w^2 u and
    M' = -Q - rho I r t with r = w^2, where Euler-Bernoulli theory has neither 1/(kappa G A) nor rho I. apart: r stays a
    variable of its own, see whirl_terms. Each term follows from those below it by integration (Picard), exact but for
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
    terms, back = number_of_terms(apart), (TERMS, TERMS + 1) if apart else (1, 1)
    found = np.zeros((terms, segment.size, 4, 4))
    nothing = np.zeros((segment.size, POINTS, 4))
    deflections, rotations = [nothing] * terms, [nothing] * terms
    for power in range(terms):
        if apart and power % TERMS > power // TERMS:
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
def _quadrature() -> tuple[_Float, _Float, _Float]:
    """Gauss points and weights on 0 to 1, and the matrix that integrates from 0 to each point."""
    point, weight = np.polynomial.legendre.leggauss(POINTS)
    order = np.arange(POINTS)
    to_legendre = (order[:, np.newaxis] + 0.5) * np.polynomial.legendre.legvander(point, POINTS - 1).T * weight
    integrals = np.polynomial.legendre.legint(np.eye(POINTS), lbnd=-1)
    running = np.polynomial.legendre.legvander(point, POINTS) @ integrals @ to_legendre
    return (point + 1) / 2, weight / 2, running / 2
