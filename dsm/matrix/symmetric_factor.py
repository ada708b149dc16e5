"""A full symmetric matrix as L D L^T."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

_Float = NDArray[np.float64]


class SymmetricFactor(NamedTuple):
    """L D L^T by the pivoting of Bunch and Kaufman, as LAPACK keeps it."""

    values: _Float
    """L, and D of 1 x 1 and 2 x 2 blocks."""
    pivots: NDArray[np.int32]
    """Rows exchanged; negative ones belong to 2 x 2 blocks, which have one negative eigenvalue each."""

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues (Sylvester's law of inertia)."""
        single = self.pivots > 0
        pairs = (self.pivots.size - np.count_nonzero(single)) // 2
        return int(np.count_nonzero(self.values.diagonal()[single] < 0) + pairs)

    def solve(self, right: _Float) -> _Float:
        """Solutions of matrix times y = right, shape (n, m)."""
        return np.asarray(scipy.linalg.lapack.dsytrs(self.values, self.pivots, right, lower=1)[0])


def symmetric_factor(matrix: _Float) -> SymmetricFactor:
    """The factor of a matrix (n, n) in Fortran's order, its lower half alone looked at; the matrix is overwritten."""
    values, pivots, _ = scipy.linalg.lapack.dsytrf(matrix, lower=1, overwrite_a=1)
    return SymmetricFactor(values, pivots)
