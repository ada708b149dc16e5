"""What was learnt of the turning spindle: draws from the prior, weighted by how well they explain the cuts heard."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lobes import MillingRows
from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.likelihood import CutPrediction, log_likelihood, most_likely, predict_cut
from lobewatch.cuts.learning.priors import Draws, draw_prior
from lobewatch.verdicts.doubt import Doubt

COUNT = 2000
"""Draws."""
REFRESHED = 500
"""Draws that they are made anew with where few have any weight left ..."""
ENOUGH = 120
"""... which is when the effective sample size is less."""
MOVES, REACH = 4, 0.5
"""Times that each is then moved, and how far, as a share of their own spread."""
NEGLIGIBLE = 1e-6
"""Draws with less than this share of the largest weight are not looked at any more."""
SETTLED, OPEN = 2, (0.90, 1.05)
"""Chatter frequencies without which nobody knows how far a spindle at speed may be off, and how far that is."""
USUAL = (0.945, 1.025)
"""95 % of natural frequencies at speed lie between these, over those at rest."""
LEVEL = 0.95
"""Of intervals."""

Floats = NDArray[np.float64]


class Interval(NamedTuple):
    """A number that is learnt, as a factor on that at rest (on that of the table, of coefficients)."""

    mean: float
    low: float
    """2.5 % ..."""
    high: float
    """... and 97.5 % lie beyond."""
    std: float

    def no_narrower(self, low: float, high: float) -> Interval:
        """It, with both of these inside."""
        return self._replace(low=min(self.low, low), high=max(self.high, high))


@dataclass(frozen=True, eq=False)
class Posterior:
    """Weighted draws of the turning spindle."""

    draws: Draws
    log: Floats
    """Logarithm of the weight of each, up to a constant, shape (r,)."""
    cuts: tuple[CutEvidence, ...] = ()
    """What they were learnt from."""
    refreshed: int = 0
    """How often the draws were made anew."""
    seed: int = 0

    @property
    def weights(self) -> Floats:
        """Of each draw, sum 1, shape (r,)."""
        return _weights(self.log)

    @property
    def size(self) -> float:
        """Effective sample size."""
        return float(1 / np.sum(self.weights**2))

    @property
    def intervals(self) -> dict[str, Interval]:
        """By name (`Draws.ratios`); those of natural frequencies stay open until two were heard in chatter."""
        found = {name: _interval(values, self.weights) for name, values in self.draws.ratios().items()}
        if self.frequencies >= SETTLED:
            return found
        return {name: one.no_narrower(*OPEN) if name.startswith("frequency") else one for name, one in found.items()}

    @property
    def frequencies(self) -> int:
        """Cuts whose chatter was heard with its frequency: without any, nothing is learnt of natural frequencies."""
        return sum(cut.has_frequency for cut in self.cuts)

    @property
    def is_far_off(self) -> bool:
        """Whether a natural frequency is more likely than not further from that at rest than 95 % of spindles are."""
        ratios = self.draws.ratios()
        beside = [(USUAL[0] < ratios[name]) & (ratios[name] < USUAL[1]) for name in ("frequency_x", "frequency_y")]
        return self.frequencies >= SETTLED and float(np.sum(self.weights * np.all(beside, axis=0))) < 1 / 2

    def learn_from(self, cut: CutEvidence) -> Posterior:
        """What is known after one more cut."""
        return self.predict(cut).learn()

    def predict(self, cut: CutEvidence) -> NewEvidence:
        """A cut, and what it would sound like on the spindles that are not ruled out."""
        looked = np.flatnonzero(self.log > np.max(self.log) + np.log(NEGLIGIBLE))
        draws = self.draws[looked].with_materials(cut.material + 1, self.seed)
        return NewEvidence(replace(self, draws=draws, log=self.log[looked]), cut, predict_cut(cut, draws))

    def sample(self, count: int) -> Draws:
        """Draws of equal weight."""
        return self.draws[_spread(self.weights, count, np.random.default_rng((self.seed, 4, len(self.cuts))))]


@dataclass(frozen=True, eq=False)
class NewEvidence:
    """A cut before it teaches anything."""

    learnt: Posterior
    """Without it: draws that have any weight left, with coefficients of its material."""
    cut: CutEvidence
    guess: CutPrediction
    """What each of these draws would do in it."""

    def learn(self) -> Posterior:
        """What is known with it."""
        known, cuts = self.learnt, (*self.learnt.cuts, self.cut)
        draws, log, refreshed = known.draws, known.log + _log(self.cut, self.guess), known.refreshed
        if 1 / np.sum(_weights(log) ** 2) < ENOUGH:
            draws, log = _refresh(draws, log, cuts, np.random.default_rng((known.seed, 3, len(cuts))))
            refreshed += 1
        return replace(known, draws=draws, log=log, cuts=cuts, refreshed=refreshed)


def prior(middle: MillingRows, doubt: Doubt, count: int = COUNT, seed: int = 0) -> Posterior:
    """What is known before the first cut.

    middle: the spindle at rest in the middle of the doubt (a row).
    """
    return Posterior(draw_prior(middle, doubt, count, seed=seed), np.zeros(count), seed=seed)


def learn(
    middle: MillingRows, doubt: Doubt, cuts: Sequence[CutEvidence], count: int = COUNT, seed: int = 0
) -> Posterior:
    """Learn from cuts in the order in which they were made; the same for a seed."""
    return reduce(Posterior.learn_from, cuts, prior(middle, doubt, count, seed))


def _log(cut: CutEvidence, guess: CutPrediction) -> Floats:
    """Logarithm of the likelihood of one cut; an old one counts less, the more the frequency has moved since."""
    return cut.weight * log_likelihood(cut, guess, _teeth(cut))


def _teeth(cut: CutEvidence) -> float:
    """Tooth frequency (Hz)."""
    return cut.cut.teeth * cut.speed_rpm / 60


def _weights(log: Floats) -> Floats:
    weights = np.exp(log - np.max(log))
    return np.asarray(weights / np.sum(weights))


def _refresh(
    draws: Draws, log: Floats, cuts: Sequence[CutEvidence], random: np.random.Generator
) -> tuple[Draws, Floats]:
    """Draws of equal weight, each moved a few times by Metropolis and Hastings."""
    weights = _weights(log)
    spread = np.cov(draws.normal.T, aweights=weights) + 1e-4 * np.eye(draws.normal.shape[1])
    root = np.linalg.cholesky(spread) * REACH
    chosen, copies = np.unique(_spread(weights, REFRESHED, random), return_inverse=True)
    value = _joint(draws[chosen], cuts, np.full(len(chosen), -np.inf))[copies]
    draws = draws[chosen[copies]]
    for _ in range(MOVES):
        step = random.standard_normal(draws.normal.shape) @ root.T
        moved = replace(draws, normal=draws.normal + step)
        least = value + np.log(random.uniform(size=len(draws)))
        there = _joint(moved, cuts, least)
        taken = there > least
        normal = np.where(taken[:, np.newaxis], moved.normal, draws.normal)
        draws, value = replace(draws, normal=normal), np.where(taken, there, value)
    return draws, np.zeros(len(draws))


def _joint(draws: Draws, cuts: Sequence[CutEvidence], least: Floats) -> Floats:
    """Logarithm of prior times likelihood of all cuts; -inf where that is not more than the least (r,).

    A draw that cannot come to more any more is not asked about further cuts.
    """
    value: Floats = -np.sum(draws.normal**2, axis=1) / 2
    hope = [cut.weight * most_likely(cut, _teeth(cut)) for cut in cuts]
    for k, cut in enumerate(cuts):
        value[value + sum(hope[k:]) <= least] = -np.inf
        asked = np.flatnonzero(np.isfinite(value))
        if asked.size:
            value[asked] += _log(cut, predict_cut(cut, draws[asked]))
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
