"""Noise that grows with the FRF: what the fits leave says how the weights of its lines fall with its height."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from modal.bands.extraction import Array, ComplexArray, Extraction, FittedBand
from modal.bands.systematic import leaves_rounding

EVIDENCE = 4.0
"""Twice the gain of log likelihood from which noise is taken to grow with the FRF; chance brings it once in 44."""
STEPS = 12
"""Most steps of Fisher scoring; it settles in some five."""
SETTLED = 1e-6
"""Relative change of its shares after which it has settled."""
LEAST_SHARE = 1e-4
"""Share that the floor has at least of the variance at the mean squared height."""


def weights_by_residual(state: Extraction, given: Array) -> Array:
    """Weights (p, n) that what the fits of these bands leave asks for; given: those that nothing speaks against.

    Noise proportional to the FRF (of the hammer, of the place that is hit, of leakage) is largest on the peaks, where
    equal weights take it for that of the whole band: the errors of damping ratio and stiffness come out too small.
    """
    weight = given.copy()
    for band in state.bands:
        if not leaves_rounding(band):
            weight[:, band.lines] /= _rises(state.left(band), band, given[:, band.lines])
    return weight


def _rises(left: ComplexArray, band: FittedBand, given: Array) -> Array:
    """For each FRF of a band the rms of its weighted noise by line, over that of the whole band, (p, n).

    left: what the fit leaves of the receptances (m/N); given: weights, all of shape (p, n).
    """
    height = np.abs((band.data.own - left) * given) ** 2
    variance = _variance(np.abs(left * given) ** 2, height, given > 0)
    return np.asarray(np.sqrt(np.maximum(variance / np.mean(variance), LEAST_SHARE**2)))


def _variance(left: Array, height: Array, counts: NDArray[np.bool_]) -> Array:
    """Likeliest variance by line, floor + slope height, or equal where that is as likely; of each FRF, shape (p, n).

    left, height: squares of the residual and of the model; counts: the lines that it is told from, all (p, n).
    """
    columns = np.stack([np.ones(left.shape), height / np.mean(height, axis=1, keepdims=True)], axis=1)
    known, squares = columns * counts[:, np.newaxis], left * counts
    mean = np.sum(squares, axis=1) / np.sum(counts, axis=1)
    equal = share = np.stack([np.where(mean > 0, mean, 1.0), np.zeros(mean.size)], axis=1)[:, np.newaxis]
    for _ in range(STEPS):
        before, variance = share, share @ columns
        scaled = known / variance
        share = np.maximum((squares[:, np.newaxis] / variance) @ scaled.mT @ np.linalg.pinv(scaled @ scaled.mT), 0.0)
        share[..., 0] = np.maximum(share[..., 0], LEAST_SHARE * share[..., 1])
        if np.all(np.abs(share - before) <= SETTLED * before):
            break
    likely, even = (_log_likelihood(squares, (values @ columns)[:, 0], counts) for values in (share, equal))
    share = np.where((2 * (likely - even) > EVIDENCE)[:, np.newaxis, np.newaxis], share, equal)
    return np.asarray(np.where(mean[:, np.newaxis] > 0, (share @ columns)[:, 0], 0.0))


def _log_likelihood(left: Array, variance: Array, counts: NDArray[np.bool_]) -> Array:
    """Log likelihood of these variances by the squares of complex normal residuals, of each FRF, shape (p,)."""
    return np.asarray(-np.sum((np.log(variance) + left / variance) * counts, axis=1))
