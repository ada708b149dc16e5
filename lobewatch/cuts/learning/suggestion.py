"""Suggest the next test cut by its expected gain in removal rate and its risk, on a grid of test cuts."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lobes import Cut, lower_envelope, stability_boundary, zero_order_lobes
from lobewatch.arrays import Flags, Floats, Indices
from lobewatch.cuts.chatter_detection.spectrum import fold_frequency
from lobewatch.cuts.learning import cut_likelihood
from lobewatch.cuts.learning.cut_likelihood import CutEvidence, predict_cut
from lobewatch.cuts.learning.posterior import Posterior, wrong_label_probability
from lobewatch.cuts.learning.prior_samples import SpindleSamples
from lobewatch.cuts.learning.repeated_cuts import find_cut_to_repeat, find_questioned_cut, is_setting_taken
from lobewatch.machine.journal.entries import CutVerdict
from lobewatch.machine.settings.drive_power import DEPTH_STEP_MM, STEP_ROUNDING, round_down_depth_mm
from lobewatch.tool.principal_directions import TipModes
from lobewatch.verdicts.zero_order_batch import ZeroOrderBatch, is_force_constant

SPEED_GRID_STEP = 0.008
"""Relative step of the checked speeds."""
N_COMPARED_SPEEDS = 80
"""Number of speeds at which the zero-order approximation is compared with semi-discretization."""
ZERO_ORDER_TRUST_RANGE = (0.1, 3.0)
"""Smallest and largest credible ratio of true limit to zero-order limit; chosen."""


class CutGrid(NamedTuple):
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


def floor_depth(depth: float) -> float:
    """Round a depth (m) down to one that can be set."""
    return round_down_depth_mm(1e3 * depth) / 1e3


def compare_zero_order(
    x: TipModes, y: TipModes, cut: Cut, feed_angles: tuple[float, ...], speeds: Floats, deepest: float
) -> Floats:
    """Return the true limit over the zero-order limit at speeds (rpm), shape (s,).

    x and y: modes of the spindle in the median. Semi-discretisation at fewer speeds, between them interpolated.
    """
    if is_force_constant(cut):
        return np.ones(speeds.shape)
    cuts = [replace(cut, feed_angle=angle) for angle in feed_angles]
    places = np.linspace(0, speeds.size - 1, min(N_COMPARED_SPEEDS, speeds.size))
    compared = speeds[np.unique(places.astype(np.intp))]
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


class LimitCharts(NamedTuple):
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
    def of(cls, samples: SpindleSamples, grid: CutGrid) -> "LimitCharts":
        """Compute the limits of samples at speed."""
        rows = replace(samples.build_rows(1.0, grid.cut.tangential, grid.cut.radial), cut=grid.cut)
        deepest = LIMIT_DEPTH_MARGIN + float(np.max(grid.max_depths / grid.zero_order_trust))
        fed = [
            ZeroOrderBatch.of(rows.with_feed_angle(angle)).estimate_limits(grid.speeds, deepest)
            for angle in grid.feed_angles
        ]
        worst = np.argmin([limit for limit, _ in fed], axis=0)[np.newaxis]
        limit, frequency = (np.take_along_axis(np.array(part), worst, axis=0)[0] for part in zip(*fed, strict=True))
        limit = np.minimum(limit * grid.zero_order_trust, grid.max_depths)
        typical = float(np.mean(rows.frequency)) / (2 * np.pi)
        teeth = grid.cut.repeats_per_turn * grid.speeds / 60
        return cls._of_limits(grid, limit, fold_frequency(frequency, teeth), typical)

    @classmethod
    def _of_limits(cls, grid: CutGrid, limits: Floats, frequencies: Floats, typical: float) -> "LimitCharts":
        """Order the limits of samples."""
        order = np.argsort(-limits, axis=0, kind="stable")
        steps = np.floor(np.take_along_axis(limits, order, axis=0) * 1e3 / DEPTH_STEP_MM + STEP_ROUNDING)
        return cls(grid, limits, frequencies, order, typical, grid.speeds * steps * DEPTH_STEP_MM / 1e3)

    def true_best_rates(self, cuts: Sequence[CutEvidence]) -> Floats:
        """Return the largest removal rate (rpm m) of cuts that are truly stable in each sample, shape (r,)."""
        stable = [cut for cut in cuts if not cut.has_chatter]
        rates = [np.where(self.is_label_wrong(cut), 0.0, cut.speed_rpm * cut.depth) for cut in stable]
        return np.asarray(np.max([np.zeros(len(self.limits)), *rates], axis=0))

    def doubt(self, cut: CutEvidence) -> "LimitCharts":
        """Count the samples in which the verdict of a cut is wrong several times."""
        places = np.repeat(np.arange(len(self.limits)), np.where(self.is_label_wrong(cut), ASKED_CUT_ODDS, 1))
        return self._of_limits(self.grid, self.limits[places], self.frequencies[places], self.typical_frequency)

    def is_label_wrong(self, cut: CutEvidence) -> Flags:
        """Return whether the verdict of a cut is wrong in each sample, shape (r,)."""
        row = int(np.argmin(np.abs(np.log(self.grid.speeds / cut.speed_rpm))))
        excess = np.log(cut.depth / self.limits[:, row]) * (-1 if cut.has_chatter else 1)
        return np.asarray(excess > MAX_LABEL_DEVIATION * cut_likelihood.LIMIT_SPREAD)

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
        wide = FREQUENCY_ERROR_FACTOR * cut_likelihood.CHATTER_FREQUENCY_SPREAD * self.typical_frequency
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


ABSENT_DAMPING_FACTOR = 0.25
"""Factor on the weight of samples without process damping; chosen, as nearly all cuts have some.

Verdicts keep the prior of `ProcessDamping`, as they must be safe without it."""
N_SUGGESTION_SAMPLES = 300
"""Number of samples from which chances are computed."""
TRIED_DEPTH_SHARES = (1.0, 0.85, 0.7, 0.5, 0.35)
"""Shares of a depth checked in turn where the zero-order approximation is inexact; chosen."""
MAX_FIRST_CUT_RISK, FIRST_CUT_DEPTH_FACTOR = 0.2, 1.5
"""Largest chatter risk of a first cut deeper than a factor times the program depth, and that factor."""
FIRST_CUT_DEPTH_SHARES = (1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.6, 0.5, 0.35)
"""Shares of a depth checked in turn for such a first cut; chosen."""
MIN_REPEAT_PROBABILITY = 0.05
"""Chance of a wrong label "chatter" that repeats a cut, except the last; chosen, see docs/studies/cuts.md.

The last of five cuts gains 4 % of the optimum. A wrong label costs 20 %."""
ASKED_CUT_ODDS = 3
"""Factor on the odds of a wrong verdict of the questioned cut, for the last cut; chosen.

If the verdict is right, the last cut gains 1 or 2 % of the optimum, if it is wrong up to 20 %."""
MIN_EXPECTED_GAIN = 0.005
"""Smallest expected gain as a share of the best removal rate so far; chosen."""
MIN_REMOVAL_RATE_SHARE = 1e-3
"""Smallest best removal rate so far, as a share of the largest of the grid."""


class Suggestion(NamedTuple):
    """Suggested test cut."""

    speed_rpm: float
    """Spindle speed (rpm)."""
    depth: float
    """Axial depth of cut (m)."""
    chatter_probability: float
    """Chance of chatter."""
    gain: float
    """Expected gain in removal rate over the best recorded stable rate so far; inf if there is none."""
    most_informative: str
    """Name of the quantity that it determines most (as in `SpindleSamples.ratios`)."""
    repeats: str = ""
    """Journal number of the rejected cut that it repeats; empty for a new cut."""


def expect_process_damping(posterior: Posterior) -> Posterior:
    """Return the posterior with less weight of the samples without process damping."""
    damping = posterior.samples.damping
    absent = damping.is_open & (posterior.samples.process_damping(0) <= damping.low)
    return posterior._replace(log_weight=posterior.log_weight + np.log(ABSENT_DAMPING_FACTOR) * absent)


def find_best_removal_rate(cuts: Sequence[CutEvidence]) -> float:
    """Return the largest stable speed times depth (rpm m); 0 without a stable cut."""
    return max((cut.speed_rpm * cut.depth for cut in cuts if not cut.has_chatter), default=0.0)


def suggest_cut(
    posterior: Posterior,
    grid: CutGrid,
    cuts: Sequence[CutEvidence],
    left: int = 1,
    rejected: Collection[CutEvidence] = (),
    programmed: float = 0.0,
) -> Suggestion | None:
    """Suggest the next test cut, or None if nothing more can be gained.

    A cut with a doubtful verdict is repeated once, a stable one only while another cut is left. Else, a cut is worth
    its own gain and the expected gain of the best next one. The best rate so far counts where its cut is truly stable.
    The last cut also has to gain where the questioned stable cut chattered. The zero-order approximation
    proposes. Semi-discretization evaluates the chosen cut.

    cuts: those of this program. left: test cuts still to be made, this one included. rejected: cuts with a rejected
    verdict. programmed: depth of the program (m). The first cut is about as deep, or has little risk.
    """
    best = find_best_removal_rate([cut for cut in cuts if cut not in rejected])
    few = expect_process_damping(posterior).resample(N_SUGGESTION_SAMPLES)
    samples, chart = few.samples, LimitCharts.of(few.samples, grid)
    if left <= 1 and (asked := find_cut_to_ask(posterior, cuts)) is not None:
        chart = chart.doubt(asked)
    if (again := _find_repeat(few, [cut for cut in cuts if grid.contains(cut.speed_rpm)], left, rejected)) is not None:
        return _build_suggestion(grid, again.speed_rpm, again.depth, best, samples)._replace(repeats=again.id)
    unlearned = find_best_removal_rate([cut for cut in cuts if cut not in posterior.cuts])
    true = np.maximum(chart.true_best_rates(cuts), unlearned)
    least = MIN_EXPECTED_GAIN * max(best, MIN_REMOVAL_RATE_SHARE * float(np.max(chart.removal_rates)))
    careful_from = np.inf if cuts else FIRST_CUT_DEPTH_FACTOR * programmed
    speeds, worth = grid.speeds.tolist(), dict[tuple[int, float], float]()
    for row, depth in chart.candidates(true):
        if not is_setting_taken(speeds[row], depth, cuts, rejected):
            worth[row, depth] = chart.expected_worth(row, depth, true, left)
    for row, depth in sorted(worth, key=lambda place: -worth[place]):
        if worth[row, depth] < least:
            return None
        suggestion = _find_likely_stable(grid, float(grid.speeds[row]), depth, best, samples, careful_from)
        if suggestion is not None:
            return suggestion
    return None


def _find_repeat(
    few: Posterior, cuts: Sequence[CutEvidence], left: int, rejected: Collection[CutEvidence]
) -> CutEvidence | None:
    """Find the cut whose verdict is worth a repetition, or None.

    A stable cut against which three deeper ones chatter comes first. The last cut repeats no stable one, as that gains
    nothing.
    """
    if left > 1 and (questioned := find_questioned_cut(cuts)) is not None:
        return questioned
    again = find_cut_to_repeat(cuts, [cut for cut in rejected if cut.has_chatter or left > 1])
    if again is not None or left <= 1:
        return again
    once = [cut for cut in cuts if cut in few.cuts and find_cut_to_repeat(cuts, [cut])]
    chances = [wrong_label_probability(few.predict(cut)) for cut in once]
    if max(chances, default=0.0) <= MIN_REPEAT_PROBABILITY:
        return None
    most = once[int(np.argmax(chances))]
    return most if most.has_chatter else None


def find_cut_to_ask(posterior: Posterior, cuts: Sequence[CutEvidence]) -> CutEvidence | None:
    """Find the stable cut that is questioned by name, or None.

    Three deeper cuts chatter, or it is the best one and doubtful enough. The answer needs no cut.
    """
    if (questioned := find_questioned_cut(cuts)) is not None:
        return questioned
    stable = [cut for cut in cuts if cut in posterior.cuts and not cut.has_chatter and find_cut_to_repeat(cuts, [cut])]
    best = max(stable, key=lambda cut: cut.speed_rpm * cut.depth, default=None)
    if best is None or wrong_label_probability(posterior.predict(best)) <= MIN_REPEAT_PROBABILITY:
        return None
    return best


def _find_likely_stable(
    grid: CutGrid, speed: float, depth: float, best: float, samples: SpindleSamples, careful_from: float
) -> Suggestion | None:
    """Find the cut, or a shallower one, that is likely stable; deeper than careful_from (m) with little risk."""
    nearby = (1.0,) if is_force_constant(grid.cut) else TRIED_DEPTH_SHARES
    for share in nearby if depth <= careful_from else FIRST_CUT_DEPTH_SHARES:
        deep = floor_depth(share * depth)
        if deep > 0:
            suggestion = _build_suggestion(grid, speed, deep, best, samples)
            risk = suggestion.chatter_probability
            if risk < 1 - MIN_STABLE_PROBABILITY and (deep <= careful_from or risk <= MAX_FIRST_CUT_RISK):
                return suggestion
    return None


def _build_suggestion(grid: CutGrid, speed: float, depth: float, best: float, samples: SpindleSamples) -> Suggestion:
    """Build the suggestion of a cut."""
    prediction = predict_cut(grid.build_evidence(speed, depth), samples)
    chance = float(np.mean(prediction.chatter_probability))
    gain = (1 - chance) * (speed * depth - best)
    settles = _most_informative(samples.ratios(), prediction.label_probability)
    return Suggestion(speed, depth, chance, gain / best if best else np.inf, settles)


def _most_informative(ratios: Mapping[str, Floats], chance: Floats) -> str:
    """Return the factor that differs most, in its standard deviations, between stable and chattering samples."""
    contrast = {}
    for name, values in ratios.items():
        chatters, stable = (float(np.sum(values * share) / np.sum(share)) for share in (chance, 1 - chance))
        contrast[name] = abs(chatters - stable) / max(float(np.std(values)), 1e-12)
    return max(contrast, key=lambda name: contrast[name])
