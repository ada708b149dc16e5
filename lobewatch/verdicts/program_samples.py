"""Monte Carlo samples of a program, the cuts it makes on its path, and which samples chatter."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import NamedTuple

import numpy as np

import lobes
from lobes import Cut, MillingRows, Program, ProgramLimit
from lobes.floquet.milling_rows import COARSE_CYCLES_PER_PIECE
from lobes.floquet.program_limit import MAX_PROGRAM_DEPTH_RATIO, group_by_engagement
from lobewatch.arrays import Flags, Floats, Indices
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.program_case import ProgramCase
from lobewatch.verdicts.speed_drop import NO_DROP, SpeedDrop
from lobewatch.verdicts.uncertainty import Factors, Uncertainty, scale_fields
from lobewatch.verdicts.zero_order_batch import ZeroOrderBatch, is_force_constant

N_PROGRAM_SAMPLES = 300
"""Number of samples: if all are stable, at most 1 % of the uncertainty chatters at 95 % confidence."""
ROTATING_SEED = 1
"""Random seed of the samples for the rotating spindle."""
ROTATING_DAMPING_FACTOR, ROTATING_STIFFNESS_FACTOR = (1.1, 0.25), (1.0, 0.10)
"""Mean and standard deviation of zeta and K in the cut over the values at its speed; plausible, not measured."""
ROTATING_FORCE_FACTOR, ROTATING_FORCE_SPREAD = 1.0, 0.30
"""Mean and standard deviation of Kt in the cut over that of the table; chosen, as plausible.

The prior of the learning starts 10 % higher (`ROTATING_FORCE_PRIOR`), since cuts correct it. Nothing corrects the
chatter risk computed here."""
LISTED_FORCE_SPREAD = 0.10
"""Standard deviation of Kt in the cut for a listed material, whose joint distribution holds cuts of others; chosen."""
FREQUENCY_MARGIN, N_MARGIN_SPEEDS = 0.003, 7
"""Relative frequency margin checked in addition to the speed uncertainty, and number of speeds checked."""
N_CUT_COMPARISON_SAMPLES, CUT_DIFFERENCE_FACTOR = 24, 3.0
"""Number of samples that estimate growth differences between cuts, half of them critical, and safety factor."""
MARGIN_DROP_STEP = 0.01
"""Relative frequency drop for each further speed; chosen."""
MIN_ROTATING_FACTOR = 0.1
"""Smallest factor over its mean."""


@dataclass(frozen=True, eq=False)
class ProgramSamples:
    """Samples of one program; row 0 is the median without uncertainty."""

    rows: MillingRows
    """All samples, the feed along x."""
    cuts: tuple[Cut, ...]
    """Cuts of the program on its path, the worst first."""
    limits: Floats
    """Median limit of each cut (m)."""
    piece_factor: int
    """Number of pieces of a turn over that required by the modes only."""
    uncertainty: Uncertainty
    """Uncertainty that the samples were drawn from."""
    drop: SpeedDrop = NO_DROP
    """Frequency drop at the speed of the program, not yet in the samples."""

    def growth(self, depth: float | Floats) -> Floats:
        """Return the growth rate in the worst cut; negative where stable.

        depth in m: one, several (d,) or those of each sample (samples, d). Returns shape (samples, d).
        """
        return np.asarray(np.max(self.growth_by_cut(depth), axis=0))

    def growth_by_cut(self, depth: float | Floats) -> Floats:
        """Return the growth rate in each cut, shape (cuts, samples, d)."""
        wanted = np.atleast_2d(depth)
        depths = np.broadcast_to(wanted, (len(self.rows), wanted.shape[1]))
        cut, row = np.divmod(np.arange(len(self.cuts) * len(self.rows)), len(self.rows))
        return self.growth_in_cuts(cut, row, depths[row]).reshape(len(self.cuts), *depths.shape)

    def critical_growth(self, depth: float) -> Floats:
        """Return the growth rate at a depth (m) in the worst cut; clearly stable samples in the first cut only.

        Some samples say how much more there is in each other cut: passed over are those that die away this much
        faster.
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
        """Return the growth rate of some samples, each in one of the cuts (k,), at a depth (m), shape (k,)."""
        return self.growth_in_cuts(cut, row, np.full((cut.size, 1), depth))[:, 0]

    def growth_in_cuts(self, cut: Indices, row: Indices, depths: Floats) -> Floats:
        """Return the growth rate of some samples, each in one of the cuts (k,), at depths (k, d) in m, shape (k, d)."""
        grown = np.empty(depths.shape)
        angles = np.array([each.feed_angle for each in self.cuts])
        for alike in group_by_engagement(self.cuts):
            here = np.flatnonzero(np.isin(cut, alike))
            if here.size:
                rows = replace(self.rows[row[here]], cut=self.cuts[alike[0]], feed_angle=angles[cut[here]])
                if np.any(rows.process_damping) and is_force_constant(rows.cut):
                    grown[here] = _log_depth_ratio(rows, depths[here])
                    continue
                number = self.piece_factor * lobes.count_pieces(rows, float(np.max(depths)), COARSE_CYCLES_PER_PIECE)
                grown[here] = lobes.growth_rate(rows, depths[here], number)
        return grown

    def __getitem__(self, places: Indices) -> "ProgramSamples":
        return replace(self, rows=self.rows[places])

    def join(self, other: "ProgramSamples") -> "ProgramSamples":
        """Append the samples of another state of the same program."""
        return replace(self, rows=lobes.join_rows(self.rows, other.rows))

    def with_lowest_cuts(self, below: float, most: int | None = None) -> "ProgramSamples":
        """Select the cuts with a limit up to a depth (m), at most `most`; the worst stays."""
        wanted = (self.limits <= below) & np.isfinite(self.limits) & (np.arange(self.limits.size) < (most or np.inf))
        return self.with_cuts(wanted)

    def with_cuts(self, wanted: Flags) -> "ProgramSamples":
        """Select some cuts; the worst if there is none."""
        places = np.flatnonzero(wanted) if np.any(wanted) else np.zeros(1, dtype=np.intp)
        return replace(self, cuts=tuple(self.cuts[place] for place in places), limits=self.limits[places])

    def median_growth_near(self, depth: float, drops: tuple[float, float] = (0.0, 0.0), apart: float = 1.0) -> Floats:
        """Return the largest median growth of each cut at a depth (m) within the uncertainty of speed and frequency.

        drops: smallest and largest of the frequency; a drop moves a cut as a faster speed does. apart: factor of the
        speed, slower and faster, that counts too. Shape (cuts,).
        """
        margin = self.uncertainty.speed + FREQUENCY_MARGIN
        low, high = drops
        ends = (1 - margin) / apart / (1 - low), (1 + margin) * apart / (1 - high)
        number = N_MARGIN_SPEEDS + round((high - low) / MARGIN_DROP_STEP)
        median = self[np.zeros(1, dtype=np.intp)].sweep(np.linspace(*ends, number))
        return np.asarray(np.max(median.growth_by_cut(depth)[..., 0], axis=1))

    def at_speed(self) -> "ProgramSamples":
        """Lower the frequencies of each sample by its own drop at speed; the median has the largest drop.

        The drop belongs to the place of a sample, so select samples after this.
        """
        if self.drop.is_zero:
            return self
        return replace(self, rows=self.drop.apply(self.rows, self.drop.spread(len(self.rows))))

    def over_drops(self) -> "ProgramSamples":
        """Repeat all samples at each step of the drop at speed."""
        drops = self.drop.steps
        rows = self.rows[np.tile(np.arange(len(self.rows)), drops.size)]
        return replace(self, rows=self.drop.apply(rows, np.repeat(drops, len(self.rows))))

    def sweep(
        self, speed: Factors, frequency: Factors = 1.0, stiffness: Factors = 1.0, force: Factors = 1.0
    ) -> "ProgramSamples":
        """Repeat all samples with each of several factors (k,), k times as many."""
        factors = np.broadcast_arrays(speed, frequency, stiffness, force)
        rows = self.rows[np.tile(np.arange(len(self.rows)), factors[0].size)]
        n, f, k, push = (np.repeat(factor, len(self.rows)) for factor in factors)
        rows = scale_fields(rows, frequency=f[:, np.newaxis], stiffness=k[:, np.newaxis])
        return replace(self, rows=scale_fields(rows, speed_rpm=n, tangential=push, radial=push))


DISTINGUISHED_LIMIT_RATIO = 2.0
"""Largest limit over the deepest checked depth that is told apart; chosen."""


def _log_depth_ratio(rows: MillingRows, depths: Floats) -> Floats:
    """Return the logarithm of depths (r, d) in m over the limit, in place of growth; negative for a stable cut.

    Exact for a constant force. With process damping it takes a small part of the time of multipliers, which crowd.
    """
    deepest = DISTINGUISHED_LIMIT_RATIO * float(np.max(depths))
    limits, _ = ZeroOrderBatch.of(rows).limits(rows.speed_rpm[:, np.newaxis], deepest)
    return np.asarray(np.log(depths / np.minimum(limits, deepest)))


CRITICAL_DEPTH_SHARES = np.array([0.4, 0.6, 0.8, 1.0])
"""Shares of a depth at which samples are checked for the deepest stable depth."""
DEPTH_BRACKET_SHARES = np.array([0.3, 0.6])
"""Shares of the step between a stable and an unstable depth at which they are checked again."""


def find_deepest_stable(samples: ProgramSamples, most: float) -> float:
    """Return the deepest depth (m) up to `most` at which all samples are stable; 0 if there is hardly any."""
    depths = most * CRITICAL_DEPTH_SHARES
    grown = np.max(samples.growth(depths), axis=0)
    if np.all(grown < 0):
        return most
    first = int(np.argmax(grown >= 0))
    low = float(depths[first - 1]) if first else 0.0
    between = low + (depths[first] - low) * DEPTH_BRACKET_SHARES
    finer = np.max(samples.growth(between), axis=0)
    depth = np.concatenate(([low], between, [depths[first]]))
    value = np.concatenate(([grown[first - 1] if first else -np.inf], finer, [grown[first]]))
    bad = int(np.argmax(value >= 0))
    if not np.isfinite(value[bad - 1]):
        return low
    return float(depth[bad - 1] - value[bad - 1] * (depth[bad] - depth[bad - 1]) / (value[bad] - value[bad - 1]))


def build_median_row(program: Program, assembly: Assembly, axes: Floats | None = None) -> MillingRows:
    """Build the median system, the feed along x; axes: of its modes (n, 2), None: the first sign pattern."""
    vectors = assembly.principal_directions.sign_patterns[0] if axes is None else axes
    system = lobes.build_milling_system(assembly.x, assembly.y, vectors)
    return lobes.rows_at_speeds(system, program.cut, np.array([program.speed_rpm]))


class WorstLimit(NamedTuple):
    """Median limit of a program in one of its possible sets of principal directions, the worst unless stated."""

    limit: ProgramLimit
    """Limit in these directions."""
    axes: Floats | None
    """These principal directions, shape (n, 2); None along x and y."""
    axes_ratio: float
    """Highest over lowest limit: over the open signs, and with modes along x and y; 1 if nothing is open."""


def find_worst_limit(case: ProgramCase) -> WorstLimit:
    """Find the lowest limit over all cuts of a program and all possible principal directions."""
    return next(_find_rising_limits(case))


def find_median_limit(case: ProgramCase, worst: WorstLimit) -> WorstLimit:
    """Find the lowest limit over the possible principal directions in which a program is stable; else the worst."""
    if worst.limit.stable:
        return worst
    return next((found for found in _find_rising_limits(case, case.depth) if found.limit.stable), worst)


def _find_rising_limits(case: ProgramCase, above: float = 0.0) -> Iterator[WorstLimit]:
    """Yield the limits of a program in each set of possible principal directions, the lowest estimate first.

    above: estimate (m) up to which directions are left out.
    """
    spindle, axes = case.spindle, case.spindle.principal_directions
    patterns: Sequence[Floats | None] = axes.possible_vectors if axes.sign_count else axes.sign_patterns
    estimates = case.axes_limits if axes.sign_count else np.ones(1)
    depths = np.minimum(estimates, MAX_PROGRAM_DEPTH_RATIO * case.depth)
    ratio = float(np.max(depths) / np.min(depths))
    for place in np.argsort(estimates, kind="stable").tolist():
        if axes.sign_count and estimates[place] <= above:
            continue
        limit = lobes.program_limit(case.program, spindle.x, spindle.y, case.cuts, patterns[place])
        yield WorstLimit(limit, patterns[place], ratio)


def _find_likely_axes(case: ProgramCase, program: Program) -> Floats | None:
    """Find the principal directions in which a program grows most at its depth."""
    patterns = case.spindle.principal_directions.sign_patterns
    if len(patterns) == 1:
        return patterns[0]
    rows = reduce(lobes.join_rows, (build_median_row(program, case.spindle, axes) for axes in patterns))
    return patterns[int(np.argmax(_unlimited_samples(case, rows).growth(program.depth)))]


def _unlimited_samples(case: ProgramCase, rows: MillingRows) -> ProgramSamples:
    """Build the samples of a program with unknown limits."""
    return ProgramSamples(rows, case.cuts, np.full(len(case.cuts), np.inf), 1, case.uncertainty)


def draw_likely_samples(case: ProgramCase, program: Program) -> ProgramSamples:
    """Sample the samples of a program with unknown limits, in the principal directions that are likely the worst.

    program: the case at another speed and depth, in SI units.
    """
    median = build_median_row(program, case.spindle, _find_likely_axes(case, program))
    samples = _unlimited_samples(case, lobes.join_rows(median, case.uncertainty.sample(median, N_PROGRAM_SAMPLES)))
    return replace(samples, drop=case.drop_at(program.speed_rpm))


def draw_samples(case: ProgramCase, worst: WorstLimit) -> ProgramSamples:
    """Sample the samples of a program from its median limit, with modes along the worst axes."""
    median, limits = build_median_row(case.program, case.spindle, worst.axes), np.array(worst.limit.limits)
    order = np.argsort(limits)
    finer = max(worst.limit.pieces // int(lobes.count_pieces(median, MAX_PROGRAM_DEPTH_RATIO * case.depth)[0]), 1)
    rows = lobes.join_rows(median, case.uncertainty.sample(median, N_PROGRAM_SAMPLES))
    cuts, drop = tuple(case.cuts[place] for place in order), case.drop_at(case.table.speed_rpm)
    return ProgramSamples(rows, cuts, limits[order], finer, case.uncertainty, drop)


def force_spread(uncertainty: Uncertainty) -> float:
    """Return the relative standard deviation of Kt in the cut beyond the uncertainty of its value."""
    return ROTATING_FORCE_SPREAD if uncertainty.joint is None else LISTED_FORCE_SPREAD


def draw_rotating_samples(samples: ProgramSamples, seed: int = ROTATING_SEED) -> ProgramSamples:
    """Vary the samples by plausible differences between a spindle at rest and a cutting one: drop, zeta, K, Kt."""
    rows, random = samples.at_speed().rows, np.random.default_rng(seed)
    damping, stiffness, force = random.standard_normal((3, len(rows)))

    def factor(median: float, spread: float, normal: Floats) -> Floats:
        return np.asarray(np.maximum(median * (1 + spread * normal), MIN_ROTATING_FACTOR * median)[:, np.newaxis])

    push = factor(ROTATING_FORCE_FACTOR, force_spread(samples.uncertainty), force)[:, 0]
    zeta, k = factor(*ROTATING_DAMPING_FACTOR, damping), factor(*ROTATING_STIFFNESS_FACTOR, stiffness)
    changed = scale_fields(rows, damping_ratio=zeta, stiffness=k, tangential=push, radial=push)
    return replace(samples, rows=changed)
