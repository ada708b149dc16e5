"""Stability of a program, and the largest stable depth at its speed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike

from lobes.cut import CHECKED_DEPTH_SHARES, Cut, Program
from lobes.floquet.crossings import converged_crossings, estimate_limits
from lobes.floquet.milling_rows import MillingRows, join_rows, rows_at_speeds
from lobes.floquet.multipliers import growth_rate
from lobes.floquet.stability_boundary import chatter_at_limits
from lobes.milling_system import MillingSystem, build_milling_system
from lobes.stability_lobes import MethodName
from lobes.tip_response import TipModes
from modal.arrays import Floats

MAX_PROGRAM_DEPTH_RATIO = 20.0
"""Largest searched limit over the depth of the program."""


@dataclass(frozen=True)
class ProgramLimit:
    """Stability of one program on one spindle, for its worst engagement and feed direction."""

    stable: bool
    """True if the depth is below the limit at its speed, and the multipliers at its depth below 1."""
    limit: float
    """Largest stable depth at its speed (m); inf if there is no limit up to 20 times its depth."""
    chatter_frequency: float
    """Dominant chatter frequency at the limit (Hz); nan if there is none."""
    kind: str
    """Kind of instability: "hopf", "flip" or ""."""
    method: MethodName
    """Method of the limit."""
    detail: str
    """Detail of the method: number of pieces of the tooth period."""
    pieces: int
    """Number of pieces."""
    cut: Cut
    """Worst of all cuts of the program."""
    limits: tuple[float, ...]
    """Limits of all cuts (m)."""


def program_limit(
    program: Program, x: TipModes, y: TipModes, cuts: Sequence[Cut] | None = None, vectors: ArrayLike | None = None
) -> ProgramLimit:
    """Compute stability and limit of a program by semi-discretization, for the worst of its cuts.

    Parameters
    ----------
    program : Program
        Cut, speed and depth.
    x, y : sequence of Mode, or None
        Modes of each direction of the machine; None for a rigid direction.
    cuts : sequence of Cut, optional
        Cuts of the program, different in feed angle and immersion only. Default: its cut.
    vectors : array_like, shape (n, 2), optional
        Directions of the modes of x, then of y, with rotated principal directions (`build_milling_system`).

    Returns
    -------
    ProgramLimit
        Stability and limit.

    Raises
    ------
    ValueError
        For invalid modes or vectors.

    Examples
    --------
    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> limit = program_limit(Program(slot, speed_rpm=9000.0, depth=1e-3), [mode], [mode])
    >>> f"{limit.stable}, up to {limit.limit * 1e3:.2f} mm, then {limit.kind} at {limit.chatter_frequency:.0f} Hz"
    'True, up to 1.25 mm, then hopf at 498 Hz'
    """
    cuts, system = cuts or (program.cut,), build_milling_system(x, y, vectors)
    (limit, crossing), number = np.empty((2, len(cuts))), np.empty(len(cuts), dtype=np.int64)
    for places in group_by_engagement(cuts):
        rows = _program_rows(system, program, [cuts[place] for place in places])
        crossings, number[places] = converged_crossings(rows, MAX_PROGRAM_DEPTH_RATIO * program.depth, first_only=True)
        crossing[places] = crossings[:, 0]
        depths = np.broadcast_to(program.depth * np.array(CHECKED_DEPTH_SHARES), (len(rows), len(CHECKED_DEPTH_SHARES)))
        unstable = np.any(growth_rate(rows, depths, number[places]) >= 0, axis=1)
        limit[places] = np.where(unstable, np.minimum(crossing[places], program.depth), crossing[places])
    worst = int(np.argmin(limit))
    row, here = _program_rows(system, program, [cuts[worst]]), slice(worst, worst + 1)
    chatter, kind = chatter_at_limits(system, row, crossing[here], number[here])
    return ProgramLimit(
        stable=program.depth < limit[worst],
        limit=float(limit[worst]),
        chatter_frequency=float(chatter[0]),
        kind=str(kind[0]),
        method="semi-discretisation",
        detail=f"{number[worst]} time steps of order 16 per tooth period",
        pieces=int(np.max(number)),
        cut=cuts[worst],
        limits=tuple(limit.tolist()),
    )


def estimate_program_limits(
    program: Program, x: TipModes, y: TipModes, cuts: Sequence[Cut], vectors: Sequence[ArrayLike]
) -> Floats:
    """Estimate the limits (m) of a program for each of several directions of the modes, in the worst of its cuts.

    They are those of `program_limit` within `ESTIMATE_ACCURACY`, but for slowly converging cuts. vectors: directions of
    the modes of x, then of y, shape (n, 2) each. Returns shape (vectors,).
    """
    systems, limit = [build_milling_system(x, y, each) for each in vectors], np.full(len(vectors), np.inf)
    for places in group_by_engagement(cuts):
        alike = [cuts[place] for place in places]
        rows = reduce(join_rows, (_program_rows(system, program, alike) for system in systems))
        found = estimate_limits(rows, MAX_PROGRAM_DEPTH_RATIO * program.depth).reshape(len(systems), -1)
        limit = np.minimum(limit, np.min(found, axis=1))
    return limit


def group_by_engagement(cuts: Sequence[Cut]) -> list[list[int]]:
    """Group the indices of cuts that differ in their feed angle only."""
    places: dict[Cut, list[int]] = {}
    for place, cut in enumerate(cuts):
        places.setdefault(replace(cut, feed_angle=0.0), []).append(place)
    return list(places.values())


def _program_rows(system: MillingSystem, program: Program, cuts: Sequence[Cut]) -> MillingRows:
    """Return a system at the speed of the program, with cuts that differ in their feed angle only."""
    rows = rows_at_speeds(system, cuts[0], np.full(len(cuts), program.speed_rpm))
    return replace(rows, feed_angle=np.array([cut.feed_angle for cut in cuts]))
