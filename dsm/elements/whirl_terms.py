"""Terms of a series in which rotary inertia stands apart, so that one series serves all speeds of rotation."""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np
from numpy.typing import NDArray

from dsm.elements.element_series import TERMS

_Float = NDArray[np.float64]


def number_of_terms(apart: bool) -> int:
    """Terms kept of each series."""
    return TERMS * TERMS if apart else TERMS


def whirl_terms(series: _Float, spin: float) -> _Float:
    """A series with rotary inertia apart as one in powers of w, at a speed of rotation W = `spin` (rad/s).

    Term TERMS n + j of the series (..., TERMS^2) belongs to w^2 to the power n - j times r to the power j <= n, r what
    rotary inertia is multiplied by: products of such series are those of their terms, cut off alike. In the circular
    whirl u exp(i w t), forward for w > 0, of a round shaft gyroscopic moments make r = w^2 - 2 W w. Result: (...,
    2 TERMS - 1). Source: M. I. Friswell et al., Dynamics of Rotating Machines, 2010, section 5.4.
    """
    kept, lowered, binomial = _terms()
    weight = binomial * (-2 * spin) ** lowered
    return series[..., kept] @ weight


@cache
def _terms() -> tuple[NDArray[np.int_], NDArray[np.int_], _Float]:
    """Terms that are not 0, and how (w^2 - 2 W w)^j w^(2n - 2j) is made of powers of w: exponents of -2 W, factors."""
    pairs = [(n, j) for n in range(TERMS) for j in range(n + 1)]
    lowered = np.zeros((len(pairs), 2 * TERMS - 1), dtype=int)
    binomial = np.zeros(lowered.shape)
    for row, (n, j) in enumerate(pairs):
        for k in range(j + 1):
            lowered[row, 2 * n - k], binomial[row, 2 * n - k] = k, comb(j, k)
    return np.array([TERMS * n + j for n, j in pairs]), lowered, binomial
