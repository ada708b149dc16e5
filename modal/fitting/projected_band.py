"""The least-squares problem of one band, its linear unknowns eliminated (variable projection).

Source: Golub & Pereyra (1973), SIAM J. Numer. Anal. 10, 413; Kaufman (1975), BIT 15, 49 (Jacobian).
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from functools import cached_property, partial

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
    def _both(self) -> Array:
        """Weights of real, then of imaginary parts, (p, 1, 2 n)."""
        return np.tile(self.weight, 2)[:, np.newaxis]

    def at(self, poles: Array, is_complex: bool) -> FitAtPoles:
        """The best modal constants at these poles, (2, m)."""
        curves = _curves(self.frequency, poles)
        columns = np.concatenate([curves.curve, curves.turn * curves.curve]) if is_complex else curves.curve
        q, inverse = _orthonormal(self._weighted(split(columns)))
        part = self.data @ q
        left = (self.data - part @ q.mT)[:, 0]
        linear = (part @ inverse.mT)[:, 0]
        unknowns = linear.size + 2 * self.bases.shape[0] * self.bases.shape[2]
        slope = partial(self._slope, curves, linear)
        return FitAtPoles(poles, self._free, q, inverse, linear, left, unknowns, slope)

    def _slope(self, curves: _Curves, linear: Array) -> Array:
        slope = self._weighted(_slope(curves, linear[..., np.newaxis]))
        return slope if np.all(self._free) else slope[:, self._free]

    def _weighted(self, rows: Array) -> Array:
        """What residual terms leave of rows, (k, 2 n) or (p, k, 2 n), times the weights of each FRF, (p, k, 2 n)."""
        return _without(self.bases, self._both * rows)


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
        apart = np.diagonal(lower, axis1=1, axis2=2) ** 2 > APART**2 * np.diagonal(gram, axis1=1, axis2=2)
        if np.all(apart):
            inverse = np.linalg.inv(lower).mT
            return rows.mT @ inverse, inverse
    q, triangle = np.linalg.qr(rows.mT)
    return q, np.linalg.inv(triangle)


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


def _slope(c: _Curves, linear: Array) -> Array:
    """Of modes by scaled frequency and damping, (p, 2 m, 2 n), for the parts of their constants, (p, m or 2 m, 1).

    Only the constants differ from FRF to FRF: the curves that they multiply are worked out once.
    """
    m = c.zeta.size
    steps = c.zeta * c.curve**2
    by_damping = -2j * c.r * steps
    by_frequency = -c.zeta * by_damping - 2 * c.r**2 * steps
    both = linear[:, np.newaxis]
    slope = both[:, :, :m] * split(np.stack([by_frequency, by_damping]))
    if linear.shape[1] > m:
        off = c.zeta / c.root * c.curve
        by_frequency = by_frequency * c.turn - 1j * c.r * off
        by_damping = by_damping * c.turn + (1 + c.turn * c.zeta / c.root) * off
        slope += both[:, :, m:] * split(np.stack([by_frequency, by_damping]))
    return slope.reshape(len(linear), 2 * m, -1)


def _without(bases: Array, values: Array) -> Array:
    """Values (p, k, 2 n) less their part in orthonormal bases (p, n, terms) of real and of imaginary parts."""
    parts = values.reshape(len(bases), -1, bases.shape[1])
    taken = parts @ bases @ bases.mT
    return np.subtract(parts, taken, out=taken).reshape(values.shape)
