"""Bearing stiffness from one measured natural frequency."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsm.calibration.bearing_eigenproblem import BearingEigenproblem, bearing_eigenproblem
from dsm.calibration.calibration import Calibration, UnreachableFrequencyError
from dsm.calibration.stiffness_groups import parts_stiffness, scale_parts
from dsm.modes.find_modes import MOST_MODES
from dsm.modes.natural_frequencies import natural_frequencies
from dsm.spindle.spindle import Spindle

LOOSE = 1e-9
"""Factor on the stiffness of a joint that stands for none."""
IN_95_PERCENT = 1.96
"""Standard errors either way that 95 % stay within."""


def calibrate(
    spindle: Spindle,
    frequency: float,
    frequency_std: float | None = None,
    mode: int = 1,
    group: str | None = None,
) -> Calibration:
    """Scale bearing stiffnesses by one factor, so that a mode (1 is the lowest) has its measured frequency (Hz).

    The given stiffnesses say only in which ratio the bearings share; equal ones make one unknown stiffness of them.
    group: the bearings and joints that are scaled; None: all bearings that have a group, and no joint, whose wear one
    frequency cannot tell from theirs (fit_stiffness with several can, and takes all groups). The factor is exact, from
    an eigenvalue problem of the order of the number of bearings, and a count of modes says which eigenvalue it is; its
    standard error follows from that of the frequency (`frequency_std`, Hz) by the chain rule. Near the limit of rigid
    bearings the frequency is straight in 1/k, not in k: the 95 % interval of the stiffness is that of the frequency,
    end by end. Stiffness of bearings against tilting and of the housing stays as it is.

    Raises UnreachableFrequencyError where the frequency lies outside what the springs can do, ValueError for a
    frequency not > 0, a shaft that is not held, and a group with no bearing or a rigid one.

    Bearings that left the works with 250 N/um, and the frequency of a spindle that has run for some years:

    >>> new = Spindle([Segment(0.1, 0.03), Segment(0.4, 0.06)], [Bearing(0.15, 2.5e8), Bearing(0.4, 2.5e8)])
    >>> measured = 0.95 * natural_frequencies(new, 1)[0]
    >>> now = calibrate(new, measured, frequency_std=2.0)
    >>> plus_minus(now.bearing_stiffness, now.bearing_stiffness_std, 1e6, "N/um"), round(now.factor, 3)
    ('222.2 ± 1.0 N/um', 0.889)
    >>> abs(now.residual) < 1e-6  # Hz: solved anew
    True
    """
    _check(frequency, frequency_std, mode)
    problem = bearing_eigenproblem(spindle, _with_ends(frequency, frequency_std), group)
    index = int(problem.pick(mode)[0])
    chosen = problem.springs.parts
    if index < 0:
        raise _unreachable(spindle, frequency, mode, chosen)
    factor, sensitivity = float(-1 / problem.values[0, index]), problem.sensitivity(index)
    stiffness = factor * parts_stiffness(spindle, chosen)
    return Calibration(
        frequency=float(frequency),
        frequency_std=frequency_std,
        mode=mode,
        bearing_stiffness=stiffness,
        bearing_stiffness_std=None if frequency_std is None else stiffness * frequency_std / frequency / sensitivity,
        bearing_stiffness_interval=None if frequency_std is None else _interval(problem, mode, stiffness / factor),
        factor=factor,
        sensitivity=sensitivity,
        given=spindle,
        parts=chosen,
    )


def _check(frequency: float, frequency_std: float | None, mode: int) -> None:
    if not (math.isfinite(frequency) and frequency > 0):
        raise ValueError(f"frequency={frequency} Hz is not a finite number > 0")
    if frequency_std is not None and not (math.isfinite(frequency_std) and frequency_std >= 0):
        raise ValueError(f"frequency_std={frequency_std} Hz is not a finite number >= 0")
    if not 1 <= mode <= MOST_MODES:
        raise ValueError(f"mode={mode} is not a number from 1, the lowest, to {MOST_MODES}")


def _with_ends(frequency: float, frequency_std: float | None) -> NDArray[np.float64]:
    """The frequency, and the ends of its 95 % interval (Hz)."""
    if frequency_std is None:
        return np.array([frequency])
    half = IN_95_PERCENT * frequency_std
    return np.array([frequency, max(frequency - half, LOOSE * frequency), frequency + half])


def _interval(problem: BearingEigenproblem, mode: int, start: float) -> tuple[float, float]:
    """Stiffnesses (N/m) for the second and third frequency; 0 and inf where none is as soft or stiff as that."""
    low, high = problem.pick(mode)[1:].tolist()
    return (
        0.0 if low < 0 else float(-start / problem.values[1, low]),
        math.inf if high < 0 else float(-start / problem.values[2, high]),
    )


def _unreachable(spindle: Spindle, frequency: float, mode: int, chosen: Sequence[int]) -> UnreachableFrequencyError:
    low, high = (float(natural_frequencies(limit, mode)[-1]) for limit in _limits(spindle, chosen))
    return UnreachableFrequencyError(
        f"no bearing stiffness puts mode {mode} at {frequency:g} Hz: it lies between {low:.1f} Hz (without these "
        f"bearings) and {high:.1f} Hz (rigid bearings); check the geometry, and which mode was measured",
        (low, high),
    )


def _limits(spindle: Spindle, chosen: Sequence[int]) -> tuple[Spindle, Spindle]:
    """Without the calibrated parts and with rigid ones; a joint is next to nothing, or not there."""
    count = len(spindle.bearings)
    soft = [bearing for index, bearing in enumerate(spindle.bearings) if index not in chosen]
    hard = [replace(b, stiffness=math.inf) if i in chosen else b for i, b in enumerate(spindle.bearings)]
    loose = scale_parts(spindle, [index for index in chosen if index >= count], LOOSE).joints
    fast = [joint for index, joint in enumerate(spindle.joints, count) if index not in chosen]
    return replace(spindle, bearings=soft, joints=loose), replace(spindle, bearings=hard, joints=fast)
