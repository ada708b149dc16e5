"""What was learnt of the turning spindle: draws from the prior, weighted by how well they explain its cuts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lobes import MillingRows
from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.likelihood import (
    CutPrediction,
    log_likelihood,
    most_likely,
    power_log_likelihood,
    predict_cut,
)
from lobewatch.cuts.learning.priors import Draws, draw_prior
from lobewatch.verdicts.doubt import Doubt

COUNT = 2000
"""Number of draws."""
REFRESHED = 500
"""Number of draws that are made anew where few have any weight left ..."""
ENOUGH = 120
"""... which is when the effective sample size is less."""
MOVES, REACH = 4, 0.5
"""Number of times that each is then moved, and how far, as a share of their own spread; chosen."""
REGULAR = 1e-4
"""Variance that is added to that of the draws before they are moved: a few alike have none of their own."""
NEGLIGIBLE = 1e-6
"""Share of the largest weight below which a draw is not looked at any more."""
SETTLED, OPEN = 2, (0.90, 1.05)
"""Chatter frequencies without which nobody knows how far a spindle at speed may be off, and how far that is; chosen."""
USUAL = (0.945, 1.025)
"""Ends between which 95 % of natural frequencies at speed lie, over those at rest: `priors.FREQUENCY`."""
LEVEL = 0.95
"""Share of the weight that an interval holds."""

Floats = NDArray[np.float64]


class Interval(NamedTuple):
    """A number that is learnt, as a factor on that at rest (on that of the table, of coefficients)."""

    mean: float
    """Weighted mean."""
    low: float
    """Lower end: 2.5 % of the weight lies below."""
    high: float
    """Upper end: 2.5 % of the weight lies above."""
    std: float
    """Weighted standard deviation."""

    def no_narrower(self, low: float, high: float) -> Interval:
        """An interval that has both of these inside."""
        return self._replace(low=min(self.low, low), high=max(self.high, high))


@dataclass(frozen=True, eq=False)
class Posterior:
    """Weighted draws of the turning spindle."""

    draws: Draws
    """Spindles at speed."""
    log_weight: Floats
    """Logarithm of the weight of each, up to a constant, shape (r,)."""
    cuts: tuple[CutEvidence, ...] = ()
    """Cuts that they were learnt from."""
    refreshed: int = 0
    """Number of times that the draws were made anew."""
    seed: int = 0
    """Seed of all draws."""

    @property
    def weights(self) -> Floats:
        """Weight of each draw, sum 1, shape (r,)."""
        return _weights(self.log_weight)

    @property
    def size(self) -> float:
        """Effective sample size."""
        return float(1 / np.sum(self.weights**2))

    @property
    def intervals(self) -> dict[str, Interval]:
        """Intervals by name (`Draws.ratios`); of natural frequencies they stay open until chatter was heard twice."""
        intervals = {name: _interval(values, self.weights) for name, values in self.draws.ratios().items()}
        if self.frequencies < SETTLED:
            intervals |= {
                name: intervals[name].no_narrower(*OPEN) for name in intervals if name.startswith("frequency")
            }
        return intervals

    @property
    def frequencies(self) -> int:
        """Cuts whose chatter was heard with its frequency: without any, nothing is learnt of natural frequencies."""
        return sum(cut.has_frequency for cut in self.cuts)

    @property
    def is_far_off(self) -> bool:
        """Whether a natural frequency is more likely than not further from that at rest than 95 % of spindles are."""
        leading = [values for name, values in self.draws.ratios().items() if name in ("frequency_x", "frequency_y")]
        beside = [(USUAL[0] < values) & (values < USUAL[1]) for values in leading]
        return self.frequencies >= SETTLED and float(np.sum(self.weights * np.all(beside, axis=0))) < 1 / 2

    def learn_from(self, cut: CutEvidence) -> Posterior:
        """What is known after one more cut."""
        return self.predict(cut).learn()

    def predict(self, cut: CutEvidence) -> NewEvidence:
        """A cut, and what it would sound like on the spindles that are not ruled out."""
        likely = np.flatnonzero(self.log_weight > np.max(self.log_weight) + np.log(NEGLIGIBLE))
        draws = self.draws[likely].with_materials(cut.material + 1, self.seed)
        before = replace(self, draws=draws, log_weight=self.log_weight[likely])
        return NewEvidence(before, cut, predict_cut(cut, draws))

    def sample(self, count: int) -> Draws:
        """Draws of equal weight."""
        return self.draws[_spread(self.weights, count, np.random.default_rng((self.seed, 4, len(self.cuts))))]

    def drawn(self, count: int) -> Posterior:
        """The same by so many draws of equal weight."""
        return replace(self, draws=self.sample(count), log_weight=np.zeros(count))


@dataclass(frozen=True, eq=False)
class NewEvidence:
    """A cut before it teaches anything."""

    before: Posterior
    """Posterior without it: draws that have any weight left, with coefficients of its material."""
    cut: CutEvidence
    """The cut."""
    prediction: CutPrediction
    """Sound that each of these draws would make in it."""

    def learn(self) -> Posterior:
        """What is known with it."""
        log_weight = self.before.log_weight + _log_likelihood(
            self.cut, self.before.draws, self.prediction, self.before.cuts
        )
        learnt = replace(self.before, log_weight=log_weight, cuts=(*self.before.cuts, self.cut))
        return _refresh(learnt) if learnt.size < ENOUGH else learnt


def prior(middle: MillingRows, doubt: Doubt, count: int = COUNT, seed: int = 0) -> Posterior:
    """What is known before the first cut.

    middle: the spindle at rest in the middle of the doubt (a row).
    """
    return Posterior(draw_prior(middle, doubt, count, seed=seed), np.zeros(count), seed=seed)


def _log_likelihood(cut: CutEvidence, draws: Draws, prediction: CutPrediction, before: Sequence[CutEvidence]) -> Floats:
    """Logarithm of the likelihood of one cut after those before it; the word of an old one counts less, the more the
    frequency has moved since."""
    word = log_likelihood(cut, prediction, [other for other in before if cut.is_again(other)])
    return cut.weight * word + power_log_likelihood(cut, draws.force(cut.material), before)


def _weights(log_weight: Floats) -> Floats:
    weights = np.exp(log_weight - np.max(log_weight))
    return np.asarray(weights / np.sum(weights))


def _refresh(learnt: Posterior) -> Posterior:
    """Draws of equal weight, each moved a few times by Metropolis and Hastings."""
    weights, draws, cuts = learnt.weights, learnt.draws, learnt.cuts
    random = np.random.default_rng((learnt.seed, 3, len(cuts)))
    spread = np.cov(draws.normal.T, aweights=weights) + REGULAR * np.eye(draws.normal.shape[1])
    root = np.linalg.cholesky(spread) * REACH
    chosen, copies = np.unique(_spread(weights, REFRESHED, random), return_inverse=True)
    value = _joint(draws[chosen], cuts, np.full(len(chosen), -np.inf))[copies]
    draws = draws[chosen[copies]]
    for _ in range(MOVES):
        step = random.standard_normal(draws.normal.shape) @ root.T
        moved = replace(draws, normal=draws.normal + step)
        least = value + np.log(random.uniform(size=len(draws)))
        moved_value = _joint(moved, cuts, least)
        taken = moved_value > least
        normal = np.where(taken[:, np.newaxis], moved.normal, draws.normal)
        draws, value = replace(draws, normal=normal), np.where(taken, moved_value, value)
    return replace(learnt, draws=draws, log_weight=np.zeros(len(draws)), refreshed=learnt.refreshed + 1)


def _joint(draws: Draws, cuts: Sequence[CutEvidence], least: Floats) -> Floats:
    """Logarithm of prior times likelihood of all cuts; -inf where that is not more than the least (r,).

    A draw that cannot come to more any more is not asked about further cuts.
    """
    value: Floats = -np.sum(draws.normal**2, axis=1) / 2
    hope = [cut.weight * most_likely(cut) for cut in cuts]
    for k, cut in enumerate(cuts):
        value[value + sum(hope[k:]) <= least] = -np.inf
        asked = np.flatnonzero(np.isfinite(value))
        if asked.size:
            left = draws[asked]
            value[asked] += _log_likelihood(cut, left, predict_cut(cut, left), cuts[:k])
    return value


def _spread(weights: Floats, count: int, random: np.random.Generator) -> NDArray[np.intp]:
    """Places drawn by weight, systematically: each as often as its weight says, but for one."""
    at = (np.arange(count) + random.uniform()) / count
    return np.minimum(np.searchsorted(np.cumsum(weights), at), weights.size - 1)


def _interval(values: Floats, weights: Floats) -> Interval:
    order = np.argsort(values)
    share = np.cumsum(weights[order]) - weights[order] / 2
    low, high = np.interp([(1 - LEVEL) / 2, (1 + LEVEL) / 2], share, values[order])
    mean = float(np.sum(weights * values))
    return Interval(mean, float(low), float(high), float(np.sqrt(np.sum(weights * (values - mean) ** 2))))
