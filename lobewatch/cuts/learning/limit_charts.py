"""Diagrams of many spindles by zero order, and what a test cut is worth under them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lobewatch.cuts.learning.grid import MM, Grid, floor_depth
from lobewatch.cuts.learning.likelihood import FREQUENCY
from lobewatch.cuts.learning.priors import Draws
from lobewatch.cuts.listening.fold_frequency import fold_frequency
from lobewatch.verdicts.mean_force import MeanForce

LIKELY = 0.5
"""A test cut is more likely stable than this."""
CHANCES = (0.51, 0.6, 0.7, 0.8, 0.9)
"""Chances of being stable, of the depths that are looked at."""
PLACES, APART = 8, 0.02
"""Speeds that are looked at, at most, and their least relative distance."""
HEARD = 4
"""Chatter frequencies that may be heard, of which it is seen what they would tell."""
LOOSE = 1.5
"""The frequency at the limit stands for that at the depth: so many times less is learnt from it."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LimitCharts:
    """Limits of draws of equal weight over the speeds of a grid."""

    grid: Grid
    limits: Floats
    """Limits in the worst direction of feed, as deep as is allowed (m), shape (r, s)."""
    frequencies: Floats
    """Of the chatter at them, folded by the teeth (Hz), shape (r, s)."""
    order: NDArray[np.intp]
    """Draws of each speed by their limits, the deepest first, shape (r, s)."""
    typical: float
    """A natural frequency (Hz)."""
    chips: Floats
    """Speed times the deepest depth that can be set and is stable (rpm m) for each of them, shape (r, s)."""

    @classmethod
    def of(cls, draws: Draws, grid: Grid) -> LimitCharts:
        """Of draws at speed."""
        rows = replace(draws.rows(1.0, grid.cut.tangential, grid.cut.radial), cut=grid.cut)
        deepest = 1e-6 + float(np.max(grid.deepest / grid.trust))
        found = [MeanForce.of(rows.fed_at(angle)).limits(grid.speeds, deepest) for angle in grid.feed_angles]
        worst = np.argmin([limit for limit, _ in found], axis=0)[np.newaxis]
        limit, frequency = (np.take_along_axis(np.array(part), worst, axis=0)[0] for part in zip(*found, strict=True))
        limit = np.minimum(limit * grid.trust, grid.deepest)
        order = np.argsort(-limit, axis=0, kind="stable")
        depth = np.floor(np.take_along_axis(limit, order, axis=0) * 1e3 / MM + 1e-6) * MM / 1e3
        typical = float(np.mean(rows.frequency)) / (2 * np.pi)
        teeth = grid.cut.teeth * grid.speeds / 60
        return cls(grid, limit, fold_frequency(frequency, teeth), order, typical, grid.speeds * depth)

    def gains(self, weights: Floats, best: float) -> Floats:
        """Expected gain of removal rate (rpm m) by the best cut at each speed, shape (s,)."""
        more = self.chips > best
        speeds, deep = np.any(more, axis=0), np.any(more, axis=1)
        stable = np.cumsum(weights[self.order[deep][:, speeds]], axis=0)
        gain = (stable > LIKELY) * stable * (self.chips[deep][:, speeds] - best)
        found = np.zeros(speeds.shape)
        found[speeds] = np.max(gain, axis=0, initial=0.0)
        return found

    def candidates(self, best: float) -> Iterator[tuple[int, float]]:
        """Speeds, by their place, and depths (m) that are worth looking at."""
        gains = self.gains(np.full(len(self.limits), 1 / len(self.limits)), best)
        taken = list[int]()
        for row in np.argsort(-gains).tolist():
            if all(abs(np.log(self.grid.speeds[row] / self.grid.speeds[other])) > APART for other in taken):
                taken.append(row)
            if len(taken) == PLACES:
                break
        for row in taken:
            depths = {floor_depth(float(np.quantile(self.limits[:, row], 1 - chance))) for chance in CHANCES}
            yield from ((row, depth) for depth in sorted(depths) if depth > 0)

    def worth(self, row: int, depth: float, best: float, left: int) -> float:
        """Of a cut (rpm m): what it gains, and where more are left what the best next one gains then."""
        stable = self.limits[:, row] >= depth - 1e-9
        chance, chips = float(np.mean(stable)), float(self.grid.speeds[row]) * depth
        gain = chance * max(chips - best, 0.0)
        if left <= 1 or chance <= LIKELY:
            return gain if chance > LIKELY else 0.0
        after = chance * self._next(stable / np.sum(stable), max(best, chips))
        return gain + after + (1 - chance) * self._after_chatter(row, ~stable, best)

    def _after_chatter(self, row: int, chatters: NDArray[np.bool_], best: float) -> float:
        """Gain of the next cut, over frequencies that may be heard."""
        places = np.flatnonzero(chatters)
        if not places.size:
            return 0.0
        heard = self.frequencies[places, row]
        wide = LOOSE * FREQUENCY * self.typical
        told = [heard[int(share * places.size)] for share in (np.arange(HEARD) + 0.5) / HEARD]
        found = []
        for frequency in told:
            near = np.exp(-(((heard - frequency) / wide) ** 2) / 2)
            weights = np.zeros(len(self.limits))
            weights[places] = near / np.sum(near) if np.sum(near) > 0 else 1 / places.size
            found.append(self._next(weights, best))
        return float(np.mean(found))

    def _next(self, weights: Floats, best: float) -> float:
        return float(np.max(self.gains(weights, best)))
