"""What every fit of a series has in common: its level, and the influence of the temperature where that is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

ENOUGH = 12
"""Points with a temperature from which on its influence is fitted ..."""
SPAN = 5.0
"""... where they span so much (K)."""
STEEL = -0.015
"""Change of the natural frequency that Young's modulus of steel leads to (%/K), and how far it may be from that."""

TINY = 1e-12
"""Variance of a point at least (%^2)."""
LEAST = 1e-20
"""Share of the sum of squares that is taken as left at least: less is rounding."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Base:
    """A series and the columns that are in every fit of it."""

    y: Floats
    """Without the expected influence of the temperature, from its first point on, shape (n,)."""
    columns: Floats
    """1, and the temperature where it counts, shape (n, p)."""

    def precision(self, n: NDArray[np.intp]) -> Floats:
        """Of what is known of the coefficients beforehand, times the variance of n (r,) points, shape (r, p, p)."""
        p = self.columns.shape[1]
        known = np.zeros((n.size, p, p))
        if p > 1:
            squares = np.concatenate([[0.0, 0.0], np.cumsum(np.diff(self.y) ** 2)])
            known[:, 1, 1] = np.maximum(squares[n] / (2 * (n - 1)), TINY) / STEEL**2
        return known

    def fit_change(self, kind: str, n: NDArray[np.intp], k: NDArray[np.intp]) -> tuple[Floats, Floats]:
        """Size and standard error of a "step" or "slope" (a point) from each point k (m,) on in the first n (r, 1).

        Shape (r, m) each; without meaning where k leaves no points before or after the change.
        """
        rows = n[:, 0]
        values = np.column_stack([self.y, self.columns])
        length, tail = n - k, _sums(values)[n] - _sums(values)[k]
        square: NDArray[np.float64] = length.astype(np.float64)
        if kind == "slope":
            moments = _sums(np.arange(self.y.size)[:, np.newaxis] * values)
            tail = moments[n] - moments[k] - k[:, np.newaxis] * tail
            square = (length - 1.0) * length * (2 * length - 1.0) / 6
        outer = _sums(np.einsum("ni,nj->nij", values, values))[rows]
        gram = outer[:, 1:, 1:] + self.precision(rows)
        level = np.linalg.solve(gram, outer[:, 1:, :1])
        product = tail[..., 0] - (tail[..., 1:] @ level)[..., 0]
        square = square - (tail[..., 1:] @ np.linalg.inv(gram) * tail[..., 1:]).sum(axis=-1)
        total = outer[:, 0, 0] - (outer[:, 0, 1:] * level[..., 0]).sum(axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            size = product / square
            left = np.maximum(
                total[:, np.newaxis] - size * product, LEAST * total[:, np.newaxis] + np.finfo(float).tiny
            )
            return np.nan_to_num(size), np.sqrt(np.nan_to_num(left / (n - 2) / square, nan=1.0))

    @property
    def freedom(self) -> int:
        """Degrees of freedom once a shape is fitted: the temperature costs none, its influence is known beforehand."""
        return self.y.size - 2

    def fit_columns(self, columns: Floats, n: int) -> tuple[Floats, Floats, Floats]:
        """Sum of squares (j,) that each column (j, n + d) leaves in the first n, its mean and its error in all.

        Mean and error of shape (j, n + d), at the mean temperature.
        """
        inner = columns[:, :n]
        gram = np.linalg.inv(self.columns.T @ self.columns + self.precision(np.array([n]))[0])
        level = gram @ self.columns.T @ self.y
        leaning = inner @ self.columns @ gram
        product = inner @ (self.y - self.columns @ level)
        square = (inner**2).sum(axis=1) - (leaning * (inner @ self.columns)).sum(axis=1)
        square = np.where(square > 0, square, np.inf)
        total = self.y @ (self.y - self.columns @ level)
        size = product / square
        rss = np.maximum(total - size * product, LEAST * total + np.finfo(float).tiny)
        away = columns - leaning[:, :1]
        variance = (gram[0, 0] + away**2 / square[:, np.newaxis]) * (rss / self.freedom)[:, np.newaxis]
        return rss, level[0] + size[:, np.newaxis] * away, np.sqrt(variance)


def _sums(values: Floats) -> Floats:
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])


def base_of(y: Floats, temperature: Floats | None = None) -> Base:
    """The base of a series (n,), the temperature in it only where enough of it is known over a wide enough span."""
    columns = np.ones((y.size, 1))
    start = y[:1].sum()
    known = np.isfinite(temperature) if temperature is not None else np.zeros(y.size, dtype=bool)
    if temperature is None or known.sum() < ENOUGH or np.ptp(temperature[known]) < SPAN:
        return Base(y - start, columns)
    warmer = np.where(known, temperature - temperature[known].mean(), 0.0)
    return Base(y - start - STEEL * warmer, np.column_stack([columns, warmer]))
