"""Power series of 2 x 2 matrices, shape (n, 2, 2, n_terms), cut off after n_terms."""

from __future__ import annotations

import numpy as np

from dsm.arrays import Floats, Indices


def product(a: Floats, b: Floats) -> Floats:
    """A B."""
    near, far = _terms_outside(a), _terms_outside(b)
    series = np.zeros_like(far)
    for power in _present(near):
        series[:, :, power:] += _times(near[:, :, power, np.newaxis], far[:, :, : far.shape[2] - power])
    return _terms_last(series)


def inverse(a: Floats) -> Floats:
    """A^-1, where term 0 has an inverse."""
    given = _terms_outside(a)
    (p, q), (r, s) = given[:, :, :1]
    inverted = np.array([[s, -q], [-r, p]]) / (p * s - q * r)
    series, remainder = np.zeros_like(given), np.zeros_like(given)
    remainder[0, 0, 0] = remainder[1, 1, 0] = 1.0
    for power in range(given.shape[2]):
        if not np.any(remainder[:, :, power]):
            continue
        series[:, :, power, np.newaxis] = _times(inverted, remainder[:, :, power, np.newaxis])
        earlier = _times(given[:, :, 1 : given.shape[2] - power], series[:, :, power, np.newaxis])
        remainder[:, :, power + 1 :] -= earlier
    return _terms_last(series)


def _times(a: Floats, b: Floats) -> Floats:
    """Products of matrices, shape (2, 2, ...)."""
    return np.asarray(a[:, :1] * b[:1] + a[:, 1:] * b[1:])


def _present(terms: Floats) -> Indices:
    return np.flatnonzero(terms.any(axis=(0, 1, 3)))


def _terms_outside(series: Floats) -> Floats:
    """Shape (2, 2, n_terms, n)."""
    return np.ascontiguousarray(series.transpose(1, 2, 3, 0))


def _terms_last(terms: Floats) -> Floats:
    return np.ascontiguousarray(terms.transpose(3, 0, 1, 2))
