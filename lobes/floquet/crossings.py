"""Find all depths where stability changes, with converged pieces."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lobes.floquet.milling_rows import COARSE_CYCLES_PER_PIECE, MillingRows, count_pieces
from lobes.floquet.multipliers import growth_rate, largest_multipliers
from lobes.stability_lobes import pad_columns
from modal.arrays import Complexes, Flags, Floats, Indices, Integers

SCAN_DEPTHS = 24
"""Depths that are evaluated before anything is refined."""
SCAN_PARTS = 3
"""Parts of a scan for the first crossing, the shallow depths first."""
SCAN_EXPONENT = 1.5
"""Exponent of the scan: the j-th depth is (j / SCAN_DEPTHS) ^ SCAN_EXPONENT of the deepest, as limits lie low."""
MAX_STEP_HALVINGS = 6
"""Most halvings of a step that may hide a pair of crossings."""
HIDDEN_CROSSING_SHARE = 0.5
"""Share of the way to zero and back that growth must be able to go for a step to hide a pair of crossings."""
GROWTH_SIGN_ACCURACY = 1e-4
"""Accuracy of growth that is sufficient for its sign."""
CROSSING_ACCURACY = 1e-6
"""Relative accuracy of a crossing."""
MAX_CROSSING_STEPS = 60
"""Most steps of the refinement."""

GrowthFunction = Callable[[Indices, Floats, float], Floats]
"""Function from rows (s,), depths (s, d) and an accuracy to growth (s, d), which is negative for a stable cut."""


def find_crossings(
    growth: GrowthFunction, n_rows: int, deepest: float, first_only: bool = False, accuracy: float = CROSSING_ACCURACY
) -> Floats:
    """Find the depths up to `deepest` where growth changes its sign, rising and padded with inf, shape (n_rows, k).

    A scan finds the changes between its depths. A step is halved as long as growth, as steep as in the neighbouring
    steps, could reach zero and come back: so short excursions and islands inside a step are found. Growth
    is negative at depth 0. k is at least 1. first_only: the first crossing of each row, the same but faster. accuracy:
    relative, of the crossings.
    """
    depths = deepest * (np.arange(1, SCAN_DEPTHS + 1) / SCAN_DEPTHS) ** SCAN_EXPONENT
    depth = np.broadcast_to(depths, (n_rows, SCAN_DEPTHS))
    value = _scan_growth(growth, depth, SCAN_PARTS if first_only else 1)
    brackets = _bracket_crossings(growth, _scan_steps(depth, value), first_only)
    return _pad_rows(brackets.row, _refine_crossings(growth, brackets, accuracy), n_rows)


def _scan_growth(growth: GrowthFunction, depth: Floats, parts: int) -> Floats:
    """Return growth at rising depths (r, d), part by part; NaN beyond the step after the first unstable depth."""
    value, left = np.full(depth.shape, np.nan), np.arange(len(depth))
    for columns in np.array_split(np.arange(depth.shape[1]), parts):
        value[np.ix_(left, columns)] = growth(left, depth[np.ix_(left, columns)], GROWTH_SIGN_ACCURACY)
        left = left[~np.any(value[left, : columns[-1]] >= 0, axis=1)]
        if not left.size:
            break
    return value


def _pad_rows(row: Indices, crossing: Floats, n_rows: int) -> Floats:
    order = np.lexsort((crossing, row))
    row, crossing = row[order], crossing[order]
    counts = np.bincount(row, minlength=n_rows)
    table = np.full((n_rows, max(int(np.max(counts)), 1)), np.inf)
    table[row, np.arange(row.size) - np.repeat(np.cumsum(counts) - counts, counts)] = crossing
    return table


class _DepthSteps(NamedTuple):
    """Steps between two depths, arrays of one shape (n,)."""

    row: Indices
    low: Floats
    high: Floats
    at_low: Floats
    at_high: Floats
    before: Floats
    """Steepness of growth in the step before."""
    after: Floats
    """Steepness of growth in the step after."""

    def where(self, which: Flags) -> "_DepthSteps":
        return _DepthSteps._make(column[which] for column in self)

    @property
    def crosses(self) -> Flags:
        return np.asarray((self.at_low < 0) != (self.at_high < 0))

    @property
    def may_hide(self) -> Flags:
        """True if growth could change its sign twice more: from one end to zero and back takes |low| + |high|."""
        reach = np.maximum(self.before, self.after) * (self.high - self.low)
        return np.asarray(reach > HIDDEN_CROSSING_SHARE * (np.abs(self.at_low) + np.abs(self.at_high)))

    def halves(self, middle: Floats) -> "_DepthSteps":
        """Return both halves, given growth at the middles."""
        half = (self.low + self.high) / 2
        left, right = (np.abs(middle - end) / (half - self.low) for end in (self.at_low, self.at_high))
        return _join_steps(
            _DepthSteps(self.row, self.low, half, self.at_low, middle, self.before, right),
            _DepthSteps(self.row, half, self.high, middle, self.at_high, left, self.after),
        )


def _join_steps(*parts: _DepthSteps) -> _DepthSteps:
    return _DepthSteps(*map(np.concatenate, zip(*parts, strict=True)))


def _scan_steps(depth: Floats, value: Floats) -> _DepthSteps:
    """Return the steps of a scan; depth 0 has the value at the first depth, made stable."""
    at = np.hstack((np.zeros((len(depth), 1)), depth))
    values = np.hstack((-np.abs(value[:, :1]), value))
    steep = np.pad(np.abs(np.diff(values) / np.diff(at)), ((0, 0), (1, 1)))
    row = np.repeat(np.arange(len(depth)), depth.shape[1])
    parts = (at[:, :-1], at[:, 1:], values[:, :-1], values[:, 1:], steep[:, :-2], steep[:, 2:])
    return _DepthSteps(row, *(part.ravel() for part in parts))


def _bracket_crossings(growth: GrowthFunction, steps: _DepthSteps, first_only: bool) -> _DepthSteps:
    """Return the steps that hold a crossing, halved if there may be more; first_only: the first step of each row."""
    done = steps.where(np.zeros(steps.row.size, dtype=bool))
    for _ in range(MAX_STEP_HALVINGS):
        may_hide = steps.may_hide & (steps.low <= _first_crossing_steps(done, steps) if first_only else True)
        done = _join_steps(done, steps.where(~may_hide & steps.crosses))
        steps = steps.where(may_hide)
        if not steps.row.size:
            break
        middle = (steps.low + steps.high)[:, np.newaxis] / 2
        steps = steps.halves(growth(steps.row, middle, GROWTH_SIGN_ACCURACY)[:, 0])
    found = _join_steps(done, steps.where(steps.crosses))
    return found.where(found.low <= _first_crossing_steps(found, found)) if first_only else found


def _first_crossing_steps(done: _DepthSteps, steps: _DepthSteps) -> Floats:
    """Return the low end of the first step of its row that holds a crossing, in either, for each of the steps (n,)."""
    both = _join_steps(done, steps)
    first = np.full(int(np.max(both.row, initial=-1)) + 1, np.inf)
    np.minimum.at(first, both.row[both.crosses], both.low[both.crosses])
    return np.asarray(first[steps.row])


def _refine_crossings(growth: GrowthFunction, brackets: _DepthSteps, accuracy: float) -> Floats:
    """Find the zero in each step by the false position; the weight of an end that stays twice is halved (Illinois)."""
    row, low, high = brackets.row, brackets.low.copy(), brackets.high.copy()
    at_low, at_high = brackets.at_low.copy(), brackets.at_high.copy()
    zero, was_lower = (low + high) / 2, np.full(row.size, -1)
    busy = np.arange(row.size)
    for _ in range(MAX_CROSSING_STEPS):
        if not busy.size:
            break
        a, b, fa, fb = low[busy], high[busy], at_low[busy], at_high[busy]
        guess = np.clip(b - fb * (b - a) / (fb - fa), a + 0.01 * (b - a), b - 0.01 * (b - a))
        value = growth(row[busy], guess[:, np.newaxis], min(accuracy, GROWTH_SIGN_ACCURACY))[:, 0]
        lower = (value < 0) == (fa < 0)
        left = value * np.where(lower, guess - b, a - guess) / np.where(lower, fb - value, value - fa)
        zero[busy] = guess + left
        weight = np.where(lower == was_lower[busy], 0.5, 1.0)
        low[busy], at_low[busy] = np.where(lower, guess, a), np.where(lower, value, weight * fa)
        high[busy], at_high[busy] = np.where(lower, b, guess), np.where(lower, weight * fb, value)
        was_lower[busy] = lower
        busy = busy[np.abs(left) > accuracy * guess]
    return zero


REAL_MULTIPLIER_ANGLE = 1e-4
"""Largest angle from pi (rad) of a real multiplier."""
LIMIT_TOLERANCE = 0.0025
"""Relative tolerance of a limit: twice as many pieces find the cut stable below and unstable above."""
MAX_PIECE_DOUBLINGS = 4
"""Most doublings of the number of pieces.

A kind that is open then stays so: at very low speeds multipliers of all angles crowd.
"""


def converged_crossings(rows: MillingRows, max_depth: float, first_only: bool = False) -> tuple[Floats, Integers]:
    """Return all crossings up to max_depth (m), rising and padded with inf, shape (r, k), and the pieces (r,).

    first_only: the first crossing of each row. Raises ArithmeticError if a limit does not converge.
    """
    number = count_pieces(rows, max_depth)
    crossings = find_crossings(_growth_function(rows, number), len(rows), max_depth, first_only)
    for _ in range(MAX_PIECE_DOUBLINGS):
        limit_holds, kind_holds = _has_converged(rows, crossings[:, 0], number)
        moved = np.flatnonzero(~(limit_holds & kind_holds))
        if not moved.size:
            return crossings, number
        number[moved] *= 2
        again = find_crossings(_growth_function(rows[moved], number[moved]), moved.size, max_depth, first_only)
        crossings, again = pad_columns([crossings, again])
        crossings[moved] = again
    limit_holds, _ = _has_converged(rows, crossings[:, 0], number)
    if np.all(limit_holds):
        return crossings, number
    speed = rows.speed_rpm[np.flatnonzero(~limit_holds)[0]]
    raise ArithmeticError(f"the limit at {speed:g} rpm has not converged. Leave this speed out.")


ESTIMATE_ACCURACY = 1e-3
"""Relative accuracy of an estimated limit."""


def estimate_limits(rows: MillingRows, max_depth: float) -> Floats:
    """Return the first crossing of each row up to max_depth (m), inf without one, shape (r,), with few pieces."""
    growth = _growth_function(rows, count_pieces(rows, max_depth, COARSE_CYCLES_PER_PIECE))
    return find_crossings(growth, len(rows), max_depth, first_only=True, accuracy=ESTIMATE_ACCURACY)[:, 0]


def _has_converged(rows: MillingRows, depth: Floats, number: Integers) -> tuple[Flags, Flags]:
    """Return whether twice as many pieces keep the limit, and its kind, each of shape (r,)."""
    limit, kind = np.ones((2, depth.size), dtype=bool)
    limited = np.flatnonzero(np.isfinite(depth))
    if limited.size:
        around = depth[limited, np.newaxis] * (1 + LIMIT_TOLERANCE * np.array([-1.0, 1.0]))
        fine = largest_multipliers(rows[limited], around, 2 * number[limited], LIMIT_TOLERANCE * 1e-2)
        coarse = largest_multipliers(rows[limited], around[:, 1:], number[limited], LIMIT_TOLERANCE * 1e-2)
        limit[limited] = (np.abs(fine[:, 0]) < 1) & (np.abs(fine[:, 1]) > 1)
        kind[limited] = is_flip(fine[:, 1]) == is_flip(coarse[:, 0])
    return limit, kind


def is_flip(multiplier: Complexes) -> Flags:
    """Return whether each multiplier is -1 in its direction: period two."""
    return np.asarray(np.abs(np.abs(np.angle(multiplier)) - np.pi) < REAL_MULTIPLIER_ANGLE)


def _growth_function(rows: MillingRows, number: Integers) -> GrowthFunction:
    return lambda row, depth, tolerance: growth_rate(rows[row], depth, number[row], tolerance)
