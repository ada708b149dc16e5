"""Noise that grows with the FRF: what the fits leave says how the weights of its lines fall with its height."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from modal.bands.extraction import Array, ComplexArray, Extraction, FittedBand
from modal.bands.systematic import leaves_rounding

EVIDENCE = 4.0
"""Twice the gain of log likelihood from which noise is taken to grow with the FRF; chance brings it once in 44."""
STEPS = 12
"""Steps of Fisher scoring; it settles in some five."""
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
    rows = zip(np.abs(left * given) ** 2, height, given > 0, strict=True)
    variance = np.array([_variance(*row) for row in rows])
    return np.asarray(np.sqrt(np.maximum(variance / np.mean(variance), LEAST_SHARE**2)))


def _variance(left: Array, height: Array, counts: NDArray[np.bool_]) -> Array:
    """Likeliest variance by line, floor + slope height, or equal where that is as likely, shape (n,).

    left, height: squares of the residual and of the model; counts: the lines that it is told from.
    """
    columns = np.stack([np.ones(left.size), height / np.mean(height)])
    known, squares = columns[:, counts], left[counts]
    if not np.any(squares):
        return np.zeros(left.size)
    equal = share = np.array([np.mean(squares), 0.0])
    for _ in range(STEPS):
        scaled = known / (share @ known)
        share = np.maximum(np.linalg.pinv(scaled @ scaled.T) @ scaled @ (squares / (share @ known)), 0.0)
        share[0] = max(share[0], LEAST_SHARE * share[1])
    gain = 2 * (_log_likelihood(squares, share @ known) - _log_likelihood(squares, equal @ known))
    return np.asarray((share if gain > EVIDENCE else equal) @ columns)


def _log_likelihood(left: Array, variance: Array) -> float:
    """Log likelihood of these variances by the squares of complex normal residuals."""
    return float(-np.sum(np.log(variance) + left / variance))
