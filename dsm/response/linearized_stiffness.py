"""The paper's static stiffness and mass matrix, taken from the dynamic stiffness at one frequency."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray


def linearized_stiffness(coefficients: ArrayLike, wbar: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """K_stat and M of the straight line K_stat - w^2 M that touches K(w) at w = wbar, over w^2.

    coefficients: those of K in powers of w^2, on the last axis, e.g. (n, n, n_terms); wbar: angular frequency
    (rad/s), >= 0. Both results have the shape of one coefficient, e.g. (n, n), and its units: N/m and kg where dofs
    are deflections.

    M = -dK/d(w^2) and K_stat = K + wbar^2 M, both at wbar: eqs. (32)-(34) of Gaber & Hashemi, Shock and Vibration,
    2015, the linearisation from which their eqs. (30)-(36) take the static stiffness at the tip. With
    K = sum c_n w^2n it is K_stat = sum (1 - n) c_n wbar^2n: the true static stiffness c_0 but for -c_2 wbar^4 and
    smaller terms, and c_0 itself at wbar = 0, where the paper's form of K has no value. So static_stiffness needs no
    linearisation; this one is there to show what it costs.

    Raises ValueError for coefficients that are not finite or have no last axis, and for a wbar that is negative or
    not finite.

    >>> k, m = linearized_stiffness([3e7, -2.0, -1e-9], 0.0)  # c_0 in N/m, c_1 in kg, c_2 in kg s^2
    >>> float(k), float(m)  # N/m, kg: at rest c_0 and -c_1
    (30000000.0, 2.0)
    >>> k, m = linearized_stiffness([3e7, -2.0, -1e-9], 4000.0)  # rad/s
    >>> round(float(k)), round(float(m), 3)  # c_0 - c_2 wbar^4 and -c_1 - 2 c_2 wbar^2
    (30256000, 2.032)
    """
    c = np.asarray(coefficients, dtype=np.float64)
    if c.ndim == 0 or c.shape[-1] == 0:
        raise ValueError(f"coefficients of shape {c.shape} have no last axis of powers of w^2")
    if not np.all(np.isfinite(c)):
        raise ValueError("coefficients hold a value that is not finite; look at the model they come from")
    if not (math.isfinite(wbar) and wbar >= 0):
        raise ValueError(f"wbar={wbar} is not a finite angular frequency >= 0 (rad/s)")
    order = np.arange(c.shape[-1])
    power = (wbar * wbar) ** order
    return c @ ((1 - order) * power), -(c[..., 1:] @ (order[1:] * power[:-1]))
