"""Diagrams of many spindles by zero order, and what a test cut is worth under them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lobewatch.cuts.learning.grid import MM, ROUNDING, Grid, floor_depth
from lobewatch.cuts.learning.likelihood import FREQUENCY
from lobewatch.cuts.learning.priors import Draws
from lobewatch.cuts.listening.fold_frequency import fold_frequency
from lobewatch.verdicts.mean_force import MeanForce

LIKELY = 0.5
"""Chance of being stable that a test cut has at least."""
CHANCES = (0.51, 0.6, 0.7, 0.8, 0.9)
"""Chances of being stable, of the depths that are looked at; chosen."""
PLACES, APART = 8, 0.02
"""Largest number of speeds that are looked at, and their least relative distance; chosen."""
HEARD = 4
"""Number of chatter frequencies that may be heard, of which it is worked out what they would tell."""
LOOSE = 1.5
"""Factor on the error of a chatter frequency, since that at the limit stands for that at the depth; chosen."""
MARGIN = 1e-6
"""Depth beyond the deepest that is allowed up to which limits are worked out (m)."""
EQUAL = 1e-9
"""Difference of two depths that is none (m)."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LimitCharts:
    """Limits of draws of equal weight over the speeds of a grid."""

    grid: Grid
    """Speeds and depths that a cut may be chosen from."""
    limits: Floats
    """Limits in the worst direction of feed, as deep as is allowed (m), shape (r, s)."""
    frequencies: Floats
    """Chatter frequencies at them, folded by how often the cut repeats (Hz), shape (r, s)."""
    order: NDArray[np.intp]
    """Draws of each speed by their limits, the deepest first, shape (r, s)."""
    typical: float
    """A natural frequency (Hz)."""
    chips: Floats
    """Speed times the deepest depth that can be set and is stable (rpm m) for each of them, shape (r, s)."""

    @classmethod
    def of(cls, draws: Draws, grid: Grid) -> LimitCharts:
        """Limits of draws at speed."""
        rows = replace(draws.rows(1.0, grid.cut.tangential, grid.cut.radial), cut=grid.cut)
        deepest = MARGIN + float(np.max(grid.deepest / grid.trust))
        fed = [MeanForce.of(rows.fed_at(angle)).limits(grid.speeds, deepest) for angle in grid.feed_angles]
        worst = np.argmin([limit for limit, _ in fed], axis=0)[np.newaxis]
        limit, frequency = (np.take_along_axis(np.array(part), worst, axis=0)[0] for part in zip(*fed, strict=True))
        limit = np.minimum(limit * grid.trust, grid.deepest)
        order = np.argsort(-limit, axis=0, kind="stable")
        depth = np.floor(np.take_along_axis(limit, order, axis=0) * 1e3 / MM + ROUNDING) * MM / 1e3
        typical = float(np.mean(rows.frequency)) / (2 * np.pi)
        teeth = grid.cut.repeats * grid.speeds / 60
        return cls(grid, limit, fold_frequency(frequency, teeth), order, typical, grid.speeds * depth)

    def gains(self, weights: Floats, best: float) -> Floats:
        """Expected gain of removal rate (rpm m) by the best cut at each speed, shape (s,)."""
        more = self.chips > best
        speeds, deep = np.any(more, axis=0), np.any(more, axis=1)
        stable = np.cumsum(weights[self.order[deep][:, speeds]], axis=0)
        gain = (stable > LIKELY) * stable * (self.chips[deep][:, speeds] - best)
        best_gains = np.zeros(speeds.shape)
        best_gains[speeds] = np.max(gain, axis=0, initial=0.0)
        return best_gains

    def candidates(self, best: float) -> Iterator[tuple[int, float]]:
        """Speeds, by their place, and depths (m) that are worth looking at."""
        gains = self.gains(np.full(len(self.limits), 1 / len(self.limits)), best)
        places = list[int]()
        for row in np.argsort(-gains).tolist():
            if all(abs(np.log(self.grid.speeds[row] / self.grid.speeds[place])) > APART for place in places):
                places.append(row)
            if len(places) == PLACES:
                break
        for row in places:
            depths = {floor_depth(float(np.quantile(self.limits[:, row], 1 - chance))) for chance in CHANCES}
            yield from ((row, depth) for depth in sorted(depths) if depth > 0)

    def worth(self, row: int, depth: float, best: float, left: int) -> float:
        """Worth of a cut (rpm m): what it gains, and where more are left what the best next one gains then."""
        stable = self.limits[:, row] >= depth - EQUAL
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
        gains = []
        for frequency in (heard[int(share * places.size)] for share in (np.arange(HEARD) + 0.5) / HEARD):
            near = np.exp(-(((heard - frequency) / wide) ** 2) / 2)
            weights = np.zeros(len(self.limits))
            weights[places] = near / np.sum(near) if np.sum(near) > 0 else 1 / places.size
            gains.append(self._next(weights, best))
        return float(np.mean(gains))

    def _next(self, weights: Floats, best: float) -> float:
        """Gain of the best cut at any speed (rpm m)."""
        return float(np.max(self.gains(weights, best)))
