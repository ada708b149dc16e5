"""Polynomials of the frequency that are orthonormal over the lines of an FRF."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class OrthogonalBasis:
    """Polynomials p_0 .. p_n of x that are orthonormal with a weight over the lines, by the Arnoldi process.

    x p_k(x) = sum of recurrence[j, k] p_j(x) over j <= k + 1. No power of x is ever formed, so that order 60 is as
    exact as order 2. Source: Brubeck, Nakatsukasa & Trefethen (2021), Vandermonde with Arnoldi, SIAM Review 63, 405.
    """

    values: ComplexArray
    """Weight times p_k on each line, shape (lines, n + 1)."""
    recurrence: ComplexArray
    """Shape (n + 1, n)."""

    def roots(self, coefficients: ComplexArray) -> ComplexArray:
        """Zeros of sum of coefficients[k] p_k, k = 0 .. m, by the eigenvalues of its comrade matrix, shape (m,)."""
        m = coefficients.size - 1
        comrade = self.recurrence[:m, :m].copy()
        comrade[:, -1] -= self.recurrence[m, m - 1] * coefficients[:m] / coefficients[m]
        return np.asarray(np.linalg.eigvals(comrade))


def orthogonal_basis(x: NDArray[np.float64], weight: ComplexArray, order: int) -> OrthogonalBasis:
    """Basis up to this order at x, shape (lines,), with these weights, shape (lines,)."""
    rows = np.empty((order + 1, x.size), dtype=np.complex128)
    recurrence = np.zeros((order + 1, order), dtype=np.complex128)
    rows[0] = weight / np.linalg.norm(weight)
    for k in range(order):
        new = x * rows[k]
        for _ in range(2):
            part = (rows[: k + 1] @ new.conj()).conj()
            new -= part @ rows[: k + 1]
            recurrence[: k + 1, k] += part
        recurrence[k + 1, k] = np.linalg.norm(new)
        rows[k + 1] = new / recurrence[k + 1, k]
    return OrthogonalBasis(rows.T, recurrence)
