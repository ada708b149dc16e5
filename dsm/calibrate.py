"""Bearing stiffness from one measured natural frequency."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from dsm.calibration import Calibration, UnreachableFrequencyError
from dsm.find_modes import find_modes
from dsm.modal_stiffness import modal_stiffness
from dsm.modes import Modes
from dsm.natural_frequencies import natural_frequencies
from dsm.spindle import Spindle
from dsm.static_stiffness import static_stiffness
from dsm.stiffness_factor import stiffness_factor


def calibrate(spindle: Spindle, frequency: float, frequency_std: float | None = None, mode: int = 1) -> Calibration:
    """Scale all bearing stiffnesses by one factor, so that a mode (1 is the lowest) has its measured frequency (Hz).

    The given stiffnesses say only in which ratio the bearings share; equal ones make one unknown stiffness of them.
    The factor is exact, from an eigenvalue problem of the order of the number of bearings; its standard error follows
    from that of the frequency (`frequency_std`, Hz) by the chain rule.

    Raises UnreachableFrequencyError where the frequency lies outside what free to rigid bearings allow, ValueError
    for a frequency not > 0 and for fewer than two bearings.
    """
    _check(frequency, frequency_std, mode)
    static_before = static_stiffness(spindle)
    factor = float(stiffness_factor(spindle, frequency, mode)[0])
    if math.isnan(factor):
        raise _unreachable(spindle, frequency, mode)
    bearings = [replace(bearing, stiffness=factor * bearing.stiffness) for bearing in spindle.bearings]
    after = replace(spindle, bearings=bearings)
    modes = find_modes(after, mode)
    sensitivity = _sensitivity(after, modes)
    stiffness = after.mean_bearing_stiffness
    return Calibration(
        frequency=float(frequency),
        mode=mode,
        bearing_stiffness=stiffness,
        bearing_stiffness_std=None if frequency_std is None else stiffness * frequency_std / frequency / sensitivity,
        factor=factor,
        sensitivity=sensitivity,
        residual=float(modes.frequency[-1]) - frequency,
        static_stiffness_before=static_before,
        static_stiffness_after=static_stiffness(after),
        modal_stiffness_before=modal_stiffness(spindle, mode),
        modal_stiffness_after=float(modes.stiffness_at(0.0)[-1]),
        spindle=after,
    )


def _check(frequency: float, frequency_std: float | None, mode: int) -> None:
    if not (math.isfinite(frequency) and frequency > 0):
        raise ValueError(f"frequency={frequency} Hz is not a finite number > 0")
    if frequency_std is not None and not (math.isfinite(frequency_std) and frequency_std >= 0):
        raise ValueError(f"frequency_std={frequency_std} Hz is not a finite number >= 0")
    if mode < 1:
        raise ValueError(f"mode={mode} is not at least 1, the lowest")


def _sensitivity(spindle: Spindle, modes: Modes) -> float:
    """d ln f / d ln k of the last mode: sum of k phi^2 over the bearings, over 2 w^2; phi of unit modal mass."""
    energy = sum(b.stiffness * modes.deflection_at(b.position)[-1] ** 2 for b in spindle.bearings)
    return float(energy / (2 * (2 * np.pi * modes.frequency[-1]) ** 2))


def _unreachable(spindle: Spindle, frequency: float, mode: int) -> UnreachableFrequencyError:
    low = float(natural_frequencies(replace(spindle, bearings=()), mode)[-1])
    high = float(natural_frequencies(spindle, mode, rigid_bearings=True)[-1])
    return UnreachableFrequencyError(
        f"no bearing stiffness puts mode {mode} at {frequency:g} Hz: it lies between {low:.1f} Hz (free shaft) and "
        f"{high:.1f} Hz (rigid bearings); check the geometry, and which mode was measured",
        (low, high),
    )
