"""What stands for all that lies outside a band."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from modal.fitting.band_fit import BandFit, split
from modal.fitting.fit_at_poles import Array

POWERS = (-2, 0, 2, 4, 6, 8)
"""Of the frequency, in the order in which residual terms are taken."""
LEAST_TERMS = 4
"""Complex residual terms that every band has."""
MOST_TERMS = len(POWERS)
"""Complex residual terms that a band has at most."""


def residual_terms(frequency: Array, terms: int) -> NDArray[np.complex128]:
    """The first powers of the frequency, each real and imaginary, shape (2 terms, n)."""
    powers = residual_powers(frequency, terms)
    return np.concatenate([powers, 1j * powers])


def residual_powers(frequency: Array, terms: int) -> Array:
    """The first powers of the frequency, shape (terms, n)."""
    square = (frequency / np.mean(frequency)) ** 2
    return np.stack([square ** (power // 2) for power in POWERS[:terms]])


def gain_of_a_term(fit: BandFit, frequency: Array, weight: Array, terms: int) -> float:
    """Fall of the sum of squares, to first order, that one residual term more than these in each FRF would bring."""
    columns = residual_terms(frequency, terms + 1)
    is_new = np.arange(2 * terms + 2) % (terms + 1) == terms
    old, new = (_block_diagonal([split(w * columns[which]).T for w in weight]) for which in (~is_new, is_new))
    q = np.linalg.qr(np.hstack([old, fit.influence.T, new]))[0]
    part = q[:, -new.shape[1] :].T @ fit.residual
    return float(part @ part)


def _block_diagonal(blocks: Sequence[Array]) -> Array:
    """Blocks of one shape, each a FRF's, on the diagonal of a matrix that is 0 elsewhere."""
    p, (rows, columns) = len(blocks), blocks[0].shape
    matrix = np.zeros((p, rows, p, columns))
    matrix[np.arange(p), :, np.arange(p)] = blocks
    return matrix.reshape(p * rows, p * columns)
