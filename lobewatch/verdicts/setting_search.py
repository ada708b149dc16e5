"""Search for stable settings with margin: advice, pockets, recommendations.

Zero order and the multipliers of the middle say where to look (`LikelyDepths`), few samples how deep
(`CriticalSamples`). What is recommended has been evaluated like any program: `run_monte_carlo` finds it stable
throughout, and the same samples are stable around it and as the spindle will be when it is tapped again (`room`).
Where no speed of the grid has such a depth, nothing is recommended.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from lobes import Program
from lobewatch.arrays import Flags, Floats
from lobewatch.machine.settings.drive_power import DEPTH_STEP_MM, SPEED_STEP_RPM, CutRange
from lobewatch.tool.tap_series import expected_frequency_drop
from lobewatch.verdicts import safe_depth_estimates as estimates
from lobewatch.verdicts import setting_robustness as robustness
from lobewatch.verdicts.monte_carlo import (
    SKIPPED_CUT_MARGIN,
    MonteCarloResult,
    estimate_chatter_risk,
    evaluate_samples,
    find_chattering_at_speed,
)
from lobewatch.verdicts.program_case import ProgramCase
from lobewatch.verdicts.program_samples import (
    N_PROGRAM_SAMPLES,
    ProgramSamples,
    draw_samples,
    find_deepest_stable,
    find_worst_limit,
)
from lobewatch.verdicts.safe_depth_estimates import CriticalSamples, LikelyDepths
from lobewatch.verdicts.setting_robustness import Setting, StiffnessAt, model_softening

MAX_DEPTH_MARGIN = 20.0
"""Largest searched depth margin, which also represents no limit."""
MAX_SEARCHED_SPEEDS = 12
"""Number of speeds checked with few samples before the search gives up."""
PROMISING_FACTOR = 1.1
"""Factor on the likely removal rate of a speed, above which it is checked against the best rate so far.

The likely rate includes the largest share of such a depth that few samples have left elsewhere."""
NEIGHBOR_SPEED_STEPS = np.outer([-1, 1], [0.003, 0.006, 0.01, 0.015, 0.02, 0.03, 0.04]).ravel()
"""Relative distances of neighbors checked around the speed of the largest removal rate."""
N_CLIMBS = 2
"""Number of times that neighbors are checked."""
MIN_FAILED_SPEEDS = 3
"""Number of failed speeds that predict the other speeds of their pocket."""
TRIES_PER_SPEED, MAX_SETTING_TRIES = 4, 12
"""Number of depths evaluated at one speed, and at all speeds."""
NEARLY_SAFE_SHARE = 0.85
"""Likely safe share of a requested depth, from which it is evaluated."""
MAX_REMEMBERED_SAMPLES = 8
"""Number of chattering samples of each result that are remembered."""
NEXT_DEPTH_SHARE = 0.98
"""Largest next depth over one at which samples chatter."""
N_WINDOW_SAMPLES = 24
"""Number of critical samples that bound a window before all samples decide."""

N_TAP_INTERVALS = 2
"""Number of tap intervals for which a setting must stay stable."""
DEFAULT_NEEDED_DROP = 0.02
"""Frequency drop by age at which a setting must stay stable if no trend is known; chosen. Added to that at speed."""

DepthsBySpeed = dict[float, float]
"""Possibly safe depths (mm) by speed (rpm)."""
SharesBySpeed = dict[float, float]
"""Share of the depth by few samples that all samples left, by failed speed (rpm)."""


@dataclass(frozen=True, eq=False)
class SettingSearch:
    """Search for settings of one cut with a known tool."""

    case: ProgramCase
    """Program and tool; speed and depth of the program are ignored."""
    critical: dict[float, CriticalSamples] = field(default_factory=dict)
    """Critical samples by speed (rpm), with those known to chatter at the last query."""
    chattered: set[int] = field(default_factory=set)
    """Indices of samples that chattered where few samples seemed safe."""
    results: dict[tuple[float, float], MonteCarloResult] = field(default_factory=dict)
    """Results of the settings found, by speed (rpm) and depth (mm)."""

    @cached_property
    def cut_range(self) -> CutRange:
        """Speeds and depths that may be recommended."""
        return CutRange.of(self.case.machine, self.case.table)

    @cached_property
    def needed_drop(self) -> float:
        """Relative frequency drop by age at which a setting must stay stable: two tap intervals at the rate so far."""
        days = N_TAP_INTERVALS * self.case.machine.machine.interval_days
        drops = [expected_frequency_drop(series, days) for series in self.case.assembly.series.values()]
        expected = [DEFAULT_NEEDED_DROP if drop is None else max(drop, robustness.MIN_ROBUST_DROP) for drop in drops]
        return max(expected, default=DEFAULT_NEEDED_DROP)

    @cached_property
    def stiffness_at(self) -> StiffnessAt:
        """Stiffness over the present one as a function of the frequency drop."""
        return model_softening(self.case.assembly)[0]

    @cached_property
    def likely_depths(self) -> LikelyDepths:
        """Likely safe depths over speed."""
        return estimates.estimate_likely_depths(self.case, self.cut_range, self.needed_drop)

    @cached_property
    def best(self) -> Setting | None:
        """Setting with the largest removal rate at the same feed per tooth; None if no setting is safe."""
        return next(self._search_settings(), None)

    def pockets(self, count: int) -> list[Setting]:
        """Return the best setting, and the best of other pockets."""
        taken: list[Setting] = []
        for setting in self._search_settings(taken):
            taken.append(setting)
            if len(taken) == count:
                break
        return taken

    def nearest_window(self, depth_mm: float, speed_rpm: float) -> Setting | None:
        """Find a depth (mm) in the speed window nearest to a speed (rpm)."""
        for speed in self._candidate_speeds(depth_mm, speed_rpm):
            if self.cut_range.contains(speed, depth_mm) and self._deepest_stable(speed) >= depth_mm:
                setting = self.verify(speed, depth_mm)
                if isinstance(setting, Setting):
                    return setting
        return None

    def deepest_at(self, speed_rpm: float, most_mm: float) -> Setting | None:
        """Find the deepest setting at a speed (rpm), up to a depth (mm)."""
        if self.best is None or not self.cut_range.low_rpm <= speed_rpm <= self.cut_range.high_rpm:
            return None
        return self._deepest_setting(speed_rpm, min(most_mm, self._deepest_stable(speed_rpm)))

    def _candidate_speeds(self, depth_mm: float, near_rpm: float) -> Iterator[float]:
        """Yield speeds (rpm) at which a depth (mm) is likely safe, the nearest first; that of the best setting last."""
        if self.cut_range.is_empty:
            return
        depths = depth_mm, NEARLY_SAFE_SHARE * depth_mm
        middles = {center for depth in depths for center in self.likely_depths.window_centers(depth)}
        nearest = sorted(middles, key=lambda speed: abs(math.log(speed / near_rpm)))
        yield from map(_round_speed, nearest[:MAX_SEARCHED_SPEEDS])
        if self.best is not None:
            yield self.best.speed_rpm

    def _search_settings(self, taken: Sequence[Setting] = ()) -> Iterator[Setting]:
        """Yield the deepest settings of the grid, the largest removal rate first.

        What was evaluated in vain comes back with less depth, and the samples that chattered count from then on.
        Pockets that are taken while it goes on are passed over.
        """
        if self.cut_range.is_empty:
            return
        peaks = self.likely_depths.removal_peaks(MAX_SEARCHED_SPEEDS)
        tops = [(_round_speed(speed), depth) for speed, depth in reversed(peaks)]
        depths, confirmed = DepthsBySpeed(), SharesBySpeed()
        visited, left = set[float](), 0.0
        for _ in range(MAX_SETTING_TRIES):
            tops = [top for top in tops if self._is_free(top[0], taken)]
            depths = {speed: depth for speed, depth in depths.items() if self._is_free(speed, taken)}
            speed = self._best_speed(depths, confirmed)
            while tops and PROMISING_FACTOR * left * math.prod(tops[-1]) >= speed * depths.get(speed, 0.0):
                top, likely = tops.pop()
                depths[top] = self.cut_range.round_down_depth(self._deepest_stable(top))
                left, speed = max(left, depths[top] / likely), self._best_speed(depths, confirmed)
            if not depths.get(speed):
                return
            speed = self._climb(speed, depths, confirmed, visited)
            if not self._is_free(speed, taken):
                continue
            setting = self.verify(speed, depths[speed])
            if isinstance(setting, Setting):
                del depths[speed]
                yield setting
            else:
                confirmed[speed] = confirmed.get(speed, 1.0) * setting / depths[speed]
                depths[speed] = self.cut_range.round_down_depth(setting)

    def _is_free(self, speed: float, taken: Sequence[Setting]) -> bool:
        """Return whether a speed (rpm) is in none of the pockets taken."""
        return not any(self.likely_depths.is_same_pocket(speed, setting.speed_rpm) for setting in taken)

    def _climb(self, speed: float, depths: DepthsBySpeed, confirmed: SharesBySpeed, visited: set[float]) -> float:
        """Return the speed (rpm) of the largest removal rate after its neighbors have been tried, once a peak."""
        for _ in range(0 if speed in visited else N_CLIMBS):
            visited.add(speed)
            if (neighbor := self._better_neighbor(speed, depths[speed])) in visited:
                break
            visited.add(neighbor)
            depths[neighbor] = self.cut_range.round_down_depth(self._deepest_stable(neighbor))
            speed = self._best_speed(depths, confirmed)
        return speed

    def _best_speed(self, depths: DepthsBySpeed, confirmed: SharesBySpeed) -> float:
        """Return the speed (rpm) of the largest removal rate, with the share likely to be confirmed; 0 without any."""

        def rate(speed: float) -> float:
            pocket = [share for other, share in confirmed.items() if self.likely_depths.is_same_pocket(speed, other)]
            share = 1.0 if speed in confirmed or len(pocket) < MIN_FAILED_SPEEDS else max(pocket)
            return speed * depths[speed] * share

        while True:
            speed = max(depths, key=rate, default=0.0)
            if not speed or self.critical[speed].chattered == self.chattered:
                return speed
            depths[speed] = min(depths[speed], self.cut_range.round_down_depth(self._deepest_stable(speed)))

    def _better_neighbor(self, speed: float, depth_mm: float) -> float:
        """Return a neighboring speed (rpm) with a larger removal rate by the critical samples, or itself."""
        speeds = np.round(speed * (1 + NEIGHBOR_SPEED_STEPS) / SPEED_STEP_RPM) * SPEED_STEP_RPM
        depths = (np.floor(speed * depth_mm / speeds / DEPTH_STEP_MM) + 1) * DEPTH_STEP_MM
        held = [self.cut_range.contains(*place) for place in zip(speeds.tolist(), depths.tolist(), strict=True)]
        if not any(held):
            return speed
        grown = self.critical[speed].growth_at_speeds(speeds[held] / speed, depths[held] / 1e3)
        return float(speeds[held][np.argmin(grown)]) if np.min(grown) < 0 else speed

    def _deepest_stable(self, speed: float) -> float:
        """Return the deepest depth (mm) at a speed (rpm) by the critical samples, now and later."""
        most = float(self.cut_range.depth_limits(np.array([speed]))[0]) / 1e3
        if speed not in self.critical:
            likely = float(np.interp(speed, self.likely_depths.speeds, self.likely_depths.depths)) / 1e3
            program = Program(self.case.machine.build_cut(self.case.table), speed, max(likely, DEPTH_STEP_MM / 1e3))
            few = estimates.select_critical_samples(self.case, program, self.needed_drop, self.stiffness_at)
            self.critical[speed] = few
        hard = self.critical[speed] = self.critical[speed]._replace(chattered=frozenset(self.chattered))
        return 1e3 * hard.deepest_stable(most)

    def _deepest_setting(self, speed: float, depth_mm: float) -> Setting | None:
        """Find the deepest setting up to a depth (mm)."""
        for _ in range(TRIES_PER_SPEED):
            if not (depth_mm := self.cut_range.round_down_depth(depth_mm)):
                return None
            setting = self.verify(speed, depth_mm)
            if isinstance(setting, Setting):
                return setting
            depth_mm = min(setting, self._deepest_stable(speed))
        return None

    def verify(self, speed: float, depth_mm: float) -> Setting | float:
        """Verify a setting on all samples, now and at the next tap test; else return a depth (mm) to try."""
        depth = depth_mm / 1e3
        deep = robustness.ROBUST_DEPTH_FACTOR * depth
        case = self.case.with_changes(speed_rpm=speed, depth_mm=depth_mm)
        worst = find_worst_limit(case)
        limit, samples = worst.limit.limit, draw_samples(case, worst)
        if limit < depth * (1 + robustness.MIN_DEPTH_MARGIN):
            return 1e3 * limit / (1 + robustness.MIN_DEPTH_MARGIN)
        drops = samples.drop.age(self.needed_drop)
        grown = samples.median_growth_near(
            SKIPPED_CUT_MARGIN * deep / (1 - samples.drop.largest) ** 2, drops, robustness.ROBUST_SPEED_FACTOR
        )
        near = samples.with_cuts(grown >= 0)
        around = robustness.sweep_neighborhood(near, self.needed_drop, self.stiffness_at)
        grown = around.critical_growth(depth)
        if np.any(grown >= 0):
            return self._reduced_depth(around, grown, depth_mm)
        if (less := self._depth_beside(samples, depth_mm)) is not None:
            return less
        result = evaluate_samples(depth, worst, samples, np.zeros(len(samples.rows), dtype=np.bool_))
        if not result.is_stable_throughout:
            return min(self._depth_below(samples, np.append(False, result.chatters), depth_mm), 1e3 * result.lowest)
        few = np.argsort(np.max(grown.reshape(-1, len(near.rows)), axis=0))[-N_WINDOW_SAMPLES:]
        hardest = near.at_speed()[few]
        window = robustness.find_speed_window(samples, near[few].join(hardest), speed, depth, self.cut_range)
        left = robustness.find_drop_margin(hardest, depth, self.stiffness_at)
        self.results[speed, depth_mm] = result
        risk = estimate_chatter_risk(result, depth, self.case.at_speed.n_cuts)
        return Setting(speed, depth_mm, window, min(limit / depth - 1, MAX_DEPTH_MARGIN), left, risk)

    def _depth_beside(self, samples: ProgramSamples, depth_mm: float) -> float | None:
        """Return a smaller depth (mm) if samples chatter at speed, slower or faster, or slower or faster at rest."""
        for speed in (1.0, *robustness.ROBUST_SPEEDS):
            beside = samples.sweep(speed)
            turning = find_chattering_at_speed(beside, depth_mm / 1e3)
            if np.any(turning):
                return self._depth_below(beside.over_drops(), turning, depth_mm)
            resting = beside.critical_growth(depth_mm / 1e3) if speed != 1.0 else np.empty(0)
            if np.any(resting >= 0):
                return self._reduced_depth(beside, resting, depth_mm)
        return None

    def _depth_below(self, samples: ProgramSamples, chatters: Flags, depth_mm: float) -> float:
        """Return a smaller depth (mm) at which the samples that chatter may be stable, with all their drops."""
        places = np.flatnonzero(chatters)[:N_WINDOW_SAMPLES]
        self.chattered.update(places[:MAX_REMEMBERED_SAMPLES].tolist())
        repeated = np.add.outer(np.arange(0, len(samples.rows), chatters.size), places).ravel()
        calm = find_deepest_stable(samples[repeated], depth_mm / 1e3)
        return min(1e3 * calm, NEXT_DEPTH_SHARE * depth_mm, depth_mm - DEPTH_STEP_MM)

    def _reduced_depth(self, samples: ProgramSamples, grown: Floats, depth_mm: float) -> float:
        """Return a smaller depth (mm) at which these samples may be stable."""
        places = np.argsort(-grown)[:N_WINDOW_SAMPLES]
        self.chattered.update((places[grown[places] >= 0] % (N_PROGRAM_SAMPLES + 1))[:MAX_REMEMBERED_SAMPLES].tolist())
        calm = find_deepest_stable(samples[places], depth_mm / 1e3)
        return min(1e3 * calm, depth_mm - DEPTH_STEP_MM)


def _round_speed(speed: float) -> float:
    return round(speed / SPEED_STEP_RPM) * SPEED_STEP_RPM
