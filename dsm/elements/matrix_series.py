"""Power series of 2 x 2 matrices, shape (n, 2, 2, n_terms), cut off after n_terms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_Float = NDArray[np.float64]


def product(a: _Float, b: _Float) -> _Float:
    """A B."""
    found = np.zeros_like(b)
    for power in np.flatnonzero(a.any(axis=(0, 1, 2))):
        rest = b.shape[-1] - power
        found[..., power:] += np.einsum("eij,ejkn->eikn", a[..., power], b[..., :rest])
    return found


def inverse(a: _Float) -> _Float:
    """A^-1, where term 0 has an inverse."""
    first = a[..., 0]
    (p, q), (r, s) = np.moveaxis(first, 0, 2)
    inverted = np.moveaxis(np.array([[s, -q], [-r, p]]) / (p * s - q * r), 2, 0)
    found = np.zeros_like(a)
    found[..., 0] = inverted
    for power in range(1, a.shape[-1]):
        known = np.einsum("eijn,ejkn->eik", a[..., 1 : power + 1], found[..., power - 1 :: -1])
        found[..., power] = -inverted @ known
    return found
