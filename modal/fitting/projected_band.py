"""The least-squares problem of one band, its linear unknowns eliminated (variable projection).

Source: Golub & Pereyra (1973), SIAM J. Numer. Anal. 10, 413; Kaufman (1975), BIT 15, 49 (Jacobian).
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from modal.fitting.band_fit import BandFit, split
from modal.fitting.fit_at_poles import Array, ComplexArray, FitAtPoles
from modal.fitting.residual_terms import residual_powers

APART = 1e-2
"""Share of itself that each curve has beyond all others where normal equations lose no more than four digits."""


@dataclass(frozen=True, eq=False)
class ProjectedBand:
    """Weighted FRFs of a band, and the modes that they are fitted with."""

    frequency: Array
    weight: Array
    """Weights, (p, n)."""
    bases: Array
    """Orthonormal bases of the residual terms of each FRF, the same of real and imaginary parts, (p, n, terms)."""
    data: Array
    """Values that they leave of each weighted FRF, (p, 1, 2 n)."""
    held: NDArray[np.bool_]
    """Modes whose poles stay where they are, (m,)."""

    @cached_property
    def _free(self) -> NDArray[np.bool_]:
        """Whether each frequency and damping ratio may move, (2 m,)."""
        return np.tile(~self.held, 2)

    @cached_property
    def _root(self) -> ComplexArray:
        """i f, (n,)."""
        return np.asarray(1j * self.frequency)

    @cached_property
    def _both(self) -> Array:
        """Weights of real, then of imaginary parts, (p, 1, 2 n)."""
        return np.tile(self.weight, 2)[:, np.newaxis]

    def at(self, poles: Array, is_complex: bool) -> FitAtPoles:
        """The best modal constants at these poles, (2, m)."""
        m = poles.shape[1]
        rows = _without(self.bases, self._both * _rows(self._root, poles))
        q, inverse = _orthonormal(rows[:, : 2 * m if is_complex else m])
        part = self.data @ q
        left = self.data - part @ q.mT
        linear = part @ inverse.mT
        unknowns = linear.size + 2 * self.bases.shape[0] * self.bases.shape[2]
        squares = rows[:, 2 * m :].reshape(len(rows), 2, m, -1)
        return FitAtPoles(poles, self._free, q, inverse, linear[:, 0], left[:, 0], unknowns, squares)


def projected_band(
    frequency: Array, receptance: ComplexArray, weight: Array, terms: int, held: NDArray[np.bool_]
) -> ProjectedBand:
    """frequency (Hz) has shape (n,), receptance (m/N) and weight (p, n), held (m,)."""
    bases = _bases(frequency, weight, terms)
    return ProjectedBand(frequency, weight, bases, _without(bases, split(weight * receptance)[:, np.newaxis]), held)


def beyond_terms(frequency: Array, receptance: ComplexArray, weight: Array, terms: int) -> Array:
    """What residual terms leave of weighted receptances, (p, 2 n); arguments as `projected_band`."""
    return _without(_bases(frequency, weight, terms), split(weight * receptance)[:, np.newaxis])[:, 0]


def gain_of_a_term(fit: BandFit, frequency: Array, weight: Array, terms: int) -> float:
    """Fall of the sum of squares, to first order, that one residual term more than these in each FRF would bring."""
    power = residual_powers(frequency, terms + 1)[-1]
    return _gain(fit, frequency, weight, terms, np.stack([power, 1j * power]))


def gain_of_a_pair(fit: BandFit, frequency: Array, weight: Array, terms: int, i: int) -> float:
    """Fall of the sum of squares, to first order, that two modes close together in place of mode i would bring.

    Two poles at lambda - d and lambda + d add the second derivative of R / (i w - lambda) by lambda, which goes with
    its third power; what is odd in d the pole of the one mode follows.
    """
    fn, zeta = fit.poles[:, i]
    pole, r = complex(-zeta, np.sqrt(1 - zeta**2)), 1j * frequency / fn
    here, conjugate = 1 / (r - pole) ** 3, 1 / (r - pole.conjugate()) ** 3
    return _gain(fit, frequency, weight, terms, np.stack([here + conjugate, 1j * (here - conjugate)]))


def _gain(fit: BandFit, frequency: Array, weight: Array, terms: int, columns: ComplexArray) -> float:
    rows = np.tile(weight, 2)[:, np.newaxis] * split(columns)
    return fit.with_phases.gain(_without(_bases(frequency, weight, terms), rows))


def _bases(frequency: Array, weight: Array, terms: int) -> Array:
    columns = weight[:, np.newaxis] * residual_powers(frequency, terms)
    return np.asarray(np.linalg.qr(columns.mT)[0])


def _orthonormal(rows: Array) -> tuple[Array, Array]:
    """Orthonormal columns, (p, 2 n, c), that span rows (p, c, 2 n), and the inverse of their triangle, (p, c, c).

    By Cholesky, in half the time, where no row is all but a sum of the others, so that this is as exact.
    """
    gram = rows @ rows.mT
    with contextlib.suppress(np.linalg.LinAlgError):
        lower = np.linalg.cholesky(gram)
        apart = lower.diagonal(axis1=1, axis2=2) ** 2 > APART**2 * gram.diagonal(axis1=1, axis2=2)
        if apart.all():
            inverse = np.linalg.inv(lower).mT
            return rows.mT @ inverse, inverse
    q, triangle = np.linalg.qr(rows.mT)
    return q, np.linalg.inv(triangle)


def _rows(root: ComplexArray, poles: Array) -> Array:
    """Modes of constants 1, of constants i, and their slopes by both parts of the pole, (4 m, 2 n); root is i f, (n,).

    With lambda in Hz, h = g / (i f - lambda), g = f_n / (2 sqrt(1 - zeta^2)), and h' for its conjugate: -i (h - h'),
    h + h', h^2 + h'^2 and i (h^2 - h'^2).
    """
    fn, zeta = poles[:, :, np.newaxis]
    turning = np.sqrt(1 - zeta**2)
    pole, size = fn * (1j * turning - zeta), fn / (2 * turning)
    here, there = size / (root - pole), size / (root - pole.conj())
    square, of_there = here * here, there * there
    return split(np.concatenate([1j * (there - here), here + there, square + of_there, 1j * (square - of_there)]))


def _without(bases: Array, values: Array) -> Array:
    """Values (p, k, 2 n) less their part in orthonormal bases (p, n, terms) of real and of imaginary parts."""
    parts = values.reshape(len(bases), -1, bases.shape[1])
    taken = parts @ bases @ bases.mT
    return np.subtract(parts, taken, out=taken).reshape(values.shape)
