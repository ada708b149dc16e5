"""A mode of a spindle that was not measured, from stiffnesses that were fitted to others."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsm.calibration.stiffness_fit import StiffnessFit
from dsm.calibration.stiffness_groups import scale_groups
from dsm.modes.modes_at import modes_at
from dsm.spindle.spindle import Spindle

_Float = NDArray[np.float64]

FARTHEST = math.log(30.0)
"""A stiffness that is known less well than to this factor (its logarithm) is moved by no more."""


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
    the change from one end of each principal axis of the factors' covariance to the other, added in squares. What the
    drawing has wrong is not in them. Raises ValueError as modes_at.
    """

    def at(log_factor: _Float) -> _Float:
        factors = dict(zip(fit.groups, np.exp(log_factor).tolist(), strict=True))
        frequency, stiffness = modes_at(scale_groups(spindle, factors), mode, position)
        return np.array([frequency[-1], stiffness[-1]])

    best = np.log(fit.factor)
    frequency, stiffness = at(best).tolist()
    if fit.log_covariance is None:
        return PredictedMode(frequency, None, stiffness, None)
    variance, axes = np.linalg.eigh(fit.log_covariance)
    steps = (axes * np.minimum(np.sqrt(np.maximum(variance, 0.0)), FARTHEST)).T
    changes = [(at(best + step) - at(best - step)) / 2 for step in steps]
    errors = np.sqrt(np.sum(np.square(changes), axis=0)).tolist()
    return PredictedMode(frequency, errors[0], stiffness, errors[1])
