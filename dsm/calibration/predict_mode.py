"""A mode of a spindle that was not measured, from stiffnesses that were fitted to others."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsm.calibration.drawing import diameters, effects, frequency_effects, in_order
from dsm.calibration.stiffness_fit import StiffnessFit
from dsm.calibration.stiffness_groups import scale_groups
from dsm.modes.modes_at import modes_at
from dsm.spindle.spindle import Spindle

_Float = NDArray[np.float64]

FARTHEST = math.log(30.0)
"""A stiffness that is known less well than to this factor (its logarithm) is moved by no more ..."""
SMALLEST = 1e-9
"""... and by no less than this."""


class PredictedMode(NamedTuple):
    """One mode of a spindle with the fitted bearings and joints."""

    frequency: float
    """Natural frequency (Hz)."""
    frequency_std: float | None
    """Standard error of the frequency from those of the stiffnesses (Hz); None where these are not known."""
    stiffness: float
    """Modal stiffness where it is looked at (N/m)."""
    stiffness_std: float | None
    """Standard error of the modal stiffness, likewise (N/m)."""


def predict_mode(fit: StiffnessFit, spindle: Spindle, mode: int = 1, position: float = 0.0) -> PredictedMode:
    """A mode (1 is the lowest) of a spindle with the groups of the fit, at `position` from its tool tip (m).

    spindle: with the stiffnesses that the fit started from, such as the same one with a third tool. The errors are half
    the change from one end of each principal axis of the factors' covariance to the other, added in squares, and what
    the tolerance of the drawing adds: diameters that it shares with the fitted spindles act on both. Raises ValueError
    as modes_at.

    >>> bearings = [Bearing(0.15, 2.5e8), Bearing(0.4, 2.5e8)]
    >>> tapped = Spindle([Segment(0.1, 0.03), Segment(0.4, 0.06)], bearings)
    >>> fit = fit_stiffness(tapped, [0.95 * natural_frequencies(tapped, 1)[0]], frequency_std=[2.0])
    >>> other = Spindle([Segment(0.1, 0.04), Segment(0.4, 0.06)], bearings)  # with a tool that was never tapped
    >>> mode = predict_mode(fit, other)
    >>> f"{mode.frequency:.0f} +- {mode.frequency_std:.0f} Hz, K = {mode.stiffness / 1e6:.1f} N/um"
    '921 +- 2 Hz, K = 33.2 N/um'
    """

    def of(shaft: Spindle) -> _Float:
        frequency, stiffness = modes_at(shaft, mode, position)
        return np.array([frequency[-1], stiffness[-1]])

    def at(log_factor: _Float) -> _Float:
        return of(scale_groups(spindle, dict(zip(fit.groups, np.exp(log_factor).tolist(), strict=True))))

    best = np.log(fit.factor)
    values = at(best)
    if fit.log_covariance is None:
        return PredictedMode(float(values[0]), None, float(values[1]), None)
    variance, axes = np.linalg.eigh(fit.log_covariance)
    sizes = np.clip(np.sqrt(np.maximum(variance, 0.0)), SMALLEST, FARTHEST)
    changes = np.array([(at(best + step) - at(best - step)) / 2 for step in (axes * sizes).T])
    squares = np.sum(np.square(changes), axis=0)
    if fit.tolerance > 0 and fit.frequency_std is not None:
        slope = (axes / sizes) @ changes / values
        squares = squares + values**2 * _of_drawing(fit, _effects_beside(fit, fit.applied_to(spindle), of), slope)
    errors = np.sqrt(np.maximum(squares, 0.0)).tolist()
    return PredictedMode(float(values[0]), errors[0], float(values[1]), errors[1])


def _effects_beside(fit: StiffnessFit, spindle: Spindle, values: Callable[[Spindle], _Float]) -> tuple[_Float, _Float]:
    """Effects of all diameters on the modes of the fit (n, d), and on two values of another spindle (2, d)."""
    names = diameters([*fit.spindles, spindle])
    order = in_order(names)
    own = np.zeros((2, len(order)))
    own[:, [order[name] for name in names[-1]]] = effects(spindle, values, names[-1])
    fitted = frequency_effects(fit.spindles, fit.mode, fit.shaft, names)
    return fitted, own


def _of_drawing(fit: StiffnessFit, effect: tuple[_Float, _Float], slope: _Float) -> _Float:
    """What the drawing adds to the relative variances (2,), whose part by the factors holds its effect on the fit.

    slope: d ln value / d ln factor, shape (g, 2).
    """
    fitted, own = effect
    relative = np.asarray(fit.frequency_std) / fit.frequency
    covariance = np.diag(relative**2) + fit.tolerance**2 * fitted @ fitted.T
    factors = np.asarray(fit.log_covariance)
    known = np.where(np.diag(factors) < FARTHEST**2, 1.0, 0.0)[:, np.newaxis]
    by_fit = slope.T @ (known * (factors @ (fit.energy_share / 2).T)) @ np.linalg.solve(covariance, fitted)
    return np.asarray(fit.tolerance**2 * np.sum(own**2 - 2 * by_fit * own, axis=1))
