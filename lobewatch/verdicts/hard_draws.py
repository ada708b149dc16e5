"""The draws of a cut at one speed that chatter first, now or when it is tapped again: what these few allow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobes import Cut, Program, program_limit
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.aging import StiffnessAt
from lobewatch.verdicts.doubt import Doubt
from lobewatch.verdicts.draws import ProgramDraws, draw, likely_axes
from lobewatch.verdicts.mean_force import MeanForce
from lobewatch.verdicts.room import APART, at_ends

FIRST = 24
"""Number of draws that zero order has as the first to chatter ..."""
HARDEST = 8
"""... and of those with the largest force on the most flexible mode, whatever zero order says of them."""
FEEDS = 2
"""Number of directions of feed, the worst around the speed, in which they are looked at."""
SHARES = np.array([0.4, 0.6, 0.8, 1.0])
"""Shares of a depth at which they are."""
BETWEEN = np.array([0.3, 0.6])
"""Shares of the step between two of these, one calm and one not, at which they are once more."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HardDraws:
    """A cut at one speed."""

    limit: float
    """Deepest stable depth in the middle of the doubt (m)."""
    draws: ProgramDraws
    """All draws at both ends of what must be safe (`at_ends`)."""
    first: NDArray[np.intp]
    """Places of the few that are likely the first to chatter."""
    chattered: frozenset[int] = frozenset()
    """Draws that count too since they have chattered elsewhere."""

    def deepest(self, most: float) -> float:
        """The deepest up to a depth (m) at which, and below which, all that count are stable (m)."""
        more = np.add.outer([0, len(self.draws.rows) // 2], sorted(self.chattered)).ravel().astype(np.intp)
        return deepest_calm(self.draws[np.union1d(self.first, more)], most)


def hard_draws(
    program: Program, cuts: Sequence[Cut], spindle: Assembly, doubt: Doubt, fall: float, stiffness_at: StiffnessAt
) -> HardDraws:
    """Those of a program (SI), with all cuts on its way, at its speed; its depth is the scale of what is looked at."""
    axes = likely_axes(program, spindle, cuts, doubt)
    middle = program_limit(program, spindle.x, spindle.y, cuts, axes)
    drawn = draw(program, middle, cuts, spindle, doubt, axes)
    if len(cuts) > 1:
        grown = drawn.around(program.depth, fall, APART)
        drawn = drawn.fed_where(np.isin(np.arange(grown.size), np.argsort(-grown)[:FEEDS]))
    aged = at_ends(drawn, fall, stiffness_at)
    rows = aged.rows
    mean = MeanForce.of(rows.making(drawn.cuts[0])).limits(rows.speed_rpm[:, np.newaxis])[0][:, 0]
    hard = np.max(rows.tangential[:, np.newaxis] / (rows.stiffness * rows.damping_ratio), axis=1)
    return HardDraws(middle.limit, aged, np.union1d(np.argsort(mean)[:FIRST], np.argsort(-hard)[:HARDEST]))


def deepest_calm(draws: ProgramDraws, most: float) -> float:
    """The deepest up to a depth (m) at which, and below which, all draws are stable (m); 0 where it is hardly any."""
    depths = most * SHARES
    grown = np.max(draws.growth(depths), axis=0)
    if np.all(grown < 0):
        return most
    first = int(np.argmax(grown >= 0))
    low = float(depths[first - 1]) if first else 0.0
    between = low + (depths[first] - low) * BETWEEN
    finer = np.max(draws.growth(between), axis=0)
    depth = np.concatenate(([low], between, [depths[first]]))
    value = np.concatenate(([grown[first - 1] if first else -np.inf], finer, [grown[first]]))
    bad = int(np.argmax(value >= 0))
    if not np.isfinite(value[bad - 1]):
        return low
    return float(depth[bad - 1] - value[bad - 1] * (depth[bad] - depth[bad - 1]) / (value[bad] - value[bad - 1]))
