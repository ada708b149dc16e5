"""Final growth rate of a linear, periodic motion from its record."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

WINDOW = 48
"""Most periods that an estimate rests on."""
FEWEST = 8
"""Record length (periods) below which the mean growth is used (orders of magnitude per period)."""
RANK = (1e-12, 1e-10)
"""Parts of the motion smaller than this, relative to the largest, are rounding: in the fit, and in one to check it."""


def late_growth(record: Floats) -> tuple[float, float]:
    """Logarithm of the largest multiplier of a period, and how far it is in doubt, from a record (periods, values).

    The map of one period is fitted to the last WINDOW periods in the subspace they span (dynamic mode decomposition);
    the doubt is the change against such a fit a quarter of the record earlier, or against one of lower rank. It is inf
    while each period still adds something new to the subspace, and at least the growth itself where a plain look at
    the amplitude, last against second quarter, has another sign.
    Source of the fit: P. J. Schmid, J. Fluid Mech. 656 (2010) 5-28.
    """
    periods = len(record)
    size = np.log(np.max(np.abs(record), axis=1))
    if periods < FEWEST:
        return float(size[-1] - size[0]) / max(periods - 1, 1), 0.0
    fits = [_fit(record[periods // 3 :], rank) for rank in RANK]
    fits.append(_fit(record[periods // 4 : periods - periods // 4], RANK[0]))
    growth, closed = fits[0]
    doubt = max(abs(other - growth) for other, _ in fits[1:])
    quarter = periods // 4
    plain = np.mean(size[-quarter:]) - np.mean(size[quarter : 2 * quarter])
    if plain * growth <= 0:
        doubt = max(doubt, abs(growth))
    return growth, doubt if closed else np.inf


def _fit(record: Floats, smallest: float) -> tuple[float, bool]:
    """Logarithm of the largest multiplier, and whether the periods span less than their number."""
    last = record[-WINDOW - 1 :]
    scale = np.max(np.abs(last[:-1]), axis=1)[:, np.newaxis]
    before, after = (last[:-1] / scale).T, (last[1:] / scale).T
    left, size, right = np.linalg.svd(before, full_matrices=False)
    rank = int(np.sum(size > smallest * size[0]))
    fitted = left[:, :rank].T @ after @ right[:rank].T / size[:rank]
    return float(np.log(np.max(np.abs(np.linalg.eigvals(fitted))))), rank < len(size)
