"""Least squares of a few neighbouring modes at once, in one FRF or in several with the same poles."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

RESIDUAL_POWERS = (-2, 0, 2, 4, 6, 8)
"""Of the frequency, in the order in which residual terms are taken."""
MOST_TRIALS = 60
"""Evaluations of the model; a mode in its own band takes some ten."""
CONVERGED = 1e-13
"""Step (share of the half-power half-width) after which there is nothing left to gain."""
GAINED = 1e-10
"""Relative fall of the sum of squares that is not worth another step: a thousandth of a standard error."""
LEAST_SINGULAR = 1e-10
"""Share of the largest singular value below which an unknown cannot be told from the others."""


@dataclass(frozen=True, eq=False)
class BandFit:
    """Values of m modes that were fitted together in p FRFs."""

    frequency: Array
    """Natural frequencies (Hz), shape (m,)."""
    damping_ratio: Array
    """Damping ratios (-), shape (m,)."""
    flexibility: Array
    """1/K, signed (m/N), shape (p, m)."""
    covariance: Array
    """Of all frequencies, all damping ratios, then all flexibilities FRF by FRF, shape (2 m + p m, 2 m + p m)."""
    freedom: int
    """Real values that were fitted less unknowns."""
    influence: Array
    """Change of those values by a change of the weighted FRFs, one Gauss-Newton step, shape (2 m + p m, 2 n p)."""
    residual: Array
    """Of the weighted FRFs, each its real and then its imaginary part, shape (2 n p,)."""

    @property
    def standard_error(self) -> Array:
        """Standard errors of frequencies, damping ratios, then flexibilities FRF by FRF, shape (2 + p, m)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)).reshape(-1, self.frequency.size))

    @property
    def complex_residual(self) -> ComplexArray:
        """The residual line by line, shape (p, n)."""
        parts = self.residual.reshape(len(self.flexibility), 2, -1)
        return np.asarray(parts[:, 0] + 1j * parts[:, 1])

    @property
    def mobility_peak(self) -> Array:
        """|mobility| of each mode alone at its natural frequency, largest of all FRFs (m/s/N), shape (m,)."""
        return np.asarray(np.pi * self.frequency * np.abs(self.flexibility / self.damping_ratio).max(axis=0))

    @property
    def sum_of_squares(self) -> float:
        """Of the weighted residuals."""
        return float(self.residual @ self.residual)

    def influence_of(self, i: int) -> Array:
        """The part of the influence that belongs to FRF i, shape (2 m + p m, 2 n)."""
        return np.hsplit(self.influence, len(self.flexibility))[i]

    def receptance(self, frequency: Array) -> ComplexArray:
        """Sum of these modes alone (m/N) at these frequencies (Hz), shape (p, n)."""
        return np.asarray(self.flexibility @ mode_curves(frequency, self.frequency, self.damping_ratio))


def fit_band(
    frequency: Array, receptance: ComplexArray, weight: Array, starts: Array, terms: int = 4
) -> BandFit | None:
    """Fit H = sum of a_k / (1 - r_k^2 + 2i zeta_k r_k) + L/f^2 + U + ..., r_k = f/f_k; None where nothing fits.

    a_k = 1/K_k is real. L (modes far below, and the free body) and U (modes far above) are complex: the tail of a
    damped neighbour is not real, and a real L or U would push its imaginary part into zeta and K, by percents.
    In accelerance, -(2 pi f)^2 H, L is a constant and U grows with f^2: the weight says what was measured. Further
    terms, f^2, f^4, ..., follow the tails of strong modes just outside the band.
    The linear unknowns are eliminated (variable projection), f_k and zeta_k found by Levenberg-Marquardt.
    frequency (Hz) has shape (n,), receptance (m/N) and weight (p, n), starts (Hz; damping ratios) (2, m).

    Source: Golub & Pereyra (1973), SIAM J. Numer. Anal. 10, 413; Kaufman (1975), BIT 15, 49 (Jacobian).
    """
    p, m = receptance.shape[0], starts.shape[1]
    if 2 * m + p * (m + 2 * terms) >= 2 * receptance.size or m == 0:
        return None
    problem = _problem(frequency, receptance, weight, terms)
    with np.errstate(all="ignore"):
        try:
            return _result(_solve(problem, starts), terms)
        except np.linalg.LinAlgError:
            return None


def mode_curves(frequency: Array, natural_frequency: Array, damping_ratio: Array) -> ComplexArray:
    """1/(1 - r^2 + 2i zeta r) of m modes (rows) at n frequencies, shape (m, n)."""
    r = frequency / natural_frequency[:, None]
    return np.asarray(1 / (1 - r**2 + 2j * damping_ratio[:, None] * r))


def residual_terms(frequency: Array, terms: int) -> Array:
    """The first powers of the frequency that stand for what lies outside the band, shape (terms, n)."""
    return np.asarray((frequency / np.mean(frequency)) ** np.array([RESIDUAL_POWERS[:terms]], dtype=float).T)


def gain_of_a_term(fit: BandFit, frequency: Array, weight: Array, terms: int) -> float:
    """Fall of the sum of squares, to first order, that one residual term more than these in each FRF would bring."""
    powers = residual_terms(frequency, terms + 1)
    old, new = (
        _block_diagonal([_split(w * np.concatenate([part, 1j * part])).T for w in weight])
        for part in (powers[:-1], powers[-1:])
    )
    q = np.linalg.qr(np.hstack([old, fit.influence.T, new]))[0]
    part = q[:, -new.shape[1] :].T @ fit.residual
    return float(part @ part)


@dataclass(frozen=True, eq=False)
class _Projected:
    """One FRF at given poles with its linear unknowns eliminated, the residual terms first."""

    q: Array
    """Orthonormal basis of what the residual terms leave of the modes, (2 n, m)."""
    inverse: Array
    """Inverse of its triangle, (m, m)."""
    linear: Array
    """Best flexibilities, (m,)."""
    residual: Array
    """Weighted data that is left, (2 n,)."""
    slope: Array
    """By frequencies (in shares of zeta f) and damping ratios (in shares of zeta) of the model, (2 n, 2 m)."""

    @property
    def jacobian(self) -> Array:
        """Slope of the residual with the linear unknowns following (Kaufman), (2 n, 2 m)."""
        return np.asarray(self.q @ (self.q.T @ self.slope) - self.slope)


@dataclass(frozen=True, eq=False)
class _State:
    poles: Array
    """(2, m)."""
    frfs: list[_Projected]

    @cached_property
    def cost(self) -> float:
        cost = float(sum(frf.residual @ frf.residual for frf in self.frfs))
        return cost if np.all(np.isfinite(self.poles)) and np.all(self.poles > 0) and np.isfinite(cost) else np.inf

    @property
    def scale(self) -> Array:
        """What a step of one means: zeta f and zeta, (2 m,)."""
        return np.concatenate([self.poles[0] * self.poles[1], self.poles[1]])

    @property
    def jacobian(self) -> Array:
        return np.concatenate([frf.jacobian for frf in self.frfs])

    @property
    def residual(self) -> Array:
        return np.concatenate([frf.residual for frf in self.frfs])


@dataclass(frozen=True, eq=False)
class _Problem:
    frequency: Array
    weight: Array
    """(p, n)."""
    bases: list[Array]
    """Orthonormal basis of the residual terms of each FRF, (2 n, 2 terms)."""
    data: list[Array]
    """What they leave of each weighted FRF, (2 n,)."""

    def at(self, poles: Array) -> _State:
        return _State(poles, list(self._projected(poles)))

    def _projected(self, poles: Array) -> Iterator[_Projected]:
        fn, zeta = poles
        curves = mode_curves(self.frequency, fn, zeta)
        r = self.frequency / fn[:, None]
        slopes = np.concatenate([(2j * zeta[:, None] * r - 2 * r**2) * zeta[:, None], -2j * r * zeta[:, None]])
        for data, weight, base in zip(self.data, self.weight, self.bases, strict=True):
            q, triangle = np.linalg.qr(_without(base, _split(weight * curves).T))
            part = q.T @ data
            inverse = np.linalg.inv(triangle)
            linear = inverse @ part
            slope = _split(weight * np.tile(linear, 2)[:, None] * slopes * np.tile(curves**2, (2, 1))).T
            yield _Projected(q, inverse, linear, data - q @ part, _without(base, slope))


def _problem(frequency: Array, receptance: ComplexArray, weight: Array, terms: int) -> _Problem:
    powers = residual_terms(frequency, terms)
    columns = np.concatenate([powers, 1j * powers])
    bases = [np.linalg.qr(_split(w * columns).T)[0] for w in weight]
    data = [_without(base, values) for base, values in zip(bases, _split(weight * receptance), strict=True)]
    return _Problem(frequency, weight, bases, data)


def _without(base: Array, values: Array) -> Array:
    """Values less their part in an orthonormal basis."""
    return np.asarray(values - base @ (base.T @ values))


def _split(values: ComplexArray) -> Array:
    """Real, then imaginary parts along the last axis."""
    return np.concatenate([values.real, values.imag], axis=-1)


def _block_diagonal(blocks: Sequence[Array]) -> Array:
    """Blocks of one shape, each a FRF's, on the diagonal of a matrix that is 0 elsewhere."""
    p, (rows, columns) = len(blocks), blocks[0].shape
    made = np.zeros((p, rows, p, columns))
    made[np.arange(p), :, np.arange(p)] = blocks
    return made.reshape(p * rows, p * columns)


def _solve(problem: _Problem, starts: Array) -> _State | None:
    """Levenberg-Marquardt; None where it does not converge."""
    state, damping = problem.at(starts), 1e-4
    for _ in range(MOST_TRIALS):
        if not np.isfinite(state.cost):
            return None
        step, gain = _step(state, damping)
        if gain < GAINED * state.cost or np.max(np.abs(step)) < CONVERGED:
            return state
        trial = problem.at(state.poles + (step * state.scale).reshape(2, -1))
        if trial.cost < state.cost:
            state, damping = trial, damping / 10
        elif damping > 1e8 or np.max(np.abs(step)) < 1e-6:
            return state
        else:
            damping = max(damping, 1e-6) * 10
    return None


def _step(state: _State, damping: float) -> tuple[Array, float]:
    """Damped Gauss-Newton step in units of the scale, shape (2 m,), and the fall of the cost that it promises."""
    jacobian = state.jacobian
    norm = np.linalg.norm(jacobian, axis=0)
    gram = (jacobian.T @ jacobian) / np.outer(norm, norm) + damping * np.eye(norm.size)
    step = np.linalg.solve(gram, -(jacobian.T @ state.residual) / norm) / norm
    change = jacobian @ step
    return step, float(change @ change)


def _result(state: _State | None, terms: int) -> BandFit | None:
    if state is None:
        return None
    m = state.poles.shape[1]
    jacobian = state.jacobian
    norm = np.linalg.norm(jacobian, axis=0)
    left, singular, right = np.linalg.svd(jacobian / norm, full_matrices=False)
    if not singular[-1] > LEAST_SINGULAR * singular[0]:
        return None
    influence = _influence(state, -(right.T / singular) @ left.T / norm[:, None])
    freedom = jacobian.shape[0] - 2 * m - (m + 2 * terms) * len(state.frfs)
    return BandFit(
        state.poles[0],
        state.poles[1],
        np.array([frf.linear for frf in state.frfs]),
        influence @ influence.T * (state.cost / freedom),
        freedom,
        influence,
        state.residual,
    )


def _influence(state: _State, on_poles: Array) -> Array:
    """On poles in Hz and damping ratio, then on the flexibilities; on_poles: on scaled poles, shape (2 m, 2 n p)."""
    own = _block_diagonal([frf.inverse @ frf.q.T for frf in state.frfs])
    by_poles = np.concatenate([frf.inverse @ (frf.q.T @ frf.slope) for frf in state.frfs])
    return np.concatenate([on_poles * state.scale[:, None], own - by_poles @ on_poles])
