"""Inverses of many small matrices at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

WHOLE = 8
"""Number of rows up to which matrices are inverted as they are; larger ones by their quarters."""

Floats = NDArray[np.float64]


def inverses(matrices: NDArray[np.floating[Any]]) -> Floats:
    """Inverses of matrices (..., m, m) whose leading parts are far from singular: no rows are exchanged.

    So are those of a piece of time in which a tip answers to its own displacement: 1 and what is integrated since the
    piece began. By Gauss-Jordan elimination of all of them together, of halves and their Schur complement where m > 8.
    One that is singular gives numbers that are not finite.
    Source: Golub & Van Loan, Matrix Computations, 4th ed., ch. 3.2 and 3.4.
    """
    m = matrices.shape[-1]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.asarray(_by_quarters(matrices.reshape(-1, m, m)).reshape(matrices.shape))


def _by_quarters(matrices: Any) -> Floats:
    half = matrices.shape[-1] // 2
    if matrices.shape[-1] <= WHOLE:
        return _eliminated(matrices)
    a, b, c, d = (np.ascontiguousarray(matrices[:, i, j]) for i in _halves(half) for j in _halves(half))
    inverse, whole = _by_quarters(a), np.empty_like(matrices)
    right, below = inverse @ b, c @ inverse
    rest = _by_quarters(d - c @ right)
    right, below_of_rest = right @ rest, rest @ below
    whole[:, :half, :half] = inverse + right @ below
    whole[:, :half, half:] = np.negative(right, out=right)
    whole[:, half:, :half] = np.negative(below_of_rest, out=below_of_rest)
    whole[:, half:, half:] = rest
    return np.asarray(whole)


def _halves(half: int) -> tuple[slice, slice]:
    return slice(None, half), slice(half, None)


def _eliminated(matrices: Floats) -> Floats:
    """The same by Gauss-Jordan elimination, in place of a copy (m, m, c)."""
    left = np.moveaxis(matrices, 0, -1).copy()
    for i in range(len(left)):
        pivot = 1 / left[i, i]
        column = left[:, i].copy()
        column[i] = 0
        left[:, i] = 0
        left[i, i] = 1
        left[i] *= pivot
        left -= column[:, np.newaxis] * left[i]
    return np.ascontiguousarray(np.moveaxis(left, -1, 0))
