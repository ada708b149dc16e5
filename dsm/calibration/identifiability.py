"""Check by profile likelihood whether the measured modes determine the stiffness of each group."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy

from dsm.arrays import Floats
from dsm.calibration.least_squares import MAX_LOG_INTERVAL, Iterate, StiffnessProblem, minimize
from dsm.calibration.report_text import FitRemark

PROFILE_CONFIDENCE = 0.95
"""Confidence of the compared intervals."""
PROFILE_STEPS = 0.2, 0.7, 1.7, 3.4
"""Distances beyond the first-order interval at which S(v) is computed (logarithm of the factor)."""
RIVAL_START_DISTANCES = -2.4, -1.2, -0.5, 0.5, 1.2, 2.4
"""Distances of starts along the least certain direction (logarithm of a factor)."""
MIN_INTERVAL_COVERAGE = 1 - 2 * (1 - PROFILE_CONFIDENCE)
"""Least coverage of an interval by the likelihood."""
MIN_INTERVAL_RISE = 0.8
"""Least rise of the sum of squares at an end over the expected one for which the end is good enough."""
PROFILE_TOLERANCE = 0.1
"""Convergence of the other factors: change of a frequency over the least error."""
MIN_PROFILE_WIDTH = 1e-6
"""Smallest interval that is examined; computed frequencies have smaller ones."""
MIN_RIVAL_DISTANCE = 4.0
"""Least distance of another solution (standard errors of a factor)."""
LOW_ENERGY_SHARE = 0.1
"""Energy share in every measured mode below which stiffness far from the fit is tried."""
MAX_RIVALS = 8
"""Most solutions that are taken in turn, each as it fits better than the one before."""
IDENTIFIABILITY_REMEDY = "Measure more or other modes, or leave the group out of the calibration"


class AllowedExcess(NamedTuple):
    """Allowed excess of the sum of squares for a factor inside its 95 % interval."""

    variance: float
    """Variance of the scaled residuals: 1, or from their scatter without standard errors."""
    rise: float
    """Square of Student's t."""
    degrees_of_freedom: float
    """Degrees of freedom of the variance: inf if it is known."""

    @classmethod
    def of(cls, problem: StiffnessProblem, best: Iterate) -> AllowedExcess:
        """Return the excess for a fit with a covariance."""
        spare = problem.degrees_of_freedom if problem.measured.std is None else math.inf
        rise = float(scipy.special.stdtrit(spare, (1 + PROFILE_CONFIDENCE) / 2)) ** 2
        return cls(problem.variance(best), rise, spare)

    @property
    def limit(self) -> float:
        """Allowed excess."""
        return self.variance * self.rise

    def log_density(self, excess: float) -> float:
        """Return the logarithm of the likelihood of an excess, over that of none: normal, or Student's."""
        square = excess / self.variance
        dof = self.degrees_of_freedom
        return -square / 2 if math.isinf(dof) else -(dof + 1) / 2 * math.log1p(square / dof)


Profile = list[list[Iterate]]
"""Least sum of squares over all other factors, S(v), along the logarithm v of one factor, below and above the fit.

Each side begins with the end of the first-order interval, the best fit without an interval; the states further away
follow if they are computed.
"""


class ProfileScan(NamedTuple):
    """Profiles and other minima around a fit over the whole range of factors."""

    log_covariance: Floats
    """Covariance of the logarithms of the factors, shape (g, g)."""
    profiles: tuple[Profile | None, ...]
    """Profile of each factor; None if its interval is too small, or the model cannot be solved there."""
    rivals: tuple[Iterate, ...]
    """Other minima, the lowest first; they may be lower than the fit."""


def scan_rivals(problem: StiffnessProblem, state: Iterate) -> tuple[Iterate, ProfileScan | None]:
    """Return the solution, or another that fits better by more than 95 % intervals allow, with its profile scan."""
    for _ in range(MAX_RIVALS):
        covariance = problem.covariance(state)
        if covariance is None:
            return state, None
        around = _scan_profiles(problem, state, covariance)
        if not around.rivals or around.rivals[0].cost + AllowedExcess.of(problem, around.rivals[0]).limit > state.cost:
            break
        state = around.rivals[0]
    return state, around


def _scan_profiles(problem: StiffnessProblem, best: Iterate, log_covariance: Floats) -> ProfileScan:
    """Scan each factor over its interval, and up to a factor of 30 beyond and through the given stiffness.

    Beyond the interval only for a group with little energy in all measured modes at the fit, at the given stiffness, or
    half-way. Other minima, such as that of a nearly symmetric shaft, are searched from all places where S(v) falls
    again on the way, and nearby along the least certain direction.
    """
    ways: list[Profile | None] = []
    for index, felt in enumerate(_min_group_shares(problem, best).tolist()):
        try:
            ways.append(_likelihood_profile(problem, best, log_covariance, index, felt < LOW_ENERGY_SHARE))
        except ArithmeticError:
            ways.append(None)
    falling = [state.log_factor for way in ways if way for side in way for state in _lower_points(side)]
    rivals = []
    for start in [*_weakest_direction_starts(best, log_covariance), *falling]:
        with suppress(ArithmeticError):
            rivals.append(minimize(problem, start, (), _profile_tolerance(problem, best))[0])
    return ProfileScan(log_covariance, tuple(ways), tuple(sorted(rivals, key=lambda rival: rival.cost)))


def _min_group_shares(problem: StiffnessProblem, best: Iterate) -> Floats:
    """Return the least of the largest energy shares of each group at the fit, the given stiffness and half-way."""
    states = [best]
    for share in (0.0, 0.5):
        with suppress(ArithmeticError):
            states.append(problem.evaluate(share * best.log_factor))
    return np.asarray(np.min([np.max(state.share, axis=0) for state in states], axis=0))


def _weakest_direction_starts(best: Iterate, log_covariance: Floats) -> list[Floats]:
    """Return starts in the least certain direction of several factors."""
    direction = np.linalg.eigh(log_covariance)[1][:, -1]
    direction /= np.max(np.abs(direction))
    return [best.log_factor + step * direction for step in RIVAL_START_DISTANCES if direction.size > 1]


def identifiability_remarks(problem: StiffnessProblem, best: Iterate, around: ProfileScan | None) -> list[FitRemark]:
    """Return remarks on groups whose factor the frequencies leave open.

    For each group the least sum of squares over all other factors, S(v), belongs to the logarithm v of its own. The
    first-order interval holds if S - S_min reaches Student's t^2 (times the variance of the residuals without
    standard errors) at its ends (D. J. Venzon and S. H. Moolgavkar, A method for computing
    profile-likelihood-based confidence intervals, Appl. Statist. 37, 1988). With the signed roots of S - S_min as
    normal deviates, the rises at its ends give its coverage, and the likelihood beyond them, integrated over
    v, reduces it: not twice as often wrong as stated is good enough. All other minima within the 95 % intervals
    are reported. Without a scan the energy shares alone decide.
    """
    remarks = []
    for index in np.flatnonzero(best.unfelt).tolist():
        text = (
            f"group has at most {100 * np.max(best.share[:, index]):.2g} % of the strain energy of the measured modes"
        )
        remarks.append(FitRemark("group-not-felt", problem.names[index], text, IDENTIFIABILITY_REMEDY))
    if around is None:
        return remarks
    others = _rival_text(problem, best, around)
    if others:
        text = f"other stiffness factors fit as well: {others}"
        return [*remarks, FitRemark("stiffness-ambiguous", ", ".join(problem.names), text, IDENTIFIABILITY_REMEDY)]
    for index in np.flatnonzero(~best.unfelt).tolist():
        text = _open_interval_text(problem, best, around, index)
        if text:
            remarks.append(FitRemark("stiffness-ambiguous", problem.names[index], text, IDENTIFIABILITY_REMEDY))
    return remarks


def _rival_text(problem: StiffnessProblem, best: Iterate, around: ProfileScan) -> str:
    """Return the factors of all solutions that fit as well, far off in one that is not open."""
    error, highest = np.sqrt(np.diag(around.log_covariance)), best.cost + AllowedExcess.of(problem, best).limit
    far = np.where(error < MAX_LOG_INTERVAL, MIN_RIVAL_DISTANCE * error + MIN_PROFILE_WIDTH, math.inf)
    apart = [best.log_factor]
    for rival in around.rivals:
        if rival.cost < highest and all(np.max(np.abs(rival.log_factor - other) / far) > 1 for other in apart):
            apart.append(rival.log_factor)
    return " or ".join(", ".join(f"{math.exp(value):.3g}" for value in rival) for rival in apart[1:])


def _likelihood_profile(problem: StiffnessProblem, best: Iterate, cov: Floats, i: int, far: bool) -> Profile | None:
    allowed = AllowedExcess.of(problem, best)
    half = math.sqrt(allowed.rise * float(cov[i, i]))
    if half < MIN_PROFILE_WIDTH:
        return None
    fixed = [i, *np.flatnonzero(np.diag(cov) >= MAX_LOG_INTERVAL**2).tolist()]
    ends = [best, best]
    if half < MAX_LOG_INTERVAL:
        along = np.clip(half * cov[:, i] / cov[i, i], -MAX_LOG_INTERVAL, MAX_LOG_INTERVAL)
        ends = [problem.evaluate(best.log_factor - along), problem.evaluate(best.log_factor + along)]
        if not all(MIN_INTERVAL_RISE < (end.cost - best.cost) / allowed.limit < 1 / MIN_INTERVAL_RISE for end in ends):
            ends = [minimize(problem, end.log_factor, fixed, _profile_tolerance(problem, best))[0] for end in ends]
    if not far:
        return [[end] for end in ends]
    return [[end, *_extend_profile(problem, best, end, fixed, s)] for s, end in zip((-1, 1), ends, strict=True)]


def _open_interval_text(problem: StiffnessProblem, best: Iterate, around: ProfileScan, i: int) -> str:
    """Return the fault of the interval of one factor; empty if there is none."""
    allowed, way, var = AllowedExcess.of(problem, best), around.profiles[i], float(around.log_covariance[i, i])
    half = math.sqrt(allowed.rise * var)
    if not half < MAX_LOG_INTERVAL:
        return f"stiffness is uncertain by a factor of {math.exp(min(half, 50.0)):.3g} (standard error)"
    if half < MIN_PROFILE_WIDTH:
        return ""
    if way is None:
        return "stiffness is uncertain, because the model cannot be solved at the ends of the interval"
    near = _interval_coverage([(end.cost - best.cost) / allowed.limit for end, *_ in way])
    beyond = [list(_likelihood_masses(best, side, i, allowed)) for side in way]
    mass = math.sqrt(2 * math.pi * var)
    total = mass + math.fsum(part for side in beyond for part, _ in side)
    held = near * mass / total
    if held >= MIN_INTERVAL_COVERAGE:
        return ""
    low, high = (_interval_reach(side, total * (1 - PROFILE_CONFIDENCE) / 2, half) for side in beyond)
    interval = f"{math.exp(-low):.3g} to {math.exp(high):.3g} times the fitted stiffness"
    first = f"first-order interval: factor {math.exp(half):.4g}, covers only {100 * held:.0f} %"
    return f"stiffness may be {interval} ({first})"


def _likelihood_masses(
    best: Iterate, side: Sequence[Iterate], index: int, allowed: AllowedExcess
) -> Iterator[tuple[float, float]]:
    """Yield the likelihood over that of the best fit, integrated from place to place, and the distance (logarithm).

    In between its logarithm is linear.
    """
    for near, far in pairwise(side):
        distance = abs(float(far.log_factor[index] - near.log_factor[index]))
        low, high = sorted(allowed.log_density(state.cost - best.cost) for state in (near, far))
        mean = math.exp(high) * (-math.expm1(low - high) / (high - low) if high > low else 1.0)
        yield distance * mean, abs(float(far.log_factor[index] - best.log_factor[index]))


def _interval_reach(side: Sequence[tuple[float, float]], least: float, half: float) -> float:
    """Return how far the likelihood extends with no more than a given part left out."""
    left_out = 0.0
    for part, place in reversed(side):
        left_out += part
        if left_out > least:
            return place
    return half


def _interval_coverage(rises: Sequence[float]) -> float:
    """Return the coverage of an interval from the rises of the sum of squares at its ends over the expected one."""
    outside = (1 - PROFILE_CONFIDENCE) / 2
    deviates = [-float(scipy.special.ndtri(outside)) * math.sqrt(max(rise, 0.0)) for rise in rises]
    return float(1 - scipy.special.ndtr(-deviates[0]) - scipy.special.ndtr(-deviates[1]))


def _lower_points(side: Sequence[Iterate]) -> list[Iterate]:
    """Return places beyond the first that are lower than the one before and not above the next."""
    costs = [state.cost for state in side]
    behind = [*costs[2:], math.inf]
    return [state for state, last, next_ in zip(side[1:], costs, behind, strict=False) if last > state.cost <= next_]


def _profile_tolerance(problem: StiffnessProblem, best: Iterate) -> float:
    least = float(np.min(problem.measured.scale / problem.measured.frequency))
    return PROFILE_TOLERANCE * math.sqrt(problem.variance(best)) * least


def _extend_profile(
    problem: StiffnessProblem, best: Iterate, end: Iterate, fixed: Sequence[int], side: int
) -> Iterator[Iterate]:
    """Yield the least sum of squares further and further from the first fixed factor, beyond an end of its interval.

    A large value, as at the place before, need not be accurate.
    """
    index = fixed[0]
    half = abs(float(end.log_factor[index] - best.log_factor[index]))
    to_start = -side * float(best.log_factor[index])
    places = {half + step for step in PROFILE_STEPS} | {share * to_start for share in (0.5, 1.0)}
    state, tolerance, limit = end, _profile_tolerance(problem, best), AllowedExcess.of(problem, best).limit
    for place in sorted(place for place in places if place > half):
        start = state.log_factor.copy()
        start[index] = best.log_factor[index] + side * place
        coarser = math.sqrt(max((state.cost - best.cost) / limit, 1.0))
        try:
            state, _ = minimize(problem, start, fixed, tolerance * coarser)
        except ArithmeticError:
            return
        yield state
