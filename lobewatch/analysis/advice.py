"""What a programmer should know beyond the verdict: how sure the limit is, where to go, how much decay is left."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition import Remark
from dsm import Calibration, calibrate
from lobes import StabilityLobes, aged_mode, measurement_band, nearest_speed, stability_boundary, tolerable_decay
from lobes.program_limit import DEEPEST
from lobewatch.analysis.assembly import Assembly, Modes, speed_grid
from lobewatch.analysis.verdict import Verdict, as_program
from lobewatch.machine import Machine, drive_limit

FALLS = np.array([0.0, 0.05, 0.10, 0.15, 0.20])
"""Falls of the frequency for which the model is recalibrated; between them its stiffness is interpolated."""

ModesAt = Callable[[float], tuple[Modes, Modes]]


@dataclass(frozen=True)
class Advice:
    """What goes beyond stable or not."""

    limit_band: tuple[float, float] = (math.nan, math.nan)
    """95 % band of the limit from the covariance of the modes (m); NaN where they have none."""
    nearest_speed: float | None = None
    """Nearest speed at which the same depth is of the other state (rpm): where an unstable program becomes stable, or
    a stable one unstable. None where no speed of the range is, or none that the drive allows."""
    decay: float = math.nan
    """Tolerable fall of the frequency, relative; 0 where it is not stable now, inf where nothing happens down to 80 %,
    NaN where the program could not be checked."""
    remarks: tuple[Remark, ...] = ()
    """What the decay rests on."""

    def speed_margin(self, speed_rpm: float) -> float:
        """Relative distance from a speed (rpm) to the nearest one of the other state; inf where there is none."""
        return math.inf if self.nearest_speed is None else abs(self.nearest_speed / speed_rpm - 1)


def advise(verdict: Verdict, machine: Machine) -> Advice:
    """Advice beside a verdict; empty where it is unknown."""
    assembly = verdict.assembly
    if verdict.stable is None or assembly is None:
        return Advice()
    band, nearest = _band(verdict, assembly, machine), _nearest(verdict, assembly, machine)
    if not verdict.stable:
        return Advice(band, nearest, 0.0)
    modes_at, remark = aging(assembly)
    return Advice(band, nearest, tolerable_decay(as_program(verdict.program, machine), modes_at), (remark,))


def aging(assembly: Assembly) -> tuple[ModesAt, Remark]:
    """The modes of an assembly as functions of a frequency ratio, all falling alike, and the assumption in words.

    K follows the model (bearings softer until its frequency has fallen as far); without a model it stays.
    """
    ratios = np.ones(1) if assembly.calibration is None else _stiffness_ratios(assembly.calibration)

    def modes_at(ratio: float) -> tuple[Modes, Modes]:
        softer = float(np.interp(1 - ratio, FALLS[: ratios.size], ratios)) if ratios.size > 1 else None
        x, y = (
            [aged_mode(mode, ratio, "model", softer) for mode in modes] if modes else None
            for modes in (assembly.x, assembly.y)
        )
        return x, y

    said = "K does not (no model)"
    if ratios.size > 1:
        fall, change = 100 * FALLS[ratios.size - 1], 100 * (ratios[-1] - 1)
        said = f"K changes as in the model ({change:+.1f} % when f_n has fallen by {fall:.0f} %)"
    text = f"decay left: all modes fall alike, zeta does not change, {said}"
    return modes_at, Remark("decay-assumption", assembly.tool, text)


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


def _nearest(verdict: Verdict, assembly: Assembly, machine: Machine) -> float | None:
    program, speeds = as_program(verdict.program, machine), speed_grid(machine)
    if not verdict.stable:
        speeds = speeds[drive_limit(machine, verdict.program, speeds) >= program.depth]
    return nearest_speed(program, assembly.x, assembly.y, speeds, not verdict.stable) if speeds.size else None


def _band(verdict: Verdict, assembly: Assembly, machine: Machine) -> tuple[float, float]:
    if not np.isfinite(verdict.limit):
        return verdict.limit, verdict.limit
    x, y = assembly.x, assembly.y
    if all(mode.best_covariance is None for mode in (*(x or ()), *(y or ()))):
        return math.nan, math.nan
    program = as_program(verdict.program, machine)

    def limits(x: Modes, y: Modes) -> StabilityLobes:
        return stability_boundary(x, y, program.cut, program.speed_rpm, DEEPEST * program.depth)

    band = measurement_band(limits, x, y)
    return float(band.low[0]), float(band.high[0])
