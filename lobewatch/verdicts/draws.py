"""A program on all the spindles that it may be run on: draws from its doubt, and which of them chatter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lobes import (
    Cut,
    MillingRows,
    Program,
    ProgramLimit,
    growth,
    joined_rows,
    milling_system,
    piece_numbers,
    program_limit,
    rows_of,
)
from lobes.floquet.pieces import ROUGH
from lobes.floquet.program_limit import DEEPEST, places_alike
from lobewatch.machine import Machine, ProgramTable
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.doubt import Doubt

DRAWS = 300
"""Number of draws: as many stable ones say, with 95 % confidence, that no more than 1 % of the doubt chatters."""
TURNING_SEED = 1
"""Seed of the draws for the turning spindle."""
FREQUENCY, DAMPING, STIFFNESS = (0.985, 0.02), (1.1, 0.25), (1.0, 0.10)
"""Middle and standard deviation of f_n, zeta and K in the cut over those at rest; chosen: plausible, not measured."""
FORCE_MIDDLE, FORCE_SPREAD = 1.0, 0.30
"""Middle and standard deviation of Kt in the cut over that of the table; chosen, as those. The prior of the learning
begins 10 % higher (`priors.FORCE`), since cuts then correct it; nothing corrects the chance made here."""
BESIDE, LOOKS = 0.003, 7
"""Relative distance of the frequency that is looked at beside the doubt of the speed, and number of looks."""
SAMPLE, SPREAD = 24, 3.0
"""Number of draws, the hardest and as many others, that say how far growth differs between cuts; and factor on it."""
LEAST_FACTOR = 0.1
"""Least share of its middle that a factor has."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ProgramDraws:
    """Draws of one program; row 0 is the middle, without any doubt."""

    rows: MillingRows
    """All draws, the feed along x."""
    cuts: tuple[Cut, ...]
    """Cuts that the program makes on its way, the worst first."""
    limits: Floats
    """Deepest stable depth of each in the middle (m)."""
    finer: int
    """Number of pieces of a turn over those that modes alone ask for."""
    doubt: Doubt
    """Doubt that they were drawn from."""

    def growth(self, depth: float | Floats) -> Floats:
        """Growth from tooth to tooth in the worst of its cuts; negative where stable.

        depth in m: one, several (d,) or those of each draw (draws, d). Returns shape (draws, d).
        """
        wanted = np.atleast_2d(depth)
        depths = np.broadcast_to(wanted, (len(self.rows), wanted.shape[1]))
        cut, row = np.divmod(np.arange(len(self.cuts) * len(self.rows)), len(self.rows))
        return np.asarray(np.max(self.growth_of(cut, row, depths[row]).reshape(len(self.cuts), *depths.shape), axis=0))

    def growth_that_counts(self, depth: float) -> Floats:
        """Growth at a depth (m) in the worst of its cuts, (draws,); of those that surely do not grow that in the first.

        Some draws say how much more there is in each other cut: passed over are those that die away so much faster.
        """
        places = np.arange(len(self.rows))
        grown = self._growth_in(np.zeros_like(places), places, depth)
        order = np.argsort(-grown)
        sample = np.union1d(order[:SAMPLE], order[:: max(order.size // SAMPLE, 1)])
        cut, row = np.divmod(np.arange((len(self.cuts) - 1) * sample.size), sample.size)
        others = self._growth_in(cut + 1, sample[row], depth).reshape(-1, sample.size)
        more = np.max(others - grown[sample], axis=1, initial=0.0)[:, np.newaxis]
        cut, row = np.nonzero((grown >= -SPREAD * more - BESIDE) & ~np.isin(places, sample))
        np.maximum.at(grown, row, self._growth_in(cut + 1, row, depth))
        grown[sample] = np.max(np.vstack((grown[sample], others)), axis=0)
        return grown

    def _growth_in(self, cut: NDArray[np.intp], row: NDArray[np.intp], depth: float) -> Floats:
        """Growth of some draws, each in one of the cuts (k,), at a depth (m), shape (k,)."""
        return self.growth_of(cut, row, np.full((cut.size, 1), depth))[:, 0]

    def growth_of(self, cut: NDArray[np.intp], row: NDArray[np.intp], depths: Floats) -> Floats:
        """Growth of some draws, each in one of the cuts (k,), at depths (k, d) in m, shape (k, d)."""
        grown = np.empty(depths.shape)
        angles = np.array([each.feed_angle for each in self.cuts])
        for alike in places_alike(self.cuts):
            here = np.flatnonzero(np.isin(cut, alike))
            if here.size:
                rows = replace(self.rows[row[here]], cut=self.cuts[alike[0]], feed_angle=angles[cut[here]])
                number = self.finer * piece_numbers(rows, float(np.max(depths)), ROUGH)
                grown[here] = growth(rows, depths[here], number)
        return grown

    def __getitem__(self, places: NDArray[np.intp]) -> ProgramDraws:
        """The draws at some places."""
        return replace(self, rows=self.rows[places])

    def fed(self, below: float, most: int | None = None) -> ProgramDraws:
        """The cuts with a limit up to a depth (m) alone, at most so many; the worst stays."""
        wanted = (self.limits <= below) & np.isfinite(self.limits) & (np.arange(self.limits.size) < (most or np.inf))
        wanted[0] = True
        return self.fed_where(wanted)

    def fed_where(self, wanted: NDArray[np.bool_]) -> ProgramDraws:
        """The cuts at some places alone; the worst where it is none of them."""
        places = np.flatnonzero(wanted) if np.any(wanted) else np.zeros(1, dtype=np.intp)
        return replace(self, cuts=tuple(self.cuts[place] for place in places), limits=self.limits[places])

    def around(self, depth: float, fall: float = 0.0, apart: float = 1.0) -> Floats:
        """Largest growth of the middle in each cut at a depth (m), as far as speed and frequency may be off.

        fall: of the frequency, that is to come; it moves a cut as a faster speed does. apart: factor of the speed,
        slower and faster, that counts too. Shape (cuts,).
        """
        beside = self.doubt.speed + BESIDE
        ends = (1 - beside) / apart, (1 + beside) * apart / (1 - fall)
        middle = self[np.zeros(1, dtype=np.intp)].swept(np.linspace(*ends, LOOKS))
        cut, row = np.divmod(np.arange(len(self.cuts) * LOOKS), LOOKS)
        grown = middle.growth_of(cut, row, np.full((cut.size, 1), depth))
        return np.asarray(np.max(grown.reshape(-1, LOOKS), axis=1))

    def at(self, speed: float = 1.0, frequency: float = 1.0, stiffness: float = 1.0) -> ProgramDraws:
        """The same draws with speed, frequencies and stiffnesses times these factors."""
        return self.swept(np.array([speed]), np.array([frequency]), np.array([stiffness]))

    def swept(self, speed: Floats, frequency: Floats | float = 1.0, stiffness: Floats | float = 1.0) -> ProgramDraws:
        """All draws at each of several factors (k,) after the other, k times as many."""
        factors = np.broadcast_arrays(speed, frequency, stiffness)
        rows = self.rows[np.tile(np.arange(len(self.rows)), factors[0].size)]
        speeds, frequencies, stiffnesses = (np.repeat(factor, len(self.rows)) for factor in factors)
        changed = replace(
            rows,
            speed_rpm=rows.speed_rpm * speeds,
            frequency=rows.frequency * frequencies[:, np.newaxis],
            stiffness=rows.stiffness * stiffnesses[:, np.newaxis],
        )
        return replace(self, rows=changed)


def as_program(table: ProgramTable, machine: Machine) -> Program:
    """A program in SI units."""
    return Program(machine.build_cut(table), table.speed_rpm, table.depth_mm / 1e3)


def middle_row(program: Program, assembly: Assembly, axes: Floats | None = None) -> MillingRows:
    """The program without any doubt, the feed along x; axes: of its modes (n, 2), None: the first that may be."""
    vectors = assembly.axes.patterns[0] if axes is None else axes
    return rows_of(milling_system(assembly.x, assembly.y, vectors), program.cut, np.array([program.speed_rpm]))


class WorstLimit(NamedTuple):
    """Limit of a program in the middle of its doubt, with the axes that are worst of those that may be."""

    limit: ProgramLimit
    """The lowest limit."""
    axes: Floats | None
    """Vectors of the modes that have it, shape (n, 2); None along x and y."""
    across: float
    """The highest limit over the lowest: over the open signs, and with modes along x and y; 1 where nothing is open."""


def worst_limit(program: Program, assembly: Assembly, cuts: Sequence[Cut]) -> WorstLimit:
    """The lowest limit of the cuts that a program makes on its way, over what is open of the signs of the axes."""
    axes = assembly.axes
    patterns = [*axes.patterns, *([None] if axes.signs else [])]
    limits = [program_limit(program, assembly.x, assembly.y, cuts, vectors) for vectors in patterns]
    worst = min(range(len(axes.patterns)), key=lambda i: limits[i].limit)
    deepest = DEEPEST * program.depth
    depths = [min(limit.limit, deepest) for limit in limits]
    return WorstLimit(limits[worst], patterns[worst], max(depths) / min(depths))


def likely_axes(program: Program, assembly: Assembly, cuts: Sequence[Cut], doubt: Doubt) -> Floats | None:
    """Axes that are likely to have the lowest limit: those in which the program grows most at its depth."""
    patterns = assembly.axes.patterns
    if len(patterns) == 1:
        return patterns[0]
    rows = reduce(joined_rows, (middle_row(program, assembly, axes) for axes in patterns))
    middles = ProgramDraws(rows, tuple(cuts), np.full(len(cuts), np.inf), 1, doubt)
    return patterns[int(np.argmax(middles.growth(program.depth)))]


def draw_likely(program: Program, cuts: Sequence[Cut], assembly: Assembly, doubt: Doubt) -> ProgramDraws:
    """The draws of a program whose limit nobody knows yet, with `likely_axes`, its cuts in no order."""
    middle = middle_row(program, assembly, likely_axes(program, assembly, cuts, doubt))
    rows = joined_rows(middle, doubt.draw(middle, DRAWS))
    return ProgramDraws(rows, tuple(cuts), np.full(len(cuts), np.inf), 1, doubt)


def draw(
    program: Program,
    limit: ProgramLimit,
    cuts: Sequence[Cut],
    assembly: Assembly,
    doubt: Doubt,
    axes: Floats | None = None,
) -> ProgramDraws:
    """The draws of a program; limit: that in the middle of the doubt, with modes along axes (n, 2)."""
    middle, limits = middle_row(program, assembly, axes), np.array(limit.limits)
    order = np.argsort(limits)
    finer = max(limit.pieces // int(piece_numbers(middle, DEEPEST * program.depth)[0]), 1)
    rows = joined_rows(middle, doubt.draw(middle, DRAWS))
    return ProgramDraws(rows, tuple(cuts[place] for place in order), limits[order], finer, doubt)


def turning_draws(draws: ProgramDraws, seed: int = TURNING_SEED) -> ProgramDraws:
    """The draws with what may differ between a spindle at rest and one in the cut, alike in all modes of a draw."""
    rows, random = draws.rows, np.random.default_rng(seed)
    frequency, damping, stiffness, force = random.standard_normal((4, len(rows)))

    def factor(middle: float, spread: float, normal: Floats) -> Floats:
        return np.asarray(np.maximum(middle * (1 + spread * normal), LEAST_FACTOR * middle)[:, np.newaxis])

    push = factor(FORCE_MIDDLE, FORCE_SPREAD, force)[:, 0]
    changed = replace(
        rows,
        frequency=rows.frequency * factor(*FREQUENCY, frequency),
        damping_ratio=rows.damping_ratio * factor(*DAMPING, damping),
        stiffness=rows.stiffness * factor(*STIFFNESS, stiffness),
        tangential=rows.tangential * push,
        radial=rows.radial * push,
    )
    return replace(draws, rows=changed)
