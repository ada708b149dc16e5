"""A program against the stability of its cut: margins, and where to go instead."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobes.nearest_speed import nearest_speed
from lobes.program import Modes, Program
from lobes.program_limit import ProgramLimit, program_limit
from lobes.speeds import check_speeds


@dataclass(frozen=True)
class ProgramCheck:
    """What can be said of one program on one spindle."""

    state: ProgramLimit
    """Its state and limit."""
    nearest_speed: float | None
    """Nearest speed at which the same depth is of the other state (rpm): where an unstable program becomes stable, or
    a stable one unstable. None where no speed of the range is, or none that the drive allows."""
    depth_margin: float
    """Limit over depth, less 1; negative where unstable."""
    speed_margin: float
    """Relative distance to the nearest speed of the other state, > 0; inf where there is none."""

    @property
    def stable(self) -> bool:
        """Whether its depth lies below the limit at its speed."""
        return self.state.stable

    @property
    def limit(self) -> float:
        """Deepest stable depth at its speed (m); inf where there is none up to 20 times its own depth."""
        return self.state.limit

    @property
    def method(self) -> str:
        """How it was found."""
        return self.state.method


def check_program(
    program: Program, x: Modes, y: Modes, speeds_rpm: NDArray[np.float64], deepest: ArrayLike = np.inf
) -> ProgramCheck:
    """Check a program by semi-discretisation; speeds_rpm are those that the machine can run (rpm), shape (n,).

    `deepest` is the cut that the drive allows there (m), a number or (n,): an unstable program is sent nowhere where
    its depth is beyond it. Raises ValueError for bad speeds and modes.
    """
    found = program_limit(program, x, y)
    speeds = check_speeds(speeds_rpm)
    within = speeds if found.stable else speeds[np.broadcast_to(deepest, speeds.shape) >= program.depth]
    nearest = nearest_speed(program, x, y, within, not found.stable) if within.size else None
    return ProgramCheck(
        state=found,
        nearest_speed=nearest,
        depth_margin=found.limit / program.depth - 1,
        speed_margin=float("inf") if nearest is None else abs(nearest / program.speed_rpm - 1),
    )
