"""Whether the measured modes tell the stiffness of each group: the profile likelihood beside the standard error."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from dsm.calibration.least_squares import Problem, State, minimize
from dsm.calibration.remark import Remark

_Float = NDArray[np.float64]

CONFIDENCE = 0.95
"""Of the intervals that are compared."""
FARTHEST = math.log(30.0)
"""An interval wider than this, in the logarithm of the factor, is none."""
STEPS = 0.2, 0.5, 1.0, 1.7, 2.5, 3.4
"""Distances beyond the interval of first order, in the logarithm of the factor, at which that is done."""
SOFT, HARD = 0.55, 1.8
"""The cost at both ends of the interval of first order, over what it should have risen by."""
TOLERANCE = 0.1
"""Other factors are found anew until a step would change no frequency by more than this part of the least error."""
NOT_WORSE = 6.0
"""A second solution counts where its sum of squares is larger by less than this."""
SHARP = 1e-6
"""Intervals and distances smaller than this, as of computed frequencies, are not looked at."""
LITTLE_SHARE = 0.1
"""Below this part of the strain energy of every measured mode, stiffness far from what was found is tried."""
LEAST_SHARE = 0.01
"""A group with less than this part of the strain energy of every measured mode is reported."""
CURE = "measure more or other modes, or leave the group out"


def identifiability(problem: Problem, best: State, log_covariance: _Float | None) -> list[Remark]:
    """Remarks on groups whose factor the frequencies leave open.

    For each group the least sum of squares over all other factors, S(v), belongs to the logarithm v of its own. The
    interval of first order holds where S - S_min reaches Student's t^2 (times the variance of the residuals where no
    standard errors were given) at its ends, and stays above beyond them (D. J. Venzon and S. H. Moolgavkar, A method
    for computing profile-likelihood-based confidence intervals, Appl. Statist. 37, 1988). Beyond them S is followed,
    through the given stiffness (v = 0), half-way to it and up to a factor of 30, where the group has little energy in
    all measured modes at what was found, at what was given, or half-way. A second solution, such as that of a nearly
    symmetric shaft, is looked for along the direction that is known least. Without a covariance there is nothing to
    compare with, and the energy shares decide alone.
    """
    felt = _felt(problem, best)
    found = []
    for index, name in enumerate(problem.names):
        share = float(np.max(best.share[:, index]))
        if share < LEAST_SHARE:
            text = f"at most {100 * share:.2g} % of the strain energy of the measured modes is in it"
            found.append(Remark("group-not-felt", name, text, CURE))
        elif log_covariance is not None:
            text = _open(problem, best, log_covariance, index, felt[index] < LITTLE_SHARE)
            found += [Remark("stiffness-ambiguous", name, text, CURE)] if text else []
    return found or _second_solution(problem, best, log_covariance)


def _second_solution(problem: Problem, best: State, log_covariance: _Float | None) -> list[Remark]:
    """Other factors that fit as well, far outside the intervals of those that were found."""
    if log_covariance is None or best.log_factor.size == 1:
        return []
    width, vectors = np.linalg.eigh(log_covariance)
    direction = vectors[:, -1] / np.max(np.abs(vectors[:, -1]))
    variance = best.cost / problem.spare if problem.measured.std is None else 1.0
    for step in (-1.2, -0.5, 0.5, 1.2):
        try:
            other, _ = minimize(problem, best.log_factor + step * direction, (), _tolerance(problem, best))
        except ArithmeticError:
            continue
        away = np.abs(other.log_factor - best.log_factor)
        if other.cost - best.cost < NOT_WORSE * variance and np.max(away) > max(4 * math.sqrt(width[-1]), SHARP):
            factors = ", ".join(f"{math.exp(value):.3g}" for value in other.log_factor)
            text = f"another solution fits as well: factors {factors}"
            return [Remark("stiffness-ambiguous", ", ".join(problem.names), text, CURE)]
    return []


def _felt(problem: Problem, best: State) -> _Float:
    """Least share, of what was found, what was given and half-way, of each group in the mode that has most of it."""
    states = [best]
    for share in (0.0, 0.5):
        with suppress(ArithmeticError):
            states.append(problem.evaluate(share * best.log_factor))
    return np.asarray(np.min([np.max(state.share, axis=0) for state in states], axis=0))


def _open(problem: Problem, best: State, log_covariance: _Float, index: int, far: bool) -> str:
    """What is wrong with the interval of one factor, in words; empty where nothing is."""
    variance, rise = 1.0, float(stdtrit(math.inf, (1 + CONFIDENCE) / 2)) ** 2
    if problem.measured.std is None:
        variance = best.cost / problem.spare
        rise = float(stdtrit(problem.spare, (1 + CONFIDENCE) / 2)) ** 2
    unknown = np.flatnonzero(np.diag(log_covariance) >= FARTHEST**2).tolist()
    half, limit = math.sqrt(rise * float(log_covariance[index, index])), variance * rise
    if not half < FARTHEST:
        return f"its standard error is a factor of {math.exp(min(half, 50.0)):.3g} either way"
    if half < SHARP:
        return ""
    along = np.clip(half * log_covariance[:, index] / log_covariance[index, index], -FARTHEST, FARTHEST)
    try:
        sides = (_one_side(problem, best, index, unknown, way, limit, far) for way in (-along, along))
        return next(filter(None, sides), "")
    except ArithmeticError:
        return "its interval reaches where the model cannot be solved"


def _one_side(
    problem: Problem, best: State, index: int, unknown: list[int], along: _Float, limit: float, far: bool
) -> str:
    """The same for one side of the interval, which ends `along` from the factors found; unknown: groups that stay."""
    end = problem.evaluate(best.log_factor + along)
    if not SOFT < (end.cost - best.cost) / limit < HARD:
        end, _ = minimize(problem, end.log_factor, [index, *unknown], _tolerance(problem, best))
    ratio = (end.cost - best.cost) / limit
    if not SOFT < ratio < HARD:
        said = "better" if ratio <= SOFT else "worse"
        return f"at {math.exp(along[index]):.4g} times what was found the fit is {said} than its standard error says"
    side = 1 if along[index] > 0 else -1
    for place, cost in _beyond(problem, best, end, index, unknown, side) if far else ():
        if cost - best.cost < limit:
            return (
                f"the frequencies fit {math.exp(math.copysign(place, along[index])):.3g} times what was found as well"
            )
    return ""


def _tolerance(problem: Problem, best: State) -> float:
    error = math.sqrt(best.cost / problem.spare) if problem.measured.std is None else 1.0
    return TOLERANCE * error * float(np.min(problem.measured.scale / problem.measured.frequency))


def _beyond(
    problem: Problem, best: State, end: State, index: int, unknown: list[int], side: int
) -> Iterator[tuple[float, float]]:
    """Distances from the factor found (logarithm) beyond an end of its interval, and the least cost there."""
    half = abs(float(end.log_factor[index] - best.log_factor[index]))
    to_start = -side * float(best.log_factor[index])
    places = {half + step for step in STEPS} | {share * to_start for share in (0.5, 1.0)}
    state = end
    for place in sorted(place for place in places if place > half):
        start = state.log_factor.copy()
        start[index] = best.log_factor[index] + side * place
        try:
            state, _ = minimize(problem, start, [index, *unknown], _tolerance(problem, best))
        except ArithmeticError:
            return
        yield place, state.cost
