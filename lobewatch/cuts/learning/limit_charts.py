"""Diagrams of many spindles by zero order, and what a test cut is worth under them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.grid import MM, ROUNDING, Grid, floor_depth
from lobewatch.cuts.learning.likelihood import EDGE, FREQUENCY
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
TRULY = 2.0
"""Edges (`likelihood.EDGE`) by which a cut may be on the other side of the limit than its word says; chosen: beyond it
the word is more likely wrong."""
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

    def truly_best(self, cuts: Sequence[CutEvidence]) -> Floats:
        """Largest removal rate (rpm m) of the cuts that were heard stable and are so, in each draw, shape (r,)."""
        best = np.zeros(len(self.limits))
        for cut in cuts:
            if not cut.chatters:
                best = np.maximum(best, np.where(self.contradicts(cut), 0.0, cut.speed_rpm * cut.depth))
        return best

    def contradicts(self, cut: CutEvidence) -> NDArray[np.bool_]:
        """Whether the word of a cut is wrong in each draw, shape (r,)."""
        row = int(np.argmin(np.abs(np.log(self.grid.speeds / cut.speed_rpm))))
        excess = np.log(cut.depth / self.limits[:, row])
        return np.asarray(excess < -TRULY * EDGE if cut.chatters else excess > TRULY * EDGE)

    def gains(self, weights: Floats, best: float | Floats) -> Floats:
        """Expected gain of removal rate (rpm m) by the best cut at each speed, shape (s,); best: that so far, of each
        draw or of all."""
        more = self.chips > np.min(best)
        speeds, deep = np.any(more, axis=0), np.any(more, axis=1)
        order, chips = self.order[deep][:, speeds], self.chips[deep][:, speeds]
        gain = np.zeros(chips.shape)
        for value in np.unique(best):
            stable = np.cumsum((weights * (best == value))[order], axis=0)
            gain += stable * np.maximum(chips - value, 0.0)
        likely = np.cumsum(weights[order], axis=0) > LIKELY
        best_gains = np.zeros(speeds.shape)
        best_gains[speeds] = np.max(likely * gain, axis=0, initial=0.0)
        return best_gains

    def candidates(self, best: float | Floats) -> Iterator[tuple[int, float]]:
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

    def worth(self, row: int, depth: float, best: float | Floats, left: int) -> float:
        """Worth of a cut (rpm m): what it gains, and where more are left what the best next one gains then; best: as
        for `gains`."""
        stable = self.limits[:, row] >= depth - EQUAL
        chance, chips = float(np.mean(stable)), float(self.grid.speeds[row]) * depth
        if chance <= LIKELY:
            return 0.0
        gain = float(np.mean(stable * np.maximum(chips - best, 0.0)))
        if left <= 1:
            return gain
        after = chance * self._next(stable / np.sum(stable), np.maximum(best, chips))
        return gain + after + (1 - chance) * self._after_chatter(row, ~stable, best)

    def _after_chatter(self, row: int, chatters: NDArray[np.bool_], best: float | Floats) -> float:
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

    def _next(self, weights: Floats, best: float | Floats) -> float:
        """Gain of the best cut at any speed (rpm m)."""
        return float(np.max(self.gains(weights, best)))
