"""Whether a program is stable, and the deepest stable depth at its speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobes.floquet.growth import growth
from lobes.floquet.milling_rows import MillingRows, rows_of
from lobes.floquet.settled_crossings import settled_crossings
from lobes.floquet.stability_boundary import chatter_at
from lobes.milling_system import milling_system
from lobes.program import SHARES, Modes, Program
from lobes.stability_lobes import MethodName

DEEPEST = 20.0
"""Limits are looked for up to this many times the depth of the program."""


@dataclass(frozen=True)
class ProgramLimit:
    """How one program stands on one spindle, in the direction of feed that is worst."""

    stable: bool
    """Whether its depth lies below the limit at its speed, and the multipliers at its depth below 1."""
    limit: float
    """Deepest stable depth at its speed (m); inf where there is none up to 20 times its own depth."""
    chatter_frequency: float
    """Frequency that is heard at the limit (Hz); nan where there is none."""
    kind: str
    """Kind of instability: "hopf", "flip" or ""."""
    method: MethodName
    """Method it was found by."""
    detail: str
    """Detail of the method: into how many pieces the tooth period was divided."""
    pieces: int
    """The same as a number."""
    feed_angle: float
    """Angle from x to the feed that is worst (rad)."""
    limits: tuple[float, ...]
    """The limits for each direction of feed (m)."""


def program_limit(
    program: Program,
    x: Modes,
    y: Modes,
    feed_angles: Sequence[float] | None = None,
    vectors: ArrayLike | None = None,
) -> ProgramLimit:
    """State and limit of a program by semi-discretisation, in the worst of its directions of feed.

    feed_angles: from x (rad); None: that of its cut. vectors: directions (n, 2) of the modes of x, then of y, where
    they lie askew (`milling_system`). Raises ValueError for bad modes or vectors.
    """
    angles = np.array([program.cut.feed_angle] if feed_angles is None else feed_angles)
    system = milling_system(x, y, vectors)
    rows = replace(rows_of(system, program.cut, np.full(angles.size, program.speed_rpm)), feed_angle=angles)
    crossings, number = settled_crossings(rows, DEEPEST * program.depth)
    unstable = _unstable(rows, program, number)
    limit = np.where(unstable, np.minimum(crossings[:, 0], program.depth), crossings[:, 0])
    worst = int(np.argmin(limit))
    chatter, kind = np.array([np.nan]), np.array([""])
    if np.isfinite(crossings[worst, 0]):
        row = slice(worst, worst + 1)
        cut = replace(program.cut, feed_angle=float(angles[worst]))
        chatter, kind = chatter_at(system, replace(rows[row], cut=cut), crossings[row, 0], number[row])
    return ProgramLimit(
        stable=program.depth < limit[worst],
        limit=float(limit[worst]),
        chatter_frequency=float(chatter[0]),
        kind=str(kind[0]),
        method="semi-discretisation",
        detail=f"{number[worst]} pieces of order 16 a tooth period",
        pieces=int(np.max(number)),
        feed_angle=float(angles[worst]),
        limits=tuple(limit.tolist()),
    )


def _unstable(rows: MillingRows, program: Program, number: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether the program is unstable at its depth or a share of it, shape (r,)."""
    depths = np.broadcast_to(program.depth * np.array(SHARES), (len(rows), len(SHARES)))
    return np.asarray(np.any(growth(rows, depths, number) >= 0, axis=1))
