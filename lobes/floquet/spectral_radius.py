"""Stability of milling on a grid of speeds and depths, by semi-discretisation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobes.cut import Cut
from lobes.floquet.depths import check_depths
from lobes.floquet.milling_rows import rows_of
from lobes.floquet.multipliers import spectral_radii
from lobes.floquet.pieces import piece_numbers
from lobes.milling_system import milling_system
from lobes.speeds import check_speeds
from modal import Mode


def spectral_radius(
    x: Sequence[Mode] | None,
    y: Sequence[Mode] | None,
    cut: Cut,
    speed_rpm: ArrayLike,
    depth: ArrayLike,
    vectors: ArrayLike | None = None,
) -> NDArray[np.float64]:
    """Largest magnitude of the Floquet multipliers over a tooth period at each speed (rpm) and depth (m); < 1: stable.

    x and y are directions of the machine (`Cut.feed_angle` says how the feed lies in them); None stands for one that
    is rigid. Any immersion, any number of modes, straight or helical teeth. The tooth period is divided finely enough
    for all modes that count at the deepest depth. vectors: directions (n, 2) of the modes of x, then of y, where they
    lie askew (`milling_system`). Returns shape (n_speed, n_depth).

    Raises ValueError for bad speeds, depths, modes or vectors.
    Source: Insperger & Stepan, Semi-Discretization for Time-Delay Systems, Springer 2011, with a high order
    (`lobes.floquet.period_map`).

    Below 1 is stable. Without a cut a free mode decays by exp(-zeta w T) in a tooth period T:

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> spectral_radius([mode], [mode], slot, 12000.0, [1e-9, 0.2e-3, 2e-3]).round(3).tolist()
    [[0.855, 0.863, 0.959]]
    >>> round(float(np.exp(-0.02 * 2 * np.pi * 500.0 * 60 / (2 * 12000.0))), 3)
    0.855
    """
    system, speed, deep = milling_system(x, y, vectors), check_speeds(speed_rpm), check_depths(depth)
    rows = rows_of(system, cut, speed)
    grid = np.broadcast_to(deep, (speed.size, deep.size))
    return spectral_radii(rows, grid, piece_numbers(rows, float(np.max(deep))))
