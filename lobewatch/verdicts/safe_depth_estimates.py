"""Estimate the safe depth over speed from few samples, before a setting is evaluated.

Zero order narrows; where it is not exact, the multipliers of the median estimate are checked at coarser speeds, so
that what it does not see (low immersion, flip) counts. Nothing is evaluated yet.
"""

import itertools
import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy

from lobes import MillingRows, Program, build_milling_system, count_pieces, growth_rate, join_rows, rows_at_speeds
from lobes.floquet.milling_rows import COARSE_CYCLES_PER_PIECE
from lobewatch.arrays import Flags, Floats, Indices
from lobewatch.machine.settings.drive_power import CutRange
from lobewatch.tool.principal_directions import lowest_zero_order_lobes
from lobewatch.verdicts import setting_robustness as robustness
from lobewatch.verdicts.monte_carlo import interpolate_first_crossing
from lobewatch.verdicts.program_case import ProgramCase
from lobewatch.verdicts.program_samples import (
    FREQUENCY_MARGIN,
    N_PROGRAM_SAMPLES,
    ProgramSamples,
    draw_likely_samples,
    find_deepest_stable,
)
from lobewatch.verdicts.setting_robustness import ROBUST_SPEED_FACTOR, StiffnessAt
from lobewatch.verdicts.zero_order_batch import is_force_constant

N_GROWING_SAMPLES = 24
"""Number of samples with the largest growth at the likely depth."""
N_FLEXIBLE_SAMPLES = 8
"""Number of samples with the largest force on the most flexible mode."""
N_CRITICAL_FEEDS = 2
"""Number of worst feed directions around the speed in which these samples are checked."""
DEPTH_GROWTH_FACTOR, DEPTH_SHRINK_FACTOR = 1.5, 0.15
"""Depth factor of the search if all depths are stable, and if hardly any is."""
MIN_SEARCHED_DEPTH = 1e-5
"""Smallest searched depth (m)."""


class CriticalSamples(NamedTuple):
    """Critical samples of a cut at one speed."""

    likely_depth: float
    """Likely safe depth (m), the scale of the checked depths."""
    samples: ProgramSamples
    """Samples at the ends of the required range (`sweep_extremes`), then the median with its depth margin."""
    likely_first: Indices
    """Indices of the few samples that probably chatter first."""
    chattered: frozenset[int] = frozenset()
    """Indices of further samples that have chattered elsewhere."""

    @property
    def selected(self) -> ProgramSamples:
        """Samples that are evaluated."""
        blocks = np.arange(len(self.samples.rows) // (N_PROGRAM_SAMPLES + 1)) * (N_PROGRAM_SAMPLES + 1)
        more = np.add.outer(blocks, sorted(self.chattered)).ravel().astype(np.intp)
        return self.samples[np.union1d(self.likely_first, more)]

    def deepest_stable(self, most: float) -> float:
        """Return the deepest depth (m) up to `most` at which all selected samples are stable."""
        few, depth = self.selected, min(self.likely_depth, most)
        calm = find_deepest_stable(few, depth)
        while calm == depth < most:
            depth = min(DEPTH_GROWTH_FACTOR * depth, most)
            calm = find_deepest_stable(few, depth)
        while calm == 0 and depth > MIN_SEARCHED_DEPTH:
            depth *= DEPTH_SHRINK_FACTOR
            calm = find_deepest_stable(few, depth)
        return calm

    def growth_at_speeds(self, speeds: Floats, depths: Floats) -> Floats:
        """Return the largest growth of the selected samples at relative speeds and depths (m) (k,).

        In the worst direction of feed: it says where to look, no more.
        """
        few = self.selected.with_lowest_cuts(0.0)
        wanted = np.repeat(depths, len(few.rows))[:, np.newaxis]
        return np.asarray(np.max(few.sweep(speeds).growth(wanted).reshape(speeds.size, -1), axis=1))


def select_critical_samples(
    case: ProgramCase, program: Program, drop: float, stiffness_at: StiffnessAt
) -> CriticalSamples:
    """Select the samples that are likely the first to chatter, at speed, now or after a frequency drop by age.

    program: the case at one speed and the depth that is likely safe.
    """
    likely = draw_likely_samples(case, program)
    resting = likely.rows
    drops = likely.drop.age(drop)
    order = np.argsort(-likely.median_growth_near(program.depth, drops, ROBUST_SPEED_FACTOR))[:N_CRITICAL_FEEDS]
    likely = replace(likely, cuts=tuple(case.cuts[place] for place in order), limits=likely.limits[order])
    aged = robustness.sweep_extremes(likely, drop, stiffness_at)
    grown = aged.with_lowest_cuts(0.0).growth(program.depth)[:, 0]
    force = np.max(aged.rows.tangential[:, np.newaxis] / (aged.rows.stiffness * aged.rows.damping_ratio), axis=1)
    median = resting[np.zeros(1, dtype=np.intp)]
    push = 1 + robustness.MIN_DEPTH_MARGIN
    median = replace(median, tangential=push * median.tangential, radial=push * median.radial)
    growing, flexible = np.argsort(-grown)[:N_GROWING_SAMPLES], np.argsort(-force)[:N_FLEXIBLE_SAMPLES]
    first = np.unique(np.concatenate((growing, flexible, [grown.size])))
    return CriticalSamples(program.depth, replace(aged, rows=join_rows(aged.rows, median)), first)


LIKELY_SPEED_STEP = 0.002
"""Relative step of the speeds."""
COARSE_SPEED_STEPS = 6
"""Number of speed steps between two checks of the multipliers."""
TRIED_ZERO_ORDER_SHARES = np.array([0.3, 0.6, 1.0, 1.6, 2.5])
"""Shares of the zero-order limit at which multipliers are checked."""
FURTHER_DEPTH_SHARES = np.array([0.2, 0.5, 1.0])
"""Further shares between the last of these and the largest relevant depth, if none chatters."""
N_LIKELY_FEEDS = 2
"""Number of feed directions checked at a speed, the worst by the zero-order approximation."""
MIN_REMOVAL_SHARE = 0.75
"""Possible removal rate at a speed, as a share of the largest zero-order rate, below which it is not checked."""
MAX_DEPTH_FACTOR = 1.3
"""Largest distinguished limit over the largest allowed depth including its margin."""
MIN_PEAK_SPEED_DISTANCE, MIN_OTHER_SPEED_DISTANCE = 0.02, 0.05
"""Smallest relative distance of two checked maxima, and of other checked speeds."""
POCKET_VALLEY_SHARE = 0.8
"""Likely depth between two separate pockets, as a share of the shallower pocket, at most."""


class LikelyDepths(NamedTuple):
    """Likely safe depths over speed."""

    speeds: Floats
    """Speeds (rpm), ascending, shape (n,)."""
    depths: Floats
    """Likely safe depth (mm), limited by tool and drive, shape (n,)."""

    def window_centers(self, depth_mm: float) -> list[float]:
        """Return the center (rpm) of each speed window in which a depth (mm) is likely safe."""
        places = np.flatnonzero(self.depths >= depth_mm)
        runs = np.split(places, np.flatnonzero(np.diff(places) > 1) + 1)
        return [float(self.speeds[run[run.size // 2]]) for run in runs if run.size]

    def removal_peaks(self, count: int) -> list[tuple[float, float]]:
        """Return speeds (rpm) and depths (mm) of local maxima of the removal rate, then of others apart."""
        removal_rates = np.pad(self.depths * self.speeds, 1)
        tops = np.flatnonzero((removal_rates[1:-1] >= removal_rates[:-2]) & (removal_rates[1:-1] >= removal_rates[2:]))
        order = np.argsort(-removal_rates[1:-1], kind="stable")
        taken: list[int] = []
        looks = (order[np.isin(order, tops)], MIN_PEAK_SPEED_DISTANCE), (order, MIN_OTHER_SPEED_DISTANCE)
        for places, apart in looks:
            for place in places.tolist():
                if all(abs(place - top) * LIKELY_SPEED_STEP > apart for top in taken):
                    taken.append(place)
        return [(float(self.speeds[place]), float(self.depths[place])) for place in taken[:count]]

    def is_same_pocket(self, first: float, second: float) -> bool:
        """Return whether the likely depth between two speeds (rpm) stays nearly as large: one pocket."""
        ends = np.searchsorted(self.speeds, sorted((first, second)))
        between = self.depths[ends[0] : ends[1] + 1]
        return between.size < 2 or bool(np.min(between) >= POCKET_VALLEY_SHARE * min(between[0], between[-1]))


def estimate_likely_depths(case: ProgramCase, reach: CutRange, drop: float) -> LikelyDepths:
    """Estimate the safe depth over speed within the uncertainty, now and after a frequency drop.

    cuts: all that the program makes on its path; spare: depth margin in the median estimate at least.
    """
    cuts, spindle, uncertainty = case.cuts, case.spindle, case.uncertainty
    number = max(int(math.log(reach.high_rpm / reach.low_rpm) / LIKELY_SPEED_STEP), 1)
    speeds = np.geomspace(reach.low_rpm, reach.high_rpm, number + 1)
    lobes = [lowest_zero_order_lobes(spindle.x, spindle.y, [cut], speeds, spindle.cross) for cut in cuts]
    by_cut = np.array([each.depth for each in lobes]) * 1e3
    deepest, safe = reach.depth_limits(speeds), max(uncertainty.tangential.high, 1 + robustness.MIN_DEPTH_MARGIN)
    by_cut = np.minimum(by_cut, MAX_DEPTH_FACTOR * safe * deepest)
    margin = uncertainty.speed + FREQUENCY_MARGIN + math.log(ROBUST_SPEED_FACTOR)
    drops = [case.drop_at(speed) for speed in speeds.tolist()]
    softer = np.array([1 - each.largest for each in drops]) ** 2
    moved = -np.log1p(-np.array([each.age(drop) for each in drops])) + [-margin, margin]
    steps = np.ceil(np.abs(moved) / LIKELY_SPEED_STEP).astype(np.intp)

    def around(limits: Floats) -> Floats:
        return np.asarray(np.minimum(_lowest_around(limits, *steps.T) * softer / safe, deepest))

    limit = np.min(by_cut, axis=0)
    if not all(map(is_force_constant, cuts)):
        best = np.max(speeds * around(limit))
        rates = speeds * np.minimum(deepest, TRIED_ZERO_ORDER_SHARES[-1] * limit / safe)
        wanted = scipy.ndimage.maximum_filter1d(rates >= MIN_REMOVAL_SHARE * best, 4 * int(np.max(steps)) + 1)
        limit = _limits_by_multipliers(case, speeds, by_cut, MAX_DEPTH_FACTOR * safe * deepest, wanted)
    return LikelyDepths(speeds, around(limit))


def _lowest_around(limits: Floats, below: Indices, above: Indices) -> Floats:
    """Return the lowest limit within some steps below and above each place, each shape (n,)."""
    moves = np.arange(-np.max(below), np.max(above) + 1)
    places = np.arange(limits.size)[:, np.newaxis] + moves
    around = limits[np.clip(places, 0, limits.size - 1)]
    is_outside = (moves < -below[:, np.newaxis]) | (moves > above[:, np.newaxis])
    return np.asarray(np.min(np.where(is_outside, np.inf, around), axis=1))


def _limits_by_multipliers(case: ProgramCase, speeds: Floats, by_cut: Floats, deepest: Floats, wanted: Flags) -> Floats:
    """Return limits (mm) by multipliers where wanted (n,), interpolated; else by the zero-order approximation.

    by_cut: limits by the zero-order approximation (cuts, n).
    """
    places = np.unique(np.append(np.arange(0, speeds.size, COARSE_SPEED_STEPS), speeds.size - 1))
    places = places[wanted[places]]
    x, y, patterns = case.spindle.x, case.spindle.y, case.spindle.principal_directions.sign_patterns
    systems = [build_milling_system(x, y, vectors) for vectors in patterns]
    worst, true = np.argsort(by_cut[:, places], axis=0)[:N_LIKELY_FEEDS], deepest[places].copy()
    for (i, cut), system in itertools.product(enumerate(case.cuts), systems):
        here = np.flatnonzero(np.any(worst == i, axis=0))
        rows = rows_at_speeds(system, cut, speeds[places[here]])
        limit = _first_crossing(rows, np.min(by_cut[:, places[here]], axis=0), deepest[places[here]])
        true[here] = np.minimum(true[here], limit)
    return np.asarray(np.where(wanted, np.interp(np.log(speeds), np.log(speeds[places]), true), np.min(by_cut, axis=0)))


def _first_crossing(rows: MillingRows, mean: Floats, most: Floats) -> Floats:
    """Return the depth (mm) (r,) at which growth first reaches zero, or inf.

    mean: limit by the zero-order approximation (mm) (r,); most: depth up to which it matters.
    """
    ends = np.minimum(mean * TRIED_ZERO_ORDER_SHARES[-1], most)[:, np.newaxis]
    limit = _interpolate_crossing(rows, np.minimum(mean[:, np.newaxis] * TRIED_ZERO_ORDER_SHARES, most[:, np.newaxis]))
    beyond = np.flatnonzero(np.isinf(limit) & (ends[:, 0] < most))
    further = ends[beyond] * (1 - FURTHER_DEPTH_SHARES) + most[beyond, np.newaxis] * FURTHER_DEPTH_SHARES
    limit[beyond] = _interpolate_crossing(rows[beyond], further)
    return limit


def _interpolate_crossing(rows: MillingRows, depths: Floats) -> Floats:
    """Interpolate the first zero of growth between depths (mm) (r, d)."""
    if not depths.size:
        return np.empty(0)
    grown = growth_rate(rows, depths / 1e3, count_pieces(rows, float(np.max(depths)) / 1e3, COARSE_CYCLES_PER_PIECE))
    return interpolate_first_crossing(depths, grown)
