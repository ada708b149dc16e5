"""Least squares of a few neighbouring modes at once, with what all other modes leave in their band."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

MOST_TRIALS = 60
"""Evaluations of the model; a mode in its own band takes some ten."""


@dataclass(frozen=True, eq=False)
class LocalFit:
    """Values of m modes that were fitted together."""

    frequency: Array
    """Natural frequencies (Hz), shape (m,)."""
    damping_ratio: Array
    """Damping ratios (-), shape (m,)."""
    flexibility: Array
    """1/K, signed (m/N), shape (m,)."""
    covariance: Array
    """Of all frequencies, then all damping ratios, then all flexibilities, shape (3 m, 3 m)."""

    @property
    def standard_error(self) -> Array:
        """Standard errors of frequencies, damping ratios and flexibilities, shape (3, m)."""
        return np.sqrt(np.diag(self.covariance)).reshape(3, -1)

    @property
    def mobility_peak(self) -> Array:
        """|mobility| of each mode alone at its natural frequency (m/s/N), shape (m,)."""
        return np.asarray(np.pi * self.frequency * np.abs(self.flexibility / self.damping_ratio))

    def receptance(self, frequency: Array) -> ComplexArray:
        """Sum of these modes alone (m/N) at these frequencies (Hz), shape (n,)."""
        return np.asarray(self.flexibility @ mode_shapes(frequency, self.frequency, self.damping_ratio))


def fit_local(frequency: Array, receptance: ComplexArray, weight: Array, starts: Array) -> LocalFit | None:
    """Fit H = sum of a_k / (1 - r_k^2 + 2i zeta_k r_k) + L/f^2 + U, r_k = f/f_k; None where nothing can be fitted.

    a_k = 1/K_k is real. L (modes far below, and the free body) and U (modes far above) are complex: the tail of a
    damped neighbour is not real, and a real L or U would push its imaginary part into zeta and K, by percents.
    frequency (Hz), receptance (m/N) and weight have shape (n,), starts (Hz; damping ratios) (2, m).
    """
    problem = _Problem(frequency, receptance, weight, starts.shape[1])
    if 3 * problem.n_modes + 4 >= 2 * frequency.size:
        return None
    with np.errstate(all="ignore"):
        fit = least_squares(
            problem.residuals,
            problem.start(*starts),
            problem.jacobian,
            method="lm",
            x_scale="jac",
            xtol=1e-12,
            ftol=1e-14,
            gtol=1e-14,
            max_nfev=MOST_TRIALS,
        )
    covariance = _covariance(fit.jac, fit.fun)
    if not fit.success or covariance is None:
        return None
    m = problem.n_modes
    return LocalFit(fit.x[:m], fit.x[m : 2 * m], fit.x[2 * m : 3 * m], covariance[: 3 * m, : 3 * m])


def mode_shapes(frequency: Array, natural_frequency: Array, damping_ratio: Array) -> ComplexArray:
    """1/(1 - r^2 + 2i zeta r) of m modes (rows) at n frequencies, shape (m, n)."""
    r = frequency / natural_frequency[:, None]
    return np.asarray(1 / (1 - r**2 + 2j * damping_ratio[:, None] * r))


@dataclass(frozen=True, eq=False)
class _Problem:
    """Unknowns x: m frequencies, m damping ratios, m flexibilities, then Re L, Im L, Re U, Im U."""

    frequency: Array
    receptance: ComplexArray
    weight: Array
    n_modes: int

    def start(self, natural_frequency: Array, damping_ratio: Array) -> Array:
        """The given non-linear unknowns and the best linear ones for them."""
        columns = self._weighted(self._columns(natural_frequency, damping_ratio)).T
        norm = np.linalg.norm(columns, axis=0)
        linear = np.linalg.lstsq(columns / norm, self._weighted(self.receptance), rcond=None)[0] / norm
        return np.concatenate([natural_frequency, damping_ratio, linear])

    def residuals(self, x: Array) -> Array:
        fn, zeta, linear = np.split(x, [self.n_modes, 2 * self.n_modes])
        return self._weighted(linear @ self._columns(fn, zeta) - self.receptance)

    def jacobian(self, x: Array) -> Array:
        fn, zeta, linear = np.split(x, [self.n_modes, 2 * self.n_modes])
        columns = self._columns(fn, zeta)
        r = self.frequency / fn[:, None]
        slope = linear[: self.n_modes, None] * columns[: self.n_modes] ** 2
        by_frequency = slope * (2j * zeta[:, None] * r - 2 * r**2) / fn[:, None]
        return self._weighted(np.vstack([by_frequency, slope * -2j * r, columns])).T

    def _columns(self, natural_frequency: Array, damping_ratio: Array) -> ComplexArray:
        low = (np.mean(self.frequency) / self.frequency) ** 2
        high = np.ones_like(low)
        return np.vstack(
            [mode_shapes(self.frequency, natural_frequency, damping_ratio), low, 1j * low, high, 1j * high]
        )

    def _weighted(self, values: ComplexArray) -> Array:
        return np.concatenate([(self.weight * values).real, (self.weight * values).imag], axis=-1)


def _covariance(jacobian: Array, residual: Array) -> Array | None:
    """Inverse of J'J times the reduced chi-square; None where an unknown cannot be told from the others."""
    norm = np.linalg.norm(jacobian, axis=0)
    if not (np.all(np.isfinite(jacobian)) and np.all(norm > 0)):
        return None
    _, singular, right = np.linalg.svd(jacobian / norm, full_matrices=False)
    if singular[-1] < 1e-10 * singular[0]:
        return None
    root = right.T / singular / norm[:, None]
    return np.asarray(root @ root.T * (residual @ residual) / (residual.size - norm.size))
