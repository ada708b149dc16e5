"""The next test cut: the one that is worth most of those that are more likely stable than not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.grid import Grid, floor_depth
from lobewatch.cuts.learning.likelihood import predict_cut
from lobewatch.cuts.learning.limit_charts import LIKELY, LimitCharts
from lobewatch.cuts.learning.posterior import Posterior
from lobewatch.cuts.learning.priors import Draws
from lobewatch.verdicts.mean_force import is_constant

DRAWS = 300
"""Number of draws that chances are worked out from."""
NEARBY = (1.0, 0.85, 0.7, 0.5, 0.35)
"""Shares of a depth that are looked at in turn where zero order is not exact; chosen."""
GAINED = 0.005
"""Share of the best removal rate so far below which an expected gain is none; chosen."""
LEAST_RATE = 1e-3
"""Share of the largest removal rate of the grid that the best so far is taken for at least."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Suggestion:
    """A test cut that is worth making."""

    speed_rpm: float
    """Spindle speed (rpm)."""
    depth: float
    """Axial depth (m)."""
    chance: float
    """Chance that it chatters."""
    gain: float
    """Expected gain of removal rate, relative to the best heard stable so far; inf where there is none."""
    settles: str
    """Name of what it tells most of (as in `Draws.ratios`)."""


def best_removal_rate(cuts: Sequence[CutEvidence]) -> float:
    """Largest speed times depth (rpm m) that was heard stable; 0 where none was."""
    return max((cut.speed_rpm * cut.depth for cut in cuts if not cut.chatters), default=0.0)


def suggest(learnt: Posterior, grid: Grid, cuts: Sequence[CutEvidence], left: int = 1) -> Suggestion | None:
    """The next test cut; None where nothing more is to be gained.

    cuts: those of this very program; left: test cuts that are still to be made, this one with them. With more than
    one a cut is worth what it gains itself and what the best next one is then expected to gain. A diagram by zero order
    proposes; what is chosen was judged by semi-discretisation.
    """
    best, draws = best_removal_rate(cuts), learnt.sample(DRAWS)
    chart = LimitCharts.of(draws, grid)
    most = float(np.max(chart.chips))
    least = GAINED * max(best, LEAST_RATE * most)
    worth = {place: chart.worth(place[0], place[1], best, left) for place in chart.candidates(best)}
    for row, depth in sorted(worth, key=lambda place: -worth[place]):
        if worth[row, depth] < least:
            return None
        suggestion = _judge(grid, float(grid.speeds[row]), depth, best, draws)
        if suggestion is not None:
            return suggestion
    return None


def _judge(grid: Grid, speed: float, depth: float, best: float, draws: Draws) -> Suggestion | None:
    """The cut, or one not as deep where it is more likely to chatter than not."""
    for share in (1.0,) if is_constant(grid.cut) else NEARBY:
        deep = floor_depth(share * depth)
        chance = predict_cut(grid.evidence(speed, deep), draws).chance
        if deep > 0 and np.mean(chance) < 1 - LIKELY:
            gain = float(1 - np.mean(chance)) * (speed * deep - best)
            settles = _settles(draws.ratios(), chance)
            return Suggestion(speed, deep, float(np.mean(chance)), gain / best if best else np.inf, settles)
    return None


def _settles(ratios: Mapping[str, Floats], chance: Floats) -> str:
    """Name of what differs most, in its standard deviations, between spindles on which a cut chatters and others."""
    contrast = {}
    for name, values in ratios.items():
        chatters, stable = (float(np.sum(values * share) / np.sum(share)) for share in (chance, 1 - chance))
        contrast[name] = abs(chatters - stable) / max(float(np.std(values)), 1e-12)
    return max(contrast, key=lambda name: contrast[name])
