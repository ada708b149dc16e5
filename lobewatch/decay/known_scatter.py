"""What the series of other machines tell of the scatter of one that is young."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from lobewatch.decay.lone_points import MAD
from lobewatch.decay.readings import UNKNOWN_SCATTER, KnownSpread

ENOUGH = 8
"""Points of a series from which on its scatter tells anything; chosen."""
WORTH = 0.25
"""Degrees of freedom that a difference is worth: a median has 37 % of the efficiency of a sum of squares, differences
of neighbours two thirds of that of residuals."""
FEWEST = 4
"""Series that anything is said of others from; chosen."""
MOST = 30.0
"""Degrees of freedom that others are worth at most; chosen."""

Floats = NDArray[np.float64]


def scatter_of(y: Floats) -> KnownSpread:
    """Scatter from point to point of a series (n,), by the median of its steps: what it fell counts little."""
    if y.size < ENOUGH:
        return UNKNOWN_SCATTER
    return KnownSpread(MAD * float(np.median(np.abs(np.diff(y)))) / 2**0.5, WORTH * (y.size - 1))


def scatter_of_others(series: Sequence[KnownSpread]) -> KnownSpread:
    """What the scatters of some series, each known with its own degrees of freedom, say of another one.

    Empirical Bayes: variances scattered as scaled inverse chi squares; its two parameters by the moments of their
    logarithms (Smyth 2004, "Linear models and empirical Bayes methods", Stat. Appl. Genet. Mol. Biol. 3(1), section
    6.2). Nothing below four series.
    """
    known = np.array([scatter for scatter in series if scatter.freedom and scatter.percent > 0])
    if len(known) < FEWEST:
        return UNKNOWN_SCATTER
    half = known[:, 1] / 2
    logs = 2 * np.log(known[:, 0]) - scipy.special.digamma(half) + np.log(half)
    spread = float(np.var(logs, ddof=1) - scipy.special.polygamma(1, half).mean())
    freedom = MOST
    if spread > scipy.special.polygamma(1, MOST / 2):
        freedom = 2 * scipy.optimize.brentq(lambda x: scipy.special.polygamma(1, x) - spread, 1e-3, MOST / 2)
    variance = np.exp(logs.mean() + scipy.special.digamma(freedom / 2) - np.log(freedom / 2))
    return KnownSpread(float(np.sqrt(variance)), float(freedom))
