"""Evaluate a program on all Monte Carlo samples: limits, band of limits, samples that chatter."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lobes import Cut, MillingRows, Program, ProgramLimit, StabilityLobes
from lobes.floquet.program_limit import MAX_PROGRAM_DEPTH_RATIO
from lobewatch.arrays import Flags, Floats
from lobewatch.machine import Machine
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts import program_samples
from lobewatch.verdicts.program_case import NO_TEST_CUTS, ProgramCase, SpindleAtSpeed
from lobewatch.verdicts.program_samples import (
    ProgramSamples,
    WorstLimit,
    build_median_row,
    draw_rotating_samples,
    find_deepest_stable,
)
from lobewatch.verdicts.uncertainty import uncertainty_of
from lobewatch.verdicts.zero_order_batch import ZeroOrderBatch

TRIED_LIMIT_SHARES = np.array([0.75, 1.0, 1.4])
"""Shares of the median limit, scaled by the cutting coefficient of each sample, at which the sample is checked."""
FURTHER_LIMIT_SHARES = np.array([2.0, 3.0])
"""Further shares, for samples that are stable at all of these."""
LOWER_LIMIT_SHARES = np.linspace(0, 1, 9)[1:]
"""Shares of the first of these depths, for samples that chatter there."""
UNLIMITED_DEPTH_SHARES = np.array([0.05, 0.2, 0.5, 1.0])
"""Shares of the largest depth of interest, if there is no median limit."""
N_REFINED_EXTREMES = 9
"""Number of the lowest and of the highest limits that are refined, in all relevant feed directions."""
LIMIT_REFINEMENT_STEPS = 3
"""Number of refinement steps of these limits."""
SIMILAR_FEED_LIMIT = 1.15
"""Limit of a relevant feed direction over the lowest limit, at most."""
MAX_SIMILAR_FEEDS = 3
"""Largest number of relevant feed directions, those with the lowest limits."""

RECHECKED_LIMIT_SHARES = np.array([0.5, 0.7, 0.8, 0.9, 1.0])
"""Shares of the limit of each sample at which the sample is checked again."""
WIDER_FEED_LIMIT, MAX_WIDER_FEEDS = 1.3, 6
"""Limit over the lowest limit in the feed directions of that check, and number of directions, at most."""


def find_sample_limits(samples: ProgramSamples, depth: float) -> Floats:
    """Find the deepest stable depth of each sample (m), shape (samples,); inf beyond the tried depths.

    Of the other samples than the lowest and highest it is the first change between the depths that are checked,
    linearly interpolated. depth: that of the program (m).
    """
    limit, worst = float(samples.limits[0]), samples.with_lowest_cuts(0.0)
    near = samples.with_lowest_cuts(SIMILAR_FEED_LIMIT * limit, MAX_SIMILAR_FEEDS)
    softness = (samples.rows.tangential[0] / samples.rows.tangential)[:, np.newaxis]
    tried = np.tile(MAX_PROGRAM_DEPTH_RATIO * depth * UNLIMITED_DEPTH_SHARES, (len(softness), 1))
    if np.isfinite(limit):
        tried = softness * limit * TRIED_LIMIT_SHARES
    bracket = _bracket_limits(tried, worst.growth(tried))
    low, high, at_low, at_high = bracket
    early = np.flatnonzero(low == 0)
    if early.size:
        first = tried[early, :1]
        lower = np.sort(np.hstack((first * LOWER_LIMIT_SHARES, np.minimum(first, depth))), axis=1)
        bracket[:, early] = _bracket_limits(lower, worst[early].growth(lower))
    open_ones = np.flatnonzero(np.isinf(high)) if np.isfinite(limit) else np.empty(0, dtype=np.intp)
    if open_ones.size:
        further = np.hstack((low[open_ones, np.newaxis], softness[open_ones] * limit * FURTHER_LIMIT_SHARES))
        bracket[:, open_ones] = _bracket_limits(further, worst[open_ones].growth(further))
    limits = _interpolate_limits(*bracket)
    order = np.argsort(limits)
    ends = np.unique(np.concatenate((order[:N_REFINED_EXTREMES], order[-N_REFINED_EXTREMES:])))
    ends = ends[np.isfinite(limits[ends])]
    for _ in range(LIMIT_REFINEMENT_STEPS if ends.size else 0):
        value = near[ends].growth(limits[ends, np.newaxis])[:, 0]
        above = value >= 0
        low[ends], at_low[ends] = np.where(above, low[ends], limits[ends]), np.where(above, at_low[ends], value)
        high[ends], at_high[ends] = np.where(above, limits[ends], high[ends]), np.where(above, value, at_high[ends])
        limits[ends] = _interpolate_limits(*bracket[:, ends])
    return limits


def refine_sample_limits(samples: ProgramSamples, limits: Floats) -> Floats:
    """Refine limits (m) of `find_sample_limits` in the feed direction that is worst for each sample.

    For numbers of single samples, such as ratios of two cuts on the same spindle.
    """
    settled, finite = limits.copy(), np.flatnonzero(np.isfinite(limits))
    if not finite.size:
        return settled
    tried = limits[finite, np.newaxis] * RECHECKED_LIMIT_SHARES
    near = samples.with_lowest_cuts(WIDER_FEED_LIMIT * float(samples.limits[0]), MAX_WIDER_FEEDS)[finite]
    crossing = interpolate_first_crossing(tried, near.growth(tried))
    settled[finite] = np.where(np.isfinite(crossing), crossing, limits[finite])
    return settled


def interpolate_first_crossing(tried: Floats, grown: Floats) -> Floats:
    """Interpolate the depth at which growth first reaches zero in each row of tried depths (rows, d), or inf."""
    return _interpolate_limits(*_bracket_limits(tried, grown))


def _bracket_limits(tried: Floats, grown: Floats) -> Floats:
    """Return depths on both sides of the first change to growth in each row, and the growth there, shape (4, rows)."""
    depth = np.pad(tried, ((0, 0), (1, 1)))
    depth[:, -1] = np.inf
    value = np.pad(grown, ((0, 0), (1, 1)), constant_values=1.0)
    value[:, 0] = -np.abs(grown[:, 0])
    first, row = np.argmax(value >= 0, axis=1), np.arange(len(value))
    return np.array([depth[row, first - 1], depth[row, first], value[row, first - 1], value[row, first]])


def _interpolate_limits(low: Floats, high: Floats, at_low: Floats, at_high: Floats) -> Floats:
    """Interpolate the depths at which growth is zero."""
    share = -at_low / (at_high - at_low)
    return np.where(np.isfinite(high), low + share * (np.where(np.isfinite(high), high, low) - low), np.inf)


LIMIT_QUANTILES = (0.01, 0.99)
"""Quantiles of the limit at the ends of a band."""
SKIPPED_CUT_MARGIN = 1.15
"""Factor of margin with which a cut on the path is skipped, if it were as uncertain as the lowest.

A cut is not skipped if the median chatters at a depth larger by this factor, anywhere within the speed uncertainty."""
SKIPPED_SAMPLE_MARGIN = 1.6
"""Factor of margin with which one sample is skipped in such a cut.

Both factors affect only the share of samples that chatter: before a program is called stable, every sample is
checked in every cut. In 408 random cuts, each fed in up to 24 directions, 6 samples were missed."""


class MonteCarloResult(NamedTuple):
    """Monte Carlo result that the verdict on a program rests on."""

    median: ProgramLimit
    """Limit of the median estimate."""
    lowest: float
    """Lowest limit of all samples (m)."""
    low: float
    """1 % quantile of the limit (m)."""
    high: float
    """99 % quantile of the limit (m)."""
    samples: ProgramSamples
    """Evaluated samples."""
    chatters: Flags
    """True for each sample that chatters, not rotating, without the median, shape (samples,)."""
    axes_ratio: float
    """Highest over lowest median limit for all open principal directions; 1 if none are open."""
    limit_at_speed: float
    """Lowest limit of the median estimate over the frequency drop at speed (m)."""
    chatters_at_speed: Flags
    """True for each sample that chatters at a frequency drop at speed, the median first, shape (samples + 1,).

    Looked for only where none chatters that does not rotate."""

    chatters_otherwise: bool = False
    """True if the median chatters in other possible principal directions than those of `median`."""

    @property
    def is_stable_throughout(self) -> bool:
        """True if the median in all possible principal directions and every sample are stable, also at speed."""
        is_calm = self.median.stable and not self.chatters_otherwise
        return is_calm and not np.any(self.chatters) and not np.any(self.chatters_at_speed)


def run_monte_carlo(case: ProgramCase) -> MonteCarloResult:
    """Evaluate a program on all its samples by semi-discretization."""
    worst = program_samples.find_worst_limit(case)
    median = program_samples.find_median_limit(case, worst)
    result = evaluate_samples(case.depth, median, program_samples.draw_samples(case, median))
    return result._replace(low=min(result.low, worst.limit.limit), chatters_otherwise=median is not worst)


def evaluate_samples(
    depth: float, worst: WorstLimit, samples: ProgramSamples, turning: Flags | None = None
) -> MonteCarloResult:
    """Evaluate all samples of a program at its depth (m): limits, quantiles, samples that chatter.

    turning: samples that chatter at speed (`find_chattering_at_speed`), if they have been found already.
    """
    median, _, axes_ratio = worst
    limits = find_sample_limits(samples, depth)[1:]
    low, high = np.quantile(limits, LIMIT_QUANTILES, method="closest_observation")
    below = SKIPPED_CUT_MARGIN * depth * median.limit / low if np.isfinite(median.limit) else 0.0
    around = samples.median_growth_near(SKIPPED_CUT_MARGIN * depth) >= 0
    chatters = _find_chattering(samples, (samples.limits <= below) | around, around, limits, depth)
    at_speed = find_limit_at_speed(samples, depth)
    if turning is None:
        is_calm = median.stable and not np.any(chatters)
        turning = find_chattering_at_speed(samples, depth) if is_calm else np.zeros(len(samples.rows), dtype=np.bool_)
    lowest = float(np.min(limits))
    return MonteCarloResult(median, lowest, float(low), float(high), samples, chatters, axes_ratio, at_speed, turning)


N_HARDEST_SAMPLES, N_SOFTEST_SAMPLES = 24, 8
"""Numbers of samples checked over the whole drop at speed: nearest to chatter, and with the most force on a mode."""
SHALLOWER_SHARE = 0.12
"""Share of a depth at which the limit at speed is searched next, if all of it chatters."""
REFINED_LIMIT_SHARE = 1.03
"""Depth over the first estimate of the limit at speed up to which it is refined."""
MIN_LIMIT = 1e-6
"""Smallest limit at speed that is searched (m)."""


def find_limit_at_speed(samples: ProgramSamples, depth: float) -> float:
    """Find the lowest limit (m) of the median over the drop at speed, up to that not rotating; depth: m."""
    limit = float(samples.limits[0])
    if samples.drop.is_zero:
        return limit
    median, most = samples[np.zeros(1, dtype=np.intp)].over_drops(), min(limit, MAX_PROGRAM_DEPTH_RATIO * depth)
    near = median.with_lowest_cuts(WIDER_FEED_LIMIT * limit, MAX_SIMILAR_FEEDS) if np.isfinite(limit) else median
    found = _find_median_limit(near, most)
    lower = np.any(median.growth_by_cut(found)[..., 0] >= 0, axis=1)
    lower[: len(near.cuts)] = False
    if np.any(lower):
        found = min(found, _find_median_limit(median.with_cuts(lower), found))
    return limit if found == most else min(found, limit)


def _find_median_limit(median: ProgramSamples, most: float) -> float:
    """Find the deepest depth (m) up to `most` at which the median is stable at all drops."""
    found, tried = find_deepest_stable(median, most), most
    while found == 0 and tried > MIN_LIMIT:
        tried *= SHALLOWER_SHARE
        found = find_deepest_stable(median, tried)
    return most if found == most else find_deepest_stable(median, REFINED_LIMIT_SHARE * found)


def find_chattering_at_speed(samples: ProgramSamples, depth: float) -> Flags:
    """Find samples, the median first, that chatter at a depth (m) at speed: at its own drop each, critical ones at all.

    Each drop is drawn evenly from its range, so that no chatter of 300 means what it means not rotating. The range is
    then checked in steps with the samples nearest to chatter, as lobes may lie between its ends.
    """
    if samples.drop.is_zero:
        return np.zeros(len(samples.rows), dtype=np.bool_)
    deep = SKIPPED_CUT_MARGIN * depth / (1 - samples.drop.largest) ** 2
    near = samples.with_cuts(samples.median_growth_near(deep, samples.drop.ends) >= 0)
    turning = near.at_speed()
    grown = turning.critical_growth(depth)
    chatters = grown >= 0
    if not np.any(chatters):
        rows = turning.rows
        force = np.max(rows.tangential[:, np.newaxis] / (rows.stiffness * rows.damping_ratio), axis=1)
        few = np.union1d(np.argsort(-grown)[:N_HARDEST_SAMPLES], np.argsort(-force)[:N_SOFTEST_SAMPLES])
        few = np.union1d(few, [0]).astype(np.intp)
        worst = near[few].over_drops().critical_growth(depth).reshape(-1, few.size)
        chatters[few] = np.any(worst >= 0, axis=0)
    return chatters


def estimate_chatter_risk(result: MonteCarloResult, depth: float, n_cuts: int) -> float:
    """Estimate the chatter risk at speed at a depth (m): that learned from test cuts, else by plausible differences."""
    if n_cuts:
        return float(np.mean(result.chatters))
    worst = draw_rotating_samples(result.samples.with_lowest_cuts(0.0))
    return float(np.mean(worst.growth(depth)[1:] >= 0))


def _find_chattering(samples: ProgramSamples, near: Flags, around: Flags, limits: Floats, depth: float) -> Flags:
    """Find the samples that chatter at a depth (m) in any of the cuts; exact where none does.

    limits: of the samples in the worst cut (m), shape (samples,). In another cut that is near (cuts,), a sample is
    checked if its limit, scaled as in the worst cut, has less than `SKIPPED_SAMPLE_MARGIN`, and if the median
    chatters around it (cuts,). All others are checked only if none of these chatters, in all cuts.
    """
    chatters = limits <= depth
    softness = limits / samples.limits[0] if np.isfinite(samples.limits[0]) else np.ones(limits.size)
    likely = np.multiply.outer(samples.limits, softness) <= SKIPPED_SAMPLE_MARGIN * depth
    likely = (likely | around[:, np.newaxis]) & near[:, np.newaxis]
    likely[0] = True
    for wanted in (likely, ~likely):
        cut, draw = np.nonzero(wanted & ~chatters)
        grown = samples.growth_in_cuts(cut, draw + 1, np.full((cut.size, 1), depth))[:, 0]
        chatters[draw[grown >= 0]] = True
        if np.any(chatters):
            break
    return chatters


N_BAND_SAMPLES = 64
"""Number of samples for a band."""
N_BAND_SPEEDS = 81
"""Number of speeds of their diagrams."""
UNLIMITED_DEPTH = 1e3
"""Depth that represents no limit (m)."""


class LimitBand(NamedTuple):
    """Band between the 1 % and 99 % quantiles of the limits, at the speeds of a diagram."""

    speed_rpm: Floats
    """Spindle speeds (rpm), shape (n,)."""
    low: Floats
    """1 % quantile of the limit, or the median line if lower (m), shape (n,)."""
    high: Floats
    """99 % quantile of the limit, or the median line if higher (m), shape (n,); inf without a limit."""


def compute_limit_band(
    line: StabilityLobes, cut: str, assembly: Assembly, machine: Machine, at_speed: SpindleAtSpeed = NO_TEST_CUTS
) -> LimitBand:
    """Compute the uncertainty band around the limits of a cut (its name) by samples.

    Each sample is worked out by the zero-order approximation. Of a line by another method it is the same line at the
    speed that belongs to the frequency of the sample, times what zero-order approximation says of the rest: that
    holds to a per cent for a line by the zero-order approximation, and for any method as to spindle speed, cutting
    coefficient, and changes that all modes share.
    """
    cuts = machine.cuts(assembly.tool)[cut]
    rows = build_median_row(Program(cuts[0], 1.0, 1.0), at_speed.scale_modes(assembly))
    uncertainty = at_speed.uncertainty or uncertainty_of(assembly, machine.cut_tables[cut], machine)
    samples = uncertainty.sample(rows, N_BAND_SAMPLES)
    softest = int(np.argmin(rows.stiffness[0] * rows.damping_ratio[0]))
    moved = (samples.speed_rpm / (samples.frequency[:, softest] / rows.frequency[0, softest]))[:, np.newaxis]
    low, high = float(np.min(line.speed_rpm)), float(np.max(line.speed_rpm))
    speeds, median = np.geomspace(low, high, N_BAND_SPEEDS), rows[np.zeros(N_BAND_SAMPLES, np.intp)]
    depths = _band_depths(samples, cuts, samples.speed_rpm[:, np.newaxis] * speeds)
    ratios = depths / _band_depths(median, cuts, np.clip(moved * speeds, low, high))
    order = np.argsort(line.speed_rpm)
    rising = line.speed_rpm[order], np.minimum(line.depth[order], UNLIMITED_DEPTH)
    limits = np.interp(np.clip(moved * line.speed_rpm, low, high), *rising)
    limits *= [np.interp(line.speed_rpm, speeds, ratio) for ratio in ratios]
    lowest, highest = np.quantile(limits, LIMIT_QUANTILES, axis=0)
    highest = np.where(highest < UNLIMITED_DEPTH / 2, highest, np.inf)
    return LimitBand(line.speed_rpm, np.minimum(lowest, line.depth), np.maximum(highest, line.depth))


def _band_depths(rows: MillingRows, cuts: Sequence[Cut], speed_rpm: Floats) -> Floats:
    """Return the limit of each row in the worst cut at its own speeds (rpm) (r, s)."""
    depths = [ZeroOrderBatch.of(rows.with_cut(cut)).limits(speed_rpm)[0] for cut in cuts]
    return np.asarray(np.minimum(np.min(depths, axis=0), UNLIMITED_DEPTH))
