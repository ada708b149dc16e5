"""Suggest the next test cut by its expected gain and risk."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lobewatch.arrays import Floats
from lobewatch.cuts.learning.cut_evidence import CutEvidence, find_cut_to_repeat, is_setting_taken
from lobewatch.cuts.learning.cut_likelihood import predict_cut
from lobewatch.cuts.learning.expected_gain import MIN_STABLE_PROBABILITY, CutGrid, LimitCharts, floor_depth
from lobewatch.cuts.learning.label_check import wrong_label_probability
from lobewatch.cuts.learning.posterior import Posterior
from lobewatch.cuts.learning.prior_samples import SpindleSamples
from lobewatch.verdicts.zero_order_batch import is_force_constant

N_SUGGESTION_SAMPLES = 300
"""Number of samples from which chances are computed."""
TRIED_DEPTH_SHARES = (1.0, 0.85, 0.7, 0.5, 0.35)
"""Shares of a depth checked in turn where the zero-order approximation is inexact; chosen."""
MAX_FIRST_CUT_RISK, FIRST_CUT_DEPTH_FACTOR = 0.2, 1.5
"""Largest chatter risk of a first cut deeper than a factor times the program depth, and that factor."""
FIRST_CUT_DEPTH_SHARES = (1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.6, 0.5, 0.35)
"""Shares of a depth checked in turn for such a first cut; chosen."""
MIN_REPEAT_PROBABILITY = 0.05
"""Chance of a wrong label "chatter" from which a cut is repeated, unless it is the last; chosen, see docs/cuts.md.

The last of five cuts gains 4 % of the optimum. A wrong label costs 20 %."""
MIN_EXPECTED_GAIN = 0.005
"""Smallest expected gain as a share of the best removal rate so far; chosen."""
MIN_REMOVAL_RATE_SHARE = 1e-3
"""Smallest best removal rate so far, as a share of the largest of the grid."""


@dataclass(frozen=True)
class Suggestion:
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

    cuts: those of this very program; left: test cuts that are still to be made, this one with them; doubted: cuts
    that are not believed. One of those that lies within the grid is made again, once, but for a stable one with the
    last cut; and so is one whose word is doubtful enough while another is left. Else, with more than one left, a cut
    is worth what it gains itself and what the best next one is then expected to gain; the best so far counts as its
    chance to be right says. A diagram by the zero-order approximation proposes; what is chosen was evaluated by
    semi-discretization. programmed: depth of the program (m); the first cut is about as deep, or chatters hardly.
    """
    best = find_best_removal_rate([cut for cut in cuts if cut not in rejected])
    few = posterior.resample(N_SUGGESTION_SAMPLES)
    samples, chart = few.samples, LimitCharts.of(few.samples, grid)
    if (again := _find_repeat(few, [cut for cut in cuts if grid.contains(cut.speed_rpm)], left, rejected)) is not None:
        return replace(_build_suggestion(grid, again.speed_rpm, again.depth, best, samples), repeats=again.id)
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

    The last cut makes none again whose word "stable" is not believed: that would gain nothing.
    """
    again = find_cut_to_repeat(cuts, [cut for cut in rejected if cut.has_chatter or left > 1])
    if again is not None or left <= 1:
        return again
    once = [cut for cut in cuts if cut in few.cuts and find_cut_to_repeat(cuts, [cut])]
    chances = [wrong_label_probability(few.predict(cut)) for cut in once]
    if max(chances, default=0.0) <= MIN_REPEAT_PROBABILITY:
        return None
    most = once[int(np.argmax(chances))]
    return most if most.has_chatter else None


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
