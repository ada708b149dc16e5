"""Fit poles by Levenberg-Marquardt with the linear unknowns eliminated.

Source: Golub & Pereyra (1973), SIAM J. Numer. Anal. 10, 413; Kaufman (1975), BIT 15, 49 (Jacobian).
"""

import contextlib
from dataclasses import dataclass, replace

import numpy as np
import scipy

from modal.arrays import Complexes, Flags, Floats
from modal.fitting.band_fit import BandFit, FixedPoleFit, residual_powers, split_complex

MIN_CURVE_SEPARATION = 1e-2
"""Least independent part of each curve for which normal equations lose no more than four digits."""


@dataclass(frozen=True, eq=False)
class ProjectedBand:
    """Weighted FRFs of a band without residual terms.

    FRFs with the same weights share one set of rows: s is then 1, otherwise p.
    """

    root: Complexes
    """Values i f, (n,)."""
    weight: Floats
    """Weights of real, then of imaginary parts, (s, 1, 2 n)."""
    bases: Floats
    """Orthonormal bases of the residual terms of each FRF, the same for real and imaginary parts, (s, n, terms)."""
    data: Floats
    """Weighted FRFs without residual terms, (p, 1, 2 n)."""
    free: Flags
    """True for each frequency and damping ratio that is free, (2 m,)."""

    def at(self, poles: Floats, is_complex: bool) -> FixedPoleFit:
        """Fit the modal constants at these poles, (2, m)."""
        m = poles.shape[1]
        rows = _project_out(self.bases, self.weight * _model_rows(self.root, poles))
        q, inverse = _orthonormal(rows[:, : 2 * m if is_complex else m])
        part = self.data @ q
        left = self.data - part @ q.mT
        linear = part @ inverse.mT
        unknowns = linear.size + 2 * len(linear) * self.bases.shape[2]
        return FixedPoleFit(poles, self.free, q, inverse, linear[:, 0], left[:, 0], unknowns, rows[:, 2 * m :])


def project_band(frequency: Floats, receptance: Complexes, weight: Floats, terms: int, held: Flags) -> ProjectedBand:
    """Remove the residual terms from the weighted FRFs of a band.

    frequency (Hz) has shape (n,), receptance (m/N) and weight (p, n), held (m,).
    """
    shared = weight[:1] if np.all(weight == weight[0]) else weight
    bases = _term_bases(frequency, shared, terms)
    values = _project_out(bases, split_complex(weight * receptance)[:, np.newaxis])
    root = np.asarray(1j * frequency)
    return ProjectedBand(root, np.tile(shared, 2)[:, np.newaxis], bases, values, np.tile(~held, 2))


def residual_term_gain(fit: BandFit, frequency: Floats, weight: Floats, terms: int) -> float:
    """Return the first-order drop of the sum of squares by one more residual term in each FRF."""
    power = residual_powers(frequency, terms + 1)[-1]
    return _linear_gain(fit, frequency, weight, terms, np.stack([power, 1j * power]))


def mode_pair_gain(fit: BandFit, frequency: Floats, weight: Floats, terms: int, i: int) -> float:
    """Return the first-order drop of the sum of squares by two close modes in place of mode i.

    Two poles at lambda - d and lambda + d add the second derivative of R / (i w - lambda) by lambda, which goes with
    its third power. The pole of the single mode follows what is odd in d.
    """
    fn, zeta = fit.poles[:, i]
    pole, r = complex(-zeta, np.sqrt(1 - zeta**2)), 1j * frequency / fn
    here, conjugate = 1 / (r - pole) ** 3, 1 / (r - pole.conjugate()) ** 3
    return _linear_gain(fit, frequency, weight, terms, np.stack([here + conjugate, 1j * (here - conjugate)]))


def _linear_gain(fit: BandFit, frequency: Floats, weight: Floats, terms: int, columns: Complexes) -> float:
    rows = np.tile(weight, 2)[:, np.newaxis] * split_complex(columns)
    return fit.complex_fit.gain(_project_out(_term_bases(frequency, weight, terms), rows))


def _term_bases(frequency: Floats, weight: Floats, terms: int) -> Floats:
    columns = weight[:, np.newaxis] * residual_powers(frequency, terms)
    return np.asarray(np.linalg.qr(columns.mT)[0])


def _orthonormal(rows: Floats) -> tuple[Floats, Floats]:
    """Return orthonormal columns, (s, 2 n, c), that span rows (s, c, 2 n), and the inverse triangle, (s, c, c).

    By Cholesky, in half the time, if no row is nearly a sum of the others, which makes it as exact.
    """
    gram = rows @ rows.mT
    lapack = scipy.linalg.lapack  # numpy takes as long for its checks as for a small matrix
    lower, failed = zip(*(lapack.dpotrf(each, lower=1) for each in gram), strict=True)
    lowest = np.array([each.diagonal() for each in lower]) ** 2 / gram.diagonal(axis1=1, axis2=2)
    if not any(failed) and lowest.min() > MIN_CURVE_SEPARATION**2:
        inverse = np.array([lapack.dtrtri(each, lower=1)[0].T for each in lower])
        return rows.mT @ inverse, inverse
    q, triangle = np.linalg.qr(rows.mT)
    return q, np.linalg.inv(triangle)


def _model_rows(root: Complexes, poles: Floats) -> Floats:
    """Return modes of constants 1 and i, and their slopes by both parts of the pole, (4 m, 2 n); root is i f, (n,).

    With lambda in Hz, h = g / (i f - lambda), g = f_n / (2 sqrt(1 - zeta^2)), and h' for its conjugate: -i (h - h'),
    h + h', h^2 + h'^2 and i (h^2 - h'^2).
    """
    fn, zeta = poles[:, :, np.newaxis]
    turning = np.sqrt(1 - zeta**2)
    pole, size = fn * (1j * turning - zeta), fn / (2 * turning)
    here, there = size / (root - pole), size / (root - pole.conj())
    square, of_there = here * here, there * there
    rows = [1j * (there - here), here + there, square + of_there, 1j * (square - of_there)]
    return split_complex(np.concatenate(rows))


def _project_out(bases: Floats, values: Floats) -> Floats:
    """Subtract from values (p, k, 2 n) their part in orthonormal bases (s, n, terms) of real and imaginary parts."""
    parts = values.reshape(len(bases), -1, bases.shape[1])
    taken = parts @ bases @ bases.mT
    return np.subtract(parts, taken, out=taken).reshape(values.shape)


AKAIKE_PENALTY = 2.0
"""Factor on the chance gain of an unknown that complex constants must exceed (Akaike)."""
MAX_FIT_EVALUATIONS = 60
"""Most evaluations of the model; a single mode takes about five."""
FIT_STEP_TOLERANCE = 1e-13
"""Step at convergence (half-power half-widths)."""
INITIAL_FIT_DAMPING = 1e-3
"""Damping of the first step, over the diagonal of the scaled normal matrix."""
MIN_EFFECTIVE_FIT_DAMPING = 0.1
"""Least damping after a failed step; less hardly changes the step."""
GOOD_GAIN_RATIO, POOR_GAIN_RATIO = 0.75, 0.25
"""Share of the predicted cost drop above which the damping decreases, and below which it increases."""
NEARBY_FIT_STEPS = 2
"""Steps of a trial fit near the solution.

With five steps, sensors of the same measured hits agree no more often.
"""
MAX_DROP_RATIO = 10.0
"""Largest drop of the cost by all further steps over that predicted for the next one, hardly damped; chosen."""
MIN_WORTHWHILE_GAIN = 1e-3
"""Least cost drop of a step over that by chance of one unknown: a thirtieth of an error."""


def fit_band(
    frequency: Floats, receptance: Complexes, weight: Floats, starts: Floats, terms: int, held: Flags | None = None
) -> BandFit | None:
    """Fit modes with complex constants (`Mode.receptance`) and L/f^2 + U + ... to FRFs; None if nothing fits.

    L (modes far below, and the free body) and U (modes far above) are complex: the tail of a damped neighbour is not
    real, and a real L or U would push its imaginary part into zeta and K, by percents. In accelerance,
    -(2 pi f)^2 H, L is a constant and U grows with f^2: the weight knows what was measured. Further terms, f^2,
    f^4, ..., follow the tails of strong modes just outside the band.

    The linear unknowns are eliminated, f and zeta found by Levenberg-Marquardt. frequency (Hz) has shape (n,),
    receptance (m/N) and weight (p, n), starts (Hz; damping ratios) (2, m). held, (m,): modes fixed at their starts.

    Source: Golub & Pereyra (1973), SIAM J. Numer. Anal. 10, 413; Kaufman (1975), BIT 15, 49 (Jacobian).
    """
    p, m = receptance.shape[0], starts.shape[1]
    if 2 * m + p * (2 * m + 2 * terms) >= 2 * receptance.size or m == 0:
        return None
    with np.errstate(all="ignore"), contextlib.suppress(np.linalg.LinAlgError):
        fixed = np.zeros(m, bool) if held is None else held
        band = project_band(frequency, receptance, weight, terms, fixed)
        state, has_converged = _descend(band, starts, is_complex=True, trials=MAX_FIT_EVALUATIONS)
        if has_converged and np.all(np.isfinite(state.covariance)):
            return _band_fit(state, state)
    return None


def fit_real_constants(fit: BandFit, frequency: Floats, receptance: Complexes, weight: Floats, terms: int) -> BandFit:
    """Fit the same modes with real constants, if Akaike's criterion allows.

    It does if they raise the sum of squares by no more than twice what phases take off by chance. The errors stay
    those of the complex fit, because an unfitted phase need not be 0. Otherwise the fit is unchanged. Arguments
    as `fit_band`.

    Source: Akaike (1974), IEEE Trans. Automatic Control 19, 716.
    """
    allowed = AKAIKE_PENALTY * fit.constant.size * fit.sum_of_squares / fit.degrees_of_freedom
    with np.errstate(all="ignore"), contextlib.suppress(np.linalg.LinAlgError):
        band = project_band(frequency, receptance, weight, terms, fit.held)
        starts = _poles_for_real_constants(fit)
        most = fit.sum_of_squares + allowed
        state, has_converged = _descend(band, starts, is_complex=False, trials=MAX_FIT_EVALUATIONS, most=most)
        if has_converged and state.cost <= most:
            across = fit.constant / state.constant
            return replace(_band_fit(state, fit.complex_fit), phase_if_complex=np.angle(across * np.sign(across.real)))
    return fit


def refit_nearby(
    fit: BandFit, frequency: Floats, receptance: Complexes, weight: Floats, terms: int
) -> tuple[Floats, Complexes] | None:
    """Refit the same modes approximately with other residual terms or on other lines.

    Returns poles (2, m) and modal constants (p, m) after a few steps, with real constants if those of the fit are; None
    if nothing fits. Arguments as `fit_band`.
    """
    p, m = fit.constant.shape
    if 2 * m + p * (2 * m + 2 * terms) >= 2 * receptance.size:
        return None
    with np.errstate(all="ignore"), contextlib.suppress(np.linalg.LinAlgError):
        band = project_band(frequency, receptance, weight, terms, fit.held)
        state, _ = _descend(band, fit.poles, bool(np.any(fit.constant.imag)), NEARBY_FIT_STEPS)
        return (state.poles, state.constant) if np.isfinite(state.cost) else None
    return None


def _poles_for_real_constants(fit: BandFit) -> Floats:
    """Return the poles (2, m) of real constants, to first order in the removed phases."""
    m, covariance = fit.frequency.size, fit.covariance
    across = slice(2 * m + fit.constant.size, None)
    off = fit.constant.imag * np.sign(fit.constant.real)
    change = covariance[: 2 * m, across] @ np.linalg.solve(covariance[across, across], off.ravel())
    moved = fit.poles - change.reshape(2, m)
    return moved if np.all(moved > 0) and np.all(moved[1] < 1) else fit.poles


def _band_fit(state: FixedPoleFit, with_phases: FixedPoleFit) -> BandFit:
    real, held = np.zeros(state.constant.shape), np.array(~state.free[: state.poles.shape[1]])
    (f, zeta), freedom = state.poles, state.degrees_of_freedom
    return BandFit(f, zeta, state.constant, freedom, with_phases, state.residual, real, held)


def _descend(
    band: ProjectedBand, starts: Floats, is_complex: bool, trials: int, most: float = np.inf
) -> tuple[FixedPoleFit, bool]:
    """Run a number of evaluations and return the state and whether it has converged.

    A descent that will not reach a cost of at most `most` ends.
    """
    state, damping = band.at(starts, is_complex), INITIAL_FIT_DAMPING
    for _ in range(trials):
        if not np.isfinite(state.cost):
            break
        step, gain, promise = _damped_step(state, damping)
        size = float(np.abs(step).max(initial=0.0))
        if gain < MIN_WORTHWHILE_GAIN * state.cost / state.degrees_of_freedom or size < FIT_STEP_TOLERANCE:
            return state, True
        if damping <= MIN_EFFECTIVE_FIT_DAMPING and state.cost - MAX_DROP_RATIO * promise > most:
            break
        trial = band.at(state.poles + state.spread(step * state.scale).reshape(2, -1), is_complex)
        if trial.cost < state.cost:
            kept = (state.cost - trial.cost) / promise
            state = trial
            damping *= 0.1 if kept > GOOD_GAIN_RATIO else 1.0 if kept > POOR_GAIN_RATIO else 4.0
        elif damping > 1e8 or size < 1e-6:
            return state, True
        else:
            damping = max(10 * damping, MIN_EFFECTIVE_FIT_DAMPING)
    return state, False


def _damped_step(state: FixedPoleFit, damping: float) -> tuple[Floats, float, float]:
    """Return the damped Gauss-Newton step (k,), its squared model change (first order), and the predicted cost drop."""
    gram, gradient = state.gram, state.gradient
    if not gradient.size:
        return gradient, 0.0, 0.0
    norm = np.sqrt(gram.diagonal())
    scaled = gram / (norm[:, np.newaxis] * norm)
    scaled.flat[:: norm.size + 1] += damping
    _, _, solution, failed = scipy.linalg.lapack.dgesv(scaled, -gradient / norm)
    if failed:
        raise np.linalg.LinAlgError("the unknowns of the mode fit are linearly dependent")
    step = solution / norm
    gain = float(step @ gram @ step)
    return step, gain, float(-2 * step @ gradient) - gain
