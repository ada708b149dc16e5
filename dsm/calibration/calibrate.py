"""Bearing stiffness from one measured natural frequency."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from dsm.calibration.bearing_eigenproblem import BearingEigenproblem, bearing_eigenproblem, calibrated_bearings
from dsm.calibration.calibration import Calibration, UnreachableFrequencyError
from dsm.calibration.stiffness_curve import mean_stiffness
from dsm.modes.find_modes import MOST_MODES
from dsm.modes.natural_frequencies import natural_frequencies
from dsm.spindle.spindle import Spindle


def calibrate(
    spindle: Spindle,
    frequency: float,
    frequency_std: float | None = None,
    mode: int = 1,
    group: str | None = None,
) -> Calibration:
    """Scale bearing stiffnesses by one factor, so that a mode (1 is the lowest) has its measured frequency (Hz).

    The given stiffnesses say only in which ratio the bearings share; equal ones make one unknown stiffness of them.
    group: the bearings that are scaled; None: all that have a group. The factor is exact, from an eigenvalue problem of
    the order of the number of bearings, and a count of modes says which eigenvalue it is; its standard error follows
    from that of the frequency (`frequency_std`, Hz) by the chain rule. Stiffness against tilting and of the housing
    stays as it is.

    Raises UnreachableFrequencyError where the frequency lies outside what the springs can do, ValueError for a
    frequency not > 0, a shaft that is not held, and a group with no bearing or a rigid one.
    """
    _check(frequency, frequency_std, mode)
    problem = bearing_eigenproblem(spindle, np.array([frequency]), group)
    index = int(problem.pick(mode)[0])
    if index < 0:
        raise _unreachable(spindle, frequency, mode, group)
    factor = float(-1 / problem.values[0, index])
    sensitivity = _sensitivity(problem, index)
    stiffness = factor * mean_stiffness(spindle, group)
    return Calibration(
        frequency=float(frequency),
        frequency_std=frequency_std,
        mode=mode,
        bearing_stiffness=stiffness,
        bearing_stiffness_std=None if frequency_std is None else stiffness * frequency_std / frequency / sensitivity,
        factor=factor,
        sensitivity=sensitivity,
        given=spindle,
        spindle=_scaled(spindle, factor, group),
    )


def _check(frequency: float, frequency_std: float | None, mode: int) -> None:
    if not (math.isfinite(frequency) and frequency > 0):
        raise ValueError(f"frequency={frequency} Hz is not a finite number > 0")
    if frequency_std is not None and not (math.isfinite(frequency_std) and frequency_std >= 0):
        raise ValueError(f"frequency_std={frequency_std} Hz is not a finite number >= 0")
    if not 1 <= mode <= MOST_MODES:
        raise ValueError(f"mode={mode} is not a number from 1, the lowest, to {MOST_MODES}")


def _sensitivity(problem: BearingEigenproblem, index: int) -> float:
    """d ln f / d ln k: with -1/factor = v^T R v, d(v^T R v)/d(w^2) = -x^T (dK/d w^2) x, x = K^-1 B v."""
    x = problem.response[0] @ problem.vectors[0, :, index]
    slope = -x @ problem.model.dense(problem.w2, derivative=True)[0] @ x
    return float(-problem.values[0, index] / (2 * problem.w2[0] * slope))


def _scaled(spindle: Spindle, factor: float, group: str | None) -> Spindle:
    bearings = list(spindle.bearings)
    for index in calibrated_bearings(spindle, group):
        bearings[index] = replace(bearings[index], stiffness=factor * bearings[index].stiffness)
    return replace(spindle, bearings=bearings)


def _unreachable(spindle: Spindle, frequency: float, mode: int, group: str | None) -> UnreachableFrequencyError:
    chosen = calibrated_bearings(spindle, group)
    soft = [bearing for index, bearing in enumerate(spindle.bearings) if index not in chosen]
    hard = [replace(b, stiffness=math.inf) if i in chosen else b for i, b in enumerate(spindle.bearings)]
    low = float(natural_frequencies(replace(spindle, bearings=soft), mode)[-1])
    high = float(natural_frequencies(replace(spindle, bearings=hard), mode)[-1])
    return UnreachableFrequencyError(
        f"no bearing stiffness puts mode {mode} at {frequency:g} Hz: it lies between {low:.1f} Hz (without these "
        f"bearings) and {high:.1f} Hz (rigid bearings); check the geometry, and which mode was measured",
        (low, high),
    )
