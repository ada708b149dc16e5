"""Modal constants at given poles, how what is left changes with these, and what errors of all follow from it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

LEAST_SINGULAR = 1e-10
"""Share of the largest singular value below which an unknown cannot be told from the others."""


@dataclass(frozen=True, eq=False)
class FitAtPoles:
    """Modes of p FRFs at given poles.

    c unknowns of each FRF are its modal constants: m real parts, and m imaginary ones where they are complex; k poles
    may move.
    """

    poles: Array
    """Frequencies (Hz) and damping ratios, (2, m)."""
    free: NDArray[np.bool_]
    """Whether each of them may move, (2 m,)."""
    q: Array
    """Orthonormal bases of what the residual terms leave of the modes, (p, 2 n, c)."""
    inverse: Array
    """Inverses of their triangles, (p, c, c)."""
    linear: Array
    """Best modal constants, (p, c)."""
    left: Array
    """Weighted data that is left, (p, 2 n)."""
    unknowns: int
    """Modal constants and residual terms of all FRFs, real and imaginary parts."""
    squares: Array
    """What the residual terms leave of the squares of partial fractions of each mode, (p, 2, m, 2 n): their slopes by
    its pole for residues that are real, and imaginary."""

    @cached_property
    def cost(self) -> float:
        """Sum of squares; infinite for what are no poles."""
        cost = float(self.residual @ self.residual)
        is_legal = self.poles.min() > 0 and self.poles[1].max() < 1
        return cost if is_legal and math.isfinite(cost) else np.inf

    @property
    def freedom(self) -> int:
        """Real values less unknowns."""
        return int(self.left.size - np.sum(self.free) - self.unknowns)

    @property
    def scale(self) -> Array:
        """What a step of one means: zeta f and zeta of those that may move, (k,)."""
        return np.concatenate([self.poles[0] * self.poles[1], self.poles[1]])[self.free]

    @property
    def residual(self) -> Array:
        """Of all FRFs, (2 n p,)."""
        return self.left.reshape(-1)

    @cached_property
    def slope(self) -> Array:
        """Slope of the models by what may move, frequencies in zeta f, damping ratios in shares of themselves, while
        their residues A f / (2i sqrt(1 - zeta^2)) stay, (p, k, 2 n).

        Only these differ from FRF to FRF: the squares that they multiply are worked out once.
        """
        zeta = self.poles[1]
        turning = np.sqrt(1 - zeta**2)
        moved = 2 * zeta * np.array([turning * (1j * turning - zeta), -(turning + 1j * zeta)])
        by_pole = (-1j * self.constant[:, np.newaxis] * moved)[..., np.newaxis]
        along, across = self.squares[:, :1], self.squares[:, 1:]
        slope = by_pole.real * along + by_pole.imag * across
        every = slope.reshape(len(slope), self.free.size, -1)
        return np.asarray(every if self.free.all() else every[:, self.free])

    @cached_property
    def _follow(self) -> Array:
        """What the constants take up of the slopes, in their bases, (p, k, c)."""
        return np.asarray(self.slope @ self.q)

    @cached_property
    def by_frf(self) -> Array:
        """Slope of the residual by the scaled poles, the constants following (Kaufman), FRF by FRF, (p, k, 2 n)."""
        taken = self._follow @ self.q.mT
        return np.asarray(np.subtract(taken, self.slope, out=taken))

    @cached_property
    def jacobian(self) -> Array:
        """Slope of the residual of all FRFs, (k, 2 n p)."""
        return np.asarray(self.by_frf.swapaxes(0, 1).reshape(-1, self.left.size))

    @cached_property
    def gram(self) -> Array:
        """Products of these slopes with each other, (k, k)."""
        return np.asarray(self.jacobian @ self.jacobian.T)

    @property
    def gradient(self) -> Array:
        """Half the slope of the cost by the scaled poles, (k,)."""
        return np.asarray(self.jacobian @ self.residual)

    @property
    def constant(self) -> ComplexArray:
        """Modal constants, (p, m)."""
        m, linear = self.poles.shape[1], self.linear
        return np.asarray(linear + 0j if linear.shape[1] == m else linear[:, :m] + 1j * linear[:, m:])

    def spread(self, values: Array) -> Array:
        """Values (k, ...) of what may move, with 0 for all that may not, (2 m, ...)."""
        everything = np.zeros((self.free.size, *values.shape[1:]))
        everything[self.free] = values
        return everything

    @cached_property
    def _solution(self) -> tuple[Array, Array]:
        """Norms of the columns of the Jacobian, (k,), and inverse of its triangle when they are one, (k, k)."""
        norm = np.linalg.norm(self.jacobian, axis=1)
        triangle = np.linalg.qr(self.jacobian.T / norm, mode="r")
        left, singular, right = np.linalg.svd(triangle)
        if not np.min(singular, initial=np.inf) > LEAST_SINGULAR * np.max(singular, initial=0.0):
            raise np.linalg.LinAlgError("an unknown cannot be told from the others")
        return norm, (right.T / singular) @ left.T

    def gain(self, rows: Array) -> float:
        """Fall of the cost, to first order, with a further linear unknown for each row of each FRF, (p, rows, 2 n)."""
        norm, inverse = self._solution
        new = rows - rows @ self.q @ self.q.mT
        taken = (new @ (self.by_frf.mT / norm @ inverse)).reshape(-1, norm.size)
        size = -taken @ taken.T
        p, each = len(new), np.arange(len(new))
        size.reshape(p, -1, p, rows.shape[1])[each, :, each] += new @ new.mT
        fall = (new @ self.left[..., np.newaxis]).ravel() - taken @ (inverse.T @ (self.gradient / norm))
        return float(fall @ np.linalg.lstsq(size, fall, rcond=None)[0])

    @cached_property
    def _turned(self) -> Array:
        """Constants along themselves and across, from the bases, (p, 2, m, c); c = 2 m."""
        constant, m = self.constant[..., np.newaxis], self.poles.shape[1]
        off = constant.conj() / np.abs(constant) * (self.inverse[:, :m] + 1j * self.inverse[:, m:])
        return np.stack([off.real, off.imag], axis=1)

    @cached_property
    def _by_poles(self) -> Array:
        """Errors by steps of the scaled poles, (2 m + 2 p m, k)."""
        by_poles = -(self._turned @ self._follow.mT[:, np.newaxis]).swapaxes(0, 1)
        by_poles[0] -= np.abs(self.constant)[..., np.newaxis] * self._own
        return np.concatenate([self.spread(np.diag(self.scale)), by_poles.reshape(self.linear.size, self.scale.size)])

    @property
    def _own(self) -> Array:
        """Shares of itself by which each residue changes with its own pole while the constant stays, (m, k)."""
        zeta = self.poles[1]
        return np.hstack([np.diag(zeta), np.diag(zeta**2 / (1 - zeta**2))])[:, self.free]

    @cached_property
    def covariance(self) -> Array:
        """Of the errors of a complex fit by independent ones of variance 1, (2 m + 2 p m, 2 m + 2 p m).

        Raises LinAlgError where an unknown cannot be told from the others.
        """
        norm, inverse = self._solution
        moved = self._by_poles @ (inverse / norm[:, np.newaxis])
        covariance, (p, _, m, _) = moved @ moved.T, self._turned.shape
        at_once = covariance[2 * m :, 2 * m :].reshape(2, p, m, 2, p, m)
        each = np.arange(p)
        at_once[:, each, :, :, each] += np.einsum("pamc,pbnc->pambn", self._turned, self._turned)
        return covariance

    @cached_property
    def influence(self) -> Array:
        """Of the weighted FRFs on the errors of a complex fit, one Gauss-Newton step, (2 m + 2 p m, 2 n p)."""
        norm, inverse = self._solution
        p, _, m, _ = self._turned.shape
        steps = (inverse / norm[:, np.newaxis]) @ inverse.T @ (self.jacobian / norm[:, np.newaxis])
        influence = -self._by_poles @ steps
        at_once = influence[2 * m :].reshape(2, p, m, p, -1)
        each = np.arange(p)
        at_once[:, each, :, each] += self._turned @ self.q.mT[:, np.newaxis]
        return influence
