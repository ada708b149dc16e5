"""What becomes of a spindle's modes when its frequency falls further, and when a program will chatter on it."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from acquisition import Remark
from dsm import Calibration, calibrate
from lobes.program import SHARES
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.draws import ProgramDraws

FALLS = np.array([0.0, 0.05, 0.10, 0.15, 0.20])
"""Falls of the frequency for which the model is recalibrated; between them its stiffness is interpolated."""
STEPS = 101
"""Number of looks between no fall and the largest of them ..."""
PARTS = 8
"""... in so many parts, up to the one with the first chatter."""
KEPT = 8
"""Number of calibrated models whose answers are kept, those asked for last."""

StiffnessAt = Callable[[float], float]


def softening(assembly: Assembly) -> tuple[StiffnessAt, Remark]:
    """Stiffness over that of now as a function of the fall of the frequency, and the assumption in words.

    All modes fall alike. K follows the model (bearings softer until its frequency has fallen as far); without a model
    it stays.
    """
    ratios = np.ones(1) if assembly.calibration is None else _stiffness_ratios(assembly.calibration)
    clause = "stiffness does not (no model)"
    if ratios.size > 1:
        fall, change = 100 * FALLS[ratios.size - 1], 100 * (ratios[-1] - 1)
        clause = f"stiffness changes as in the model ({change:+.1f} % when the frequency has fallen by {fall:.0f} %)"
    text = f"fall left: all modes fall alike, damping does not change, {clause}"

    def stiffness_at(fall: float) -> float:
        return float(np.interp(fall, FALLS[: ratios.size], ratios))

    return stiffness_at, Remark("decay-assumption", assembly.tool, text)


@lru_cache(maxsize=KEPT)
def _stiffness_ratios(calibration: Calibration) -> NDArray[np.float64]:
    """Modal stiffness at the tip for each of FALLS over that for none, as far as softer bearings can bring about."""
    stiffness: list[float] = []
    for fall in FALLS:
        try:
            softer = calibrate(calibration.spindle, calibration.frequency * (1 - fall), mode=calibration.mode)
            stiffness.append(softer.modal_stiffness_after)
        except (ValueError, ArithmeticError):
            break
    return np.array(stiffness or [1.0]) / (stiffness or [1.0])[0]


def age(draws: ProgramDraws, falls: NDArray[np.float64], stiffness_at: StiffnessAt) -> ProgramDraws:
    """All draws with all frequencies fallen by each of these shares (k,), one after the other."""
    return draws.swept(np.ones(falls.size), 1 - falls, np.array([stiffness_at(fall) for fall in falls.tolist()]))


def tolerable_decay(draws: ProgramDraws, depth: float, stiffness_at: StiffnessAt) -> float:
    """Largest fall of the frequency, relative, up to which a depth (m) stays stable in the middle of the doubt.

    0.0 where it is unstable now, inf where nothing happens down to 80 %. Looks every 0.2 % of fall.
    """
    falls, worst = np.linspace(0, FALLS[-1], STEPS), np.empty(0)
    for part in np.array_split(falls, PARTS):
        middle = age(draws[np.array([0])], part, stiffness_at)
        worst = np.append(worst, np.max(middle.growth(depth * np.array(SHARES)), axis=1))
        if np.any(worst >= 0):
            break
    else:
        return math.inf
    first = int(np.argmax(worst >= 0))
    if first == 0:
        return 0.0
    before, after = worst[first - 1], worst[first]
    return float(falls[first - 1] + (falls[first] - falls[first - 1]) * before / (before - after))
