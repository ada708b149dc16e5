"""The nearest speed at which a program is of another state."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobes.program import Modes, Program, log_radius
from lobes.stability_boundary import stability_boundary

COARSE = 8
"""Every so many speeds are looked at first."""
BLOCK = 48
"""Speeds looked at together, the nearest first."""

Floats = NDArray[np.float64]
Rows = NDArray[np.intp]


def nearest_speed(program: Program, x: Modes, y: Modes, speeds_rpm: Floats, wanted: bool) -> float | None:
    """The speed nearest to the program's at which it is stable (wanted) or unstable; None where none was found.

    Every 8th of speeds_rpm (rpm), shape (n,), is looked at; then, nearest first, those beside the ones that are of the
    wanted state or closer to it than both their neighbours. A stable speed must lie below the limit as well.
    """
    speeds = np.unique(speeds_rpm)
    coarse = np.unique(np.append(np.arange(0, speeds.size, COARSE), speeds.size - 1))
    towards = log_radius(program, x, y, speeds[coarse]) * (1 if wanted else -1)
    padded = np.pad(towards, 1, constant_values=np.inf)
    likely = (towards < 0) | ((towards <= padded[:-2]) & (towards <= padded[2:]))
    beside = np.abs(np.arange(speeds.size)[:, np.newaxis] - coarse[likely]) < COARSE
    near = speeds[np.any(beside, axis=1)]
    near = near[np.argsort(np.abs(near - program.speed_rpm), kind="stable")]
    for block in np.array_split(near, -(-near.size // BLOCK)):
        for speed in block[(log_radius(program, x, y, block) < 0) == wanted]:
            if not wanted or stability_boundary(x, y, program.cut, speed, program.depth).depth[0] == np.inf:
                return float(speed)
    return None
