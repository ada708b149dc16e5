"""A program against the stability of its cut: margins, and where to go instead."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobes.nearest_speed import nearest_speed
from lobes.program import Modes, Program, stable_at
from lobes.speeds import check_speeds
from lobes.stability_boundary import stability_boundary
from lobes.stability_lobes import MethodName

DEEPEST = 20.0
"""Limits are looked for up to this many times the depth of the program."""


@dataclass(frozen=True)
class ProgramCheck:
    """What can be said of one program on one spindle."""

    stable: bool
    """Whether its depth lies below the limit at its speed, and the multipliers at its depth below 1."""
    limit: float
    """Deepest stable depth at its speed (m); inf where there is none up to 20 times its own depth."""
    chatter_frequency: float
    """Frequency that is heard at the limit (Hz); nan where there is none."""
    kind: str
    """"hopf", "flip" or ""."""
    nearest_speed: float | None
    """Nearest speed at which the same depth is of the other state (rpm): where an unstable program becomes stable, or
    a stable one unstable. None where no speed of the range is, or none that the drive allows."""
    depth_margin: float
    """Limit over depth, less 1; negative where unstable."""
    speed_margin: float
    """Relative distance to the nearest speed of the other state, > 0; inf where there is none."""
    method: MethodName
    """How it was found."""
    detail: str
    """Into how many intervals the tooth period was divided."""


def check_program(
    program: Program, x: Modes, y: Modes, speeds_rpm: NDArray[np.float64], deepest: ArrayLike = np.inf
) -> ProgramCheck:
    """Check a program by semi-discretisation; speeds_rpm are those that the machine can run (rpm), shape (n,).

    `deepest` is the cut that the drive allows there (m), a number or (n,): an unstable program is sent nowhere where
    its depth is beyond it. Raises ValueError for bad speeds and modes.
    """
    lobes = stability_boundary(x, y, program.cut, program.speed_rpm, DEEPEST * program.depth)
    stable = bool(stable_at(program, x, y, np.array([program.speed_rpm]))[0])
    if not stable and lobes.depth[0] > program.depth:
        lobes = stability_boundary(x, y, program.cut, program.speed_rpm, program.depth)
    limit = float(lobes.depth[0]) if stable else min(float(lobes.depth[0]), program.depth)
    stable = program.depth < limit
    speeds = check_speeds(speeds_rpm)
    within = speeds if stable else speeds[np.broadcast_to(deepest, speeds.shape) >= program.depth]
    nearest = nearest_speed(program, x, y, within, not stable) if within.size else None
    return ProgramCheck(
        stable=stable,
        limit=limit,
        chatter_frequency=float(lobes.chatter_frequency[0]),
        kind=str(lobes.kind[0]),
        nearest_speed=nearest,
        depth_margin=limit / program.depth - 1,
        speed_margin=float("inf") if nearest is None else abs(nearest / program.speed_rpm - 1),
        method=lobes.method,
        detail=lobes.detail,
    )
