"""Result of a band fit: modal constants at given poles, their errors, and residual terms."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from modal.arrays import Complexes, Flags, Floats

MIN_SINGULAR_VALUE_SHARE = 1e-10
"""Least singular value, over the largest, of an unknown that can be separated from the others."""


@dataclass(frozen=True, eq=False)
class FixedPoleFit:
    """Fit of the modal constants of p FRFs at given poles.

    Each FRF has c unknowns, its modal constants: m real parts, and m imaginary parts if they are complex. k poles
    may move. s is 1 if all FRFs have the same weights, otherwise p.
    """

    poles: Floats
    """Frequencies (Hz) and damping ratios, (2, m)."""
    free: Flags
    """True for each of them that is free, (2 m,)."""
    q: Floats
    """Orthonormal bases of the modes without their part in the residual terms, (s, 2 n, c)."""
    inverse: Floats
    """Inverses of the triangular factors, (s, c, c)."""
    linear: Floats
    """Best modal constants, (p, c)."""
    left: Floats
    """Weighted residuals, (p, 2 n)."""
    unknowns: int
    """Modal constants and residual terms of all FRFs, real and imaginary parts."""
    squares: Floats
    """Squared partial fractions of the modes without residual terms, (s, 2 m, 2 n).

    They are the slopes by the pole for real and for imaginary residues.
    """

    @cached_property
    def cost(self) -> float:
        """Sum of squares; infinite for illegal poles."""
        cost = float(self.residual @ self.residual)
        is_legal = self.poles.min() > 0 and self.poles[1].max() < 1
        return cost if is_legal and math.isfinite(cost) else np.inf

    @property
    def degrees_of_freedom(self) -> int:
        """Real values less unknowns."""
        return int(self.left.size - np.sum(self.free) - self.unknowns)

    @property
    def scale(self) -> Floats:
        """Scale of a step, zeta f and zeta of the free values, (k,)."""
        return np.concatenate([self.poles[0] * self.poles[1], self.poles[1]])[self.free]

    @property
    def residual(self) -> Floats:
        """Residuals of all FRFs, (2 n p,)."""
        return self.left.reshape(-1)

    @cached_property
    def _slope_parts(self) -> Floats:
        """Shares of the squares in the slopes of the models by the free values, (p, k, 2 m).

        The residues A f / (2i sqrt(1 - zeta^2)) are constant. Frequencies are in units of zeta f, damping ratios
        relative to themselves. Only the constants differ from FRF to FRF.
        """
        zeta = self.poles[1]
        turning, m = np.sqrt(1 - zeta**2), zeta.size
        moved = 2 * zeta * np.array([turning * (1j * turning - zeta), -(turning + 1j * zeta)])
        by_pole = -1j * self.constant[:, np.newaxis] * moved
        parts, own = np.zeros((len(by_pole), 2, m, 2, m)), np.arange(m)
        parts[:, :, own, 0, own], parts[:, :, own, 1, own] = by_pole.real, by_pole.imag
        return np.asarray(parts.reshape(-1, 2 * m, 2 * m)[:, self.free])

    @cached_property
    def _constant_squares(self) -> Floats:
        """Part of the squares that the constants take up, in their bases, (s, 2 m, c)."""
        return np.asarray(self.squares @ self.q)

    @cached_property
    def _free_squares(self) -> Floats:
        """Squares without that part, (s, 2 m, 2 n)."""
        return np.asarray(self.squares - self._constant_squares @ self.q.mT)

    @cached_property
    def by_frf(self) -> Floats:
        """Slope of the residual by the scaled poles with optimal constants (Kaufman), by FRF, (p, k, 2 n)."""
        return np.asarray(-self._slope_parts @ self._free_squares)

    @cached_property
    def jacobian(self) -> Floats:
        """Slope of the residual of all FRFs, (k, 2 n p)."""
        return np.asarray(self.by_frf.swapaxes(0, 1).reshape(-1, self.left.size))

    @cached_property
    def gram(self) -> Floats:
        """Products of these slopes with each other, (k, k)."""
        products = self._free_squares @ self._free_squares.mT
        return np.asarray(np.sum(self._slope_parts @ products @ self._slope_parts.mT, axis=0))

    @property
    def gradient(self) -> Floats:
        """Half the slope of the cost by the scaled poles, (k,)."""
        along = self._free_squares @ self.left[..., np.newaxis]
        return np.asarray(-np.sum(self._slope_parts @ along, axis=0)[:, 0])

    @property
    def constant(self) -> Complexes:
        """Modal constants, (p, m)."""
        m, linear = self.poles.shape[1], self.linear
        return np.asarray(linear + 0j if linear.shape[1] == m else linear[:, :m] + 1j * linear[:, m:])

    def spread(self, values: Floats) -> Floats:
        """Return values (k, ...) of the free unknowns, with 0 for the fixed ones, (2 m, ...)."""
        everything = np.zeros((self.free.size, *values.shape[1:]))
        everything[self.free] = values
        return everything

    @cached_property
    def _solution(self) -> tuple[Floats, Floats]:
        """Norms of the Jacobian columns, (k,), and inverse of the triangle of the scaled Jacobian, (k, k)."""
        norm = np.linalg.norm(self.jacobian, axis=1)
        triangle = np.linalg.qr(self.jacobian.T / norm, mode="r")
        left, singular, right = np.linalg.svd(triangle)
        if not np.min(singular, initial=np.inf) > MIN_SINGULAR_VALUE_SHARE * np.max(singular, initial=0.0):
            raise np.linalg.LinAlgError("the unknowns of the mode fit are linearly dependent")
        return norm, (right.T / singular) @ left.T

    def gain(self, rows: Floats) -> float:
        """Return the first-order drop of the cost by one more linear unknown per row of each FRF, (p, rows, 2 n)."""
        norm, inverse = self._solution
        new = rows - rows @ self.q @ self.q.mT
        taken = (new @ (self.by_frf.mT / norm @ inverse)).reshape(-1, norm.size)
        size = -taken @ taken.T
        p, each = len(new), np.arange(len(new))
        size.reshape(p, -1, p, rows.shape[1])[each, :, each] += new @ new.mT
        fall = (new @ self.left[..., np.newaxis]).ravel() - taken @ (inverse.T @ (self.gradient / norm))
        return float(fall @ np.linalg.lstsq(size, fall, rcond=None)[0])

    @cached_property
    def _rotated_constants(self) -> Floats:
        """Size and phase direction of the constants in the bases, (p, 2, m, c); c = 2 m."""
        constant, m = self.constant[..., np.newaxis], self.poles.shape[1]
        off = constant.conj() / np.abs(constant) * (self.inverse[:, :m] + 1j * self.inverse[:, m:])
        return np.stack([off.real, off.imag], axis=1)

    @cached_property
    def _pole_errors(self) -> Floats:
        """Errors by steps of the scaled poles, (2 m + 2 p m, k)."""
        by_constants = self._slope_parts @ self._constant_squares
        by_poles = -(self._rotated_constants @ by_constants.mT[:, np.newaxis]).swapaxes(0, 1)
        zeta = self.poles[1]
        residue_slopes = np.hstack([np.diag(zeta), np.diag(zeta**2 / (1 - zeta**2))])[:, self.free]
        by_poles[0] -= np.abs(self.constant)[..., np.newaxis] * residue_slopes
        return np.concatenate([self.spread(np.diag(self.scale)), by_poles.reshape(self.linear.size, self.scale.size)])

    @cached_property
    def covariance(self) -> Floats:
        """Covariance of the errors of a complex fit for independent noise of variance 1, (2 m + 2 p m, 2 m + 2 p m).

        Raises LinAlgError if an unknown cannot be separated from the others.
        """
        norm, inverse = self._solution
        moved = self._pole_errors @ (inverse / norm[:, np.newaxis])
        covariance, (p, _, m, _) = moved @ moved.T, self._rotated_constants.shape
        at_once = covariance[2 * m :, 2 * m :].reshape(2, p, m, 2, p, m)
        each = np.arange(p)
        at_once[:, each, :, :, each] += np.einsum("pamc,pbnc->pambn", self._rotated_constants, self._rotated_constants)
        return covariance

    @cached_property
    def influence(self) -> Floats:
        """Influence of the weighted FRFs on the errors of a complex fit, a Gauss-Newton step, (2 m + 2 p m, 2 p n)."""
        norm, inverse = self._solution
        p, _, m, _ = self._rotated_constants.shape
        steps = (inverse / norm[:, np.newaxis]) @ inverse.T @ (self.jacobian / norm[:, np.newaxis])
        influence = -self._pole_errors @ steps
        at_once = influence[2 * m :].reshape(2, p, m, p, -1)
        each = np.arange(p)
        at_once[:, each, :, each] += self._rotated_constants @ self.q.mT[:, np.newaxis]
        return influence


RESIDUAL_POWERS = (-2, 0, 2, 4, 6, 8)
"""Powers of the frequency in the order of the residual terms."""
MIN_RESIDUAL_TERMS = 4
"""Number of complex residual terms of every band."""
MAX_RESIDUAL_TERMS = len(RESIDUAL_POWERS)
"""Largest number of complex residual terms of a band."""


def residual_powers(frequency: Floats, terms: int) -> Floats:
    """Return the first powers of the frequency, shape (terms, n)."""
    square = (frequency / np.mean(frequency)) ** 2
    return np.stack([square ** (power // 2) for power in RESIDUAL_POWERS[:terms]])


@dataclass(frozen=True, eq=False)
class BandFit:
    """Fit of m modes together in p FRFs.

    Order of the errors: all frequencies, all damping ratios, then by FRF the size error of each modal constant, then by
    FRF its phase error (times its size): 2 m + 2 p m values.
    """

    frequency: Floats
    """Natural frequencies (Hz), shape (m,)."""
    damping_ratio: Floats
    """Damping ratios (-), shape (m,)."""
    constant: Complexes
    """Modal constants A (m/N), shape (p, m); all real after a real fit."""
    degrees_of_freedom: int
    """Real values that were fitted less unknowns."""
    complex_fit: FixedPoleFit
    """Fit with complex constants, which the errors come from."""
    residual: Floats
    """Residuals of the weighted FRFs, each its real and then its imaginary part, shape (2 n p,)."""
    phase_if_complex: Floats
    """Phases (rad) that complex constants would have, of a real fit, shape (p, m); else 0."""
    held: Flags
    """Modes whose frequency and damping ratio were given and have no error, shape (m,)."""

    @cached_property
    def covariance(self) -> Floats:
        """Covariance of the errors from the residual, shape (2 m + 2 p m, 2 m + 2 p m)."""
        return self.complex_fit.covariance * (self.sum_of_squares / self.degrees_of_freedom)

    @property
    def standard_error(self) -> Floats:
        """Standard errors, shape (2 + 2 p, m)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)).reshape(-1, self.frequency.size))

    @property
    def size_error(self) -> Floats:
        """Relative standard errors of the sizes of the modal constants, shape (p, m)."""
        return np.asarray(self.standard_error[2 : 2 + len(self.constant)] / np.abs(self.constant))

    def size_covariance(self, i: int) -> Floats:
        """Return the covariance of the relative sizes of the modal constants of mode i in the FRFs, shape (p, p)."""
        p, m = self.constant.shape
        own, size = (2 + np.arange(p)) * m + i, np.abs(self.constant[:, i])
        return np.asarray(self.covariance[np.ix_(own, own)] / np.outer(size, size))

    @property
    def complex_residual(self) -> Complexes:
        """Residual line by line, shape (p, n)."""
        parts = self.residual.reshape(len(self.constant), 2, -1)
        return np.asarray(parts[:, 0] + 1j * parts[:, 1])

    @property
    def mobility_peak(self) -> Floats:
        """|mobility| of each mode alone at its natural frequency, largest of all FRFs (m/s/N), shape (m,)."""
        return np.asarray(np.pi * self.frequency * np.abs(self.constant / self.damping_ratio).max(axis=0))

    @property
    def poles(self) -> Floats:
        """Natural frequencies (Hz) and damping ratios, shape (2, m)."""
        return np.stack([self.frequency, self.damping_ratio])

    @property
    def sum_of_squares(self) -> float:
        """Sum of the squared weighted residuals."""
        return float(self.residual @ self.residual)

    def passes_f_test(self, fewer: Self, least: float) -> bool:
        """Return whether these unknowns lower the sum of squares of a fit with fewer by over `least` times chance."""
        gain = (fewer.sum_of_squares - self.sum_of_squares) / max(fewer.degrees_of_freedom - self.degrees_of_freedom, 1)
        return gain > least * self.sum_of_squares / self.degrees_of_freedom

    def has_lower_aic(self, other: Self) -> bool:
        """Return whether this fit has the lower Akaike information criterion."""
        variance = min(fit.sum_of_squares / fit.degrees_of_freedom for fit in (self, other))
        own, others = (fit.sum_of_squares - 2 * variance * fit.degrees_of_freedom for fit in (self, other))
        return own < others

    def influence_of(self, i: int) -> Floats:
        """Return the influence of FRF i, shape (2 m + 2 p m, 2 n)."""
        return np.hsplit(self.complex_fit.influence, len(self.constant))[i]

    def of_mode(self, i: int, frequency: Floats) -> Complexes:
        """Return the receptance of mode i alone (m/N) at these frequencies (Hz), shape (p, n)."""
        f, zeta, constant = self.frequency[[i]], self.damping_ratio[[i]], self.constant[:, [i]]
        return replace(self, frequency=f, damping_ratio=zeta, constant=constant).receptance(frequency)

    def receptance(self, frequency: Floats) -> Complexes:
        """Return the receptance of these modes alone (m/N) at these frequencies (Hz), shape (p, n)."""
        fn, zeta = self.poles[:, :, np.newaxis]
        r = frequency / fn
        turn = self.constant.imag / np.sqrt(1 - zeta[:, 0] ** 2)
        steady = self.constant.real + turn * zeta[:, 0]
        curve = 1 / (1 - r**2 + 2j * zeta * r)
        return np.asarray(steady @ curve + 1j * turn @ (r * curve))


def split_complex(values: Complexes) -> Floats:
    """Join real and imaginary parts along the last axis."""
    return np.concatenate([values.real, values.imag], axis=-1)
