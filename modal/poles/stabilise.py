"""Least-squares complex frequency domain (LSCF) poles of every order: the stabilisation chart."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from modal.poles.orthogonal_basis import OrthogonalBasis, orthogonal_basis

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
_Order = tuple[ComplexArray, ComplexArray]

EXTRA = 2
"""Degree of the polynomial that stands for all poles outside the band, negative frequencies among them."""
MOST_LINES = 600
"""Lines that poles are computed from; of more, every so many."""
RIDGE = 1e-12
"""Added to the unit diagonal of the normal equations for the residues, so that coinciding poles can be solved for."""
POLE_TOLERANCE = 0.25
"""A pole is stable where one of the order below lies within this many half-power half-widths ..."""
FLEXIBILITY_TOLERANCE = 0.35
"""... with a modal flexibility that differs by less than this share of its own."""


@dataclass(frozen=True, eq=False)
class StabilisationChart:
    """Poles of all orders, shape (k,), lower orders first; those that decay and lie inside the band."""

    order: NDArray[np.int64]
    """Order of the model: the number of poles it has, shape (k,)."""
    frequency: Array
    """Undamped natural frequency (Hz), shape (k,)."""
    damping_ratio: Array
    """Damping ratio (-), shape (k,)."""
    flexibility: ComplexArray
    """Modal flexibility 1/K, complex (m/N), in each of p FRFs, shape (k, p)."""
    previous: NDArray[np.int64]
    """Place of the same pole at the order below, -1 where there is none (the pole is not stable), shape (k,)."""

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Whether the order below has the same pole, shape (k,)."""
        return self.previous >= 0


def stabilise(frequency: Array, receptance: ComplexArray, weight: Array, orders: int) -> StabilisationChart:
    """Poles of the models of order 1 .. orders, fitted to H = B/A with complex polynomials of the frequency.

    The weighted error w (A H - B) is linear in the coefficients; B, of a degree higher by two than A, is eliminated
    first, and what is left gives A of every order from one matrix. frequency (Hz) has shape (n,), receptance (m/N)
    and weight (p, n); several FRFs share their poles. Both bases are orthonormal over the lines, which may be
    spaced unevenly and begin anywhere.

    Source: Peeters et al. (2004), The PolyMAX frequency-domain method, Shock and Vibration 11, 395; Richardson &
    Formenti (1982), Parameter estimation from FRF measurements using rational fraction polynomials, IMAC 1.

    >>> line = np.linspace(400.0, 600.0, 201)  # Hz
    >>> receptance = Mode(500.0, 0.02, 2e7).receptance(line)[np.newaxis]  # m/N, (1, 201)
    >>> chart = stabilise(line, receptance, np.ones((1, 201)), orders=1)
    >>> chart.order.tolist(), chart.frequency.round(2).tolist(), chart.damping_ratio.round(4).tolist()  # -, Hz, -
    ([1], [500.0], [0.02])
    """
    orders = min(orders, (2 * frequency.size - 2 * EXTRA) // 6)
    thinned = slice(None, None, -(-frequency.size // MOST_LINES))
    model = _Model(frequency[thinned], receptance[:, thinned], weight[:, thinned])
    return _chart(list(_orders(model, orders)), receptance.shape[0])


@dataclass(frozen=True, eq=False)
class _Model:
    frequency: Array
    receptance: ComplexArray
    weight: Array

    @property
    def x(self) -> Array:
        """Frequency on -1 .. 1."""
        return (self.frequency - self.middle) / self.half

    @property
    def middle(self) -> float:
        return float(self.frequency[0] + self.frequency[-1]) / 2

    @property
    def half(self) -> float:
        return float(self.frequency[-1] - self.frequency[0]) / 2


def _orders(model: _Model, orders: int) -> Iterator[_Order]:
    """Poles (complex frequencies, Hz) inside the band and their flexibilities (k, p), order by order."""
    p, n = model.receptance.shape
    if orders < 1:
        return
    below = orthogonal_basis(np.tile(model.x, p), (model.weight * model.receptance).ravel(), orders)
    above = [orthogonal_basis(model.x, w.astype(complex), orders + EXTRA) for w in model.weight]
    overlap = [
        basis.values.conj().T @ part for basis, part in zip(above, below.values.reshape(p, n, orders + 1), strict=True)
    ]
    for order in range(1, orders + 1):
        left = np.eye(order + 1) - sum(
            part.conj().T @ part for part in (o[: order + EXTRA + 1, : order + 1] for o in overlap)
        )
        poles = below.roots(np.linalg.eigh(left)[1][:, 0]) * model.half + model.middle
        poles = poles[_inside(model, poles)]
        yield poles, _flexibilities(model, above, poles)


def _inside(model: _Model, poles: ComplexArray) -> NDArray[np.bool_]:
    """Which of the poles decay and lie in the band."""
    size = np.abs(poles)
    return np.asarray((poles.imag > 0) & (size > model.frequency[0]) & (size < model.frequency[-1]))


def _flexibilities(model: _Model, above: list[OrthogonalBasis], poles: ComplexArray) -> ComplexArray:
    """Complex 1/K of every pole by linear least squares, shape (k, p)."""
    fractions = 1 / (model.frequency[:, None] - poles)
    residues = np.empty((poles.size, len(above)), dtype=np.complex128)
    for i, basis in enumerate(above):
        columns = np.hstack([model.weight[i][:, None] * fractions, basis.values[:, : EXTRA + 1]])
        columns /= np.linalg.norm(columns, axis=0)
        gram = columns.conj().T @ columns + RIDGE * np.eye(columns.shape[1])
        fit = np.linalg.solve(gram, columns.conj().T @ (model.weight[i] * model.receptance[i]))[: poles.size]
        residues[:, i] = fit / np.linalg.norm(model.weight[i][:, None] * fractions, axis=0)
    return np.asarray(residues * (-2 * poles.real / np.abs(poles) ** 2)[:, None])


def _same(below: _Order, here: _Order) -> NDArray[np.int64]:
    """For each pole its place among the poles of the order below, -1 where it is not there."""
    if not below[0].size:
        return np.full(here[0].size, -1)
    distance = np.abs(here[0][:, None] - below[0])
    nearest = np.argmin(distance, axis=1)
    change = np.linalg.norm(here[1] - below[1][nearest], axis=1)
    same = (distance.min(axis=1) < POLE_TOLERANCE * here[0].imag) & (
        change < FLEXIBILITY_TOLERANCE * np.linalg.norm(here[1], axis=1)
    )
    return np.where(same, nearest, -1)


def _chart(orders: list[_Order], p: int) -> StabilisationChart:
    sizes = np.array([poles.size for poles, _ in orders], dtype=np.int64)
    starts = np.cumsum(sizes) - sizes
    previous = [np.full(size, -1) for size in sizes[:1]]
    for (below, here), start in zip(pairwise(orders), starts, strict=False):
        same = _same(below, here)
        previous.append(np.where(same < 0, -1, same + start))
    poles = np.concatenate([poles for poles, _ in orders] or [np.empty(0, complex)])
    return StabilisationChart(
        np.repeat(np.arange(1, sizes.size + 1), sizes),
        np.abs(poles),
        poles.imag / np.abs(poles),
        np.concatenate([a for _, a in orders] or [np.empty((0, p), complex)]),
        np.concatenate([*previous, np.empty(0, np.int64)]),
    )
