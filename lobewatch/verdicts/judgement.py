"""A program over its doubt by semi-discretisation: limit in the middle, band of limits, draws that chatter."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lobes import ProgramLimit
from lobewatch.machine import Machine, ProgramTable
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.doubt import doubt_of
from lobewatch.verdicts.drawn_limits import drawn_limits
from lobewatch.verdicts.draws import ProgramDraws, as_program, draw, worst_limit
from lobewatch.verdicts.spindle_at_speed import SpindleAtSpeed
from lobewatch.verdicts.ways import ways

QUANTILES = (0.01, 0.99)
"""Quantiles of the limit over the doubt that a band reaches between."""
SURELY = 1.15
"""Factor that the limit of a cut on its way, were it as doubtful as the lowest, has to spare where it is passed over,
unless the middle chatters in it at a depth so much larger somewhere within the doubt of the speed ..."""
EACH = 1.6
"""... and that of one draw in such a cut. Both are for the share of draws that chatter: before `stable` is said every
draw is looked at in every cut. In 408 judgements of random cuts, each fed in up to 24 ways, EACH missed 6 draws."""

Floats = NDArray[np.float64]


class Judgement(NamedTuple):
    """What the word on a program rests on."""

    middle: ProgramLimit
    """Limit in the middle of the doubt."""
    lowest: float
    """Lowest limit of any of the spindles (m)."""
    low: float
    """1 % quantile of the limit over the doubt (m)."""
    high: float
    """99 % quantile of the limit over the doubt (m)."""
    draws: ProgramDraws
    """Spindles that it was judged on."""
    chatters: NDArray[np.bool_]
    """Whether each draw chatters, without the middle, shape (DRAWS,)."""
    across: float
    """Highest limit in the middle over the lowest, whatever the open axes are; 1 where none are."""

    @property
    def is_stable_throughout(self) -> bool:
        """Whether it is stable in the middle and on every draw."""
        return self.middle.stable and not np.any(self.chatters)


class DrawnProgram(NamedTuple):
    """A program on all the spindles that it may be run on, before these are looked at."""

    depth: float
    """Its depth (m)."""
    middle: ProgramLimit
    """Limit in the middle of the doubt."""
    draws: ProgramDraws
    """Spindles from all of the doubt."""
    across: float
    """Highest limit in the middle over the lowest, whatever the open axes are; 1 where none are."""


def weigh(table: ProgramTable, assembly: Assembly, machine: Machine, at_speed: SpindleAtSpeed) -> Judgement:
    """A program with the coefficients that were learnt, over its doubt; charts by other methods decide nothing."""
    return weighed(drawn_program(table, assembly, machine, at_speed))


def drawn_program(
    table: ProgramTable, assembly: Assembly, machine: Machine, at_speed: SpindleAtSpeed, either: bool = False
) -> DrawnProgram:
    """A program with the coefficients that were learnt; either: milled up and down, the worse counts."""
    program, spindle = as_program(table, machine), at_speed.moved(assembly)
    cuts = ways(table, machine, spindle, either)
    middle, axes, across = worst_limit(program, spindle, cuts)
    doubt = at_speed.doubt or doubt_of(assembly, table, machine)
    return DrawnProgram(program.depth, middle, draw(program, middle, cuts, spindle, doubt, axes), across)


def weighed(program: DrawnProgram) -> Judgement:
    """What is seen of a program on all spindles that it may be run on."""
    depth, middle, draws, across = program
    limits = drawn_limits(draws, depth)[1:]
    low, high = np.quantile(limits, QUANTILES, method="closest_observation")
    below = SURELY * depth * middle.limit / low if np.isfinite(middle.limit) else 0.0
    around = draws.around(SURELY * depth) >= 0
    near = (draws.limits <= below) | around
    chatters = _chatters(draws, near, around, limits, depth)
    return Judgement(middle, float(np.min(limits)), float(low), float(high), draws, chatters, across)


def _chatters(
    draws: ProgramDraws, near: NDArray[np.bool_], around: NDArray[np.bool_], limits: Floats, depth: float
) -> NDArray[np.bool_]:
    """Whether each draw chatters at a depth (m) in any of the cuts, shape (DRAWS,); where none does, that is exact.

    limits: of the draws in the worst cut (m), shape (DRAWS,). In another cut that is near (cuts,) a draw is looked at
    where its limit, were it as far off the middle as in the worst, has less than EACH to spare, and where the middle
    chatters around (cuts,). Only where none of these chatters all others are looked at, in all cuts.
    """
    chatters = limits <= depth
    softness = limits / draws.limits[0] if np.isfinite(draws.limits[0]) else np.ones(limits.size)
    likely = np.multiply.outer(draws.limits, softness) <= EACH * depth
    likely = (likely | around[:, np.newaxis]) & near[:, np.newaxis]
    likely[0] = True
    for wanted in (likely, ~likely):
        cut, draw = np.nonzero(wanted & ~chatters)
        grown = draws.growth_of(cut, draw + 1, np.full((cut.size, 1), depth))[:, 0]
        chatters[draw[grown >= 0]] = True
        if np.any(chatters):
            break
    return chatters
