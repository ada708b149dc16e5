"""How many hits an FRF with a coherence was averaged from, where nobody says."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquisition.frf import Frf

BLOCK = 32
"""Lines looked at together."""
LEAST_BLOCKS = 4
"""With fewer the answer is too uncertain."""
MOST_SPREAD = 3.0
"""Ratio of the upper to the lower quartile of the blocks above which the coherence is not that of the FRF."""
LEAST_INCOHERENCE = 1e-7
"""1 - coherence below which only rounding is seen."""


def infer_averages(frf: Frf) -> int | None:
    """Number of hits whose scatter from line to line fits the coherence; None where it cannot be told.

    The coherence says how far single hits scatter, |H|^2 (1 - g2)/g2; the mean of n of them scatters by 1/n of that,
    which third differences of neighbouring lines show. It takes the noise of neighbouring lines as independent: a
    Hann window or interpolated lines make the answer too large. Its error is some 15 % with 500 lines. Source: variance
    of H1, Bendat & Piersol, Random Data, ch. 9; n - 1 degrees of freedom of the residual of n hits.

    >>> random = np.random.default_rng(1)
    >>> noise = random.normal(0.0, 0.1, (2, 2000)) / np.sqrt(2 * 8)  # of a mean of 8
    >>> frf = Frf(np.arange(1.0, 2001.0), 1 + noise[0] + 1j * noise[1], coherence=np.full(2000, 1 / 1.01))
    >>> infer_averages(frf)  # some 15 % of error
    9
    """
    if frf.coherence is None:
        return None
    g2 = np.clip(frf.coherence, 1e-6, 1.0)[1:-2]
    of_hits = np.abs(frf.receptance[1:-2]) ** 2 * (1 - g2) / g2
    of_mean = np.abs(np.diff(frf.receptance, 3)) ** 2 / 20
    incoherent = _blocks(1 - g2) > LEAST_INCOHERENCE
    ratios = (_blocks(of_hits) / np.maximum(_blocks(of_mean), 1e-300))[incoherent]
    if ratios.size < LEAST_BLOCKS:
        return None
    low, middle, high = np.quantile(ratios, [0.25, 0.5, 0.75])
    return round(1 + middle) if high < MOST_SPREAD * low and middle > 1.5 else None


def _blocks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means over some lines each."""
    return np.asarray(values[: values.size // BLOCK * BLOCK].reshape(-1, BLOCK).mean(axis=1))
