"""A program against the stability of its cut: margins, and where to go instead."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobes.program import Modes, Program, stable_at
from lobes.stability_boundary import stability_boundary

DEEPEST = 20.0
"""Limits are looked for up to this many times the depth of the program."""
BLOCK = 48
"""Speeds looked at together, the nearest first."""


@dataclass(frozen=True)
class ProgramCheck:
    """What can be said of one program on one spindle."""

    stable: bool
    """Whether its depth lies below the limit at its speed."""
    limit: float
    """Deepest stable depth at its speed (m); inf where there is none up to 20 times its own depth."""
    chatter_frequency: float
    """Frequency that is heard at the limit (Hz); nan where there is none."""
    kind: str
    """"hopf", "flip" or ""."""
    nearest_speed: float | None
    """Nearest speed at which the same depth is of the other state (rpm): where an unstable program becomes stable, or
    a stable one unstable. None where no speed of the range is."""
    depth_margin: float
    """Limit over depth, less 1; negative where unstable."""
    speed_margin: float
    """Relative distance to the nearest speed of the other state, > 0; inf where there is none."""
    method: str
    """How it was found."""


def check_program(program: Program, x: Modes, y: Modes, speeds_rpm: NDArray[np.float64]) -> ProgramCheck:
    """Check a program by semi-discretisation; speeds_rpm are those that the machine can run (rpm), shape (n,).

    Raises ValueError for bad speeds and modes.
    """
    lobes = stability_boundary(x, y, program.cut, program.speed_rpm, DEEPEST * program.depth)
    limit = float(lobes.depth[0])
    stable = program.depth < limit
    nearest = _nearest(program, x, y, np.asarray(speeds_rpm, dtype=np.float64), not stable)
    return ProgramCheck(
        stable=stable,
        limit=limit,
        chatter_frequency=float(lobes.chatter_frequency[0]),
        kind=str(lobes.kind[0]),
        nearest_speed=nearest,
        depth_margin=limit / program.depth - 1,
        speed_margin=float("inf") if nearest is None else abs(nearest / program.speed_rpm - 1),
        method=lobes.method,
    )


def _nearest(program: Program, x: Modes, y: Modes, speeds: NDArray[np.float64], wanted: bool) -> float | None:
    """The speed nearest to the program's at which its state is as wanted."""
    near = speeds[np.argsort(np.abs(speeds - program.speed_rpm), kind="stable")]
    for block in np.array_split(near, -(-near.size // BLOCK)):
        hits = np.flatnonzero(stable_at(program, x, y, block) == wanted)
        if hits.size:
            return float(block[hits[0]])
    return None
