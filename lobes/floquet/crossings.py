"""All depths where stability changes, over many speeds at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

SCAN = 24
"""Depths looked at before anything is refined ..."""
SPREAD = 1.5
"""... the j-th of them at (j / SCAN) ^ SPREAD of the deepest: limits lie low."""
ROUNDS = 6
"""Halvings of a step that may hide a pair of crossings."""
DOUBT = 0.5
"""It may where growth, as steep as in a step beside it, goes this share of the way to zero and back."""
SURE = 1e-4
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

    A scan finds the changes between its depths. A step of it is halved as long as growth, were it as steep in it as in
    the steps beside it, could reach zero and come back: so short excursions and islands inside a step are seen. Growth
    is negative at depth 0. k is at least 1.
    """
    rows = np.arange(n_rows)
    depth = np.broadcast_to(deepest * (np.arange(1, SCAN + 1) / SCAN) ** SPREAD, (n_rows, SCAN))
    value = growth(rows, depth, SURE)
    brackets = _brackets(growth, _steps(depth, value))
    return _table(brackets.row, _refine(growth, brackets), n_rows)


def _table(row: Rows, crossing: Floats, n_rows: int) -> Floats:
    order = np.lexsort((crossing, row))
    row, crossing = row[order], crossing[order]
    counts = np.bincount(row, minlength=n_rows)
    table = np.full((n_rows, max(int(np.max(counts)), 1)), np.inf)
    table[row, np.arange(row.size) - np.repeat(np.cumsum(counts) - counts, counts)] = crossing
    return table


@dataclass(frozen=True, eq=False)
class _Steps:
    """Steps between two depths, arrays of one shape (n,)."""

    row: Rows
    low: Floats
    high: Floats
    at_low: Floats
    at_high: Floats
    before: Floats
    """Steepness of growth in the step before."""
    after: Floats
    """Steepness of growth in the step after."""

    def __getitem__(self, which: NDArray[np.bool_]) -> _Steps:
        return _Steps(*(getattr(self, field.name)[which] for field in fields(self)))

    @property
    def crosses(self) -> NDArray[np.bool_]:
        return np.asarray((self.at_low < 0) != (self.at_high < 0))

    @property
    def may_hide(self) -> NDArray[np.bool_]:
        """Whether growth could change its sign twice more: from one end to zero and back takes |low| + |high|."""
        reach = np.maximum(self.before, self.after) * (self.high - self.low)
        return np.asarray(reach > DOUBT * (np.abs(self.at_low) + np.abs(self.at_high)))

    def halves(self, middle: Floats) -> _Steps:
        """Both halves, given growth at the middles."""
        half = (self.low + self.high) / 2
        left, right = (np.abs(middle - end) / (half - self.low) for end in (self.at_low, self.at_high))
        return _joined(
            _Steps(self.row, self.low, half, self.at_low, middle, self.before, right),
            _Steps(self.row, half, self.high, middle, self.at_high, left, self.after),
        )


def _joined(*parts: _Steps) -> _Steps:
    return _Steps(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(_Steps)))


def _steps(depth: Floats, value: Floats) -> _Steps:
    """The steps of a scan; depth 0 has the value at the first depth, made stable."""
    at = np.hstack((np.zeros((len(depth), 1)), depth))
    values = np.hstack((-np.abs(value[:, :1]), value))
    steep = np.pad(np.abs(np.diff(values) / np.diff(at)), ((0, 0), (1, 1)))
    row = np.repeat(np.arange(len(depth)), depth.shape[1])
    parts = (at[:, :-1], at[:, 1:], values[:, :-1], values[:, 1:], steep[:, :-2], steep[:, 2:])
    return _Steps(row, *(part.ravel() for part in parts))


def _brackets(growth: Growth, steps: _Steps) -> _Steps:
    """The steps that hold a crossing, halved where there may be more."""
    done = []
    for _ in range(ROUNDS):
        doubtful = steps.may_hide
        done.append(steps[~doubtful & steps.crosses])
        steps = steps[doubtful]
        if not steps.row.size:
            break
        middle = (steps.low + steps.high)[:, np.newaxis] / 2
        steps = steps.halves(growth(steps.row, middle, SURE)[:, 0])
    return _joined(*done, steps[steps.crosses])


def _refine(growth: Growth, brackets: _Steps) -> Floats:
    """The zero in each step by the false position, with the weight of an end that stays put twice halved (Illinois)."""
    row, low, high = brackets.row, brackets.low.copy(), brackets.high.copy()
    at_low, at_high = brackets.at_low.copy(), brackets.at_high.copy()
    zero, was_lower = (low + high) / 2, np.full(row.size, -1)
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
        weight = np.where(lower == was_lower[busy], 0.5, 1.0)
        low[busy], at_low[busy] = np.where(lower, guess, a), np.where(lower, value, weight * fa)
        high[busy], at_high[busy] = np.where(lower, b, guess), np.where(lower, weight * fb, value)
        was_lower[busy] = lower
        busy = busy[np.abs(left) > ACCURACY * guess]
    return zero
