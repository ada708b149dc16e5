"""The stability limit of milling over spindle speed, by semi-discretisation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobes.chatter_frequency import chatter_frequency
from lobes.crossings import Growth, find_crossings
from lobes.cut import Cut
from lobes.floquet import MillingRows, largest_multipliers, piece_numbers, rows_of
from lobes.milling_system import MillingSystem, milling_system
from lobes.speeds import check_speeds
from lobes.stability_lobes import StabilityLobes
from modal import Mode

REAL = 1e-4
"""A multiplier whose angle is this near to pi (rad) is real."""
LIMITS = (1e-300, 1e300)
"""Magnitudes of multipliers that are told apart."""
SETTLED = 0.0025
"""A limit has settled where twice as many pieces find the cut stable this much below it, and unstable above."""
DOUBLINGS = 4
"""Of the pieces, at most. A kind that is open then stays so: at crawling speeds multipliers of all angles crowd."""

Floats = NDArray[np.float64]
Numbers = NDArray[np.int64]


def stability_boundary(
    x: Sequence[Mode] | None, y: Sequence[Mode] | None, cut: Cut, speed_rpm: ArrayLike, max_depth: float
) -> StabilityLobes:
    """Depths (m) up to max_depth at each speed (rpm) where milling changes from stable to unstable or back.

    x and y are directions of the machine; None stands for one that is rigid. `depth` is the lowest crossing, inf where
    there is none; `crossings` are all, islands too. `kind` is "flip" where the multiplier is -1 (period two), else
    "hopf"; the chatter frequency is the loudest of those that the multiplier leaves. The tooth period is divided into
    pieces for all modes that count, and again twice as finely until limits and kinds have settled within 0.25 %;
    `detail` states how many that took.

    Raises ValueError for bad speeds, depths or modes, ArithmeticError where a limit does not settle.
    Source: Insperger & Stepan, Semi-Discretization for Time-Delay Systems, Springer 2011, with a high order
    (`lobes.floquet.period_map`).
    """
    system, speed = milling_system(x, y), check_speeds(speed_rpm)
    if not (np.isfinite(max_depth) and max_depth > 0):
        raise ValueError(f"max_depth={max_depth} m is not a finite depth > 0; give the deepest cut of interest")
    rows = rows_of(system, cut, speed)
    crossings, number = _settled(rows, float(max_depth))
    depth = crossings[:, 0]
    chatter, kind = np.full(speed.shape, np.nan), np.full(speed.shape, "", dtype="<U4")
    found = np.flatnonzero(np.isfinite(depth))
    if found.size:
        chatter[found], kind[found] = _sound(system, rows[found], depth[found], number[found])
    low, high = int(np.min(number)), int(np.max(number))
    return StabilityLobes(
        speed_rpm=speed,
        depth=depth,
        chatter_frequency=chatter,
        kind=kind,
        crossings=crossings,
        method="semi-discretisation",
        detail=f"{low if low == high else f'{low} to {high}'} pieces of order 16 a tooth period",
    )


def _settled(rows: MillingRows, max_depth: float) -> tuple[Floats, Numbers]:
    """All crossings (r, k) and the pieces (r,) with which each lowest one has settled."""
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
    found = np.flatnonzero(np.isfinite(depth))
    if found.size:
        around = depth[found, np.newaxis] * (1 + SETTLED * np.array([-1.0, 1.0]))
        fine = largest_multipliers(rows[found], around, 2 * number[found], SETTLED * 1e-2)
        coarse = largest_multipliers(rows[found], around[:, 1:], number[found], SETTLED * 1e-2)
        limit[found] = (np.abs(fine[:, 0]) < 1) & (np.abs(fine[:, 1]) > 1)
        kind[found] = _is_flip(fine[:, 1]) == _is_flip(coarse[:, 0])
    return limit, kind


def _widened(table: Floats, width: int) -> Floats:
    return np.pad(table, ((0, 0), (0, width - table.shape[1])), constant_values=np.inf)


def _is_flip(multiplier: NDArray[np.complex128]) -> NDArray[np.bool_]:
    return np.asarray(np.abs(np.abs(np.angle(multiplier)) - np.pi) < REAL)


def _sound(system: MillingSystem, rows: MillingRows, depth: Floats, number: Numbers) -> tuple[Floats, NDArray[np.str_]]:
    """Chatter frequency (Hz) and kind at limits (r,)."""
    multiplier = largest_multipliers(rows, depth[:, np.newaxis], number)[:, 0]
    chatter = chatter_frequency(system, rows.cut, multiplier, depth, 1 / rows.tooth_period)
    return chatter, np.where(_is_flip(multiplier), "flip", "hopf")


def _growth(rows: MillingRows, number: Numbers) -> Growth:
    """Logarithm of the largest multiplier's magnitude at some rows (s,) and depths (s, d)."""

    def growth(row: NDArray[np.intp], depth: Floats, tolerance: float) -> Floats:
        multiplier = largest_multipliers(rows[row], depth, number[row], tolerance)
        return np.asarray(np.log(np.clip(np.abs(multiplier), *LIMITS)))

    return growth
