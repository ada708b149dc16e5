"""Stability of milling on a grid of speeds and depths, by semi-discretisation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobes.cut import Cut
from lobes.depths import check_depths
from lobes.intervals import chosen_intervals
from lobes.milling_system import milling_system
from lobes.multipliers import largest_multipliers
from lobes.speeds import check_speeds
from modal import Mode


def spectral_radius(
    x: Sequence[Mode] | None,
    y: Sequence[Mode] | None,
    cut: Cut,
    speed_rpm: ArrayLike,
    depth: ArrayLike,
    intervals: int | None = None,
) -> NDArray[np.float64]:
    """Largest magnitude of the Floquet multipliers over a tooth period at each speed (rpm) and depth (m); < 1: stable.

    x is the feed, y the normal to it; None stands for a direction that is rigid or not known. `intervals` divide the
    tooth period; None takes `lobes.intervals_needed` at the deepest depth, speed by speed. Any immersion, any number
    of modes, straight or helical teeth. Returns shape (n_speed, n_depth).

    Raises ValueError for bad speeds, depths or modes.
    Source: Insperger & Stepan, Semi-Discretization for Time-Delay Systems, Springer 2011, first order.
    """
    system, speed, deep = milling_system(x, y), check_speeds(speed_rpm), check_depths(depth)
    number = chosen_intervals(intervals, system, cut, speed, float(np.max(deep)))
    grid = np.broadcast_to(deep, (speed.size, deep.size))
    return np.abs(largest_multipliers(system, cut, speed, grid, number))
