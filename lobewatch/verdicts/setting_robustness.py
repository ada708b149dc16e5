"""Robustness of a setting against changes of speed, depth and natural frequency.

The depth that only just is safe is so at one speed alone: the tip of a pocket has no width. A setting is recommended
where there is room on all sides, and no nearer to an edge.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lobewatch.arrays import Floats
from lobewatch.machine import Machine
from lobewatch.machine.settings.cut_range import SPEED_STEP_RPM, CutRange
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.tap_series import expected_frequency_drop
from lobewatch.verdicts.frequency_drop import StiffnessAt
from lobewatch.verdicts.program_samples import ProgramSamples


@dataclass(frozen=True)
class Setting:
    """Speed and depth that would be called stable."""

    speed_rpm: float
    """Spindle speed (rpm), in steps of 10 unless it is the program's own."""
    depth_mm: float
    """Axial depth (mm), in steps of 0.05 unless it is the program's own."""
    window_rpm: tuple[float, float]
    """Slowest and fastest neighboring speed at which the depth would also be called stable (rpm)."""
    depth_margin: float
    """Depth margin: median limit over depth, less 1."""
    drop_margin: float
    """Relative frequency drop up to which it stays stable; 0.1 means 0.1 or more."""


WINDOW_SPEED_STEP, MAX_WINDOW_STEPS, N_WINDOW_PARTS = 0.005, 10, 2
"""Relative step of a speed window, largest number of steps on each side, and parts in which they are checked."""
ROBUST_SPEED_FACTOR = (1 + WINDOW_SPEED_STEP) ** 2
"""Speed factor in both directions within which a setting must be safe; chosen."""
ROBUST_DEPTH_FACTOR = 1.05
"""Depth factor up to which a setting must be safe; chosen."""
MIN_DEPTH_MARGIN = 0.20
"""Smallest depth margin of a recommended setting in the median estimate; chosen."""
MIN_ROBUST_DROP = 0.01
"""Smallest frequency drop at which a recommended setting must stay stable."""
CHECKED_DROPS = np.arange(0, 0.1001, 0.01)
"""Relative frequency drops at which a setting is checked."""


def sweep_extremes(samples: ProgramSamples, drop: float, stiffness_at: StiffnessAt) -> ProgramSamples:
    """Sweep all samples over the extremes: the slower speed, and the frequency drop."""
    return _sweep_speeds_and_drops(samples, [1 / ROBUST_SPEED_FACTOR, 1], [0, drop], stiffness_at)


def sweep_neighborhood(samples: ProgramSamples, drop: float, stiffness_at: StiffnessAt) -> ProgramSamples:
    """Sweep all samples over both speeds, the frequency drop and half of it."""
    return _sweep_speeds_and_drops(
        samples, [1 / ROBUST_SPEED_FACTOR, 1, 1, ROBUST_SPEED_FACTOR], [0, drop, drop / 2, 0], stiffness_at
    )


def _sweep_speeds_and_drops(
    samples: ProgramSamples, speeds: list[float], drops: list[float], stiffness_at: StiffnessAt
) -> ProgramSamples:
    stiffness = np.array([stiffness_at(drop) for drop in drops])
    return samples.sweep(np.array(speeds), 1 - np.array(drops), stiffness)


def find_speed_window(
    near: ProgramSamples, hardest: ProgramSamples, speed: float, depth: float, reach: CutRange
) -> tuple[float, float]:
    """Find the slowest and fastest speed (rpm) at which a depth (m) is stable on all samples."""
    steps = np.arange(MAX_WINDOW_STEPS + 1.0)
    slow, fast = (
        _last_stable_ratio(near, hardest, np.power(1 + WINDOW_SPEED_STEP, sign * steps), depth) for sign in (-1, 1)
    )
    slowest, fastest = max(speed * slow, reach.low_rpm), min(speed * fast, reach.high_rpm)
    return min(math.ceil(slowest / SPEED_STEP_RPM) * SPEED_STEP_RPM, speed), max(
        math.floor(fastest / SPEED_STEP_RPM) * SPEED_STEP_RPM, speed
    )


def find_drop_margin(hardest: ProgramSamples, depth: float, stiffness_at: StiffnessAt) -> float:
    """Find the relative frequency drop up to which a depth (m) is stable on these samples."""
    grown = _sweep_speeds_and_drops(
        hardest, [1.0] * CHECKED_DROPS.size, CHECKED_DROPS.tolist(), stiffness_at
    ).critical_growth(depth)
    return float(CHECKED_DROPS[_last_stable_row(grown.reshape(CHECKED_DROPS.size, -1))])


def _last_stable_ratio(near: ProgramSamples, hardest: ProgramSamples, ratio: Floats, depth: float) -> float:
    """Return the last relative speed up to which all samples are stable."""
    last = 0
    for steps in np.array_split(np.arange(1, ratio.size), N_WINDOW_PARTS):
        grown = hardest.sweep(ratio[steps]).critical_growth(depth).reshape(steps.size, -1)
        last += _last_stable_row(np.vstack((np.full(len(hardest.rows), -np.inf), grown)))
        if last < steps[-1]:
            break
    while last > 0 and np.any(near.scale(speed=float(ratio[last])).critical_growth(depth) >= 0):
        last //= 2
    return float(ratio[last])


def _last_stable_row(grown: Floats) -> int:
    """Return the row up to which all of growth (k, samples) is negative from the first on."""
    calm = np.all(grown < 0, axis=1)
    return calm.size - 1 if np.all(calm) else max(int(np.argmin(calm)) - 1, 0)


N_TAP_INTERVALS = 2
"""Number of tap intervals for which a setting must stay stable."""
DEFAULT_NEEDED_DROP = 0.02
"""Frequency drop at which a setting must stay stable if no trend is known; chosen."""


def find_needed_drop(assembly: Assembly, machine: Machine) -> float:
    """Return the frequency drop that a recommended setting must tolerate: two tap intervals at the rate so far."""
    days = N_TAP_INTERVALS * machine.machine.tap_interval_days
    drops = [expected_frequency_drop(series, days) for series in assembly.series.values()]
    return max(
        (DEFAULT_NEEDED_DROP if drop is None else max(drop, MIN_ROBUST_DROP) for drop in drops),
        default=DEFAULT_NEEDED_DROP,
    )
