"""Room around a setting: slower and faster speeds, more depth and falls of the frequency at which it is safe too.

The depth that only just is safe is so at one speed alone: the tip of a pocket has no width. A setting is recommended
where there is room on all sides, and no nearer to an edge.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lobewatch.machine.settings.cut_range import RPM, CutRange
from lobewatch.verdicts.aging import StiffnessAt
from lobewatch.verdicts.draws import ProgramDraws

EDGE, WIDEST, PARTS = 0.005, 10, 2
"""Relative step of a window of speeds, most steps on each side, and parts in which they are looked at."""
APART = (1 + EDGE) ** 2
"""Factor of the speed, slower and faster, up to which a setting must be safe; chosen, as the two below."""
DEEPER = 1.05
"""Factor of the depth up to which it must be ..."""
LEAST_FALL = 0.01
"""... and fall of the frequency that it must stand at least."""
LEFT = np.arange(0, 0.1001, 0.01)
"""Falls of the frequency that a setting is looked at with; more than the last is not told apart."""

Floats = NDArray[np.float64]


def at_ends(draws: ProgramDraws, fall: float, stiffness_at: StiffnessAt) -> ProgramDraws:
    """All draws at the slower speed, then after the fall: the ends of what must be safe."""
    return _moved(draws, [1 / APART, 1], [0, fall], stiffness_at)


def all_around(draws: ProgramDraws, fall: float, stiffness_at: StiffnessAt) -> ProgramDraws:
    """All draws at these ends, after half of the fall, and at the faster speed."""
    return _moved(draws, [1 / APART, 1, 1, APART], [0, fall, fall / 2, 0], stiffness_at)


def _moved(draws: ProgramDraws, speeds: list[float], falls: list[float], stiffness_at: StiffnessAt) -> ProgramDraws:
    stiffness = np.array([stiffness_at(fall) for fall in falls])
    return draws.swept(np.array(speeds), 1 - np.array(falls), stiffness)


def window_rpm(
    near: ProgramDraws, hardest: ProgramDraws, speed: float, depth: float, reach: CutRange
) -> tuple[float, float]:
    """Slowest and fastest speed (rpm) around one up to which a depth (m) is safe on all draws."""
    steps = np.arange(WIDEST + 1.0)
    slow, fast = (_last_calm(near, hardest, np.power(1 + EDGE, sign * steps), depth) for sign in (-1, 1))
    slowest, fastest = max(speed * slow, reach.low_rpm), min(speed * fast, reach.high_rpm)
    return min(math.ceil(slowest / RPM) * RPM, speed), max(math.floor(fastest / RPM) * RPM, speed)


def frequency_left(hardest: ProgramDraws, depth: float, stiffness_at: StiffnessAt) -> float:
    """Fall of the frequency, relative, up to which a depth (m) is safe on these draws."""
    grown = _moved(hardest, [1.0] * LEFT.size, LEFT.tolist(), stiffness_at).growth_that_counts(depth)
    return float(LEFT[_calm_from_the_first(grown.reshape(LEFT.size, -1))])


def _last_calm(near: ProgramDraws, hardest: ProgramDraws, ratio: Floats, depth: float) -> float:
    """The last of these speeds, over the present one, which is the first, up to which all draws are stable."""
    last = 0
    for steps in np.array_split(np.arange(1, ratio.size), PARTS):
        grown = hardest.swept(ratio[steps]).growth_that_counts(depth).reshape(steps.size, -1)
        last += _calm_from_the_first(np.vstack((np.full(len(hardest.rows), -np.inf), grown)))
        if last < steps[-1]:
            break
    while last > 0 and np.any(near.at(speed=float(ratio[last])).growth_that_counts(depth) >= 0):
        last //= 2
    return float(ratio[last])


def _calm_from_the_first(grown: Floats) -> int:
    """Row up to which all of growth (k, draws) is negative from the first on."""
    calm = np.all(grown < 0, axis=1)
    return calm.size - 1 if np.all(calm) else max(int(np.argmin(calm)) - 1, 0)
