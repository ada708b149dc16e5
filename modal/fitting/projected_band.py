"""The least-squares problem of one band, its linear unknowns eliminated (variable projection).

Source: Golub & Pereyra (1973), SIAM J. Numer. Anal. 10, 413; Kaufman (1975), BIT 15, 49 (Jacobian).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

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
        return int(self.residual.size - self.poles.size - sum(frf.unknowns for frf in self.frfs))

    @property
    def scale(self) -> Array:
        """What a step of one means: zeta f and zeta, (2 m,)."""
        return np.concatenate([self.poles[0] * self.poles[1], self.poles[1]])

    @cached_property
    def jacobian(self) -> Array:
        """Of all residuals by the scaled poles, (2 n p, 2 m)."""
        return np.concatenate([frf.jacobian for frf in self.frfs])

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

    def at(self, poles: Array, is_complex: bool) -> FitAtPoles:
        """The best modal constants at these poles, (2, m)."""
        return FitAtPoles(poles, list(self._projected(poles, is_complex)))

    def _projected(self, poles: Array, is_complex: bool) -> Iterator[Projected]:
        columns, slopes = _columns(self.frequency, poles, is_complex)
        m, n = poles.shape[1], self.frequency.size
        for data, weight, base in zip(self.data, self.weight, self.bases, strict=True):
            q, triangle = np.linalg.qr(_without(base, split(weight * columns).T))
            part = q.T @ data
            inverse = np.linalg.inv(triangle)
            linear = inverse @ part
            turned = linear.reshape(-1, 1, m, 1) * slopes
            slope = split(weight * turned.sum(axis=0).reshape(2 * m, n)).T
            unknowns = linear.size + base.shape[1]
            yield Projected(q, inverse, linear, data - q @ part, unknowns, _without(base, slope))


def projected_band(frequency: Array, receptance: ComplexArray, weight: Array, terms: int) -> ProjectedBand:
    """frequency (Hz) has shape (n,), receptance (m/N) and weight (p, n)."""
    columns = residual_powers(frequency, terms)
    bases = [_of_both_parts(np.linalg.qr((w * columns).T)[0]) for w in weight]
    data = [_without(base, values) for base, values in zip(bases, split(weight * receptance), strict=True)]
    return ProjectedBand(frequency, weight, bases, data)


def _of_both_parts(base: Array) -> Array:
    """From a basis of real parts (n, t), which is that of imaginary parts too, one of both, (2 n, 2 t)."""
    (n, t), both = base.shape, np.zeros((2 * base.shape[0], 2 * base.shape[1]))
    both[:n, :t] = both[n:, t:] = base
    return both


def _columns(frequency: Array, poles: Array, is_complex: bool) -> tuple[ComplexArray, ComplexArray]:
    """Curves of constants 1 (and i), shape (c, n), and their slopes by scaled frequency and damping, (c/m, 2, m, n)."""
    fn, zeta = poles[:, :, np.newaxis]
    r = frequency / fn
    curve = 1 / (1 - r**2 + 2j * zeta * r)
    steps = zeta * curve**2
    real = np.stack([(2j * zeta * r - 2 * r**2) * steps, -2j * r * steps])
    if not is_complex:
        return curve, real[np.newaxis]
    root = np.sqrt(1 - zeta**2)
    turn = (zeta + 1j * r) / root
    turned = turn * real + np.stack([-1j * r, (1 + turn * zeta / root)]) * (zeta / root * curve)
    return np.concatenate([curve, turn * curve]), np.stack([real, turned])


def _without(base: Array, values: Array) -> Array:
    """Values less their part in an orthonormal basis."""
    return np.asarray(values - base @ (base.T @ values))
