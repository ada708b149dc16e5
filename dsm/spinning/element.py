"""Dynamic stiffness of one spinning beam element that bends in two planes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsm.elements.element_series import MAX_X
from dsm.spinning.beam import check_positive
from dsm.spinning.chain import SpinningChain

_Float = NDArray[np.float64]


def spinning_element(
    rigidity_xx: float,
    rigidity_yy: float,
    mass_per_length: float,
    length: float,
    frequency: ArrayLike,
    speed_rpm: float,
) -> _Float:
    """Stiffness matrix of a uniform beam spinning about its axis z, in the frame that turns with it, (n, 8, 8).

    rigidity_xx: EIxx, against v (N m^2); rigidity_yy: EIyy, against u (N m^2); mass_per_length (kg/m); length (m);
    frequency: (n,) Hz, >= 0, seen in the turning frame; speed_rpm: speed of spin (rpm), >= 0.

    Rows and columns are u, v, du/dz, dv/dz at z = 0, then the same at z = length; the matrix gives the forces (N) and
    moments (N m) that do work on them, along the same axes at both ends, and is symmetric. The motion is
    u = U cos wt, v = V sin wt; for u = U sin wt, v = V cos wt the coupling of u and v changes its sign. A rotation
    about x is -dv/dz.

    Equal to A B^-1 of Gaber & Hashemi, Shock and Vibration, 2015, eqs. (1)-(27), with the signs put right
    (docs/paper.md), but also defined at speed 0, at frequency 0 and where the two are equal. Beams longer than the
    series allows are taken in equal parts whose inner dofs are eliminated; infinite only at the natural frequencies
    of the beam clamped at both ends. Raises ValueError for numbers out of range.

    At rest, and at 0 Hz, it is the stiffness of a beam, 12 E I / L^3 for its ends against each other:

    >>> element = spinning_element(1e4, 1e4, mass_per_length=15.0, length=0.5, frequency=[0.0], speed_rpm=0.0)
    >>> element.shape
    (1, 8, 8)
    >>> round(float(element[0, 0, 0]) / (12 * 1e4 / 0.5**3), 9)
    1.0
    """
    numbers = {"rigidity_xx": rigidity_xx, "rigidity_yy": rigidity_yy, "mass_per_length": mass_per_length}
    for name, value in {**numbers, "length": length}.items():
        check_positive(name, value)
    spin = angular_speed(speed_rpm)
    w = 2 * np.pi * np.atleast_1d(np.asarray(frequency, dtype=np.float64))
    if w.ndim != 1 or not np.all(np.isfinite(w) & (w >= 0)):
        raise ValueError(f"frequency={frequency!r} is not a list of finite numbers >= 0 (Hz)")
    x = length * (mass_per_length / min(rigidity_xx, rigidity_yy) * (w + spin) ** 2) ** 0.25
    parts = np.maximum(np.ceil(x / MAX_X), 1).astype(int)
    result = np.empty((w.size, 8, 8))
    for n in np.unique(parts):
        rigidity = np.tile([rigidity_yy, rigidity_xx], (n, 1))
        mass, dofs = np.full(n, mass_per_length), np.arange(4 * n + 4)
        chain = SpinningChain(np.full(n, length / n), rigidity, mass, np.zeros(dofs.size), dofs)
        result[parts == n] = _condense(chain.matrices(w[parts == n], spin)[0])
    return result


def angular_speed(speed_rpm: float) -> float:
    """Speed of spin (rad/s). Raises ValueError for a negative speed."""
    if not (math.isfinite(speed_rpm) and speed_rpm >= 0):
        raise ValueError(f"speed_rpm={speed_rpm} is not a finite number >= 0")
    return speed_rpm * math.pi / 30


def _condense(matrix: _Float) -> _Float:
    """Eliminate all nodes but the first and the last."""
    ends = np.r_[0:4, -4:0]
    outer, across, inner = matrix[:, ends[:, np.newaxis], ends], matrix[:, 4:-4, ends], matrix[:, 4:-4, 4:-4]
    reduced = outer - across.swapaxes(1, 2) @ np.linalg.solve(inner, across)
    return np.asarray((reduced + reduced.swapaxes(1, 2)) / 2)
