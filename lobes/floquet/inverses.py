"""Inverses of many small matrices at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def inverses(matrices: NDArray[np.floating[Any]]) -> Floats:
    """Inverses of matrices (m, m, ...) whose leading parts are far from singular: no rows are exchanged.

    So are those of a piece of time in which a tip answers to its own displacement: 1 and what is integrated since the
    piece began. By Gauss-Jordan elimination of all of them together. One that is singular gives numbers that are not
    finite.
    Source: Golub & Van Loan, Matrix Computations, 4th ed., ch. 3.2 and 3.4.
    """
    left = np.array(matrices)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for i in range(len(left)):
            pivot = 1 / left[i, i]
            column = left[:, i].copy()
            column[i] = 0
            left[:, i] = 0
            left[i, i] = 1
            left[i] *= pivot
            left -= column[:, np.newaxis] * left[i]
    return left
