"""Least-squares fit of logarithmic stiffness factors to measured frequencies, with drawing errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from dsm.arrays import Flags, Floats, Indices
from dsm.calibration.stiffness_groups import group_shares, scale_groups
from dsm.matrix.dynamic_stiffness import check_frequencies
from dsm.modes.find_modes import find_modes
from dsm.modes.natural_frequencies import natural_frequencies
from dsm.spindle.spindle import Spindle

DIAMETER_STEP = 1e-3
"""Relative change of a diameter for its effect, either way."""
TOOL_TOLERANCE_RATIO = 3.0
"""Tolerance of all diameters of a tool together over that of one of the drawing: flutes are modelled roughly."""
ALL_SPINDLES = -1
"""Number for all spindles in the key of a diameter."""
DiameterKey = tuple[int, int]
"""Spindle of a segment, and its number from the rear end; 0: all that no other spindle has, together."""


def diameter_keys(spindles: Sequence[Spindle]) -> list[list[DiameterKey]]:
    """Return a key for the diameters of each segment of each spindle; common segments at the rear share theirs.

    The last key of a spindle with other segments, its tool, is that of all these together.
    """
    shared = 0
    for rear in zip(*(reversed(spindle.segments) for spindle in spindles), strict=False):
        if any(segment != rear[0] for segment in rear):
            break
        shared += 1
    names = []
    for number, spindle in enumerate(spindles):
        behind = range(len(spindle.segments), 0, -1)
        together = [(number, 0)] if len(behind) > shared else []
        names.append([*((ALL_SPINDLES, k) if k <= shared else (number, k) for k in behind), *together])
    return names


def diameter_effects(spindle: Spindle, values: Callable[[Spindle], Floats], names: Sequence[DiameterKey]) -> Floats:
    """Return d ln value / d ln diameter, outside and inside alike, of each key, shape (n_values, n_names).

    All diameters of a tool together count TOOL_TOLERANCE_RATIO times.
    """
    columns = []
    for number in range(len(spindle.segments)):
        low, high = (values(_scale_diameters(spindle, number, 1 + side * DIAMETER_STEP)) for side in (-1, 1))
        columns.append(np.log(high / low) / (2 * DIAMETER_STEP))
    own = [column for column, (owner, _) in zip(columns, names, strict=False) if owner != ALL_SPINDLES]
    return np.array([*columns, TOOL_TOLERANCE_RATIO * np.sum(own, axis=0)] if own else columns).T


def frequency_effects(
    spindles: Sequence[Spindle], mode: Indices, shaft: Indices, names: Sequence[Sequence[DiameterKey]]
) -> Floats:
    """Return the effects on modes of several spindles, shape (n_modes, n_diameters), in order of appearance."""
    order = diameter_columns(names)
    found = np.zeros((mode.size, len(order)))
    for number, spindle in enumerate(spindles):
        here = np.flatnonzero(shaft == number)
        columns = np.array([order[name] for name in names[number]])
        found[np.ix_(here, columns)] = diameter_effects(spindle, _frequency_function(mode[here]), names[number])
    return found


def _frequency_function(mode: Indices) -> Callable[[Spindle], Floats]:
    return lambda spindle: np.asarray(natural_frequencies(spindle, int(np.max(mode)))[mode - 1])


def diameter_columns(names: Sequence[Sequence[DiameterKey]]) -> dict[DiameterKey, int]:
    """Return the column of each diameter."""
    return {name: column for column, name in enumerate(dict.fromkeys(name for row in names for name in row))}


def _scale_diameters(spindle: Spindle, number: int, factor: float) -> Spindle:
    """Scale all diameters of one segment."""
    segments = list(spindle.segments)
    diameters = {field: size for field, size in vars(segments[number]).items() if field.endswith("_diameter") and size}
    segments[number] = replace(segments[number], **{field: factor * size for field, size in diameters.items()})
    return replace(spindle, segments=segments)


class MeasuredModes(NamedTuple):
    """Measured modes."""

    mode: Indices
    """Numbers of the modes, shape (n,); 1 is the lowest."""
    frequency: Floats
    """Frequencies (Hz), shape (n,)."""
    std: Floats | None
    """Standard errors (Hz), shape (n,); None if not given."""
    shaft: Indices
    """Number of the spindle of each mode, shape (n,); 0 is the first."""

    @property
    def scale(self) -> Floats:
        """Divisor of the residuals: standard errors (Hz), or the frequencies without them."""
        return self.frequency if self.std is None else self.std


def check_measured_modes(
    spindles: int,
    frequency: ArrayLike,
    frequency_std: ArrayLike | None,
    mode: Sequence[int] | None,
    shaft: Sequence[int] | None,
) -> MeasuredModes:
    """Check the measured modes of so many spindles, as fit_stiffness takes them; ValueError for invalid ones."""
    f = check_frequencies(frequency, positive=True)
    std = None if frequency_std is None else np.atleast_1d(np.asarray(frequency_std, dtype=np.float64))
    if std is not None and (std.shape != f.shape or not np.all(np.isfinite(std) & (std > 0))):
        wanted = f"one finite number > 0 (Hz) for each of {f.size} modes"
        raise ValueError(f"frequency_std={frequency_std!r} is not {wanted}")
    where = np.zeros(f.size, dtype=np.int_) if shaft is None else np.atleast_1d(np.asarray(shaft))
    if where.shape != f.shape or where.dtype.kind not in "iu" or {*where.tolist()} != {*range(spindles)}:
        raise ValueError(
            f"shaft={shaft} is invalid. Give the spindle number, 0 to {spindles - 1}, of each of {f.size} modes, "
            "with every spindle at least once."
        )
    numbers = np.arange(1, f.size + 1) if mode is None else np.atleast_1d(np.asarray(mode))
    whole = numbers.shape == f.shape and numbers.dtype.kind in "iu"
    for number in range(spindles):
        _check_mode_numbers(f[where == number], numbers[where == number] if whole else numbers[:0], mode)
    return MeasuredModes(numbers, f, std, where)


def _check_mode_numbers(f: Floats, numbers: Indices, mode: Sequence[int] | None) -> None:
    """Check the mode numbers of one spindle."""
    if numbers.shape != f.shape or np.any(numbers < 1) or np.unique(numbers).size < f.size:
        raise ValueError(f"mode={mode} is invalid. Give each of {f.size} modes its own number, from 1 (the lowest).")
    order = np.argsort(numbers)
    if np.any(np.diff(f[order]) <= 0):
        raise ValueError(f"frequency={f[order].tolist()} Hz does not rise with the mode number {numbers[order]}")


MAX_LOG_FACTOR = math.log(1e6)
"""Largest logarithm of a factor: 1e-6 to 1e6."""
MAX_LOG_STEP = 2.0
"""Largest change of the logarithm of a factor in one step."""
FACTOR_STEP_TOLERANCE = 1e-12
"""Relative change of the frequencies that ends the search."""
ROUNDING_STEP_LIMIT = 1e-8
"""Relative change below which a step without gain has met rounding and ends the search."""
FREQUENCY_ROUNDING = 1e-10
"""Relative rounding error of frequencies, which may hide the gain of a step."""
MIN_CHI_SQUARE_PROBABILITY = 1e-3
"""Least probability of a chi-square, or least relative residual without standard errors, that is reported."""
MAX_LOG_INTERVAL = math.log(30.0)
"""Largest interval, in the logarithm of a factor."""
MIN_ENERGY_SHARE = 0.01
"""Least energy share in a measured mode of a group with effect."""


class Iterate(NamedTuple):
    """Model at one choice of factors."""

    log_factor: Floats
    """Logarithms of the factors (-), shape (g,)."""
    spindles: tuple[Spindle, ...]
    """Scaled spindles."""
    frequency: tuple[Floats, ...]
    """Frequencies of all modes of each spindle up to the one beyond the highest measured (Hz)."""
    fitted: Floats
    """Frequencies of the measured modes in the model (Hz), (n,)."""
    share: Floats
    """Energy shares (n, g) of the measured modes."""
    residual: Floats
    """Fitted less measured frequency, scaled and weighted, (n,)."""
    slope: Floats
    """Derivative of the residual by log_factor, (n, g)."""

    @property
    def cost(self) -> float:
        """Sum of squares."""
        return float(self.residual @ self.residual)

    @property
    def unfelt(self) -> Flags:
        """Factors without effect on the measured modes, shape (g,)."""
        return np.asarray(np.max(self.share, axis=0) < MIN_ENERGY_SHARE)


class StiffnessProblem(NamedTuple):
    """Problem of fitting factors to frequencies."""

    spindles: tuple[Spindle, ...]
    """Spindles as given; parts of one group have the same factor in all of them."""
    names: tuple[str, ...]
    """Groups with one factor each."""
    measured: MeasuredModes
    """Measured modes."""
    weight: Floats | None = None
    """Matrix that multiplies the scaled residuals (n, n), if their errors depend on each other."""

    def with_drawing(self, state: Iterate, tolerance: float) -> StiffnessProblem:
        """Return the problem with this relative standard error of all diameters, as they act on this state."""
        measured = self.measured
        effect = frequency_effects(state.spindles, measured.mode, measured.shaft, diameter_keys(state.spindles))
        scaled = tolerance * effect * (measured.frequency / measured.scale)[:, np.newaxis]
        covariance = np.eye(measured.mode.size) + scaled @ scaled.T
        return self._replace(weight=np.linalg.inv(np.linalg.cholesky(covariance)))

    @property
    def degrees_of_freedom(self) -> int:
        """Modes less factors."""
        return self.measured.frequency.size - len(self.names)

    def evaluate(self, log_factor: Floats) -> Iterate:
        """Return the model with these factors and certified modes."""
        measured, factors = self.measured, dict(zip(self.names, np.exp(log_factor).tolist(), strict=True))
        scaled = tuple(scale_groups(spindle, factors) for spindle in self.spindles)
        fitted, share = np.empty(measured.mode.size), np.empty((measured.mode.size, len(self.names)))
        frequencies = []
        for number, spindle in enumerate(scaled):
            on_shaft = measured.shaft == number
            wanted = measured.mode[on_shaft] - 1
            modes = find_modes(spindle, int(np.max(wanted)) + 2)
            frequencies.append(modes.frequency)
            fitted[on_shaft], share[on_shaft] = modes.frequency[wanted], group_shares(modes, self.names)[wanted]
        residual = (fitted - measured.frequency) / measured.scale
        slope = (fitted / measured.scale / 2)[:, np.newaxis] * share
        if self.weight is not None:
            residual, slope = self.weight @ residual, self.weight @ slope
        return Iterate(log_factor, scaled, tuple(frequencies), fitted, share, residual, slope)

    def variance(self, best: Iterate) -> float:
        """Return the variance of the scaled residuals: 1, or from their scatter without standard errors."""
        return best.cost / self.degrees_of_freedom if self.measured.std is None else 1.0

    def covariance(self, state: Iterate) -> Floats | None:
        """Return (J^T J)^-1, times the variance of the residuals if no standard errors were given.

        A group without effect, known to a factor of 30 at best, counts as known to that and independent of all others.
        """
        if self.measured.std is None and self.degrees_of_freedom == 0:
            return None
        variance = self.variance(state)
        covariance = variance * _inverse_normal_matrix(state.slope)
        felt = ~state.unfelt | (np.diag(covariance) < MAX_LOG_INTERVAL**2)
        if np.all(felt):
            return covariance
        limited = np.diag(np.full(felt.size, MAX_LOG_INTERVAL**2))
        if np.any(felt):
            limited[np.ix_(felt, felt)] = variance * _inverse_normal_matrix(state.slope[:, felt])
        return limited

    def fits(self, state: Iterate) -> bool:
        """Return whether the residuals have the expected size."""
        measured = self.measured
        if measured.std is None:
            return float(np.max(np.abs(state.fitted / measured.frequency - 1))) < MIN_CHI_SQUARE_PROBABILITY
        return float(scipy.special.chdtrc(max(self.degrees_of_freedom, 1), state.cost)) > MIN_CHI_SQUARE_PROBABILITY


def _inverse_normal_matrix(slope: Floats) -> Floats:
    """Return (J^T J)^-1, large if J is singular."""
    _, values, vectors = np.linalg.svd(slope, full_matrices=False)
    root = vectors.T / np.maximum(values, np.finfo(np.float64).eps * values[0])
    return np.asarray(root @ root.T)


def minimize(
    problem: StiffnessProblem, start: Floats, fixed: int | Sequence[int] = (), converged: float = FACTOR_STEP_TOLERANCE
) -> tuple[Iterate, bool]:
    """Return the last state from a start by Levenberg and Marquardt, and whether it is a minimum.

    fixed: indices of factors that stay. converged: relative change of frequencies that ends it.
    """
    free = np.flatnonzero(~np.isin(np.arange(start.size), fixed))
    state = problem.evaluate(start)
    if free.size == 0:
        return state, True
    damping = 1.0
    for _ in range(100):
        change = float(np.max(np.abs(state.share @ _damped_step(state, free, 0.0)))) / 2
        if change <= converged:
            return state, True
        if np.any(np.abs(state.log_factor[free]) == MAX_LOG_FACTOR):
            break
        moved = state.log_factor + _damped_step(state, free, damping)
        trial = problem.evaluate(np.clip(moved, -MAX_LOG_FACTOR, MAX_LOG_FACTOR))
        if trial.cost < state.cost:
            state, damping = trial, max(damping / 10, 1e-15)
        elif change <= max(ROUNDING_STEP_LIMIT, converged) or _is_hidden_by_rounding(problem, state, free):
            return state, True
        elif damping > 1e6:
            break
        else:
            damping *= 10
    return state, False


def _is_hidden_by_rounding(problem: StiffnessProblem, state: Iterate, free: Indices) -> bool:
    """Return whether the gain of a Gauss-Newton step is no more than rounding."""
    left = state.residual + state.slope @ _damped_step(state, free, 0.0)
    blur = FREQUENCY_ROUNDING * float(np.linalg.norm(state.fitted / problem.measured.scale))
    return state.cost - float(left @ left) <= 2 * math.sqrt(state.cost) * blur + blur**2


def _damped_step(state: Iterate, free: Indices, damping: float) -> Floats:
    """Return the Levenberg-Marquardt step; with damping 0 that of Gauss and Newton."""
    slope = state.slope[:, free]
    weight = math.sqrt(damping) * np.linalg.norm(slope, 2)
    matrix = np.vstack([slope, weight * np.eye(free.size)])
    step = np.zeros(state.log_factor.size)
    step[free] = np.linalg.lstsq(matrix, -np.append(state.residual, np.zeros(free.size)), rcond=None)[0]
    longest = float(np.max(np.abs(step)))
    return np.asarray(step * (MAX_LOG_STEP / longest if damping > 0 and longest > MAX_LOG_STEP else 1.0))
