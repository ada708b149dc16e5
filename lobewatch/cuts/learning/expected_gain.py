"""Grid of test cuts, and the expected gain in removal rate of each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lobes import Cut, lower_envelope, stability_boundary, zero_order_lobes
from lobewatch.arrays import Flags, Floats, Indices
from lobewatch.cuts.chatter_detection.spectrum import fold_frequency
from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.cut_likelihood import CHATTER_FREQUENCY_SPREAD, LIMIT_SPREAD
from lobewatch.cuts.learning.prior_samples import SpindleSamples
from lobewatch.machine.journal.entries import CutVerdict
from lobewatch.tool.principal_directions import TipModes
from lobewatch.verdicts.zero_order_batch import ZeroOrderBatch, is_force_constant

SPEED_GRID_STEP = 0.008
"""Relative step of the checked speeds."""
TRIED_SPEED_STEP_RPM, TRIED_DEPTH_STEP_MM = 10.0, 0.05
"""Steps of speed (rpm) and depth (mm) that a machine can set."""
DEPTH_ROUNDING = 1e-6
"""Share of a depth step that rounding may lose."""
N_COMPARED_SPEEDS = 80
"""Number of speeds at which the zero-order approximation is compared with semi-discretization."""
ZERO_ORDER_TRUST_RANGE = (0.1, 3.0)
"""Smallest and largest credible ratio of true limit to zero-order limit; chosen."""


@dataclass(frozen=True, eq=False)
class CutGrid:
    """Grid of possible test cuts."""

    cut: Cut
    """Geometry and coefficients of the program."""
    feed_angles: tuple[float, ...]
    """Feed directions (rad); the worst counts."""
    speeds: Floats
    """Spindle speeds (rpm), ascending, shape (s,)."""
    max_depths: Floats
    """Largest depth of tool and drive at each speed (m), shape (s,)."""
    zero_order_trust: Floats
    """True median limit over that by the zero-order approximation at each speed, shape (s,)."""

    def contains(self, speed: float) -> bool:
        """Return whether a speed (rpm) is within the grid, with the tolerance of a recorded speed."""
        return bool(self.speeds[0] * (1 - SPEED_GRID_STEP) <= speed <= self.speeds[-1] * (1 + SPEED_GRID_STEP))

    def build_evidence(self, speed: float, depth: float, word: CutVerdict = "stable") -> CutEvidence:
        """Build the evidence of a cut with this program."""
        return CutEvidence(self.cut, speed, depth, word, feed_angles=self.feed_angles)


def list_speeds(low: float, high: float) -> Floats:
    """List the speeds that can be set (rpm), in steps of 0.8 % and of 10 rpm."""
    number = max(int(np.log(high / low) / SPEED_GRID_STEP) + 1, 2)
    speeds = np.round(np.geomspace(low, high, number) / TRIED_SPEED_STEP_RPM) * TRIED_SPEED_STEP_RPM
    return np.unique(np.clip(speeds, low, high))


def floor_depth(depth: float) -> float:
    """Round a depth (m) down to one that can be set."""
    return round(math.floor(depth * 1e3 / TRIED_DEPTH_STEP_MM + DEPTH_ROUNDING) * TRIED_DEPTH_STEP_MM, 6) / 1e3


def compare_zero_order(
    x: TipModes, y: TipModes, cut: Cut, feed_angles: tuple[float, ...], speeds: Floats, deepest: float
) -> Floats:
    """Return the true limit over the zero-order limit at speeds (rpm), shape (s,).

    x and y: modes of the spindle in the median. Semi-discretisation at fewer speeds, between them interpolated.
    """
    if is_force_constant(cut):
        return np.ones(speeds.shape)
    cuts = [replace(cut, feed_angle=angle) for angle in feed_angles]
    compared = np.unique(speeds[np.linspace(0, speeds.size - 1, min(N_COMPARED_SPEEDS, speeds.size)).astype(int)])
    true = lower_envelope([stability_boundary(x, y, fed, compared, deepest) for fed in cuts]).depth
    mean = lower_envelope([zero_order_lobes(x, y, fed, compared) for fed in cuts]).depth
    share = np.minimum(true, deepest) / np.minimum(mean, deepest)
    return np.asarray(np.interp(speeds, compared, np.clip(share, *ZERO_ORDER_TRUST_RANGE)))


MIN_STABLE_PROBABILITY = 0.5
"""Smallest chance that a test cut is stable."""
TRIED_STABLE_PROBABILITIES = (0.51, 0.6, 0.7, 0.8, 0.9)
"""Chances of stability for which depths are checked; chosen."""
MAX_CANDIDATE_SPEEDS, MIN_CANDIDATE_DISTANCE = 8, 0.02
"""Largest number of checked speeds and their smallest relative distance; chosen."""
N_EXPECTED_FREQUENCIES = 4
"""Number of possible chatter frequencies for which the gain is computed."""
FREQUENCY_ERROR_FACTOR = 1.5
"""Factor on the error of a chatter frequency, as that at the limit replaces that at the depth; chosen."""
LIMIT_DEPTH_MARGIN = 1e-6
"""Depth beyond the deepest allowed one up to which limits are computed (m)."""
MAX_LABEL_DEVIATION = 2.0
"""Largest distance from the limit (`LIMIT_SPREAD`) of a cut with a right label; chosen.

A label beyond it is more likely wrong."""
EQUAL_DEPTH_TOLERANCE = 1e-9
"""Difference of two equal depths (m)."""


@dataclass(frozen=True, eq=False)
class LimitCharts:
    """Limits of equally weighted samples over the speeds of a grid."""

    grid: CutGrid
    """Grid of speeds and depths of possible cuts."""
    limits: Floats
    """Limits in the worst feed direction, up to the largest allowed depth (m), shape (r, s)."""
    frequencies: Floats
    """Chatter frequencies at the limits, folded by the repetition frequency of the cut (Hz), shape (r, s)."""
    depth_order: Indices
    """Samples at each speed in descending order of limits, shape (r, s)."""
    typical_frequency: float
    """Typical natural frequency (Hz)."""
    removal_rates: Floats
    """Speed times the largest stable depth that can be set (rpm m), shape (r, s)."""

    @classmethod
    def of(cls, samples: SpindleSamples, grid: CutGrid) -> LimitCharts:
        """Compute the limits of samples at speed."""
        rows = replace(samples.build_rows(1.0, grid.cut.tangential, grid.cut.radial), cut=grid.cut)
        deepest = LIMIT_DEPTH_MARGIN + float(np.max(grid.max_depths / grid.zero_order_trust))
        batches = (ZeroOrderBatch.of(rows.with_feed_angle(angle)) for angle in grid.feed_angles)
        fed = [batch.limits(grid.speeds, deepest) for batch in batches]
        worst = np.argmin([limit for limit, _ in fed], axis=0)[np.newaxis]
        limit, frequency = (np.take_along_axis(np.array(part), worst, axis=0)[0] for part in zip(*fed, strict=True))
        limit = np.minimum(limit * grid.zero_order_trust, grid.max_depths)
        order = np.argsort(-limit, axis=0, kind="stable")
        steps = np.floor(np.take_along_axis(limit, order, axis=0) * 1e3 / TRIED_DEPTH_STEP_MM + DEPTH_ROUNDING)
        depth = steps * TRIED_DEPTH_STEP_MM / 1e3
        typical = float(np.mean(rows.frequency)) / (2 * np.pi)
        teeth = grid.cut.repeats_per_turn * grid.speeds / 60
        return cls(grid, limit, fold_frequency(frequency, teeth), order, typical, grid.speeds * depth)

    def true_best_rates(self, cuts: Sequence[CutEvidence]) -> Floats:
        """Return the largest removal rate (rpm m) of cuts that are truly stable in each sample, shape (r,)."""
        stable = [cut for cut in cuts if not cut.has_chatter]
        rates = [np.where(self.is_label_wrong(cut), 0.0, cut.speed_rpm * cut.depth) for cut in stable]
        return np.asarray(np.max([np.zeros(len(self.limits)), *rates], axis=0))

    def is_label_wrong(self, cut: CutEvidence) -> Flags:
        """Return whether the verdict of a cut is wrong in each sample, shape (r,)."""
        row = int(np.argmin(np.abs(np.log(self.grid.speeds / cut.speed_rpm))))
        excess = np.log(cut.depth / self.limits[:, row]) * (-1 if cut.has_chatter else 1)
        return np.asarray(excess > MAX_LABEL_DEVIATION * LIMIT_SPREAD)

    def expected_gains(self, weights: Floats, best: float | Floats) -> Floats:
        """Return the expected gain of removal rate (rpm m) at each speed, shape (s,)."""
        more = self.removal_rates > np.min(best)
        speeds, deep = np.any(more, axis=0), np.any(more, axis=1)
        order, rates = self.depth_order[deep][:, speeds], self.removal_rates[deep][:, speeds]
        gain = np.zeros(rates.shape)
        for value in np.unique(best):
            gain += np.cumsum((weights * (best == value))[order], axis=0) * np.maximum(rates - value, 0.0)
        likely = np.cumsum(weights[order], axis=0) > MIN_STABLE_PROBABILITY
        best_gains = np.zeros(speeds.shape)
        best_gains[speeds] = np.max(likely * gain, axis=0, initial=0.0)
        return best_gains

    def candidates(self, best: float | Floats) -> Iterator[tuple[int, float]]:
        """Yield candidate speeds, by their place, and depths (m)."""
        gains = self.expected_gains(np.full(len(self.limits), 1 / len(self.limits)), best)
        places, speeds = list[int](), self.grid.speeds
        for row in np.argsort(-gains).tolist():
            if all(abs(np.log(speeds[row] / speeds[place])) > MIN_CANDIDATE_DISTANCE for place in places):
                places.append(row)
            if len(places) == MAX_CANDIDATE_SPEEDS:
                break
        for row in places:
            limits = [float(np.quantile(self.limits[:, row], 1 - chance)) for chance in TRIED_STABLE_PROBABILITIES]
            yield from ((row, depth) for depth in sorted(set(map(floor_depth, limits))) if depth > 0)

    def expected_worth(self, row: int, depth: float, best: float | Floats, left: int) -> float:
        """Return the worth of a cut (rpm m): its own gain, and that of the best next cut."""
        stable = self.limits[:, row] >= depth - EQUAL_DEPTH_TOLERANCE
        chance, rates = float(np.mean(stable)), float(self.grid.speeds[row]) * depth
        if chance <= MIN_STABLE_PROBABILITY:
            return 0.0
        gain = float(np.mean(stable * np.maximum(rates - best, 0.0)))
        if left <= 1:
            return gain
        after = chance * self._next_gain(stable / np.sum(stable), np.maximum(best, rates))
        return gain + after + (1 - chance) * self._gain_after_chatter(row, ~stable, best)

    def _gain_after_chatter(self, row: int, chatters: Flags, best: float | Floats) -> float:
        """Return the gain of the next cut, averaged over possible chatter frequencies."""
        places = np.flatnonzero(chatters)
        if not places.size:
            return 0.0
        expected = self.frequencies[places, row]
        wide = FREQUENCY_ERROR_FACTOR * CHATTER_FREQUENCY_SPREAD * self.typical_frequency
        gains = []
        shares = (np.arange(N_EXPECTED_FREQUENCIES) + 0.5) / N_EXPECTED_FREQUENCIES
        for frequency in (expected[int(share * places.size)] for share in shares):
            near = np.exp(-(((expected - frequency) / wide) ** 2) / 2)
            weights = np.zeros(len(self.limits))
            weights[places] = near / np.sum(near) if np.sum(near) > 0 else 1 / places.size
            gains.append(self._next_gain(weights, best))
        return float(np.mean(gains))

    def _next_gain(self, weights: Floats, best: float | Floats) -> float:
        """Return the gain of the best cut at any speed (rpm m)."""
        return float(np.max(self.expected_gains(weights, best)))
