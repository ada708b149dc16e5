"""The stability limit of milling over spindle speed, by semi-discretisation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobes.chatter_frequency import chatter_frequency
from lobes.crossings import Growth, find_crossings
from lobes.cut import Cut
from lobes.intervals import chosen_intervals
from lobes.milling_system import MillingSystem, milling_system
from lobes.multipliers import largest_multipliers
from lobes.speeds import check_speeds
from lobes.stability_lobes import StabilityLobes
from modal import Mode

REAL = 1e-4
"""A multiplier whose angle is this near to pi (rad) is real."""

LIMITS = (1e-300, 1e300)
"""Magnitudes of multipliers that are told apart."""

Floats = NDArray[np.float64]


def stability_boundary(
    x: Sequence[Mode] | None,
    y: Sequence[Mode] | None,
    cut: Cut,
    speed_rpm: ArrayLike,
    max_depth: float,
    intervals: int | None = None,
) -> StabilityLobes:
    """Depths (m) up to max_depth at each speed (rpm) where milling changes from stable to unstable or back.

    x is the feed, y the normal to it; None stands for a direction that is rigid or not known. `depth` is the lowest
    crossing, inf where there is none; `crossings` are all, islands too. `kind` is "flip" where the multiplier is -1
    (period two), else "hopf"; the chatter frequency is the loudest of those that the multiplier leaves. `intervals`
    divide the tooth period; None takes `lobes.intervals_needed`, speed by speed; `detail` states them.

    Raises ValueError for bad speeds, depths or modes.
    Source: Insperger & Stepan, Semi-Discretization for Time-Delay Systems, Springer 2011, first order.
    """
    system, speed = milling_system(x, y), check_speeds(speed_rpm)
    if not (np.isfinite(max_depth) and max_depth > 0):
        raise ValueError(f"max_depth={max_depth} m is not a finite depth > 0; give the deepest cut of interest")
    number = chosen_intervals(intervals, system, cut, speed, 0.0)
    crossings = find_crossings(_growth(system, cut, speed, number), speed.size, float(max_depth))
    depth = crossings[:, 0]
    found = np.flatnonzero(np.isfinite(depth))
    chatter, kind = np.full(speed.shape, np.nan), np.full(speed.shape, "", dtype="<U4")
    if found.size:
        at = depth[found, np.newaxis]
        multiplier = largest_multipliers(system, cut, speed[found], at, number[found])[:, 0]
        chatter[found] = chatter_frequency(system, cut, multiplier, depth[found], cut.teeth * speed[found] / 60)
        flip = np.abs(np.abs(np.angle(multiplier)) - np.pi) < REAL
        kind[found] = np.where(flip, "flip", "hopf")
    low, high = int(np.min(number)), int(np.max(number))
    stated = f"{low}" if low == high else f"{low} to {high}"
    return StabilityLobes(
        speed_rpm=speed,
        depth=depth,
        chatter_frequency=chatter,
        kind=kind,
        crossings=crossings,
        method="semi-discretisation",
        detail=f"{stated} intervals a tooth period",
    )


def _growth(system: MillingSystem, cut: Cut, speed: Floats, intervals: NDArray[np.int64]) -> Growth:
    """Logarithm of the largest multiplier's magnitude at the speeds of some rows (s,) and depths (s, d)."""

    def growth(row: NDArray[np.intp], depth: Floats, tolerance: float) -> Floats:
        multiplier = largest_multipliers(system, cut, speed[row], depth, intervals[row], tolerance)
        return np.asarray(np.log(np.clip(np.abs(multiplier), *LIMITS)))

    return growth
