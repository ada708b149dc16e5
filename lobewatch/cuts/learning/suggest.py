"""The next test cut: the one that is worth most of those that are more likely stable than not."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lobewatch.cuts.learning.contradicting import chance_wrong
from lobewatch.cuts.learning.cut_again import cut_again, is_taken
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
CAREFUL, DEEPER = 0.2, 1.5
"""Greatest chance of chatter of a first test cut that is deeper than so many times the depth of its program."""
CAREFULLY = (1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.6, 0.5, 0.35)
"""Shares of a depth that are looked at in turn for such a first cut; chosen."""
WORTH_A_CUT = 0.05
"""Chance that a word "chatter" is wrong, from which it is asked for again while another cut is left; chosen, see
docs/cuts.md: the last of five cuts gains 4 % of the optimum, a word that is wrong costs 20 %."""
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
    repeats: str = ""
    """Number in the journal of the cut that it makes again, since that is not believed; empty for a new one."""


def best_removal_rate(cuts: Sequence[CutEvidence]) -> float:
    """Largest speed times depth (rpm m) that was heard stable; 0 where none was."""
    return max((cut.speed_rpm * cut.depth for cut in cuts if not cut.chatters), default=0.0)


def suggest(
    learnt: Posterior,
    grid: Grid,
    cuts: Sequence[CutEvidence],
    left: int = 1,
    doubted: Collection[CutEvidence] = (),
    programmed: float = 0.0,
) -> Suggestion | None:
    """The next test cut; None where nothing more is to be gained.

    cuts: those of this very program; left: test cuts that are still to be made, this one with them; doubted: cuts that
    are not believed. One of those that lies within the grid is made again, once, but for a stable one with the last
    cut; and so is one whose word is doubtful enough while another is left. Else, with more than one left, a cut is
    worth what it gains itself and what the best next one is then expected to gain; the best so far counts as its chance
    to be right says. A diagram by zero order proposes; what is chosen was judged by semi-discretisation. programmed:
    depth of the program (m); the first cut is about as deep, or chatters hardly.
    """
    best, few = best_removal_rate([cut for cut in cuts if cut not in doubted]), learnt.drawn(DRAWS)
    draws, chart = few.draws, LimitCharts.of(few.draws, grid)
    if (again := _asked_again(few, [cut for cut in cuts if grid.holds(cut.speed_rpm)], left, doubted)) is not None:
        return replace(_judged(grid, again.speed_rpm, again.depth, best, draws), repeats=again.id)
    true = np.maximum(chart.truly_best(cuts), best_removal_rate([cut for cut in cuts if cut not in learnt.cuts]))
    least = GAINED * max(best, LEAST_RATE * float(np.max(chart.chips)))
    careful_from = np.inf if cuts else DEEPER * programmed
    speeds = grid.speeds.tolist()
    places = [(row, deep) for row, deep in chart.candidates(true) if not is_taken(speeds[row], deep, cuts, doubted)]
    worth = {place: chart.worth(place[0], place[1], true, left) for place in places}
    for row, depth in sorted(worth, key=lambda place: -worth[place]):
        if worth[row, depth] < least:
            return None
        suggestion = _likely_stable(grid, float(grid.speeds[row]), depth, best, draws, careful_from)
        if suggestion is not None:
            return suggestion
    return None


def _asked_again(
    few: Posterior, cuts: Sequence[CutEvidence], left: int, doubted: Collection[CutEvidence]
) -> CutEvidence | None:
    """The cut whose word is to be asked for again; None where all are sure enough, or were asked for.

    The last cut makes none again whose word "stable" is not believed: that would gain nothing.
    """
    again = cut_again(cuts, [cut for cut in doubted if cut.chatters or left > 1])
    if again is not None or left <= 1:
        return again
    once = [cut for cut in cuts if cut in few.cuts and cut_again(cuts, [cut])]
    chances = [chance_wrong(few.predict(cut)) for cut in once]
    if max(chances, default=0.0) <= WORTH_A_CUT:
        return None
    most = once[int(np.argmax(chances))]
    return most if most.chatters else None


def _likely_stable(
    grid: Grid, speed: float, depth: float, best: float, draws: Draws, careful_from: float
) -> Suggestion | None:
    """The cut, or one not as deep where it is more likely to chatter than not; deeper than careful_from (m) hardly."""
    nearby = (1.0,) if is_constant(grid.cut) else NEARBY
    for share in nearby if depth <= careful_from else CAREFULLY:
        deep = floor_depth(share * depth)
        if deep > 0:
            suggestion = _judged(grid, speed, deep, best, draws)
            if suggestion.chance < 1 - LIKELY and (deep <= careful_from or suggestion.chance <= CAREFUL):
                return suggestion
    return None


def _judged(grid: Grid, speed: float, depth: float, best: float, draws: Draws) -> Suggestion:
    """A cut with what it promises."""
    prediction = predict_cut(grid.evidence(speed, depth), draws)
    chance = float(np.mean(prediction.chatters))
    gain = (1 - chance) * (speed * depth - best)
    settles = _settles(draws.ratios(), prediction.chance)
    return Suggestion(speed, depth, chance, gain / best if best else np.inf, settles)


def _settles(ratios: Mapping[str, Floats], chance: Floats) -> str:
    """Name of what differs most, in its standard deviations, between spindles on which a cut chatters and others."""
    contrast = {}
    for name, values in ratios.items():
        chatters, stable = (float(np.sum(values * share) / np.sum(share)) for share in (chance, 1 - chance))
        contrast[name] = abs(chatters - stable) / max(float(np.std(values)), 1e-12)
    return max(contrast, key=lambda name: contrast[name])
