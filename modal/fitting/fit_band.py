"""Poles by Levenberg-Marquardt, modal constants real unless the sum of squares asks for complex ones."""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from modal.fitting.band_fit import BandFit
from modal.fitting.fit_at_poles import Array, ComplexArray, FitAtPoles
from modal.fitting.projected_band import ProjectedBand, projected_band
from modal.fitting.residual_terms import LEAST_TERMS

AKAIKE = 2.0
"""Complex constants are taken where they lower the sum of squares by this many times what an unknown does by chance."""
MOST_TRIALS = 60
"""Evaluations of the model; a mode in its own band takes some five."""
CONVERGED = 1e-13
"""Step (share of the half-power half-width) after which there is nothing left to gain."""
FIRST_DAMPING = 1e-3
"""Damping of the first step, over the diagonal of the scaled normal matrix."""
FELT = 0.1
"""Damping after a step that led nowhere, at least; less hardly changes the step."""
KEPT, BROKEN = 0.75, 0.25
"""Share of the promised fall from which the damping falls, and below which it rises."""
NEAR_TRIALS = 2
"""Steps after which the values of much the same fit are taken as they are; with five, sensors of the same measured hits
agree no more often."""
GAINED = 1e-3
"""Fall of the sum of squares, against that by chance of one unknown, not worth a step: a thirtieth of an error."""


def fit_band(
    frequency: Array,
    receptance: ComplexArray,
    weight: Array,
    starts: Array,
    terms: int = LEAST_TERMS,
    held: NDArray[np.bool_] | None = None,
) -> BandFit | None:
    """Fit modes with complex constants (`Mode.receptance`) and L/f^2 + U + ... to FRFs; None where nothing fits.

    L (modes far below, and the free body) and U (modes far above) are complex: the tail of a damped neighbour is not
    real, and a real L or U would push its imaginary part into zeta and K, by percents. In accelerance,
    -(2 pi f)^2 H, L is a constant and U grows with f^2: the weight says what was measured. Further terms, f^2,
    f^4, ..., follow the tails of strong modes just outside the band.

    The linear unknowns are eliminated, f and zeta found by Levenberg-Marquardt. frequency (Hz) has shape (n,),
    receptance (m/N) and weight (p, n), starts (Hz; damping ratios) (2, m). held, (m,): modes that stay at their starts.

    Source: Golub & Pereyra (1973), SIAM J. Numer. Anal. 10, 413; Kaufman (1975), BIT 15, 49 (Jacobian).
    """
    p, m = receptance.shape[0], starts.shape[1]
    if 2 * m + p * (2 * m + 2 * terms) >= 2 * receptance.size or m == 0:
        return None
    with np.errstate(all="ignore"), contextlib.suppress(np.linalg.LinAlgError):
        fixed = np.zeros(m, bool) if held is None else held
        state = _solved(projected_band(frequency, receptance, weight, terms, fixed), starts, is_complex=True)
        return None if state is None or not np.all(np.isfinite(state.covariance)) else _fit_of(state, state)
    return None


def with_real_constants(fit: BandFit, frequency: Array, receptance: ComplexArray, weight: Array, terms: int) -> BandFit:
    """The same modes with real constants, where Akaike's criterion allows.

    It does where they raise the sum of squares by no more than twice what phases take off by chance. The errors stay
    those of the complex fit, for a phase that is not asked for is not known to be 0. Else the fit as it is. Arguments
    as `fit_band`.

    Source: Akaike (1974), IEEE Trans. Automatic Control 19, 716.
    """
    allowed = AKAIKE * fit.constant.size * fit.sum_of_squares / fit.freedom
    with np.errstate(all="ignore"), contextlib.suppress(np.linalg.LinAlgError):
        band = projected_band(frequency, receptance, weight, terms, fit.held)
        state = _solved(band, _poles_of_real(fit), is_complex=False)
        if state is not None and state.cost - fit.sum_of_squares <= allowed:
            across = fit.constant / state.constant
            return replace(_fit_of(state, fit.with_phases), unasked=np.angle(across * np.sign(across.real)))
    return fit


def values_nearby(
    fit: BandFit, frequency: Array, receptance: ComplexArray, weight: Array, terms: int
) -> tuple[Array, ComplexArray] | None:
    """Poles (2, m) and modal constants (p, m) of the same modes with other residual terms or on other lines, nearly.

    After a few steps, with real constants where those of the fit are; None where nothing fits. Arguments as `fit_band`.
    """
    p, m = fit.constant.shape
    if 2 * m + p * (2 * m + 2 * terms) >= 2 * receptance.size:
        return None
    with np.errstate(all="ignore"), contextlib.suppress(np.linalg.LinAlgError):
        band = projected_band(frequency, receptance, weight, terms, fit.held)
        state, _ = _descended(band, fit.poles, bool(np.any(fit.constant.imag)), NEAR_TRIALS)
        return (state.poles, state.constant) if np.isfinite(state.cost) else None
    return None


def _poles_of_real(fit: BandFit) -> Array:
    """Poles (2, m) that real constants would have, to first order in the phases taken off."""
    m, covariance = fit.frequency.size, fit.covariance
    across = slice(2 * m + fit.constant.size, None)
    off = fit.constant.imag * np.sign(fit.constant.real)
    change = covariance[: 2 * m, across] @ np.linalg.solve(covariance[across, across], off.ravel())
    moved = fit.poles - change.reshape(2, m)
    return moved if np.all(moved > 0) and np.all(moved[1] < 1) else fit.poles


def _fit_of(state: FitAtPoles, with_phases: FitAtPoles) -> BandFit:
    return BandFit(
        state.poles[0],
        state.poles[1],
        state.constant,
        state.freedom,
        with_phases,
        state.residual,
        np.zeros(state.constant.shape),
        np.array(~state.free[: state.poles.shape[1]]),
    )


def _solved(band: ProjectedBand, starts: Array, is_complex: bool) -> FitAtPoles | None:
    """Levenberg-Marquardt; None where it does not converge."""
    state, has_converged = _descended(band, starts, is_complex, MOST_TRIALS)
    return state if has_converged else None


def _descended(band: ProjectedBand, starts: Array, is_complex: bool, trials: int) -> tuple[FitAtPoles, bool]:
    """Where so many evaluations lead, and whether there is nothing left to gain there."""
    state, damping = band.at(starts, is_complex), FIRST_DAMPING
    for _ in range(trials):
        if not np.isfinite(state.cost):
            break
        step, gain, promise = _step(state, damping)
        size = float(np.abs(step).max(initial=0.0))
        if gain < GAINED * state.cost / state.freedom or size < CONVERGED:
            return state, True
        trial = band.at(state.poles + state.spread(step * state.scale).reshape(2, -1), is_complex)
        if trial.cost < state.cost:
            kept = (state.cost - trial.cost) / promise
            state, damping = trial, damping * (0.1 if kept > KEPT else 1.0 if kept > BROKEN else 4.0)
        elif damping > 1e8 or size < 1e-6:
            return state, True
        else:
            damping = max(10 * damping, FELT)
    return state, False


def _step(state: FitAtPoles, damping: float) -> tuple[Array, float, float]:
    """Damped Gauss-Newton step in units of the scale, shape (k,), the squared change of the model that it makes to
    first order, and the fall of the cost that it promises."""
    gram, gradient = state.gram, state.gradient
    norm = np.sqrt(gram.diagonal())
    scaled = gram / (norm[:, np.newaxis] * norm)
    scaled.flat[:: norm.size + 1] += damping
    step = np.linalg.solve(scaled, -gradient / norm) / norm
    gain = float(step @ gram @ step)
    return step, gain, float(-2 * step @ gradient) - gain
