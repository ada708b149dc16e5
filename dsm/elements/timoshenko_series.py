"""Dynamic stiffness of one uniform Timoshenko beam element as a power series."""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.typing import NDArray

_Float = NDArray[np.float64]


def timoshenko_series(
    bending_stiffness: _Float,
    mass_per_length: _Float,
    rotary_inertia: _Float,
    shear_stiffness: _Float,
    length: _Float,
    terms: int,
    spin: float | None = None,
) -> _Float:
    """Coefficients of the element matrices in powers of w^2, or of w where it spins, shape (6, n_elements, terms).

    bending_stiffness EI (N m^2), mass_per_length m (kg/m), rotary_inertia rho I (kg m), shear_stiffness kappa G A (N),
    length L (m): shape (n_elements,). With u the deflection and t the rotation of the cross-section at both ends, the
    rows are k(u1,u1), k(u1,t1), k(t1,t1), k(u1,u2), k(u1,t2), k(t1,t2). spin: speed of rotation W (rad/s) of a round
    shaft; the motion is then the circular whirl u exp(i w t), forward for w > 0, with rho I (w^2 - 2 W w) for
    rho I w^2. Source: S. P. Timoshenko, On the correction for shear ..., Phil. Mag. 41 (1921); gyroscopic term:
    M. I. Friswell et al., Dynamics of Rotating Machines, 2010, section 5.4.

    From EI t' = M, kappa G A (u' - t) = Q, Q' = -m w^2 u and M' = -Q - rho I w^2 t, for L = EI = 1:
    every unknown obeys D^4 y + p D^2 y = q y with p = r + phi z, q = z (1 - phi r), where z = m w^2, r = rho I w^2 and
    phi = 1/(kappa G A). The solution f with f = f' = f'' = 0, f''' = 1 at one end is the sum of
    a_n s^(2n+3)/(2n+3)! with a_0 = 1, a_1 = -p, a_(n+2) = q a_n - p a_(n+1); f and its derivatives at the other end
    give the element.
    """
    phi = (bending_stiffness / (shear_stiffness * length**2))[:, np.newaxis]
    z, r = np.zeros((2, length.size, terms))
    power = 1 if spin is None else 2
    z[:, power] = mass_per_length * length**4 / bending_stiffness
    r[:, power] = rotary_inertia * length**2 / bending_stiffness
    if spin is not None:
        r[:, 1] = -2 * spin * r[:, 2]
    f3, f2, f1, f0 = _fundamental(r + phi * z, z - phi * _times(r, z))
    b = phi * (f1 + _times(r, f3)) - f3
    c = f1 + phi * _times(z, f3)
    u_u, t_t = f0 + _times(r, f2), f0 + phi * _times(z, f2)
    numerators = [
        _times(c, u_u) - _times(z, _times(f2, f3)),
        _times(c, f1) - _times(f2, t_t),
        _times(f1, f2) + _times(b, t_t),
        -c,
        f2,
        -b,
    ]
    unit = _divide(np.stack(numerators), _times(f2, f2) + _times(b, c))
    slopes = np.array([0, 1, 2, 0, 1, 2])[:, np.newaxis, np.newaxis]
    scale = (bending_stiffness / length**3)[:, np.newaxis] * length[:, np.newaxis] ** slopes
    return np.asarray(unit * scale)


def _fundamental(p: _Float, q: _Float) -> _Float:
    """f, f', f'' and f''' at s = 1."""
    a = np.zeros((2 * p.shape[1], *p.shape))
    a[0, :, 0] = 1.0
    a[1] = -p
    for n in range(2, a.shape[0]):
        a[n] = _times(q, a[n - 2]) - _times(p, a[n - 1])
    weights = [[1 / factorial(2 * n + 3 - k) for n in range(a.shape[0])] for k in range(4)]
    return np.tensordot(weights, a, axes=1)


def _times(a: _Float, b: _Float) -> _Float:
    """Product of power series, cut off; only powers that `a` has are visited."""
    product = np.zeros_like(b)
    for i in np.flatnonzero(a.any(axis=0)):
        product[:, i:] += a[:, i : i + 1] * b[:, : b.shape[1] - i]
    return product


def _divide(a: _Float, b: _Float) -> _Float:
    quotient = np.zeros_like(a)
    for n in range(b.shape[1]):
        known = np.einsum("kei,ei->ke", quotient[..., :n], b[:, n:0:-1])
        quotient[..., n] = (a[..., n] - known) / b[:, 0]
    return quotient
