"""Estimate the errors by modes beyond the first and the last line."""

from functools import lru_cache

import numpy as np

from modal.arrays import Complexes, Flags, Floats
from modal.bands.extraction import Extraction, FittedBand
from modal.fitting.band_fit import residual_powers, split_complex

FREE_HALF_WIDTHS = 1.0
"""Half-power half-widths from the outermost mode from which lines show the tail of a mode beyond; chosen."""
MIN_TAIL_LINES, MAX_TAIL_LINES = 12, 200
"""Fewest and most lines that a tail is fitted to; chosen."""
TAIL_DISTANCES = np.geomspace(0.005, 0.3, 16)
"""Relative distances of the mode beyond from the edge that are tried; chosen. Beyond, residual terms follow a tail."""
TAIL_DAMPING_RATIOS = (0.003, 0.01, 0.03, 0.1)
"""Damping ratios of the mode beyond that are tried; chosen."""
MIN_TAIL_GAIN = 10.0
"""Gain of the mode beyond over the mean square that it leaves, at least; noise reaches a fourth; chosen."""
TAIL_RESIDUAL_TERMS = 2
"""Residual terms next to the mode beyond: with its constant and pole, as many unknowns as a band has terms."""


def edge_covariance(state: Extraction, band: FittedBand) -> Floats:
    """Return the covariance of the errors of a band by modes beyond the lines, in the order of `BandFit`.

    Residual terms follow the tail of a far mode exactly, and of one just beyond the edge only nearly. The most likely
    mode beyond each edge is fitted to what the modes inside leave there; its tail moves the band by a Gauss-Newton
    step. The whole step counts as an error, since the mode beyond is not measured.
    """
    covariance = np.zeros_like(band.fit.covariance)
    for tails in edge_tails(state):
        for i, (tail, weight) in enumerate(zip(tails[:, band.lines], state.weight[:, band.lines], strict=True)):
            step = band.fit.influence_of(i) @ split_complex(tail * weight)
            covariance += np.outer(step, step)
    return covariance


@lru_cache(maxsize=1)
def edge_tails(state: Extraction) -> tuple[Complexes, ...]:
    """Return the tails of the most likely modes below the first line and above the last one (m/N), each (p, n)."""
    poles = np.hstack([band.fit.poles for band in state.bands])
    f = state.frf.frequency
    reach = FREE_HALF_WIDTHS * np.prod(poles, axis=0)
    below = f < np.min(poles[0] - reach), f[0] * np.exp(-TAIL_DISTANCES)
    above = f > np.max(poles[0] + reach), f[-1] * np.exp(TAIL_DISTANCES)
    left = np.array([frf.receptance for frf in state.frfs]) - state.receptance
    return tuple(
        np.array([_fit_tail(f, values, weight, use, beyond) for values, weight in zip(left, state.weight, strict=True)])
        for use, beyond in (below, above)
        if np.sum(use) >= MIN_TAIL_LINES
    )


def _fit_tail(f: Floats, left: Complexes, weight: Floats, use: Flags, beyond: Floats) -> Complexes:
    """Return the tail on all lines of the mode that fits best to what is left on some lines."""
    lines = np.flatnonzero(use)
    lines = lines[:: -(-lines.size // MAX_TAIL_LINES)]
    fn, zeta = (grid.reshape(-1, 1) for grid in np.meshgrid(beyond, TAIL_DAMPING_RATIOS, indexing="ij"))
    columns = _unit_tails(f[lines] / fn, zeta) * weight[lines]
    terms, _ = np.linalg.qr((residual_powers(f[lines], TAIL_RESIDUAL_TERMS) * weight[lines]).T)
    columns, values = (rows - (rows @ terms) @ terms.T for rows in (columns, left[lines] * weight[lines]))
    size = np.sum(np.abs(columns) ** 2, axis=1)
    along = columns.conj() @ values
    gains = np.abs(along) ** 2 / size
    best = int(np.argmax(gains))
    remaining = (np.sum(np.abs(values) ** 2) - gains[best]) / (lines.size - TAIL_RESIDUAL_TERMS - 1)
    is_seen = gains[best] > MIN_TAIL_GAIN * remaining
    return np.asarray(is_seen * along[best] / size[best] * _unit_tails(f / fn[best], zeta[best]))


def _unit_tails(ratio: Floats, zeta: Floats) -> Complexes:
    """Return the receptances of modes with K of 1 N/m at frequencies relative to fn."""
    return np.asarray(1 / (1 - ratio**2 + 2j * zeta * ratio))
