"""Several bearing and joint stiffnesses from several measured natural frequencies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsm.calibration.calibration import UnreachableFrequencyError
from dsm.calibration.identifiability import CURE, LEAST_SHARE, identifiability
from dsm.calibration.least_squares import LIMIT, Measured, Problem, State, minimize
from dsm.calibration.remark import Remark
from dsm.calibration.stiffness_fit import StiffnessFit, StiffnessFitError
from dsm.calibration.stiffness_groups import chosen_groups, scale_groups
from dsm.matrix.frequency_axis import frequency_axis
from dsm.modes.natural_frequencies import natural_frequencies
from dsm.spindle.spindle import Spindle, require_support

_Float = NDArray[np.float64]

OTHER_STARTS = 8
"""Further starts, about a factor of e around the given one, where that leads to no minimum or to a poor one."""
WORST_CONDITION = 30.0
"""A larger condition number is reported."""
NEAR = 0.01
"""Modes nearer to each other than this part of their frequency are reported."""


def fit_stiffness(
    spindle: Spindle,
    frequency: ArrayLike,
    frequency_std: ArrayLike | None = None,
    mode: Sequence[int] | None = None,
    groups: Sequence[str] | None = None,
) -> StiffnessFit:
    """Scale each group of bearings and joints by a factor of its own, so that modes have their measured frequencies.

    frequency: (n,) Hz. frequency_std: their standard errors (n,) Hz, the weights; None: all count by their relative
    error. mode: their numbers (n,), 1 is the lowest; None: 1 to n. groups: names of bearing and joint groups, no more
    than n; None: all. A bearing keeps its stiffness against tilting and that of its housing; a joint has both of its
    stiffnesses scaled. One group and one mode are what `calibrate` solves without iteration.

    Least squares in the logarithms of the factors by Levenberg and Marquardt, with d ln f / d ln factor = half the
    group's share of the strain energy. Modes keep their number, never their shape: every step solves for certified
    modes, and where two come close (veering) they exchange shapes while their numbers stay. Veering makes local minima:
    where the given stiffnesses lead to none that fits, a few starts around them are tried and the best is kept. Of
    several solutions that fit, such as the two of a symmetric shaft, it is the first that is found.

    The result has remarks where the frequencies leave a stiffness open (identifiability), where modes do not tell the
    groups apart, lie close together, or do not fit; where it has none, the 95 % intervals are to be believed.

    Raises ValueError for bad frequencies and groups, UnreachableFrequencyError (a ValueError) where no factor from 1e-6
    to 1e6 puts a mode where it was measured, StiffnessFitError (an ArithmeticError, with the best estimate) where no
    minimum is found.
    """
    require_support(spindle)
    names = chosen_groups(spindle, groups)
    measured = _check(frequency, frequency_std, mode)
    if measured.frequency.size < len(names):
        raise ValueError(
            f"{measured.frequency.size} measured mode(s) cannot give the stiffness of {len(names)} groups "
            f"({', '.join(names)}); measure more modes, or name fewer groups"
        )
    problem = Problem(spindle, names, measured)
    state, found = _search(problem)
    if not (found and problem.fits(state)):
        with suppress(ArithmeticError):  # factors so far apart may be beyond what can be computed
            _require_reachable(spindle, names, measured)
    result = _result(problem, state, found)
    if not found:
        raise StiffnessFitError(_why(result), result)
    return result


def _check(frequency: ArrayLike, frequency_std: ArrayLike | None, mode: Sequence[int] | None) -> Measured:
    f = frequency_axis(frequency)
    if np.any(f == 0):
        raise ValueError("frequency=0 Hz is not > 0")
    std = None if frequency_std is None else np.atleast_1d(np.asarray(frequency_std, dtype=np.float64))
    if std is not None and (std.shape != f.shape or not np.all(np.isfinite(std) & (std > 0))):
        raise ValueError(
            f"frequency_std={frequency_std!r} is not one finite number > 0 (Hz) for each of {f.size} modes"
        )
    numbers = np.arange(1, f.size + 1) if mode is None else np.atleast_1d(np.asarray(mode))
    whole = numbers.shape == f.shape and numbers.dtype.kind in "iu"
    if not whole or np.any(numbers < 1) or np.unique(numbers).size < f.size:
        raise ValueError(f"mode={mode} is not one number from 1 (the lowest) for each of {f.size} modes, all different")
    order = np.argsort(numbers)
    if np.any(np.diff(f[order]) <= 0):
        raise ValueError(
            f"frequency={f[order].tolist()} Hz does not rise with the number of the mode, {numbers[order]}"
        )
    return Measured(numbers, f, std)


def _search(problem: Problem) -> tuple[State, bool]:
    """The best state, and whether it is a minimum: that of the given start, or of others where that one is poor."""
    size = len(problem.names)
    state, found = minimize(problem, np.zeros(size))
    for start in np.random.default_rng(0).normal(size=(OTHER_STARTS, size)):
        if found and problem.fits(state):
            break
        other, other_found = minimize(problem, start)
        if (other_found, -other.cost) > (found, -state.cost):
            state, found = other, other_found
    return state, found


def _result(problem: Problem, state: State, found: bool) -> StiffnessFit:
    measured = problem.measured
    covariance = _covariance(problem, state)
    unsure = identifiability(problem, state, covariance) if found else []
    return StiffnessFit(
        groups=problem.names,
        mode=measured.mode,
        frequency=measured.frequency,
        frequency_std=measured.std,
        fitted_frequency=state.frequency[measured.mode - 1],
        factor=np.exp(state.log_factor),
        log_covariance=covariance,
        energy_share=state.share,
        remarks=(*unsure, *_alike(problem, state), *_close_modes(state, measured), *_misfit(problem, state)),
        given=problem.spindle,
        spindle=state.spindle,
    )


def _covariance(problem: Problem, state: State) -> _Float | None:
    """(J^T J)^-1, times the variance of the residuals where no standard errors were given."""
    given = problem.measured.std is not None
    if not given and problem.spare == 0:
        return None
    _, values, vectors = np.linalg.svd(state.slope, full_matrices=False)
    root = vectors.T / np.maximum(values, np.finfo(np.float64).eps * values[0])
    return np.asarray(root @ root.T * (1.0 if given else state.cost / problem.spare))


def _alike(problem: Problem, state: State) -> list[Remark]:
    condition = float(np.linalg.cond(state.share))
    if condition <= WORST_CONDITION or np.any(np.max(state.share, axis=0) < LEAST_SHARE):
        return []
    weakest = np.abs(np.linalg.svd(state.share)[2][-1])
    mixed = ", ".join(name for name, part in zip(problem.names, weakest, strict=True) if part > 0.3)
    text = f"the measured modes hardly tell their stiffness apart (condition number {condition:.2g})"
    return [Remark("groups-alike", mixed, text, CURE)]


def _close_modes(state: State, measured: Measured) -> list[Remark]:
    """Pairs of neighbours with a measured one among them."""
    gap = np.diff(state.frequency) / state.frequency[1:]
    return [
        Remark(
            "modes-exchange-shapes",
            f"modes {low} and {low + 1}",
            f"they are {100 * gap[low - 1]:.2g} % apart in the fitted model and exchange shapes there: standard errors "
            "hold for small changes only",
            "check which of them was measured",
        )
        for low in range(1, state.frequency.size)
        if gap[low - 1] < NEAR and np.any((measured.mode == low) | (measured.mode == low + 1))
    ]


def _misfit(problem: Problem, state: State) -> list[Remark]:
    if problem.fits(state):
        return []
    measured = problem.measured
    worst = float(np.max(np.abs(state.residual * measured.scale / measured.frequency)))
    text = f"the frequencies do not fit, by up to {100 * worst:.2g} %; standard errors leave a wrong model out"
    return [Remark("frequencies-misfit", "", text, "check geometry, mode numbers and standard errors")]


def _require_reachable(spindle: Spindle, names: tuple[str, ...], measured: Measured) -> None:
    """Raise UnreachableFrequencyError for a mode measured outside of what the factors can do; all raise all modes."""
    count = int(np.max(measured.mode))
    low, high = (
        natural_frequencies(scale_groups(spindle, dict.fromkeys(names, math.exp(end))), count)
        for end in (-LIMIT, LIMIT)
    )
    for number, frequency in zip(measured.mode, measured.frequency, strict=True):
        reachable = float(low[number - 1]), float(high[number - 1])
        if not reachable[0] < frequency < reachable[1]:
            raise UnreachableFrequencyError(
                f"no stiffness of {', '.join(names)} puts mode {number} at {frequency:g} Hz: it lies between "
                f"{reachable[0]:.1f} and {reachable[1]:.1f} Hz; check the geometry, and which mode was measured",
                reachable,
            )


def _why(result: StiffnessFit) -> str:
    factors = ", ".join(f"{name} {factor:.3g}" for name, factor in zip(result.groups, result.factor, strict=True))
    residual = float(np.max(np.abs(result.residual)))
    return (
        f"no stiffness was found that fits these frequencies; the best factors ({factors}) leave a residual of "
        f"{residual:.3g} Hz: check the mode numbers, start from other stiffnesses, or name fewer groups"
    )
