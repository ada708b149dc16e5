"""Ladder of ordinary cuts: each removes more than the one before it, at a small chance of chatter."""

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy

from lobewatch.arrays import Floats
from lobewatch.cuts.learning.cut_likelihood import (
    CLEARLY_STABLE_RATIO,
    LIMIT_SPREAD,
    CutEvidence,
    CutPrediction,
    PowerEvidence,
    predict_cut,
)
from lobewatch.cuts.learning.posterior import Posterior
from lobewatch.cuts.learning.repeated_cuts import find_questioned_cut, is_setting_taken
from lobewatch.cuts.learning.suggestion import (
    MIN_CANDIDATE_DISTANCE,
    CutGrid,
    LimitCharts,
    expect_process_damping,
    floor_depth,
)
from lobewatch.machine.settings.drive_power import DEPTH_STEP_MM

MAX_CUT_RISK = 0.05
"""Largest chance of chatter of a production cut."""
MAX_LADDER_CUTS = 3
"""Largest number of named cuts."""
N_LADDER_SAMPLES = 1000
"""Number of samples from which the chance is computed."""
N_PROPOSAL_SAMPLES, PROPOSED_SPEED_STEP = 150, 2
"""Number of samples that propose speeds, and step in the speeds of the grid; chosen."""
N_VERIFIED_SPEEDS = 4
"""Number of speeds whose depth is verified; chosen."""
N_DEPTH_TRIES = 2
"""Number of depths at which the distance of the limits is computed, each by the one before; chosen."""
MIN_STEP_GAIN = 0.03
"""Smallest gain in removal rate of a step over the one before it; chosen."""


class LadderStep(NamedTuple):
    """Ordinary cut of the ladder."""

    speed_rpm: float
    """Spindle speed (rpm)."""
    depth: float
    """Axial depth of cut (m)."""
    chatter_probability: float
    """Chance of chatter if all earlier steps are stable, with the expected power if it is read."""
    gain: float = np.inf
    """Gain in removal rate over the running cut; inf without one."""

    @property
    def removal_rate(self) -> float:
        """Speed times depth (rpm m)."""
        return self.speed_rpm * self.depth


class Ladder(NamedTuple):
    """Next ordinary cuts."""

    steps: tuple[LadderStep, ...]
    """Cuts in their order; empty if none removes more with at most `MAX_CUT_RISK`."""
    questioned: CutEvidence | None = None
    """Stable cut that deeper cuts put in question; its answer comes before any step."""


def find_ladder(
    posterior: Posterior,
    grid: CutGrid,
    cuts: Sequence[CutEvidence],
    rejected: Collection[CutEvidence],
    running: tuple[float, float] | None,
    count: int = MAX_LADDER_CUTS,
    power: PowerEvidence | None = None,
) -> Ladder:
    """Find the next ordinary cuts.

    Without a better cut, the running one is the first step if its power can teach Kt, or the best with little risk.

    Parameters
    ----------
    posterior
        Spindle at speed after all cuts.
    grid
        Possible cuts.
    cuts, rejected
        Cuts of this program, and those with a rejected verdict.
    running
        Speed (rpm) and depth (m) of the cut that runs now; None without one.
    count
        Largest number of steps.
    power
        Errors of a power reading of the cuts; None if it cannot be read.
    """
    if (questioned := find_questioned_cut(cuts)) is not None:
        return Ladder((), questioned)
    posterior = expect_process_damping(posterior)
    steps, rate = list[LadderStep](), 0.0 if running is None else running[0] * running[1]
    while len(steps) < count:
        step = _find_step(posterior, grid, cuts, rejected, steps[-1].removal_rate if steps else rate)
        if step is None and not steps and power is not None and not _is_power_known(posterior):
            step = _build_running_step(posterior, grid, running) or _find_step(posterior, grid, cuts, rejected, 0.0)
        if step is None:
            break
        steps.append(step._replace(gain=step.removal_rate / rate - 1 if rate else np.inf))
        if len(steps) < count:
            posterior = posterior.learn_from(_expect(step, posterior, grid, power))
    return Ladder(tuple(steps))


def _expect(step: LadderStep, posterior: Posterior, grid: CutGrid, power: PowerEvidence | None) -> CutEvidence:
    """Return the expected result of a step: stable, with the power of the mean Kt."""
    made = grid.build_evidence(step.speed_rpm, step.depth)
    if power is None:
        return made
    return replace(made, power=replace(power, force=posterior.intervals["tangential"].mean))


def _is_power_known(posterior: Posterior) -> bool:
    """Return whether a power in the material of the program was read."""
    return any(cut.power is not None and cut.material == 0 for cut in posterior.cuts)


def _build_running_step(posterior: Posterior, grid: CutGrid, running: tuple[float, float] | None) -> LadderStep | None:
    """Return the running cut (rpm, m) as a step, whose power teaches Kt; None if it chatters too easily."""
    return None if running is None else _verify_step(posterior.resample(N_LADDER_SAMPLES), grid, *running)


def _find_step(
    posterior: Posterior, grid: CutGrid, cuts: Sequence[CutEvidence], rejected: Collection[CutEvidence], rate: float
) -> LadderStep | None:
    """Find the cut of the largest removal rate with little risk, or None if it gains nothing over a rate (rpm m)."""
    few = posterior.resample(N_LADDER_SAMPLES)
    found = [(speed, _find_depth(few, grid, speed, depth)) for speed, depth in _list_speeds(posterior, grid)]
    gaining = [place for place in found if math.prod(place) > (1 + MIN_STEP_GAIN) * rate]
    free = [place for place in gaining if not is_setting_taken(*place, cuts, rejected)]
    verified = (_verify_step(few, grid, *place) for place in sorted(free, key=math.prod, reverse=True))
    return next((step for step in verified if step is not None), None)


def _list_speeds(posterior: Posterior, grid: CutGrid) -> Iterator[tuple[float, float]]:
    """Yield speeds (rpm) and depths (m) with the largest removal rates by the zero-order approximation."""
    part = slice(None, None, PROPOSED_SPEED_STEP)
    speeds, trust = grid.speeds[part], grid.zero_order_trust[part]
    coarse = grid._replace(speeds=speeds, max_depths=grid.max_depths[part], zero_order_trust=trust)
    limits = LimitCharts.of(posterior.resample(N_PROPOSAL_SAMPLES).samples, coarse).limits
    depths = np.quantile(limits, MAX_CUT_RISK, axis=0)
    chosen = list[float]()
    for row in np.argsort(-speeds * depths).tolist():
        speed = float(speeds[row])
        if all(abs(np.log(speed / other)) > MIN_CANDIDATE_DISTANCE for other in chosen):
            chosen.append(speed)
            yield speed, float(depths[row])
        if len(chosen) == N_VERIFIED_SPEEDS:
            return


def _find_depth(few: Posterior, grid: CutGrid, speed: float, depth: float) -> float:
    """Return the deepest cut (m) with little risk at a speed (rpm), near a depth (m); 0 without one."""
    deepest = float(np.interp(speed, grid.speeds, grid.max_depths))
    depth = max(floor_depth(depth), DEPTH_STEP_MM / 1e3)
    for _ in range(N_DEPTH_TRIES):
        within = min(deepest, CLEARLY_STABLE_RATIO * depth)
        depth = _deepest_with_little_risk(_predict(few, grid, speed, depth), depth, within)
        if depth <= 0:
            return 0.0
    return depth


def _verify_step(few: Posterior, grid: CutGrid, speed: float, depth: float) -> LadderStep | None:
    """Return a cut (rpm, m) as a step, None if it chatters too easily. No estimated limit decides."""
    chance = float(np.mean(_predict(few, grid, speed, depth, is_estimated=False).chatter_probability))
    return LadderStep(speed, depth, chance) if chance <= MAX_CUT_RISK else None


def _predict(few: Posterior, grid: CutGrid, speed: float, depth: float, *, is_estimated: bool = True) -> CutPrediction:
    """Predict a cut at its commanded speed, from which the true one may differ."""
    cut = replace(grid.build_evidence(speed, depth), speed_found=False)
    return predict_cut(cut, few.samples, is_estimated=is_estimated)


def _deepest_with_little_risk(prediction: CutPrediction, depth: float, deepest: float) -> float:
    """Return the deepest cut (m) with little risk, by how far the limits are from a depth (m)."""
    depths = np.arange(DEPTH_STEP_MM / 1e3, floor_depth(deepest) + DEPTH_STEP_MM / 2e3, DEPTH_STEP_MM / 1e3)
    chances = _chances_at(prediction, np.log(depths / depth))
    fine = np.flatnonzero(chances <= MAX_CUT_RISK)
    return floor_depth(float(depths[fine[-1]])) if fine.size else 0.0


def _chances_at(prediction: CutPrediction, deeper: Floats) -> Floats:
    """Return the chance of chatter at depths, as logarithms over that of a prediction, shape (d,)."""
    return np.asarray(np.mean(scipy.special.ndtr((prediction.excess[:, np.newaxis] + deeper) / LIMIT_SPREAD), axis=0))
