"""Least squares of measured frequencies in the logarithms of stiffness factors."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

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
UNLIKELY = 1e-3
"""A chi-square with less probability than this is reported; where there is none, a larger relative residual."""


class Measured(NamedTuple):
    """What was measured."""

    mode: NDArray[np.int_]
    """Numbers of the modes, shape (n,); 1 is the lowest."""
    frequency: _Float
    """Hz, shape (n,)."""
    std: _Float | None
    """Standard errors (Hz), shape (n,); None where not given."""

    @property
    def scale(self) -> _Float:
        """What residuals are divided by: standard errors (Hz); where there are none, the frequencies."""
        return self.frequency if self.std is None else self.std


class State(NamedTuple):
    """The model at one choice of factors."""

    log_factor: _Float
    """Logarithms of the factors (-), shape (g,)."""
    spindle: Spindle
    """The spindle scaled by them."""
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
        """Sum of squares."""
        return float(self.residual @ self.residual)


class Problem(NamedTuple):
    """Which factors are sought from which frequencies."""

    spindle: Spindle
    """As given."""
    names: tuple[str, ...]
    """Groups, each with a factor."""
    measured: Measured
    """The frequencies."""

    @property
    def spare(self) -> int:
        """Modes less factors."""
        return self.measured.frequency.size - len(self.names)

    def evaluate(self, log_factor: _Float) -> State:
        """The model with these factors; certified modes."""
        measured, factors = self.measured, np.exp(log_factor).tolist()
        scaled = scale_groups(self.spindle, dict(zip(self.names, factors, strict=True)))
        modes = find_modes(scaled, int(np.max(measured.mode)) + 1)
        share = group_shares(modes, self.names)[measured.mode - 1]
        frequency = modes.frequency[measured.mode - 1]
        return State(
            log_factor,
            scaled,
            modes.frequency,
            share,
            (frequency - measured.frequency) / measured.scale,
            (frequency / measured.scale / 2)[:, np.newaxis] * share,
        )

    def fits(self, state: State) -> bool:
        """Whether the residuals are of the size that is to be expected."""
        measured = self.measured
        if measured.std is None or self.spare == 0:
            return float(np.max(np.abs(state.residual * measured.scale / measured.frequency))) < UNLIKELY
        return float(chdtrc(self.spare, state.cost)) > UNLIKELY


def minimize(
    problem: Problem, start: _Float, fixed: int | None = None, converged: float = CONVERGED
) -> tuple[State, bool]:
    """The last state on the way down from a start by Levenberg and Marquardt, and whether it is a minimum.

    fixed: the index of a factor that stays; None: all vary. converged: the change of frequencies that ends it.
    """
    free = np.flatnonzero(np.arange(start.size) != (-1 if fixed is None else fixed))
    state = problem.evaluate(start)
    if free.size == 0:
        return state, True
    damping = 1.0
    for _ in range(100):
        change = float(np.max(np.abs(state.share @ _step(state, free, 0.0)))) / 2
        if change <= converged:
            return state, True
        if np.any(np.abs(state.log_factor) == LIMIT):
            break
        trial = problem.evaluate(np.clip(state.log_factor + _step(state, free, damping), -LIMIT, LIMIT))
        if trial.cost < state.cost:
            state, damping = trial, max(damping / 10, 1e-15)
        elif change <= max(BLURRED, converged):
            return state, True
        elif damping > 1e6:
            break
        else:
            damping *= 10
    return state, False


def _step(state: State, free: NDArray[np.int_], damping: float) -> _Float:
    """Step of Levenberg and Marquardt; with damping 0 that of Gauss and Newton."""
    slope = state.slope[:, free]
    weight = math.sqrt(damping) * np.linalg.norm(slope, 2)
    matrix = np.vstack([slope, weight * np.eye(free.size)])
    found = np.zeros(state.log_factor.size)
    found[free] = np.linalg.lstsq(matrix, -np.append(state.residual, np.zeros(free.size)), rcond=None)[0]
    longest = float(np.max(np.abs(found)))
    return np.asarray(found * (LONGEST_STEP / longest if damping > 0 and longest > LONGEST_STEP else 1.0))
