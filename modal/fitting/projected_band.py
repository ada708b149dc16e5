"""The least-squares problem of one band, its linear unknowns eliminated (variable projection).

Source: Golub & Pereyra (1973), SIAM J. Numer. Anal. 10, 413; Kaufman (1975), BIT 15, 49 (Jacobian).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from modal.fitting.band_fit import Array, ComplexArray, split
from modal.fitting.residual_terms import residual_powers


@dataclass(frozen=True, eq=False)
class Projected:
    """One FRF at given poles; c unknowns are its modal constants: m real parts, and m imaginary ones where complex."""

    q: Array
    """Orthonormal basis of what the residual terms leave of the modes, (2 n, c)."""
    inverse: Array
    """Inverse of its triangle, (c, c)."""
    linear: Array
    """Best modal constants, (c,)."""
    residual: Array
    """Weighted data that is left, (2 n,)."""
    unknowns: int
    """Modal constants and residual terms, real and imaginary parts."""
    slope: Array
    """Slope of the model by frequencies (in shares of zeta f) and damping ratios (in shares of zeta), (2 n, 2 m)."""

    @property
    def jacobian(self) -> Array:
        """Slope of the residual with the linear unknowns following (Kaufman), (2 n, 2 m)."""
        return np.asarray(self.q @ (self.q.T @ self.slope) - self.slope)


@dataclass(frozen=True, eq=False)
class FitAtPoles:
    """All FRFs of a band at given poles."""

    poles: Array
    """Frequencies (Hz) and damping ratios, (2, m)."""
    free: NDArray[np.bool_]
    """Whether each of them may move, (2 m,)."""
    frfs: list[Projected]

    @cached_property
    def cost(self) -> float:
        """Sum of squares; infinite for what are no poles."""
        cost = float(sum(frf.residual @ frf.residual for frf in self.frfs))
        is_legal = np.all(self.poles > 0) and np.all(self.poles[1] < 1)
        return cost if is_legal and np.isfinite(cost) else np.inf

    @property
    def freedom(self) -> int:
        """Real values less unknowns."""
        return int(self.residual.size - np.sum(self.free) - sum(frf.unknowns for frf in self.frfs))

    @property
    def scale(self) -> Array:
        """What a step of one means: zeta f and zeta of those that may move, (k,)."""
        return np.concatenate([self.poles[0] * self.poles[1], self.poles[1]])[self.free]

    @cached_property
    def jacobian(self) -> Array:
        """Of all residuals by the scaled poles that may move, (2 n p, k)."""
        return np.concatenate([frf.jacobian[:, self.free] for frf in self.frfs])

    @cached_property
    def residual(self) -> Array:
        """Of all FRFs, (2 n p,)."""
        return np.concatenate([frf.residual for frf in self.frfs])

    @property
    def constant(self) -> ComplexArray:
        """Modal constants, (p, m)."""
        m = self.poles.shape[1]
        linear = np.array([frf.linear for frf in self.frfs])
        return np.asarray(linear + 0j if linear.shape[1] == m else linear[:, :m] + 1j * linear[:, m:])

    def spread(self, values: Array) -> Array:
        """Values (k, ...) of what may move, with 0 for all that may not, (2 m, ...)."""
        everything = np.zeros((self.free.size, *values.shape[1:]))
        everything[self.free] = values
        return everything


@dataclass(frozen=True, eq=False)
class ProjectedBand:
    """Weighted FRFs of a band, and the modes that they are fitted with."""

    frequency: Array
    weight: Array
    """Weights, (p, n)."""
    bases: list[Array]
    """Orthonormal basis of the residual terms of each FRF, (2 n, 2 terms)."""
    data: list[Array]
    """Values that they leave of each weighted FRF, (2 n,)."""
    held: NDArray[np.bool_]
    """Modes whose poles stay where they are, (m,)."""

    def at(self, poles: Array, is_complex: bool) -> FitAtPoles:
        """The best modal constants at these poles, (2, m)."""
        return FitAtPoles(poles, np.tile(~self.held, 2), list(self._projected(poles, is_complex)))

    def _projected(self, poles: Array, is_complex: bool) -> Iterator[Projected]:
        curves = _curves(self.frequency, poles)
        columns = np.concatenate([curves.curve, curves.turn * curves.curve]) if is_complex else curves.curve
        m = poles.shape[1]
        for data, weight, base in zip(self.data, self.weight, self.bases, strict=True):
            q, triangle = np.linalg.qr(_without(base, split(weight * columns).T))
            part = q.T @ data
            inverse = np.linalg.inv(triangle)
            linear = inverse @ part
            slope = split(weight * _slope(curves, linear[:m, np.newaxis], linear[m:, np.newaxis])).T
            unknowns = linear.size + base.shape[1]
            yield Projected(q, inverse, linear, data - q @ part, unknowns, _without(base, slope))


def projected_band(
    frequency: Array, receptance: ComplexArray, weight: Array, terms: int, held: NDArray[np.bool_]
) -> ProjectedBand:
    """frequency (Hz) has shape (n,), receptance (m/N) and weight (p, n), held (m,)."""
    columns = residual_powers(frequency, terms)
    bases = [_of_both_parts(np.linalg.qr((w * columns).T)[0]) for w in weight]
    data = [_without(base, values) for base, values in zip(bases, split(weight * receptance), strict=True)]
    return ProjectedBand(frequency, weight, bases, data, held)


def _of_both_parts(base: Array) -> Array:
    """From a basis of real parts (n, t), which is that of imaginary parts too, one of both, (2 n, 2 t)."""
    (n, t), both = base.shape, np.zeros((2 * base.shape[0], 2 * base.shape[1]))
    both[:n, :t] = both[n:, t:] = base
    return both


@dataclass(frozen=True, eq=False)
class _Curves:
    """Shapes of m modes over n lines, each (m, n) or (m, 1)."""

    r: Array
    zeta: Array
    root: Array
    """sqrt(1 - zeta^2)."""
    curve: ComplexArray
    """Of a modal constant of 1."""
    turn: ComplexArray
    """Times curve: of a modal constant of i."""


def _curves(frequency: Array, poles: Array) -> _Curves:
    fn, zeta = poles[:, :, np.newaxis]
    r = frequency / fn
    root = np.sqrt(1 - zeta**2)
    turn = (zeta + 1j * r) / root
    return _Curves(r, zeta, root, 1 / (1 - r**2 + 2j * zeta * r), turn)


def _slope(c: _Curves, real: Array, imaginary: Array) -> ComplexArray:
    """Of modes by scaled frequency and damping, (2 m, n), for the parts of their constants, (m, 1), maybe no imaginary
    ones, (0, 1)."""
    steps = c.zeta * c.curve**2 * (real + imaginary * c.turn if imaginary.size else real)
    by_damping = -2j * c.r * steps
    by_frequency = -c.zeta * by_damping - 2 * c.r**2 * steps
    if imaginary.size:
        off = imaginary * (c.zeta / c.root) * c.curve
        by_frequency -= 1j * c.r * off
        by_damping += (1 + c.turn * c.zeta / c.root) * off
    return np.concatenate([by_frequency, by_damping])


def _without(base: Array, values: Array) -> Array:
    """Values less their part in an orthonormal basis."""
    return np.asarray(values - base @ (base.T @ values))
