"""What was learnt of the turning spindle: draws from the prior, weighted by how well they explain the cuts heard."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lobes import MillingRows
from lobewatch.analysis.learning.likelihood import log_likelihood, predicted
from lobewatch.analysis.learning.observed import Observed
from lobewatch.analysis.learning.priors import Draws, drawn
from lobewatch.analysis.programs.doubt import Doubt

COUNT = 2000
"""Draws."""
REFRESHED = 600
"""Draws that they are made anew with where few have any weight left ..."""
ENOUGH = 120
"""... which is when the effective sample size is less."""
MOVES, REACH = 4, 0.5
"""Times that each is then moved, and how far, as a share of their own spread."""
NEGLIGIBLE = 1e-6
"""Draws with less than this share of the largest weight are not looked at any more."""
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


@dataclass(frozen=True, eq=False)
class Learnt:
    """Weighted draws of the turning spindle."""

    draws: Draws
    weights: Floats
    """Of each, sum 1, shape (r,)."""
    cuts: tuple[Observed, ...]
    """What they were learnt from."""
    size: float
    """Effective sample size."""
    refreshed: int
    """How often the draws were made anew."""

    @property
    def intervals(self) -> dict[str, Interval]:
        """By name (`Draws.ratios`)."""
        return {name: _interval(values, self.weights) for name, values in self.draws.ratios().items()}

    @property
    def frequencies(self) -> int:
        """Cuts whose chatter was heard with its frequency: without any, nothing is learnt of natural frequencies."""
        return sum(cut.has_frequency for cut in self.cuts)

    def sample(self, count: int, seed: int = 0) -> Draws:
        """Draws of equal weight."""
        return self.draws[_spread(self.weights, count, np.random.default_rng((seed, 4)))]


def learn(middle: MillingRows, doubt: Doubt, cuts: Sequence[Observed], count: int = COUNT, seed: int = 0) -> Learnt:
    """Learn from cuts in the order in which they were made; the same for a seed.

    middle: the spindle at rest in the middle of the doubt (a row).
    """
    materials = 1 + max((cut.material for cut in cuts), default=0)
    draws = drawn(middle, doubt, count, materials, seed)
    log, refreshed = np.zeros(count), 0
    for number, cut in enumerate(cuts, 1):
        looked = np.flatnonzero(log > np.max(log) + np.log(NEGLIGIBLE))
        draws, log = draws[looked], log[looked]
        log = log + _log(cut, draws)
        if _size(log) < ENOUGH:
            draws, log = _refresh(draws, log, cuts[:number], np.random.default_rng((seed, 3, number)))
            refreshed += 1
    weights = np.exp(log - np.max(log))
    weights /= np.sum(weights)
    return Learnt(draws, weights, tuple(cuts), float(1 / np.sum(weights**2)), refreshed)


def _log(cut: Observed, draws: Draws) -> Floats:
    """Logarithm of the likelihood of one cut; an old one counts less, the more the frequency has moved since."""
    return log_likelihood(cut, predicted(cut, draws), cut.cut.teeth * cut.speed_rpm / 60)


def _size(log: Floats) -> float:
    weights = np.exp(log - np.max(log))
    return float(np.sum(weights) ** 2 / np.sum(weights**2))


def _refresh(
    draws: Draws, log: Floats, cuts: Sequence[Observed], random: np.random.Generator
) -> tuple[Draws, Floats]:
    """Draws of equal weight, each moved a few times by Metropolis and Hastings."""
    weights = np.exp(log - np.max(log))
    weights /= np.sum(weights)
    spread = np.cov(draws.normal.T, aweights=weights) + 1e-4 * np.eye(draws.normal.shape[1])
    root = np.linalg.cholesky(spread) * REACH
    draws = draws[_spread(weights, REFRESHED, random)]
    value = _joint(draws, cuts)
    for _ in range(MOVES):
        step = random.standard_normal(draws.normal.shape) @ root.T
        moved = Draws(draws.normal + step, draws.rest, draws.doubt)
        there = _joint(moved, cuts)
        taken = np.log(random.uniform(size=len(draws))) < there - value
        normal = np.where(taken[:, np.newaxis], moved.normal, draws.normal)
        draws, value = Draws(normal, draws.rest, draws.doubt), np.where(taken, there, value)
    return draws, np.zeros(len(draws))


def _joint(draws: Draws, cuts: Sequence[Observed]) -> Floats:
    """Logarithm of prior times likelihood of all cuts."""
    return np.asarray(sum(_log(cut, draws) for cut in cuts) - np.sum(draws.normal**2, axis=1) / 2)


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
