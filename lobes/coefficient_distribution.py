"""Joint distribution of the cutting coefficients Kt and Kr of a listed material, from its sources."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MIN_INTERVAL = 1.0
"""Smallest width of an interval of Kt (Pa): that of a single milling test; chosen, negligible."""
MIN_WIDTH = 1e-9
"""Smallest width of an even distribution of factors; chosen, negligible."""
MIN_PROBABILITY = 1e-15
"""Smallest distance of a probability from 0 and 1, so that its normal number is finite."""
COEFFICIENT_CORRELATION = 0.4
"""Rank correlation of Kt and Kr/Kt: of the four tests of Al 7075, the only alloy with several tests; assumed for all.

All eight tests of aluminium have 0.02. The larger value is on the safe side."""


@dataclass(frozen=True, eq=False)
class Quantiles:
    """Quantiles of a distribution that is uniform between its knots."""

    probabilities: Floats
    """Probabilities below the knots, rising from 0 to 1, shape (k,)."""
    values: Floats
    """Values at the knots, rising, shape (k,)."""

    @classmethod
    def even(cls, low: float, high: float) -> "Quantiles":
        """Return the quantiles of an even distribution between two ends."""
        return cls(np.array([0.0, 1.0]), np.array([low, max(high, low + MIN_WIDTH)]))

    def at(self, share: Floats) -> Floats:
        """Return the values at probabilities.

        Parameters
        ----------
        share : ndarray
            Probabilities, 0 to 1.

        Returns
        -------
        ndarray
            Values, of the same shape.
        """
        return np.asarray(np.interp(share, self.probabilities, self.values))

    def over(self, unit: float) -> "Quantiles":
        """Return the quantiles of the quotient by a positive number."""
        return Quantiles(self.probabilities, self.values / unit)

    def mix(self, other: "Quantiles", share: float) -> "Quantiles":
        """Return the quantiles of a mixture: with a probability `share` the other distribution."""
        values = np.union1d(self.values, other.values)
        own, others = (np.interp(values, each.values, each.probabilities) for each in (self, other))
        return Quantiles((1 - share) * own + share * others, values)


@dataclass(frozen=True, eq=False)
class JointCoefficients:
    """Joint distribution of Kt and Kr/Kt: their own quantiles, joined by a Gaussian copula.

    References
    ----------
    Nelsen, An Introduction to Copulas, 2nd ed. 2006: rank correlation 6/pi asin(r/2) of a normal correlation r.
    """

    tangential: Quantiles
    """Quantiles of Kt (Pa), or of a factor on it."""
    ratio: Quantiles
    """Quantiles of Kr/Kt (-), or of a factor on it."""
    correlation: float = COEFFICIENT_CORRELATION
    """Rank correlation of both (Spearman)."""

    def over(self, tangential: float, ratio: float) -> "JointCoefficients":
        """Return the joint distribution of the factors over a Kt and a Kr/Kt."""
        return JointCoefficients(self.tangential.over(tangential), self.ratio.over(ratio), self.correlation)

    def shares(self, even: Floats) -> Floats:
        """Return joint probabilities of Kt and Kr/Kt for independent even ones, both of shape (2, r)."""
        normal = 2 * np.sin(np.pi * self.correlation / 6)
        first, second = scipy.special.ndtri(np.clip(even, MIN_PROBABILITY, 1 - MIN_PROBABILITY))
        return np.array([even[0], scipy.special.ndtr(normal * first + np.sqrt(1 - normal**2) * second)])

    def at(self, even: Floats) -> tuple[Floats, Floats]:
        """Return Kt and Kr/Kt for independent even probabilities.

        Parameters
        ----------
        even : ndarray
            Probabilities between 0 and 1, shape (2, r): random ones sample the distribution.

        Returns
        -------
        tuple of ndarray
            Kt and Kr/Kt, shape (r,) each.
        """
        of_force, of_ratio = self.shares(even)
        return self.tangential.at(of_force), self.ratio.at(of_ratio)


def pool_intervals(intervals: Sequence[tuple[float, float]]) -> Quantiles:
    """Pool intervals of equal weight, each evenly probable inside: a linear opinion pool.

    Parameters
    ----------
    intervals : sequence of tuple of float
        Lowest and highest Kt of each source (Pa).

    Returns
    -------
    Quantiles
        Quantiles of the mixture; the ends are the lowest and the highest of all.

    References
    ----------
    Stone, The opinion pool, Ann. Math. Statist. 32 (1961) 1339-1342.

    Examples
    --------
    >>> pooled = pool_intervals([(1.0e9, 2.0e9), (1.5e9, 3.5e9)])
    >>> pooled.at(np.array([0.0, 0.25, 1.0])) / 1e9
    array([1. , 1.5, 3.5])
    """
    low, high = np.array(intervals).T
    high = np.maximum(high, low + MIN_INTERVAL)
    ends = np.unique((low, high))
    return Quantiles(np.mean(np.clip((ends[:, np.newaxis] - low) / (high - low), 0, 1), axis=1), ends)
