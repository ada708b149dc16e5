"""Whether the measured modes tell the stiffness of each group: the profile likelihood beside the standard error."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri, stdtrit

from dsm.calibration.fit_remark import FitRemark
from dsm.calibration.least_squares import Iterate, Problem, minimize

_Float = NDArray[np.float64]

CONFIDENCE = 0.95
"""Of the intervals that are compared."""
FARTHEST = math.log(30.0)
"""An interval wider than this, in the logarithm of the factor, is none."""
STEPS = 0.2, 0.5, 1.0, 1.7, 2.5, 3.4
"""Distances beyond the interval of first order, in the logarithm of the factor, at which that is done."""
LEAST_HELD = 1 - 2 * (1 - CONFIDENCE)
"""What an interval must hold by the likelihood."""
NEARLY = 0.8
"""Ends at which the sum of squares rises by this part of what it should, or more, are as good as those of S(v)."""
TOLERANCE = 0.1
"""Other factors are found anew until a step would change no frequency by more than this part of the least error."""
SHARP = 1e-6
"""Intervals and distances smaller than this, as of computed frequencies, are not looked at."""
LITTLE_SHARE = 0.1
"""Below this part of the strain energy of every measured mode, stiffness far from what was found is tried."""
LEAST_SHARE = 0.01
"""A group with less than this part of the strain energy of every measured mode is reported."""
CURE = "measure more or other modes, or leave the group out"


class Allowed(NamedTuple):
    """By how much a sum of squares may exceed the least one with a factor still inside its 95 % interval."""

    variance: float
    """Variance of the scaled residuals: 1, or from their scatter where no standard errors were given."""
    rise: float
    """Student's t^2."""

    @classmethod
    def of(cls, problem: Problem, best: Iterate) -> Allowed:
        """For a fit with a covariance."""
        given = problem.measured.std is not None
        variance = 1.0 if given else best.cost / problem.spare
        return cls(variance, float(stdtrit(math.inf if given else problem.spare, (1 + CONFIDENCE) / 2)) ** 2)

    @property
    def limit(self) -> float:
        """The excess."""
        return self.variance * self.rise


def identifiability(
    problem: Problem, best: Iterate, rival: Iterate | None, log_covariance: _Float | None
) -> list[FitRemark]:
    """Remarks on groups whose factor the frequencies leave open.

    For each group the least sum of squares over all other factors, S(v), belongs to the logarithm v of its own. The
    interval of first order holds where S - S_min reaches Student's t^2 (times the variance of the residuals where no
    standard errors were given) at its ends, and stays above beyond them (D. J. Venzon and S. H. Moolgavkar, A method
    for computing profile-likelihood-based confidence intervals, Appl. Statist. 37, 1988). With the signed roots of
    S - S_min as normal deviates, the rises at its ends say how often it holds the truth: not twice as often wrong as it
    says is good enough. Beyond them S is followed, through the given stiffness (v = 0), half-way to it and up to a
    factor of 30, where the group has little energy in all measured modes at what was found, at what was given, or
    half-way. rival: another solution that fits as well (see rival_solution). Without a covariance there is nothing to
    compare with, and the energy shares decide alone.
    """
    felt = _felt(problem, best)
    remarks = []
    for index, name in enumerate(problem.names):
        share = float(np.max(best.share[:, index]))
        if share < LEAST_SHARE:
            text = f"at most {100 * share:.2g} % of the strain energy of the measured modes is in it"
            remarks.append(FitRemark("group-not-felt", name, text, CURE))
        elif log_covariance is not None:
            text = _open(problem, best, log_covariance, index, felt[index] < LITTLE_SHARE)
            remarks += [FitRemark("stiffness-ambiguous", name, text, CURE)] if text else []
    if not remarks and rival is not None:
        factors = ", ".join(f"{math.exp(value):.3g}" for value in rival.log_factor)
        text = f"another solution fits as well: factors {factors}"
        remarks = [FitRemark("stiffness-ambiguous", ", ".join(problem.names), text, CURE)]
    return remarks


def rival_solution(problem: Problem, best: Iterate, log_covariance: _Float | None) -> Iterate | None:
    """The best other minimum, far outside the intervals of the factors found, whose sum of squares they do not exclude.

    Such as that of a nearly symmetric shaft; it is looked for along the direction that is known least. It may fit
    better than what was found.
    """
    if log_covariance is None or best.log_factor.size == 1:
        return None
    width, vectors = np.linalg.eigh(log_covariance)
    direction = vectors[:, -1] / np.max(np.abs(vectors[:, -1]))
    far, worst = max(4 * math.sqrt(width[-1]), SHARP), best.cost + Allowed.of(problem, best).limit
    rivals = []
    for step in (-1.2, -0.5, 0.5, 1.2):
        with suppress(ArithmeticError):
            trial, _ = minimize(problem, best.log_factor + step * direction, (), _tolerance(problem, best))
            if trial.cost < worst and np.max(np.abs(trial.log_factor - best.log_factor)) > far:
                rivals.append(trial)
    return min(rivals, key=lambda state: state.cost, default=None)


def _felt(problem: Problem, best: Iterate) -> _Float:
    """Least share, of what was found, what was given and half-way, of each group in the mode that has most of it."""
    states = [best]
    for share in (0.0, 0.5):
        with suppress(ArithmeticError):
            states.append(problem.evaluate(share * best.log_factor))
    return np.asarray(np.min([np.max(state.share, axis=0) for state in states], axis=0))


def _open(problem: Problem, best: Iterate, log_covariance: _Float, index: int, far: bool) -> str:
    """What is wrong with the interval of one factor, in words; empty where nothing is."""
    allowed = Allowed.of(problem, best)
    half = math.sqrt(allowed.rise * float(log_covariance[index, index]))
    if not half < FARTHEST:
        return f"its standard error is a factor of {math.exp(min(half, 50.0)):.3g} either way"
    if half < SHARP:
        return ""
    along = np.clip(half * log_covariance[:, index] / log_covariance[index, index], -FARTHEST, FARTHEST)
    fixed = [index, *np.flatnonzero(np.diag(log_covariance) >= FARTHEST**2).tolist()]
    try:
        ends = [problem.evaluate(best.log_factor + side * along) for side in (-1, 1)]
        if not all(NEARLY < (end.cost - best.cost) / allowed.limit < 1 / NEARLY for end in ends):
            ends = [minimize(problem, end.log_factor, fixed, _tolerance(problem, best))[0] for end in ends]
        held = _held([(end.cost - best.cost) / allowed.limit for end in ends])
        if held < LEAST_HELD:
            return f"its interval of first order, a factor of {math.exp(half):.4g} either way, holds {100 * held:.0f} %"
        return _elsewhere(problem, best, fixed, ends, allowed.limit) if far else ""
    except ArithmeticError:
        return "its interval reaches where the model cannot be solved"


def _held(rises: Sequence[float]) -> float:
    """How often an interval holds the truth at whose ends the sum of squares rises by so many times what it should."""
    outside = (1 - CONFIDENCE) / 2
    deviates = [-float(ndtri(outside)) * math.sqrt(max(rise, 0.0)) for rise in rises]
    return float(1 - ndtr(-deviates[0]) - ndtr(-deviates[1]))


def _elsewhere(problem: Problem, best: Iterate, fixed: Sequence[int], ends: Sequence[Iterate], limit: float) -> str:
    """Where beyond its ends the first fixed factor fits as well, in words; empty where it does not."""
    for side, end in zip((-1, 1), ends, strict=True):
        for place, cost in _beyond(problem, best, end, fixed, side):
            if cost - best.cost < limit:
                return f"the frequencies fit {math.exp(side * place):.3g} times what was found as well"
    return ""


def _tolerance(problem: Problem, best: Iterate) -> float:
    error = math.sqrt(best.cost / problem.spare) if problem.measured.std is None else 1.0
    return TOLERANCE * error * float(np.min(problem.measured.scale / problem.measured.frequency))


def _beyond(
    problem: Problem, best: Iterate, end: Iterate, fixed: Sequence[int], side: int
) -> Iterator[tuple[float, float]]:
    """Distances from the factor found (logarithm) beyond an end of its interval, and the least cost there."""
    index = fixed[0]
    half = abs(float(end.log_factor[index] - best.log_factor[index]))
    to_start = -side * float(best.log_factor[index])
    places = {half + step for step in STEPS} | {share * to_start for share in (0.5, 1.0)}
    state = end
    for place in sorted(place for place in places if place > half):
        start = state.log_factor.copy()
        start[index] = best.log_factor[index] + side * place
        try:
            state, _ = minimize(problem, start, fixed, _tolerance(problem, best))
        except ArithmeticError:
            return
        yield place, state.cost
