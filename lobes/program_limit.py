"""Whether a program is stable, and the deepest stable depth at its speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lobes.program import Modes, Program, stable_at
from lobes.stability_boundary import stability_boundary
from lobes.stability_lobes import MethodName

DEEPEST = 20.0
"""Limits are looked for up to this many times the depth of the program."""


@dataclass(frozen=True)
class ProgramLimit:
    """How one program stands on one spindle."""

    stable: bool
    """Whether its depth lies below the limit at its speed, and the multipliers at its depth below 1."""
    limit: float
    """Deepest stable depth at its speed (m); inf where there is none up to 20 times its own depth."""
    chatter_frequency: float
    """Frequency that is heard at the limit (Hz); nan where there is none."""
    kind: str
    """"hopf", "flip" or ""."""
    method: MethodName
    """How it was found."""
    detail: str
    """Into how many intervals the tooth period was divided."""


def program_limit(program: Program, x: Modes, y: Modes) -> ProgramLimit:
    """State and limit of a program by semi-discretisation. Raises ValueError for bad modes."""
    lobes = stability_boundary(x, y, program.cut, program.speed_rpm, DEEPEST * program.depth)
    stable = bool(stable_at(program, x, y, np.array([program.speed_rpm]))[0])
    if not stable and lobes.depth[0] > program.depth:
        lobes = stability_boundary(x, y, program.cut, program.speed_rpm, program.depth)
    limit = float(lobes.depth[0]) if stable else min(float(lobes.depth[0]), program.depth)
    return ProgramLimit(
        stable=program.depth < limit,
        limit=limit,
        chatter_frequency=float(lobes.chatter_frequency[0]),
        kind=str(lobes.kind[0]),
        method=lobes.method,
        detail=lobes.detail,
    )
