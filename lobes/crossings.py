"""All depths where stability changes, over many speeds at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

SCAN = 24
"""Depths looked at before anything is refined ..."""
SPREAD = 1.5
"""... the j-th of them at (j / SCAN) ^ SPREAD of the deepest: limits lie low."""
ROUNDS = 5
"""Halvings of the surroundings of a turning point that may hide an island."""
SURE = 1e-3
"""Accuracy of growth that is enough for its sign, unless it is smaller than that."""
ACCURACY = 1e-6
"""Relative accuracy of a crossing."""
MOST_STEPS = 60

Floats = NDArray[np.float64]
Rows = NDArray[np.intp]
Growth = Callable[[Rows, Floats, float], Floats]
"""From rows (s,), depths (s, d) and an accuracy to a value (s, d) that is negative where the cut is stable."""


def find_crossings(growth: Growth, n_rows: int, deepest: float) -> Floats:
    """Depths up to `deepest` where growth changes its sign, rising in each row, filled up with inf, shape (n_rows, k).

    A scan finds the changes between its depths; where growth turns around near zero, its extremum is followed, so that
    an island between two depths is seen. Growth is negative at depth 0. k is at least 1.
    """
    rows = np.arange(n_rows)
    depth = np.broadcast_to(deepest * (np.arange(1, SCAN + 1) / SCAN) ** SPREAD, (n_rows, SCAN))
    value = growth(rows, depth, SURE)
    found = zip(_brackets(depth, value), _islands(growth, depth, value), strict=True)
    row, low, high, at_low, at_high = (np.concatenate(pair) for pair in found)
    return _table(row, _refine(growth, row, low, high, at_low, at_high), n_rows)


def _table(row: Rows, crossing: Floats, n_rows: int) -> Floats:
    order = np.lexsort((crossing, row))
    row, crossing = row[order], crossing[order]
    counts = np.bincount(row, minlength=n_rows)
    table = np.full((n_rows, max(int(np.max(counts)), 1)), np.inf)
    table[row, np.arange(row.size) - np.repeat(np.cumsum(counts) - counts, counts)] = crossing
    return table


def _brackets(depth: Floats, value: Floats) -> tuple[Rows, Floats, Floats, Floats, Floats]:
    """Row, depths and values on both sides of each change of sign; depth 0 has the value at the first, made stable."""
    at = np.hstack((np.zeros((len(depth), 1)), depth))
    values = np.hstack((-np.abs(value[:, :1]), value))
    row, step = np.nonzero((values[:, 1:] < 0) != (values[:, :-1] < 0))
    return row, at[row, step], at[row, step + 1], values[row, step], values[row, step + 1]


def _islands(growth: Growth, depth: Floats, value: Floats) -> tuple[Rows, Floats, Floats, Floats, Floats]:
    """Brackets of the changes of sign that lie, in pairs, between the depths of the scan."""
    side = np.sign(value[:, 1:-1])
    left, middle, right = side * value[:, :-2], side * value[:, 1:-1], side * value[:, 2:]
    turning = (middle < left) & (middle <= right) & (middle < np.maximum(left, right) - middle)
    row, step = np.nonzero(turning)
    three = np.stack([depth[row, step + i] for i in range(3)], axis=1)
    values = side[row, step, np.newaxis] * np.stack([value[row, step + i] for i in range(3)], axis=1)
    outer_depth, outer_value, sign = three[:, ::2].copy(), values[:, ::2].copy(), side[row, step]
    for _ in range(ROUNDS if row.size else 0):
        between = (three[:, 1:] + three[:, :-1]) / 2
        fresh = sign[:, np.newaxis] * growth(row, between, SURE)
        five = np.stack([three[:, 0], between[:, 0], three[:, 1], between[:, 1], three[:, 2]], axis=1)
        fives = np.stack([values[:, 0], fresh[:, 0], values[:, 1], fresh[:, 1], values[:, 2]], axis=1)
        best = 1 + np.argmin(fives[:, 1:4], axis=1)
        pick = best[:, np.newaxis] + np.array([-1, 0, 1])
        three, values = np.take_along_axis(five, pick, axis=1), np.take_along_axis(fives, pick, axis=1)
    hit = np.flatnonzero((values[:, 1] < 0) & np.all(outer_value >= 0, axis=1))
    bottom, at_bottom = three[hit, 1], (sign * values[:, 1])[hit]
    ends = sign[hit, np.newaxis] * outer_value[hit]
    return (
        np.concatenate((row[hit], row[hit])),
        np.concatenate((outer_depth[hit, 0], bottom)),
        np.concatenate((bottom, outer_depth[hit, 1])),
        np.concatenate((ends[:, 0], at_bottom)),
        np.concatenate((at_bottom, ends[:, 1])),
    )


def _refine(growth: Growth, row: Rows, low: Floats, high: Floats, at_low: Floats, at_high: Floats) -> Floats:
    """The zero in each bracket by the false position, with the weight of an end that stays put halved (Illinois)."""
    low, high, at_low, at_high = low.copy(), high.copy(), at_low.copy(), at_high.copy()
    zero = (low + high) / 2
    busy = np.arange(row.size)
    for _ in range(MOST_STEPS):
        if not busy.size:
            break
        a, b, fa, fb = low[busy], high[busy], at_low[busy], at_high[busy]
        guess = np.clip(b - fb * (b - a) / (fb - fa), a + 0.01 * (b - a), b - 0.01 * (b - a))
        value = growth(row[busy], guess[:, np.newaxis], ACCURACY)[:, 0]
        lower = (value < 0) == (fa < 0)
        left = value * np.where(lower, guess - b, a - guess) / np.where(lower, fb - value, value - fa)
        zero[busy] = guess + left
        low[busy], at_low[busy] = np.where(lower, guess, a), np.where(lower, value, fa / 2)
        high[busy], at_high[busy] = np.where(lower, b, guess), np.where(lower, fb / 2, value)
        busy = busy[np.abs(left) > ACCURACY * guess]
    return zero
