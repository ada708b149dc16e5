"""Monte Carlo samples of a program, the cuts it makes on its path, and which samples chatter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import NamedTuple

import numpy as np

from lobes import (
    Cut,
    Direction,
    MillingRows,
    Program,
    ProgramLimit,
    build_milling_system,
    count_pieces,
    growth_rate,
    join_rows,
    program_limit,
    rows_at_speeds,
)
from lobes.floquet.milling_rows import COARSE_CYCLES_PER_PIECE
from lobes.floquet.program_limit import MAX_PROGRAM_DEPTH_RATIO, group_by_engagement
from lobewatch.arrays import Flags, Floats, Indices
from lobewatch.machine import FEED_ANGLES, Machine, ProgramTable
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.principal_directions import TipModes
from lobewatch.verdicts.uncertainty import Uncertainty

MAX_OBLIQUE_FEED_IMMERSION = 0.5
"""Radial depth over diameter below which a cut in both directions is worst at angles between x and y, always ..."""
EQUAL_DIRECTION_TOLERANCES = (0.02, 0.1, 0.1)
"""... and from which on it is only where f_n, zeta or K in x and y differ by more than this, relatively, or modes lie
askew. Else no angle had a limit more than 3.5 % lower in 148 random cases."""
MILLING_DIRECTIONS: tuple[Direction, ...] = ("down", "up")
"""Directions that a cut may be milled in; a slot is both at once."""
FEED_ANGLE_STEP = math.pi / 12
"""Step of the angles between x and y (rad)."""


def cutting_conditions_of(
    table: ProgramTable, machine: Machine, spindle: Assembly, either: bool = False
) -> tuple[Cut, ...]:
    """Cuts that a program makes on its way, in no order; either: milled up and down, whatever the table says.

    In a corner the feed turns, whatever axis it follows on the straight.
    """
    differ = not are_directions_equal(spindle.x, spindle.y) or spindle.principal_directions.sign_patterns[0] is not None
    return tuple(
        replace(cut, feed_angle=angle, direction=direction)
        for cut in machine.engaged_cuts(table)
        for direction in (MILLING_DIRECTIONS if either and cut.immersion < 1 else (cut.direction,))
        for angle in _feed_angles_of(table, cut.immersion, differ)
    )


def _feed_angles_of(table: ProgramTable, immersion: float, differ: bool) -> tuple[float, ...]:
    """Directions of feed as angles from x (rad): half a turn apart they are alike."""
    if table.feed != "both" and table.corner_radius_mm is None:
        return (FEED_ANGLES[table.feed],)
    if immersion < MAX_OBLIQUE_FEED_IMMERSION or differ:
        return tuple(i * FEED_ANGLE_STEP for i in range(round(math.pi / FEED_ANGLE_STEP)))
    return tuple(FEED_ANGLES.values())


def are_directions_equal(x: TipModes, y: TipModes) -> bool:
    """Whether the modes of both directions are the same, as those of a round spindle or a direction taken for both."""
    if x is None or y is None or len(x) != len(y):
        return False
    numbers = np.array([[(mode.frequency, mode.damping_ratio, mode.stiffness) for mode in side] for side in (x, y)])
    return bool(np.all(np.abs(numbers[1] / numbers[0] - 1) <= EQUAL_DIRECTION_TOLERANCES))


N_PROGRAM_SAMPLES = 300
"""Number of draws: as many stable ones say, with 95 % confidence, that no more than 1 % of the doubt chatters."""
ROTATING_SEED = 1
"""Seed of the draws for the turning spindle."""
ROTATING_FREQUENCY_FACTOR, ROTATING_DAMPING_FACTOR, ROTATING_STIFFNESS_FACTOR = (0.985, 0.02), (1.1, 0.25), (1.0, 0.10)
"""Middle and standard deviation of f_n, zeta and K in the cut over those at rest; chosen: plausible, not measured."""
ROTATING_FORCE_FACTOR, ROTATING_FORCE_SPREAD = 1.0, 0.30
"""Middle and standard deviation of Kt in the cut over that of the table; chosen, as those. The prior of the learning
begins 10 % higher (`priors.FORCE`), since cuts then correct it; nothing corrects the chance made here."""
FREQUENCY_MARGIN, N_MARGIN_SPEEDS = 0.003, 7
"""Relative distance of the frequency that is looked at beside the doubt of the speed, and number of looks."""
N_CUT_COMPARISON_SAMPLES, CUT_DIFFERENCE_FACTOR = 24, 3.0
"""Number of draws, the hardest and as many others, that say how far growth differs between cuts; and factor on it."""
MIN_ROTATING_FACTOR = 0.1
"""Least share of its middle that a factor has."""


@dataclass(frozen=True, eq=False)
class ProgramSamples:
    """Draws of one program; row 0 is the middle, without any doubt."""

    rows: MillingRows
    """All draws, the feed along x."""
    cuts: tuple[Cut, ...]
    """Cuts that the program makes on its way, the worst first."""
    limits: Floats
    """Deepest stable depth of each in the middle (m)."""
    piece_factor: int
    """Number of pieces of a turn over those that modes alone ask for."""
    uncertainty: Uncertainty
    """Doubt that they were drawn from."""

    def growth(self, depth: float | Floats) -> Floats:
        """Growth from tooth to tooth in the worst of its cuts; negative where stable.

        depth in m: one, several (d,) or those of each draw (draws, d). Returns shape (draws, d).
        """
        wanted = np.atleast_2d(depth)
        depths = np.broadcast_to(wanted, (len(self.rows), wanted.shape[1]))
        cut, row = np.divmod(np.arange(len(self.cuts) * len(self.rows)), len(self.rows))
        return np.asarray(
            np.max(self.growth_in_cuts(cut, row, depths[row]).reshape(len(self.cuts), *depths.shape), axis=0)
        )

    def critical_growth(self, depth: float) -> Floats:
        """Growth at a depth (m) in the worst of its cuts, (draws,); of those that surely do not grow that in the first.

        Some draws say how much more there is in each other cut: passed over are those that die away so much faster.
        """
        places = np.arange(len(self.rows))
        grown = self._growth_at_depth(np.zeros_like(places), places, depth)
        order = np.argsort(-grown)
        sample = np.union1d(order[:N_CUT_COMPARISON_SAMPLES], order[:: max(order.size // N_CUT_COMPARISON_SAMPLES, 1)])
        cut, row = np.divmod(np.arange((len(self.cuts) - 1) * sample.size), sample.size)
        others = self._growth_at_depth(cut + 1, sample[row], depth).reshape(-1, sample.size)
        more = np.max(others - grown[sample], axis=1, initial=0.0)[:, np.newaxis]
        cut, row = np.nonzero((grown >= -CUT_DIFFERENCE_FACTOR * more - FREQUENCY_MARGIN) & ~np.isin(places, sample))
        np.maximum.at(grown, row, self._growth_at_depth(cut + 1, row, depth))
        grown[sample] = np.max(np.vstack((grown[sample], others)), axis=0)
        return grown

    def _growth_at_depth(self, cut: Indices, row: Indices, depth: float) -> Floats:
        """Growth of some draws, each in one of the cuts (k,), at a depth (m), shape (k,)."""
        return self.growth_in_cuts(cut, row, np.full((cut.size, 1), depth))[:, 0]

    def growth_in_cuts(self, cut: Indices, row: Indices, depths: Floats) -> Floats:
        """Growth of some draws, each in one of the cuts (k,), at depths (k, d) in m, shape (k, d)."""
        grown = np.empty(depths.shape)
        angles = np.array([each.feed_angle for each in self.cuts])
        for alike in group_by_engagement(self.cuts):
            here = np.flatnonzero(np.isin(cut, alike))
            if here.size:
                rows = replace(self.rows[row[here]], cut=self.cuts[alike[0]], feed_angle=angles[cut[here]])
                number = self.piece_factor * count_pieces(rows, float(np.max(depths)), COARSE_CYCLES_PER_PIECE)
                grown[here] = growth_rate(rows, depths[here], number)
        return grown

    def __getitem__(self, places: Indices) -> ProgramSamples:
        """The draws at some places."""
        return replace(self, rows=self.rows[places])

    def with_lowest_cuts(self, below: float, most: int | None = None) -> ProgramSamples:
        """The cuts with a limit up to a depth (m) alone, at most so many; the worst stays."""
        wanted = (self.limits <= below) & np.isfinite(self.limits) & (np.arange(self.limits.size) < (most or np.inf))
        wanted[0] = True
        return self.with_cuts(wanted)

    def with_cuts(self, wanted: Flags) -> ProgramSamples:
        """The cuts at some places alone; the worst where it is none of them."""
        places = np.flatnonzero(wanted) if np.any(wanted) else np.zeros(1, dtype=np.intp)
        return replace(self, cuts=tuple(self.cuts[place] for place in places), limits=self.limits[places])

    def median_growth_near(self, depth: float, drop: float = 0.0, apart: float = 1.0) -> Floats:
        """Largest growth of the middle in each cut at a depth (m), as far as speed and frequency may be off.

        fall: of the frequency, that is to come; it moves a cut as a faster speed does. apart: factor of the speed,
        slower and faster, that counts too. Shape (cuts,).
        """
        beside = self.uncertainty.speed + FREQUENCY_MARGIN
        ends = (1 - beside) / apart, (1 + beside) * apart / (1 - drop)
        median = self[np.zeros(1, dtype=np.intp)].sweep(np.linspace(*ends, N_MARGIN_SPEEDS))
        cut, row = np.divmod(np.arange(len(self.cuts) * N_MARGIN_SPEEDS), N_MARGIN_SPEEDS)
        grown = median.growth_in_cuts(cut, row, np.full((cut.size, 1), depth))
        return np.asarray(np.max(grown.reshape(-1, N_MARGIN_SPEEDS), axis=1))

    def scale(self, speed: float = 1.0, frequency: float = 1.0, stiffness: float = 1.0) -> ProgramSamples:
        """The same draws with speed, frequencies and stiffnesses times these factors."""
        return self.sweep(np.array([speed]), np.array([frequency]), np.array([stiffness]))

    def sweep(self, speed: Floats, frequency: Floats | float = 1.0, stiffness: Floats | float = 1.0) -> ProgramSamples:
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


def build_program(table: ProgramTable, machine: Machine) -> Program:
    """A program in SI units."""
    return Program(machine.build_cut(table), table.speed_rpm, table.depth_mm / 1e3)


def build_median_row(program: Program, assembly: Assembly, axes: Floats | None = None) -> MillingRows:
    """The program without any doubt, the feed along x; axes: of its modes (n, 2), None: the first that may be."""
    vectors = assembly.principal_directions.sign_patterns[0] if axes is None else axes
    return rows_at_speeds(
        build_milling_system(assembly.x, assembly.y, vectors), program.cut, np.array([program.speed_rpm])
    )


class WorstLimit(NamedTuple):
    """Limit of a program in the middle of its doubt, with the axes that are worst of those that may be."""

    limit: ProgramLimit
    """The lowest limit."""
    axes: Floats | None
    """Vectors of the modes that have it, shape (n, 2); None along x and y."""
    axes_ratio: float
    """The highest limit over the lowest: over the open signs, and with modes along x and y; 1 where nothing is open."""


def find_worst_limit(program: Program, assembly: Assembly, cuts: Sequence[Cut]) -> WorstLimit:
    """The lowest limit of the cuts that a program makes on its way, over what is open of the signs of the axes."""
    axes = assembly.principal_directions
    patterns = [*axes.sign_patterns, *([None] if axes.sign_count else [])]
    limits = [program_limit(program, assembly.x, assembly.y, cuts, vectors) for vectors in patterns]
    worst = min(range(len(axes.sign_patterns)), key=lambda i: limits[i].limit)
    deepest = MAX_PROGRAM_DEPTH_RATIO * program.depth
    depths = [min(limit.limit, deepest) for limit in limits]
    return WorstLimit(limits[worst], patterns[worst], max(depths) / min(depths))


def find_likely_axes(
    program: Program, assembly: Assembly, cuts: Sequence[Cut], uncertainty: Uncertainty
) -> Floats | None:
    """Axes that are likely to have the lowest limit: those in which the program grows most at its depth."""
    patterns = assembly.principal_directions.sign_patterns
    if len(patterns) == 1:
        return patterns[0]
    rows = reduce(join_rows, (build_median_row(program, assembly, axes) for axes in patterns))
    middles = ProgramSamples(rows, tuple(cuts), np.full(len(cuts), np.inf), 1, uncertainty)
    return patterns[int(np.argmax(middles.growth(program.depth)))]


def draw_likely_samples(
    program: Program, cuts: Sequence[Cut], assembly: Assembly, uncertainty: Uncertainty
) -> ProgramSamples:
    """The draws of a program whose limit nobody knows yet, with `find_likely_axes`, its cuts in no order."""
    median = build_median_row(program, assembly, find_likely_axes(program, assembly, cuts, uncertainty))
    rows = join_rows(median, uncertainty.sample(median, N_PROGRAM_SAMPLES))
    return ProgramSamples(rows, tuple(cuts), np.full(len(cuts), np.inf), 1, uncertainty)


def draw_samples(
    program: Program,
    limit: ProgramLimit,
    cuts: Sequence[Cut],
    assembly: Assembly,
    uncertainty: Uncertainty,
    axes: Floats | None = None,
) -> ProgramSamples:
    """The draws of a program; limit: that in the middle of the doubt, with modes along axes (n, 2)."""
    median, limits = build_median_row(program, assembly, axes), np.array(limit.limits)
    order = np.argsort(limits)
    finer = max(limit.pieces // int(count_pieces(median, MAX_PROGRAM_DEPTH_RATIO * program.depth)[0]), 1)
    rows = join_rows(median, uncertainty.sample(median, N_PROGRAM_SAMPLES))
    return ProgramSamples(rows, tuple(cuts[place] for place in order), limits[order], finer, uncertainty)


def draw_rotating_samples(samples: ProgramSamples, seed: int = ROTATING_SEED) -> ProgramSamples:
    """The draws with what may differ between a spindle at rest and one in the cut, alike in all modes of a draw."""
    rows, random = samples.rows, np.random.default_rng(seed)
    frequency, damping, stiffness, force = random.standard_normal((4, len(rows)))

    def factor(median: float, spread: float, normal: Floats) -> Floats:
        return np.asarray(np.maximum(median * (1 + spread * normal), MIN_ROTATING_FACTOR * median)[:, np.newaxis])

    push = factor(ROTATING_FORCE_FACTOR, ROTATING_FORCE_SPREAD, force)[:, 0]
    changed = replace(
        rows,
        frequency=rows.frequency * factor(*ROTATING_FREQUENCY_FACTOR, frequency),
        damping_ratio=rows.damping_ratio * factor(*ROTATING_DAMPING_FACTOR, damping),
        stiffness=rows.stiffness * factor(*ROTATING_STIFFNESS_FACTOR, stiffness),
        tangential=rows.tangential * push,
        radial=rows.radial * push,
    )
    return replace(samples, rows=changed)
