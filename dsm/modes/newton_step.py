"""Inverse iteration with a Newton step, for any matrix of a frequency."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Number = TypeVar("Number", np.float64, np.complex128)


def newton_step(
    trial: NDArray[Number],
    matrix: NDArray[Number],
    slope: NDArray[Number],
    shape: NDArray[Number],
    solve: Callable[..., NDArray[Number]],
) -> tuple[NDArray[Number], NDArray[Number], NDArray[Number]]:
    """Better solutions of K(s) phi = 0, all modes at once, shape (n,): s, phi (n, n_dofs) and phi^T K' phi (n,).

    matrix, slope: K and its derivative K' at `trial` (n,), beside the s that is sought, where K can be inverted: shape
    (n, n_dofs, n_dofs). The shape becomes K^-1 K' phi, and s the zero of Rayleigh's quotient phi^T K(s) phi, to first
    order in s; its error is that of the shape squared. solve: solutions y of K y = right.
    """
    moved = solve(matrix, slope @ shape[..., np.newaxis])[..., 0]
    energy = quadratic(slope, moved)
    return trial - quadratic(matrix, moved) / energy, moved, energy


def quadratic(matrix: NDArray[Number], shape: NDArray[Number]) -> NDArray[Number]:
    """phi^T A phi of each mode, shape (n,)."""
    return np.asarray(np.sum(shape * (matrix @ shape[..., np.newaxis])[..., 0], axis=1))
