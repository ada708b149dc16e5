"""Which poles of a stabilisation chart are modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from modal.poles.stabilise import StabilisationChart

LEAST_ORDERS = 4
"""Orders in a row that a mode is stable in, at least."""


@dataclass(frozen=True, eq=False)
class PhysicalPoles:
    """Poles that stay where they are as the order grows, m of them, by rising frequency."""

    frequency: NDArray[np.float64]
    """Undamped natural frequencies (Hz), shape (m,)."""
    damping_ratio: NDArray[np.float64]
    """Damping ratios (-), shape (m,)."""
    flexibility: NDArray[np.complex128]
    """Modal flexibilities 1/K, complex (m/N), in each of p FRFs, shape (m, p)."""
    n_orders: NDArray[np.int64]
    """Orders that each is stable in, shape (m,)."""

    @property
    def largest(self) -> NDArray[np.float64]:
        """Size of each flexibility in the FRF where it is largest (m/N), shape (m,)."""
        return np.asarray(np.abs(self.flexibility).max(axis=1))


def physical_poles(chart: StabilisationChart) -> PhysicalPoles:
    """Chains of poles, each the same as that of the order below (by frequency, damping and flexibility).

    Of chains that share a pole the longest counts; a chain of fewer than five poles is none. A mode is the median of
    the upper half of its chain, part by part.

    >>> line = np.linspace(400.0, 600.0, 201)  # Hz
    >>> noise = np.random.default_rng(1).normal(0.0, 2e-9, (2, 201))  # m/N, beside a peak of 1.25e-6
    >>> measured = Mode(500.0, 0.02, 2e7).receptance(line) + noise[0] + 1j * noise[1]
    >>> chart = stabilise(line, measured[np.newaxis], np.ones((1, 201)), orders=10)
    >>> poles = physical_poles(chart)  # of all 55 those that stay where they are
    >>> poles.frequency.round(1).tolist(), poles.damping_ratio.round(3).tolist()  # Hz, -
    ([500.0], [0.02])
    """
    taken = np.zeros(chart.order.size, bool)
    rows = []
    lengths = _lengths(chart)
    for end in np.argsort(-lengths, kind="stable"):
        if lengths[end] < LEAST_ORDERS:
            break
        chain = _chain(chart, int(end))
        if not taken[chain].any():
            rows.append(_median(chart, chain))
        taken[chain] = True
    rows.sort(key=lambda row: float(row[0].real))
    table = np.array(rows).reshape(len(rows), 3 + chart.flexibility.shape[1])
    return PhysicalPoles(table[:, 0].real, table[:, 1].real, table[:, 3:], table[:, 2].real.astype(np.int64))


def _lengths(chart: StabilisationChart) -> NDArray[np.int64]:
    """Stable poles in the chain that ends at each pole."""
    lengths = np.zeros(chart.order.size, dtype=np.int64)
    for i in np.flatnonzero(chart.stable):
        lengths[i] = lengths[chart.previous[i]] + 1
    return lengths


def _chain(chart: StabilisationChart, end: int) -> NDArray[np.int64]:
    """Places of the poles of the chain that ends here, the last one first."""
    chain = [end]
    while chart.previous[chain[-1]] >= 0:
        chain.append(int(chart.previous[chain[-1]]))
    return np.array(chain)


def _median(chart: StabilisationChart, chain: NDArray[np.int64]) -> NDArray[np.complex128]:
    upper = chain[: (chain.size + 1) // 2]
    a = chart.flexibility[upper]
    poles = [np.median(chart.frequency[upper]), np.median(chart.damping_ratio[upper]), chain.size - 1]
    return np.concatenate([poles, np.median(a.real, axis=0) + 1j * np.median(a.imag, axis=0)])
