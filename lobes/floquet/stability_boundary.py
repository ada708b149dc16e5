"""The stability limit of milling over spindle speed, by semi-discretisation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobes.chatter_frequency import chatter_frequency
from lobes.cut import Cut
from lobes.floquet.milling_rows import MillingRows, rows_of
from lobes.floquet.multipliers import largest_multipliers
from lobes.floquet.settled_crossings import is_flip, settled_crossings
from lobes.milling_system import MillingSystem, milling_system
from lobes.speeds import check_speeds
from lobes.stability_lobes import StabilityLobes
from modal import Mode

Floats = NDArray[np.float64]


def stability_boundary(
    x: Sequence[Mode] | None,
    y: Sequence[Mode] | None,
    cut: Cut,
    speed_rpm: ArrayLike,
    max_depth: float,
    vectors: ArrayLike | None = None,
) -> StabilityLobes:
    """Depths (m) up to max_depth at each speed (rpm) where milling changes from stable to unstable or back.

    x and y are directions of the machine; None stands for one that is rigid. `depth` is the lowest crossing, inf where
    there is none; `crossings` are all, islands too. `kind` is "flip" where the multiplier is -1 (period two), else
    "hopf"; the chatter frequency is the loudest of those that the multiplier leaves. The tooth period is divided into
    pieces for all modes that count, and again twice as finely until limits and kinds have settled within 0.25 %;
    `detail` states how many that took. vectors: directions (n, 2) of the modes of x, then of y, where they lie askew
    (`milling_system`).

    Raises ValueError for bad speeds, depths, modes or vectors, ArithmeticError where a limit does not settle.
    Source: Insperger & Stepan, Semi-Discretization for Time-Delay Systems, Springer 2011, with a high order
    (`lobes.floquet.period_map`).

    Little immersion has flips between the lobes of a mean force, above 60 f / (N (k + 1/2)), 10000 rpm here:

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=1e6)
    >>> thin = Cut(teeth=2, immersion=0.1, direction="up", tangential=700e6, radial=200e6)
    >>> lobes = stability_boundary([mode], None, thin, [9000.0, 9500.0, 9900.0, 10500.0, 12000.0], max_depth=0.05)
    >>> [f"{depth * 1e3:.2f} mm, {kind}" for depth, kind in zip(lobes.depth, lobes.kind, strict=True)]
    ['1.11 mm, hopf', '1.53 mm, hopf', '2.12 mm, hopf', '0.96 mm, flip', '5.30 mm, flip']
    """
    system, speed = milling_system(x, y, vectors), check_speeds(speed_rpm)
    if not (np.isfinite(max_depth) and max_depth > 0):
        raise ValueError(f"max_depth={max_depth} m is not a finite depth > 0; give the deepest cut of interest")
    rows = rows_of(system, cut, speed)
    crossings, number = settled_crossings(rows, float(max_depth))
    depth = crossings[:, 0]
    chatter, kind = np.full(speed.shape, np.nan), np.full(speed.shape, "", dtype="<U4")
    limited = np.flatnonzero(np.isfinite(depth))
    if limited.size:
        chatter[limited], kind[limited] = chatter_at(system, rows[limited], depth[limited], number[limited])
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


def chatter_at(
    system: MillingSystem, rows: MillingRows, depth: Floats, number: NDArray[np.int64]
) -> tuple[Floats, NDArray[np.str_]]:
    """Chatter frequency (Hz) and kind at limits (r,) in m, with pieces (r,)."""
    multiplier = largest_multipliers(rows, depth[:, np.newaxis], number)[:, 0]
    chatter = chatter_frequency(system, rows.cut, multiplier, depth, 1 / rows.period)
    return chatter, np.where(is_flip(multiplier), "flip", "hopf")
