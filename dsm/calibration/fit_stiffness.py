"""Several bearing and joint stiffnesses from several measured natural frequencies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtrc

from dsm.calibration.calibration import UnreachableFrequencyError
from dsm.calibration.stiffness_fit import StiffnessFit, StiffnessFitError
from dsm.calibration.stiffness_groups import chosen_groups, group_shares, scale_groups
from dsm.matrix.frequency_axis import frequency_axis
from dsm.modes.find_modes import find_modes
from dsm.modes.natural_frequencies import natural_frequencies
from dsm.spindle.spindle import Spindle, require_support

_Float = NDArray[np.float64]

LIMIT = math.log(1e6)
"""Factors are sought between 1e-6 and 1e6."""
OTHER_STARTS = 8
"""Further starts, about a factor of e around the given one, where that leads to no minimum or to a poor one."""
LONGEST_STEP = 2.0
"""Largest change of the logarithm of a factor in one step."""
CONVERGED = 1e-12
"""A step that would change no frequency by more than this part of it ends the search."""
BLURRED = 1e-8
"""Below this, a step that brings nothing has met rounding, and the search has ended as well."""
LEAST_SHARE = 0.01
"""A group with less than this part of the strain energy of every measured mode is reported."""
WORST_CONDITION = 30.0
"""A larger condition number is reported."""
UNLIKELY = 1e-3
"""A chi-square with less probability than this is reported; where there is none, a larger relative residual."""
NEAR = 0.01
"""Modes nearer to each other than this part of their frequency are reported."""


class _Measured(NamedTuple):
    mode: NDArray[np.int_]
    frequency: _Float
    std: _Float | None

    @property
    def scale(self) -> _Float:
        """What residuals are divided by: standard errors (Hz); where there are none, the frequencies."""
        return self.frequency if self.std is None else self.std


class _State(NamedTuple):
    """The model at one choice of factors."""

    log_factor: _Float
    spindle: Spindle
    frequency: _Float
    """Of all modes up to the one beyond the highest measured (Hz)."""
    share: _Float
    """Energy shares (n, g) of the measured modes."""
    residual: _Float
    """Fitted less measured frequency, scaled, (n,)."""
    slope: _Float
    """Derivative of the residual by log_factor, (n, g)."""

    @property
    def cost(self) -> float:
        return float(self.residual @ self.residual)


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

    The result warns where modes do not tell the groups apart, lie close together, or do not fit. Raises ValueError for
    bad frequencies and groups, UnreachableFrequencyError (a ValueError) where no factor from 1e-6 to 1e6 puts a mode
    where it was measured, StiffnessFitError (an ArithmeticError, with the best estimate) where no minimum is found.
    """
    require_support(spindle)
    names = chosen_groups(spindle, groups)
    measured = _check(frequency, frequency_std, mode)
    if measured.frequency.size < len(names):
        raise ValueError(
            f"{measured.frequency.size} measured mode(s) cannot give the stiffness of {len(names)} groups "
            f"({', '.join(names)}); measure more modes, or name fewer groups"
        )
    state, found = _search(spindle, names, measured)
    result = _result(spindle, names, measured, state)
    if not (found and _fits(state, measured)):
        with suppress(ArithmeticError):  # factors so far apart may be beyond what can be computed
            _require_reachable(spindle, names, measured)
    if not found:
        raise StiffnessFitError(_why(result), result)
    return result


def _check(frequency: ArrayLike, frequency_std: ArrayLike | None, mode: Sequence[int] | None) -> _Measured:
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
    return _Measured(numbers, f, std)


def _evaluate(spindle: Spindle, names: tuple[str, ...], measured: _Measured, log_factor: _Float) -> _State:
    factors = np.exp(log_factor).tolist()
    scaled = scale_groups(spindle, dict(zip(names, factors, strict=True)))
    modes = find_modes(scaled, int(np.max(measured.mode)) + 1)
    share = group_shares(scaled, modes, names)[measured.mode - 1]
    frequency = modes.frequency[measured.mode - 1]
    return _State(
        log_factor,
        scaled,
        modes.frequency,
        share,
        (frequency - measured.frequency) / measured.scale,
        (frequency / measured.scale / 2)[:, np.newaxis] * share,
    )


def _search(spindle: Spindle, names: tuple[str, ...], measured: _Measured) -> tuple[_State, bool]:
    """The best state, and whether it is a minimum: that of the given start, or of others where that one is poor."""
    state, found = _minimize(spindle, names, measured, np.zeros(len(names)))
    for start in np.random.default_rng(0).normal(size=(OTHER_STARTS, len(names))):
        if found and _fits(state, measured):
            break
        other, other_found = _minimize(spindle, names, measured, start)
        if (other_found, -other.cost) > (found, -state.cost):
            state, found = other, other_found
    return state, found


def _fits(state: _State, measured: _Measured) -> bool:
    """Whether the residuals are of the size that is to be expected."""
    spare = measured.frequency.size - state.log_factor.size
    if measured.std is None or spare == 0:
        return float(np.max(np.abs(state.residual * measured.scale / measured.frequency))) < UNLIKELY
    return float(chdtrc(spare, state.cost)) > UNLIKELY


def _minimize(spindle: Spindle, names: tuple[str, ...], measured: _Measured, start: _Float) -> tuple[_State, bool]:
    """The last state on the way down from a start, and whether it is a minimum."""
    state = _evaluate(spindle, names, measured, start)
    damping = 1.0
    for _ in range(100):
        change = _change(state, _step(state, 0.0))
        if change <= CONVERGED:
            return state, True
        if np.any(np.abs(state.log_factor) == LIMIT):
            break
        log_factor = np.clip(state.log_factor + _step(state, damping), -LIMIT, LIMIT)
        trial = _evaluate(spindle, names, measured, log_factor)
        if trial.cost < state.cost:
            state, damping = trial, max(damping / 10, 1e-15)
        elif change <= BLURRED:
            return state, True
        elif damping > 1e6:
            break
        else:
            damping *= 10
    return state, False


def _step(state: _State, damping: float) -> _Float:
    """Step of Levenberg and Marquardt; with damping 0 that of Gauss and Newton."""
    size = state.log_factor.size
    weight = math.sqrt(damping) * np.linalg.norm(state.slope, 2)
    matrix = np.vstack([state.slope, weight * np.eye(size)])
    step = np.linalg.lstsq(matrix, -np.append(state.residual, np.zeros(size)), rcond=None)[0]
    longest = float(np.max(np.abs(step)))
    return np.asarray(step * (LONGEST_STEP / longest if damping > 0 and longest > LONGEST_STEP else 1.0))


def _change(state: _State, step: _Float) -> float:
    """Largest relative change of a frequency that a step promises."""
    return float(np.max(np.abs(state.share @ step))) / 2


def _result(spindle: Spindle, names: tuple[str, ...], measured: _Measured, state: _State) -> StiffnessFit:
    frequency = state.frequency[measured.mode - 1]
    return StiffnessFit(
        groups=names,
        mode=measured.mode,
        frequency=measured.frequency,
        frequency_std=measured.std,
        fitted_frequency=frequency,
        factor=np.exp(state.log_factor),
        log_covariance=_covariance(state, measured),
        energy_share=state.share,
        warnings=(*_unidentified(names, state), *_close_modes(state, measured), *_misfit(state, measured)),
        given=spindle,
        spindle=state.spindle,
    )


def _covariance(state: _State, measured: _Measured) -> _Float | None:
    """(J^T J)^-1, times the variance of the residuals where no standard errors were given."""
    spare = measured.frequency.size - state.log_factor.size
    if measured.std is None and spare == 0:
        return None
    _, values, vectors = np.linalg.svd(state.slope, full_matrices=False)
    root = vectors.T / np.maximum(values, np.finfo(np.float64).eps * values[0])
    return np.asarray(root @ root.T * (state.cost / spare if measured.std is None else 1.0))


def _unidentified(names: tuple[str, ...], state: _State) -> list[str]:
    cure = "more or other modes are needed to find it"
    idle = [
        f"group {name!r} has at most {100 * share:.2g} % of the strain energy of the measured modes; {cure}"
        for name, share in zip(names, np.max(state.share, axis=0), strict=True)
        if share < LEAST_SHARE
    ]
    if idle:
        return idle
    condition = float(np.linalg.cond(state.share))
    if condition <= WORST_CONDITION:
        return []
    weakest = np.abs(np.linalg.svd(state.share)[2][-1])
    mixed = ", ".join(repr(name) for name, part in zip(names, weakest, strict=True) if part > 0.3)
    return [
        f"the measured modes hardly tell the stiffness of {mixed} (condition number {condition:.2g}): "
        "more or other modes are needed"
    ]


def _close_modes(state: _State, measured: _Measured) -> list[str]:
    """Pairs of neighbours with a measured one among them."""
    gap = np.diff(state.frequency) / state.frequency[1:]
    return [
        f"modes {low} and {low + 1} of the fitted model are {100 * gap[low - 1]:.2g} % apart and exchange "
        "shapes there: check which of them was measured; standard errors hold for small changes only"
        for low in range(1, state.frequency.size)
        if gap[low - 1] < NEAR and np.any((measured.mode == low) | (measured.mode == low + 1))
    ]


def _misfit(state: _State, measured: _Measured) -> list[str]:
    if _fits(state, measured):
        return []
    worst = float(np.max(np.abs(state.residual * measured.scale / measured.frequency)))
    return [
        f"the frequencies do not fit, by up to {100 * worst:.2g} %: check geometry, mode numbers and standard errors; "
        "those of the stiffness leave a wrong model out"
    ]


def _require_reachable(spindle: Spindle, names: tuple[str, ...], measured: _Measured) -> None:
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
