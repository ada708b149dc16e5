"""The draws of a cut at one speed that chatter first, now or when it is tapped again: what these few allow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lobes import Cut, Program, joined_rows
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.aging import StiffnessAt
from lobewatch.verdicts.doubt import Doubt
from lobewatch.verdicts.draws import ProgramDraws, draw_likely
from lobewatch.verdicts.room import APART, DEEPER, at_ends

FIRST = 24
"""Number of draws that grow most at the depth that is likely ..."""
HARDEST = 8
"""... and of those with the largest force on the most flexible mode, whatever grows there."""
FEEDS = 2
"""Number of directions of feed, the worst around the speed, in which they are looked at."""
SHARES = np.array([0.4, 0.6, 0.8, 1.0])
"""Shares of a depth at which they are."""
BETWEEN = np.array([0.3, 0.6])
"""Shares of the step between two of these, one calm and one not, at which they are once more."""
FURTHER, NEARER = 1.5, 0.15
"""Factor of the depth up to which is looked, where all of it is calm, and where hardly any of it is ..."""
LEAST = 1e-5
"""... down to this (m)."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HardDraws:
    """A cut at one speed."""

    likely: float
    """Depth that is likely (m): the scale of what is looked at."""
    draws: ProgramDraws
    """All draws at both ends of what must be safe (`at_ends`), last the middle, pushed for its depth to spare."""
    first: NDArray[np.intp]
    """Places of the few that are likely the first to chatter."""
    chattered: frozenset[int] = frozenset()
    """Draws that count too since they have chattered elsewhere."""

    @property
    def few(self) -> ProgramDraws:
        """Those that count."""
        more = np.add.outer([0, len(self.draws.rows) // 2], sorted(self.chattered)).ravel().astype(np.intp)
        return self.draws[np.union1d(self.first, more)]

    def deepest(self, most: float) -> float:
        """The deepest up to a depth at which, and below which, all that count are stable with depth to spare (m)."""
        few, depth = self.few, DEEPER * min(self.likely, most)
        calm = deepest_calm(few, depth)
        while calm == depth < DEEPER * most:
            depth = min(FURTHER * depth, DEEPER * most)
            calm = deepest_calm(few, depth)
        while calm == 0 and depth > LEAST:
            depth *= NEARER
            calm = deepest_calm(few, depth)
        return calm / DEEPER

    def growth_beside(self, speeds: Floats, depths: Floats) -> Floats:
        """Largest growth, with room, of all that count at speeds over the present one and depths (m) there (k,).

        In the worst direction of feed: it says where to look, no more.
        """
        few = self.few.fed(0.0)
        wanted = np.repeat(DEEPER * depths, len(few.rows))[:, np.newaxis]
        return np.asarray(np.max(few.swept(speeds).growth(wanted).reshape(speeds.size, -1), axis=1))


def hard_draws(
    program: Program,
    cuts: Sequence[Cut],
    spindle: Assembly,
    doubt: Doubt,
    fall: float,
    stiffness_at: StiffnessAt,
    spare: float,
) -> HardDraws:
    """Those of a program (SI), with all cuts on its way, at its speed; its depth is what is likely.

    spare: depth to spare in the middle of the doubt, relative.
    """
    drawn = draw_likely(program, cuts, spindle, doubt)
    order = np.argsort(-drawn.around(program.depth, fall, APART))[:FEEDS]
    drawn = replace(drawn, cuts=tuple(cuts[place] for place in order), limits=drawn.limits[order])
    aged = at_ends(drawn, fall, stiffness_at)
    grown = aged.fed(0.0).growth(program.depth)[:, 0]
    force = np.max(aged.rows.tangential[:, np.newaxis] / (aged.rows.stiffness * aged.rows.damping_ratio), axis=1)
    middle = drawn.rows[np.zeros(1, dtype=np.intp)]
    push = (1 + spare) / DEEPER
    middle = replace(middle, tangential=push * middle.tangential, radial=push * middle.radial)
    first = np.concatenate((np.argsort(-grown)[:FIRST], np.argsort(-force)[:HARDEST], [grown.size]))
    return HardDraws(program.depth, replace(aged, rows=joined_rows(aged.rows, middle)), np.unique(first))


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
