"""Least squares of measured frequencies in the logarithms of stiffness factors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from dsm.calibration.drawing import diameters, frequency_effects
from dsm.calibration.measured import Measured
from dsm.calibration.stiffness_groups import group_shares, scale_groups
from dsm.modes.find_modes import find_modes
from dsm.spindle.spindle import Spindle

_Float = NDArray[np.float64]

LIMIT = math.log(1e6)
"""Factors are sought between 1e-6 and 1e6."""
LONGEST_STEP = 2.0
"""Largest change of the logarithm of a factor in one step."""
CONVERGED = 1e-12
"""A step that would change no frequency by more than this part of it ends the search."""
BLURRED = 1e-8
"""Below this, a step that brings nothing has met rounding, and the search has ended as well."""
ROUNDING = 1e-10
"""Frequencies may be off by this part of them: a step that promises no more than that can hide has met it too."""
UNLIKELY = 1e-3
"""A chi-square with less probability than this is reported; where there is none, a larger relative residual."""


class Iterate(NamedTuple):
    """The model at one choice of factors."""

    log_factor: _Float
    """Logarithms of the factors (-), shape (g,)."""
    spindles: tuple[Spindle, ...]
    """The spindles scaled by them."""
    frequency: tuple[_Float, ...]
    """Frequencies of all modes of each spindle up to the one beyond the highest measured (Hz)."""
    fitted: _Float
    """Frequencies that the model gives the measured modes (Hz), (n,)."""
    share: _Float
    """Energy shares (n, g) of the measured modes."""
    residual: _Float
    """Fitted less measured frequency, scaled and weighted, (n,)."""
    slope: _Float
    """Derivative of the residual by log_factor, (n, g)."""

    @property
    def cost(self) -> float:
        """Sum of squares."""
        return float(self.residual @ self.residual)


class Problem(NamedTuple):
    """Which factors are sought from which frequencies."""

    spindles: tuple[Spindle, ...]
    """Spindles as given; parts of one group have the same factor in all of them."""
    names: tuple[str, ...]
    """Groups, each with a factor."""
    measured: Measured
    """The frequencies."""
    weight: _Float | None = None
    """What scaled residuals are multiplied by (n, n), where their errors depend on each other."""

    def with_drawing(self, state: Iterate, tolerance: float) -> Problem:
        """The same with all diameters of the drawing off by this standard error (-), as they act on this state."""
        measured = self.measured
        effect = frequency_effects(state.spindles, measured.mode, measured.shaft, diameters(state.spindles))
        scaled = tolerance * effect * (measured.frequency / measured.scale)[:, np.newaxis]
        covariance = np.eye(measured.mode.size) + scaled @ scaled.T
        return self._replace(weight=np.linalg.inv(np.linalg.cholesky(covariance)))

    @property
    def spare(self) -> int:
        """Modes less factors."""
        return self.measured.frequency.size - len(self.names)

    def evaluate(self, log_factor: _Float) -> Iterate:
        """The model with these factors; certified modes."""
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

    def fits(self, state: Iterate) -> bool:
        """Whether the residuals are of the size that is to be expected."""
        measured = self.measured
        if measured.std is None:
            return float(np.max(np.abs(state.fitted / measured.frequency - 1))) < UNLIKELY
        return float(scipy.special.chdtrc(max(self.spare, 1), state.cost)) > UNLIKELY


def minimize(
    problem: Problem, start: _Float, fixed: int | Sequence[int] = (), converged: float = CONVERGED
) -> tuple[Iterate, bool]:
    """The last state on the way down from a start by Levenberg and Marquardt, and whether it is a minimum.

    fixed: indices of factors that stay. converged: the change of frequencies that ends it.
    """
    free = np.flatnonzero(~np.isin(np.arange(start.size), fixed))
    state = problem.evaluate(start)
    if free.size == 0:
        return state, True
    damping = 1.0
    for _ in range(100):
        change = float(np.max(np.abs(state.share @ _step(state, free, 0.0)))) / 2
        if change <= converged:
            return state, True
        if np.any(np.abs(state.log_factor[free]) == LIMIT):
            break
        trial = problem.evaluate(np.clip(state.log_factor + _step(state, free, damping), -LIMIT, LIMIT))
        if trial.cost < state.cost:
            state, damping = trial, max(damping / 10, 1e-15)
        elif change <= max(BLURRED, converged) or _hidden(problem, state, free):
            return state, True
        elif damping > 1e6:
            break
        else:
            damping *= 10
    return state, False


def _hidden(problem: Problem, state: Iterate, free: NDArray[np.int_]) -> bool:
    """Whether the sum of squares falls, by the step of Gauss and Newton, by no more than rounding changes it."""
    left = state.residual + state.slope @ _step(state, free, 0.0)
    blur = ROUNDING * float(np.linalg.norm(state.fitted / problem.measured.scale))
    return state.cost - float(left @ left) <= 2 * math.sqrt(state.cost) * blur + blur**2


def _step(state: Iterate, free: NDArray[np.int_], damping: float) -> _Float:
    """Step of Levenberg and Marquardt; with damping 0 that of Gauss and Newton."""
    slope = state.slope[:, free]
    weight = math.sqrt(damping) * np.linalg.norm(slope, 2)
    matrix = np.vstack([slope, weight * np.eye(free.size)])
    step = np.zeros(state.log_factor.size)
    step[free] = np.linalg.lstsq(matrix, -np.append(state.residual, np.zeros(free.size)), rcond=None)[0]
    longest = float(np.max(np.abs(step)))
    return np.asarray(step * (LONGEST_STEP / longest if damping > 0 and longest > LONGEST_STEP else 1.0))
