"""Frequency drops before a program chatters, and robustness of a setting against changes of speed, depth and frequency.

The largest safe depth is safe at a single speed only, the tip of a pocket. A recommended setting keeps a margin on all
sides.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from acquisition import Remark
from dsm import Calibration, calibrate
from lobes.cut import CHECKED_DEPTH_SHARES
from lobewatch.arrays import Floats
from lobewatch.machine.settings.drive_power import SPEED_STEP_RPM, CutRange
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.monte_carlo import find_chattering_at_speed
from lobewatch.verdicts.program_samples import ProgramSamples
from lobewatch.verdicts.uncertainty import Factors
from lobewatch.verdicts.verdict import CriticalDrop, Stability, StoredVerdict, Verdict

CALIBRATED_DROPS = np.array([0.0, 0.05, 0.10, 0.15, 0.20])
"""Relative frequency drops for which the model is recalibrated; between them its stiffness is interpolated."""
N_DROP_STEPS = 101
"""Number of checked frequency drops from zero to the largest."""
N_DROP_PARTS = 8
"""Number of parts in which these drops are checked, up to the part with the first chatter."""
MAX_CACHED_CALIBRATIONS = 8
"""Number of cached calibrated models, the most recently used."""

StiffnessAt = Callable[[float], float]


def model_softening(assembly: Assembly) -> tuple[StiffnessAt, Remark]:
    """Return relative stiffness as a function of the frequency drop, and the remark that states the assumption.

    All modes drop alike. K follows the model (bearings softer until its frequency has dropped as far); without a
    model it stays.
    """
    ratios = np.ones(1) if assembly.calibration is None else _stiffness_ratios(assembly.calibration)
    clause = "constant stiffness (no calibrated spindle model)"
    if ratios.size > 1:
        drop, change = 100 * CALIBRATED_DROPS[ratios.size - 1], 100 * (ratios[-1] - 1)
        clause = f"stiffness from the model ({change:+.1f} % at {drop:.0f} % frequency drop)"
    text = f"f1 margin assumes the same frequency drop for all modes, constant damping and {clause}"

    def stiffness_at(drop: float) -> float:
        return float(np.interp(drop, CALIBRATED_DROPS[: ratios.size], ratios))

    return stiffness_at, Remark("decay-assumption", assembly.tool, text)


@lru_cache(maxsize=MAX_CACHED_CALIBRATIONS)
def _stiffness_ratios(calibration: Calibration) -> Floats:
    """Return the modal stiffness at the tip for each of `CALIBRATED_DROPS` over that for none."""
    stiffness: list[float] = []
    for drop in CALIBRATED_DROPS:
        try:
            softer = calibrate(calibration.spindle, calibration.frequency * (1 - drop), mode=calibration.mode)
            stiffness.append(softer.modal_stiffness_after)
        except (ValueError, ArithmeticError):
            break
    return np.array(stiffness or [1.0]) / (stiffness or [1.0])[0]


def apply_drops(
    samples: ProgramSamples, drops: Floats, softening: StiffnessAt, speed: Factors = 1.0, force: Factors = 1.0
) -> ProgramSamples:
    """Apply each of some frequency drops (k,) to all samples; speed and force: relative, one or (k,)."""
    return samples.sweep(speed, 1 - drops, np.array([softening(drop) for drop in drops.tolist()]), force)


def find_tolerable_drop(samples: ProgramSamples, depth: float, stiffness_at: StiffnessAt) -> float:
    """Find the largest relative drop up to which a depth (m) stays stable in the median.

    0.0 where it is unstable now, inf where nothing happens down to 80 %. Looks every 0.2 % of fall.
    """
    drops, worst = np.linspace(0, CALIBRATED_DROPS[-1], N_DROP_STEPS), np.empty(0)
    for part in np.array_split(drops, N_DROP_PARTS):
        median = apply_drops(samples[np.array([0])], part, stiffness_at)
        worst = np.append(worst, np.max(median.growth(depth * np.array(CHECKED_DEPTH_SHARES)), axis=1))
        if np.any(worst >= 0):
            break
    else:
        return math.inf
    first = int(np.argmax(worst >= 0))
    if first == 0:
        return 0.0
    before, after = worst[first - 1], worst[first]
    return float(drops[first - 1] + (drops[first] - drops[first - 1]) * before / (before - after))


DROP_SEARCH_STEP = 0.0125
"""Step of the relative frequency drop at which all samples are checked."""
DROP_SLOPE_STEP = 1e-3
"""Step of the relative frequency drop over which growth is assumed linear."""
DROP_HALVINGS = 4
"""Halvings of the step at which the first sample chatters."""
N_DROP_ERROR_SAMPLES = 12
"""Number of samples of damping and stiffness for the error of the frequency drop."""


def find_critical_drop(verdict: Verdict) -> CriticalDrop:
    """Find the frequency drops that change the stability of a program, up to 20 %."""
    samples = verdict.samples
    if verdict.assembly is None or samples is None or verdict.stability is Stability.UNKNOWN:
        return CriticalDrop(math.nan, math.nan, math.nan)
    if verdict.stability is Stability.NOT_STABLE:
        return CriticalDrop(0.0, 0.0, 0.0)
    stiffness_at, _ = model_softening(verdict.assembly)
    depth = verdict.program.depth_mm / 1e3
    last = find_tolerable_drop(samples, depth, stiffness_at)
    first = _first_doubtful_drop(samples, depth, last, stiffness_at) if verdict.stability is Stability.STABLE else 0.0
    error = _drop_error(samples, depth, last, stiffness_at) if last < math.inf else 0.0
    return CriticalDrop(min(first, last), last, error)


def build_stored_verdict(verdict: Verdict, drops: bool) -> StoredVerdict:
    """Build the stored verdict; drops: with the critical frequency drops, which take as long as the verdict itself."""
    return verdict.stored._replace(critical=find_critical_drop(verdict)) if drops else verdict.stored


def is_verdict_missing(ruling: StoredVerdict | None, drops: bool) -> bool:
    """Return whether a program has to be evaluated for its stored verdict; drops: with the critical drops."""
    return ruling is None or (drops and ruling.critical is None)


def _first_doubtful_drop(samples: ProgramSamples, depth: float, last: float, stiffness_at: StiffnessAt) -> float:
    """Return the largest drop by age up to which no sample chatters, each at its own drop at speed."""
    samples, most = samples.at_speed(), min(last, float(CALIBRATED_DROPS[-1]))

    def chatters(drop: float) -> bool:
        return bool(np.any(apply_drops(samples, np.array([drop]), stiffness_at).growth(depth) >= 0))

    good = 0.0
    for bad in np.linspace(0, most, math.ceil(most / DROP_SEARCH_STEP) + 1)[1:].tolist():
        if chatters(bad):
            break
        good = bad
    else:
        return last
    for _ in range(DROP_HALVINGS):
        median = (good + bad) / 2
        good, bad = (good, median) if chatters(median) else (median, bad)
    return good


def _drop_error(samples: ProgramSamples, depth: float, last: float, stiffness_at: StiffnessAt) -> float:
    """Return the error of the drop at which the median chatters, from damping and stiffness of some samples."""
    rows, median = samples.rows[np.arange(1, N_DROP_ERROR_SAMPLES + 1)], samples[np.array([0])]
    alike = samples.rows[np.zeros(N_DROP_ERROR_SAMPLES, dtype=np.intp)]
    scattered = replace(samples, rows=replace(alike, damping_ratio=rows.damping_ratio, stiffness=rows.stiffness))
    spread = np.std(apply_drops(scattered, np.array([last]), stiffness_at).growth(depth))
    drops = last + np.array([-DROP_SLOPE_STEP, DROP_SLOPE_STEP])
    before, after = apply_drops(median, drops, stiffness_at).growth(depth)[:, 0]
    return float(spread * 2 * DROP_SLOPE_STEP / abs(after - before)) if after != before else 0.0


@dataclass(frozen=True)
class Setting:
    """Speed and depth that would be called stable."""

    speed_rpm: float
    """Spindle speed (rpm), in steps of 10 unless it is the program's own."""
    depth_mm: float
    """Axial depth (mm), in steps of 0.05 unless it is the program's own."""
    window_rpm: tuple[float, float]
    """Slowest and fastest neighboring speed at which the depth would also be called stable (rpm)."""
    depth_margin: float
    """Depth margin: median limit over depth, less 1."""
    drop_margin: float
    """Relative frequency drop by age, beyond that at speed, up to which it stays stable; 0.1 means 0.1 or more."""
    chatter_risk: float = math.nan
    """Chatter risk with the spindle rotating (0 to 1)."""


ROBUST_SPEED_FACTOR, N_ROBUST_STEPS = 1 / 0.99, 2
"""Speed factor in both directions within which a setting must be safe, chosen; and number of steps of a speed window
to it."""
WINDOW_SPEED_STEP = ROBUST_SPEED_FACTOR ** (1 / N_ROBUST_STEPS) - 1
"""Relative step of a speed window."""
MAX_WINDOW_STEPS, N_WINDOW_PARTS = 10, 2
"""Largest number of steps on each side, and parts in which they are checked."""
ROBUST_SPEEDS = np.array([1 / ROBUST_SPEED_FACTOR, ROBUST_SPEED_FACTOR])
"""Slowest and fastest relative speed of that range."""
ROBUST_DEPTH_FACTOR = 1.05
"""Depth factor up to which a setting must be safe, as a factor on the force; chosen."""
MIN_DEPTH_MARGIN = 0.20
"""Smallest depth margin of a recommended setting in the median estimate; chosen."""
MIN_ROBUST_DROP = 0.01
"""Smallest frequency drop at which a recommended setting must stay stable."""
CHECKED_DROPS = np.arange(0, 0.1001, 0.01)
"""Relative frequency drops at which a setting is checked."""


def sweep_extremes(samples: ProgramSamples, drop: float, stiffness_at: StiffnessAt) -> ProgramSamples:
    """Sweep all samples over the extremes, one at a time: slower at the smallest drop, the drop by age, more depth.

    The last two are at speed. samples: as drawn, not rotating.
    """
    least = np.full(len(samples.rows), min(samples.drop.low, 0.0))
    slower = replace(samples, rows=samples.drop.apply(samples.rows, least)).sweep(1 / ROBUST_SPEED_FACTOR)
    forces = np.array([1, ROBUST_DEPTH_FACTOR])
    return slower.join(apply_drops(samples.at_speed(), np.array([drop, 0]), stiffness_at, force=forces))


def sweep_neighborhood(samples: ProgramSamples, drop: float, stiffness_at: StiffnessAt) -> ProgramSamples:
    """Sweep all samples over the frequency drop by age, half of it, and more depth, one at a time, at speed.

    samples: as drawn, not rotating.
    """
    drops, forces = np.array([drop, drop / 2, 0]), np.array([1, 1, ROBUST_DEPTH_FACTOR])
    return apply_drops(samples.at_speed(), drops, stiffness_at, force=forces)


def find_speed_window(
    samples: ProgramSamples, hardest: ProgramSamples, speed: float, depth: float, reach: CutRange
) -> tuple[float, float]:
    """Find the slowest and fastest speed (rpm) at which a depth (m) is stable, not rotating and at speed.

    hardest: some samples, not rotating and at speed, which are checked first. The setting is known to be stable
    `N_ROBUST_STEPS` slower and faster.
    """
    ratios = (np.power(1 + WINDOW_SPEED_STEP, sign * np.arange(MAX_WINDOW_STEPS + 1.0)) for sign in (-1, 1))
    slow, fast = (_last_stable_ratio(samples, hardest, ratio, depth) for ratio in ratios)
    slowest = math.ceil(max(speed * slow, reach.low_rpm) / SPEED_STEP_RPM) * SPEED_STEP_RPM
    fastest = math.floor(min(speed * fast, reach.high_rpm) / SPEED_STEP_RPM) * SPEED_STEP_RPM
    return min(slowest, speed), max(fastest, speed)


def find_drop_margin(hardest: ProgramSamples, depth: float, stiffness_at: StiffnessAt) -> float:
    """Find the relative frequency drop up to which a depth (m) is stable on these samples."""
    grown = apply_drops(hardest, CHECKED_DROPS, stiffness_at).critical_growth(depth)
    return float(CHECKED_DROPS[_last_stable_row(grown.reshape(CHECKED_DROPS.size, -1))])


def _last_stable_ratio(samples: ProgramSamples, hardest: ProgramSamples, ratio: Floats, depth: float) -> float:
    """Return the last relative speed up to which all samples are stable."""
    last = 0
    for steps in np.array_split(np.arange(1, ratio.size), N_WINDOW_PARTS):
        grown = hardest.sweep(ratio[steps]).critical_growth(depth).reshape(steps.size, -1)
        last += _last_stable_row(np.vstack((np.full(len(hardest.rows), -np.inf), grown)))
        if last < steps[-1]:
            break
    good, bad, tried = N_ROBUST_STEPS if last >= N_ROBUST_STEPS else 0, last + 1, last
    while bad - good > 1:
        good, bad = (good, tried) if _has_chatter(samples.sweep(ratio[tried]), depth) else (tried, bad)
        tried = (good + bad) // 2
    return float(ratio[good])


def _has_chatter(samples: ProgramSamples, depth: float) -> bool:
    """Return whether a sample chatters at a depth (m), not rotating or at speed."""
    return bool(np.any(samples.critical_growth(depth) >= 0) or np.any(find_chattering_at_speed(samples, depth)))


def _last_stable_row(grown: Floats) -> int:
    """Return the row up to which all of growth (k, samples) is negative from the first on."""
    calm = np.all(grown < 0, axis=1)
    return calm.size - 1 if np.all(calm) else max(int(np.argmin(calm)) - 1, 0)
