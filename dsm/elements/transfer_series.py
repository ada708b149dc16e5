"""From one end of a beam element to the other, as a power series, for any cross-section along it."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from dsm.spindle.sections import Sections
from dsm.spindle.spindle import Theory

_Float = NDArray[np.float64]
_Indices = NDArray[np.int_]

POINTS = 16
"""Gauss points of an element: cross-sections that change by MOST_TAPER are integrated to rounding."""


def transfer_series(
    shaft: Sections, theory: Theory, segment: _Indices, start: _Float, end: _Float, terms: int, spin: float | None
) -> _Float:
    """State (u, t, Q, M) at `end` from that at `start`, in powers of w^2, or of w where it spins: (n, 4, 4, terms).

    segment, start, end (m): shape (n,), elements inside one segment each. With u the deflection, t the rotation of
    the cross-section, Q the shear force and M the bending moment: EI t' = M, kappa G A (u' - t) = Q, Q' = -m w^2 u and
    M' = -Q - rho I w^2 t, where Euler-Bernoulli theory has neither 1/(kappa G A) nor rho I. spin: speed of rotation W
    (rad/s) of a round shaft; the motion is then the circular whirl u exp(i w t), forward for w > 0, with
    rho I (w^2 - 2 W w) for rho I w^2. Each power of w follows from those below it by integration (Picard), exact but
    for rounding as long as the cross-section is smooth. Source: S. P. Timoshenko, On the correction for shear ...,
    Phil. Mag. 41 (1921); gyroscopic term: M. I. Friswell et al., Dynamics of Rotating Machines, 2010, section 5.4.
    """
    place, weight, running = _quadrature()
    length = (end - start)[:, np.newaxis, np.newaxis]
    section = shaft.at(segment[:, np.newaxis], start[:, np.newaxis] + place * length[..., 0])
    rigidity, mass, rotary, shear = (part[..., np.newaxis] for part in section)
    flexible = theory == "timoshenko"
    softness, turning = (1 / shear, rotary) if flexible else (0 * shear, 0 * rotary)
    order = 1 if spin is None else 2
    found = np.zeros((terms, segment.size, 4, 4))
    found[0] = np.eye(4)
    at = np.zeros((2, order, segment.size, POINTS, 4))  # u and t of the last powers of w, the latest first
    for power in range(terms):
        given = np.eye(4)[:, np.newaxis, np.newaxis] * (power == 0)
        q_slope, m_slope = -mass * at[0, -1], -turning * at[1, -1]
        if spin is not None:
            m_slope = m_slope + 2 * spin * turning * at[1, 0]
        q = given[2] + length * (running @ q_slope)
        m_slope = m_slope - q
        m = given[3] + length * (running @ m_slope)
        t_slope = m / rigidity
        t = given[1] + length * (running @ t_slope)
        u_slope = t + softness * q
        u = given[0] + length * (running @ u_slope)
        for row, slope in enumerate((u_slope, t_slope, q_slope, m_slope)):
            found[power, :, row] += length[..., 0] * (weight @ slope)
        at = np.stack([np.concatenate([new[np.newaxis], old[:-1]]) for new, old in zip((u, t), at, strict=True)])
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
