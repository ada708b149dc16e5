"""The deepest stable depth of each draw, well enough for quantiles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobes.floquet.program_limit import DEEPEST
from lobewatch.verdicts.draws import ProgramDraws

TRIED = np.array([0.75, 1.0, 1.4])
"""Shares of the limit in the middle, as its own cutting coefficient moves it, at which each draw is looked at ..."""
BEYOND = np.array([2.0, 3.0])
"""... and shares at which those are looked at that are stable at all of these."""
FREE = np.array([0.05, 0.2, 0.5, 1.0])
"""Shares of the deepest of interest where there is no limit in the middle."""
EXTREMES = 9
"""Number of the lowest and of the highest limits that are then refined, in all directions of feed that count."""
STEPS = 3
"""Steps of that refinement."""
ALIKE = 1.15
"""Directions of feed whose limit is at most so many times the lowest one count ..."""
MOST = 3
"""... the lowest of them."""

BELOW = np.array([0.5, 0.7, 0.8, 0.9, 1.0])
"""Shares of the limit of each draw at which it is looked at once more ..."""
WIDER, MORE = 1.3, 6
"""... in the directions of feed whose limit is at most so many times the lowest one, the lowest of them."""

Floats = NDArray[np.float64]


def drawn_limits(draws: ProgramDraws, depth: float) -> Floats:
    """Deepest stable depth of each draw (m), shape (draws,); inf beyond what is looked at.

    Of the other draws than the lowest and highest it is the first change between the depths that are looked at,
    linearly interpolated. depth: that of the program (m).
    """
    limit, worst = float(draws.limits[0]), draws.fed(0.0)
    near = draws.fed(ALIKE * limit, MOST)
    softness = (draws.rows.tangential[0] / draws.rows.tangential)[:, np.newaxis]
    tried = softness * limit * TRIED if np.isfinite(limit) else np.tile(DEEPEST * depth * FREE, (len(softness), 1))
    low, high, at_low, at_high = _brackets(tried, worst.growth(tried))
    open_ones = np.flatnonzero(np.isinf(high)) if np.isfinite(limit) else np.empty(0, dtype=np.intp)
    if open_ones.size:
        further = np.hstack((low[open_ones, np.newaxis], softness[open_ones] * limit * BEYOND))
        brackets = _brackets(further, worst[open_ones].growth(further))
        low[open_ones], high[open_ones], at_low[open_ones], at_high[open_ones] = brackets
    limits = _between(low, high, at_low, at_high)
    order = np.argsort(limits)
    ends = np.unique(np.concatenate((order[:EXTREMES], order[-EXTREMES:])))
    ends = ends[np.isfinite(limits[ends])]
    for _ in range(STEPS if ends.size else 0):
        value = near[ends].growth(limits[ends, np.newaxis])[:, 0]
        above = value >= 0
        low[ends], at_low[ends] = np.where(above, low[ends], limits[ends]), np.where(above, at_low[ends], value)
        high[ends], at_high[ends] = np.where(above, limits[ends], high[ends]), np.where(above, value, at_high[ends])
        limits[ends] = _between(low[ends], high[ends], at_low[ends], at_high[ends])
    return limits


def settled_limits(draws: ProgramDraws, limits: Floats) -> Floats:
    """Limits (m) as `drawn_limits` gives them, each in the direction of feed that is worst for that very draw.

    For numbers of single draws, such as ratios of two cuts on the same spindle.
    """
    settled, finite = limits.copy(), np.flatnonzero(np.isfinite(limits))
    if not finite.size:
        return settled
    tried = limits[finite, np.newaxis] * BELOW
    near = draws.fed(WIDER * float(draws.limits[0]), MORE)[finite]
    low, high, at_low, at_high = _brackets(tried, near.growth(tried))
    crossing = _between(low, high, at_low, at_high)
    settled[finite] = np.where(np.isfinite(crossing), crossing, limits[finite])
    return settled


def _brackets(tried: Floats, grown: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Depths on both sides of the first change to growth in each row, and growth there; inf where there is none."""
    depth = np.pad(tried, ((0, 0), (1, 1)))
    depth[:, -1] = np.inf
    value = np.pad(grown, ((0, 0), (1, 1)), constant_values=1.0)
    value[:, 0] = -np.abs(grown[:, 0])
    first, row = np.argmax(value >= 0, axis=1), np.arange(len(value))
    return depth[row, first - 1], depth[row, first], value[row, first - 1], value[row, first]


def _between(low: Floats, high: Floats, at_low: Floats, at_high: Floats) -> Floats:
    """Depths at which growth is zero on a line."""
    share = -at_low / (at_high - at_low)
    return np.where(np.isfinite(high), low + share * (np.where(np.isfinite(high), high, low) - low), np.inf)
