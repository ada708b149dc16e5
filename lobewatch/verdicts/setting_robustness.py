"""Robustness of a setting against changes of speed, depth and natural frequency.

The depth that only just is safe is so at one speed alone: the tip of a pocket has no width. A setting is recommended
where there is room on all sides, and no nearer to an edge.
"""

import math
from dataclasses import dataclass

import numpy as np

from lobewatch.arrays import Floats
from lobewatch.machine import Machine
from lobewatch.machine.settings.cut_range import SPEED_STEP_RPM, CutRange
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.tap_series import expected_frequency_drop
from lobewatch.verdicts.frequency_drop import StiffnessAt, apply_drops
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
    return apply_drops(samples, np.array([0, drop]), stiffness_at, np.array([1 / ROBUST_SPEED_FACTOR, 1]))


def sweep_neighborhood(samples: ProgramSamples, drop: float, stiffness_at: StiffnessAt) -> ProgramSamples:
    """Sweep all samples over both speeds, the frequency drop and half of it."""
    speeds = np.array([1 / ROBUST_SPEED_FACTOR, 1, 1, ROBUST_SPEED_FACTOR])
    return apply_drops(samples, np.array([0, drop, drop / 2, 0]), stiffness_at, speeds)


def find_speed_window(
    near: ProgramSamples, hardest: ProgramSamples, speed: float, depth: float, reach: CutRange
) -> tuple[float, float]:
    """Find the slowest and fastest speed (rpm) at which a depth (m) is stable on all samples."""
    ratios = (np.power(1 + WINDOW_SPEED_STEP, sign * np.arange(MAX_WINDOW_STEPS + 1.0)) for sign in (-1, 1))
    slow, fast = (_last_stable_ratio(near, hardest, ratio, depth) for ratio in ratios)
    slowest = math.ceil(max(speed * slow, reach.low_rpm) / SPEED_STEP_RPM) * SPEED_STEP_RPM
    fastest = math.floor(min(speed * fast, reach.high_rpm) / SPEED_STEP_RPM) * SPEED_STEP_RPM
    return min(slowest, speed), max(fastest, speed)


def find_drop_margin(hardest: ProgramSamples, depth: float, stiffness_at: StiffnessAt) -> float:
    """Find the relative frequency drop up to which a depth (m) is stable on these samples."""
    grown = apply_drops(hardest, CHECKED_DROPS, stiffness_at).critical_growth(depth)
    return float(CHECKED_DROPS[_last_stable_row(grown.reshape(CHECKED_DROPS.size, -1))])


def _last_stable_ratio(near: ProgramSamples, hardest: ProgramSamples, ratio: Floats, depth: float) -> float:
    """Return the last relative speed up to which all samples are stable."""
    last = 0
    for steps in np.array_split(np.arange(1, ratio.size), N_WINDOW_PARTS):
        grown = hardest.sweep(ratio[steps]).critical_growth(depth).reshape(steps.size, -1)
        last += _last_stable_row(np.vstack((np.full(len(hardest.rows), -np.inf), grown)))
        if last < steps[-1]:
            break
    while last > 0 and np.any(near.sweep(ratio[last : last + 1]).critical_growth(depth) >= 0):
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
    needed = [DEFAULT_NEEDED_DROP if drop is None else max(drop, MIN_ROBUST_DROP) for drop in drops]
    return max(needed, default=DEFAULT_NEEDED_DROP)
