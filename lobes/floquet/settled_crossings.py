"""Depths at which milling changes between stable and unstable, with pieces enough that they have settled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobes.floquet.crossings import Growth, find_crossings
from lobes.floquet.growth import growth
from lobes.floquet.milling_rows import MillingRows
from lobes.floquet.multipliers import largest_multipliers
from lobes.floquet.pieces import piece_numbers

REAL = 1e-4
"""A multiplier whose angle is this near to pi (rad) is real."""
SETTLED = 0.0025
"""A limit has settled where twice as many pieces find the cut stable this much below it, and unstable above."""
DOUBLINGS = 4
"""Of the pieces, at most. A kind that is open then stays so: at crawling speeds multipliers of all angles crowd."""

Floats = NDArray[np.float64]
Numbers = NDArray[np.int64]


def settled_crossings(rows: MillingRows, max_depth: float) -> tuple[Floats, Numbers]:
    """All crossings up to max_depth (m), rising, filled up with inf, shape (r, k), and the pieces (r,) of each row.

    Raises ArithmeticError where a limit does not settle.
    """
    number = piece_numbers(rows, max_depth)
    crossings = find_crossings(_growth(rows, number), len(rows), max_depth)
    for _ in range(DOUBLINGS):
        limit_holds, kind_holds = _holds(rows, crossings[:, 0], number)
        moved = np.flatnonzero(~(limit_holds & kind_holds))
        if not moved.size:
            return crossings, number
        number[moved] *= 2
        again = find_crossings(_growth(rows[moved], number[moved]), moved.size, max_depth)
        width = max(crossings.shape[1], again.shape[1])
        crossings, again = (_widened(table, width) for table in (crossings, again))
        crossings[moved] = again
    limit_holds, _ = _holds(rows, crossings[:, 0], number)
    if np.all(limit_holds):
        return crossings, number
    speed = rows.speed_rpm[np.flatnonzero(~limit_holds)[0]]
    raise ArithmeticError(f"the limit at {speed:g} rpm has not settled; leave this speed out")


def _holds(rows: MillingRows, depth: Floats, number: Numbers) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether twice as many pieces leave the limit where it is, and its kind, each of shape (r,)."""
    limit, kind = np.ones((2, depth.size), dtype=bool)
    limited = np.flatnonzero(np.isfinite(depth))
    if limited.size:
        around = depth[limited, np.newaxis] * (1 + SETTLED * np.array([-1.0, 1.0]))
        fine = largest_multipliers(rows[limited], around, 2 * number[limited], SETTLED * 1e-2)
        coarse = largest_multipliers(rows[limited], around[:, 1:], number[limited], SETTLED * 1e-2)
        limit[limited] = (np.abs(fine[:, 0]) < 1) & (np.abs(fine[:, 1]) > 1)
        kind[limited] = is_flip(fine[:, 1]) == is_flip(coarse[:, 0])
    return limit, kind


def _widened(table: Floats, width: int) -> Floats:
    return np.pad(table, ((0, 0), (0, width - table.shape[1])), constant_values=np.inf)


def is_flip(multiplier: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Whether each is -1 in its direction: period two."""
    return np.asarray(np.abs(np.abs(np.angle(multiplier)) - np.pi) < REAL)


def _growth(rows: MillingRows, number: Numbers) -> Growth:
    return lambda row, depth, tolerance: growth(rows[row], depth, number[row], tolerance)
