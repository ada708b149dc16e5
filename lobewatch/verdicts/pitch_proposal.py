"""Unequal pitches for one cut at one speed, and their gain over equal pitch with its uncertainty.

The closed form of the best difference between neighbours says which patterns are checked; zero-order approximation
after Altintas, Engin & Budak, over few samples, says how deep they may go; the multipliers of the same samples say
which of each kind is best. The best is then evaluated sample by sample and compared with equal pitch.
"""

import itertools
from dataclasses import replace
from typing import NamedTuple

import msgspec
import numpy as np

from acquisition import DataError
from acquisition.errors import join_sentences
from lobes import PitchPattern, equal_pitch, half_wave_deg, pitch_patterns, with_pitch_pattern
from lobes.floquet.program_limit import MAX_PROGRAM_DEPTH_RATIO
from lobewatch.arrays import Floats, Indices
from lobewatch.machine import Machine, ProgramTable
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.monte_carlo import LIMIT_QUANTILES, find_sample_limits, refine_sample_limits, run_monte_carlo
from lobewatch.verdicts.program_case import NO_TEST_CUTS, ProgramCase, SpindleAtSpeed
from lobewatch.verdicts.program_samples import ProgramSamples, find_deepest_stable
from lobewatch.verdicts.verdict import Stability, Verdict, classify_stability, evaluate_program
from lobewatch.verdicts.zero_order_batch import ZeroOrderBatch

N_LOWEST_PITCH_SAMPLES, PITCH_SAMPLE_STEP = 8, 40
"""Number of samples with the lowest limits, and step between further ones, for a first comparison of patterns."""
N_PITCH_FEEDS = 2
"""Number of feed directions in that comparison, the worst."""
PITCH_DEPTH_FACTOR = 2.0
"""Largest depth in that comparison over the lowest limit by the zero-order approximation."""
MAX_PITCH_TRIES, MIN_CONFIRMED_SHARE = 3, 0.9
"""Number of evaluated patterns of each kind, and share of the depth allowed by few samples that is sufficient.

Below that share the samples that chatter first join the few samples."""
N_ADDED_SAMPLES = 8
"""Number of samples that join them."""
MIN_PITCH_GAIN = 1.05
"""Smallest gain at the low end of the limit for which unequal pitches are proposed; chosen."""


class PitchEvaluation(NamedTuple):
    """Cutter pitches with the evaluation of the cut."""

    pattern: PitchPattern
    """Pitch pattern."""
    stability: Stability
    """Stability of the cut at its depth."""
    limit: float
    """Median estimate of the deepest stable depth (m); inf without a limit down to the flute length."""
    low: float
    """1 % quantile of the limit (m)."""
    high: float
    """99 % quantile of the limit (m)."""
    gain: float
    """Median gain: limit over that of equal pitch, less 1."""
    gain_low: float
    """1 % quantile of the gain; both cutters on the same spindle and material, sample by sample."""
    gain_high: float
    """99 % quantile of the gain."""
    share_worse: float
    """Share of the samples in which equal pitch has the higher limit."""


class PitchProposal(NamedTuple):
    """Value of unequal pitches for one cut at one speed."""

    verdict: Verdict
    """Verdict on the cut with equal pitch."""
    equal: PitchEvaluation
    """Evaluation of equal pitch."""
    unequal: tuple[PitchEvaluation, ...]
    """Best pattern of each kind, and the present pitches of the cutter, highest low end of the limit first."""
    half_wave_deg: float
    """Best difference of neighboring pitches by the closed form (deg); NaN without chatter."""

    @property
    def proposed(self) -> PitchEvaluation | None:
        """Proposed pitches; None if equal pitches are as good."""
        return next((best for best in self.unequal[:1] if best.low >= MIN_PITCH_GAIN * self.equal.low), None)


def propose_pitch(
    table: ProgramTable, assembly: Assembly, machine: Machine, at_speed: SpindleAtSpeed = NO_TEST_CUTS
) -> PitchProposal:
    """Propose pitches for a cut at its speed; limits are searched up to 20 times its depth.

    DataError where the cut cannot be evaluated, ValueError for less than two teeth.
    """
    equal = equal_pitch(table.teeth)
    verdict = evaluate_program(msgspec.structs.replace(table, pitch_deg=equal.pitch_deg), assembly, machine, at_speed)
    if verdict.stability is Stability.UNKNOWN or verdict.samples is None:
        raise DataError(join_sentences(*map(str, verdict.remarks)))
    case = ProgramCase(at_speed.apply_coefficients(table), assembly, machine, at_speed)
    limits = _pitch_limits(verdict.samples, case.depth)
    half_wave = half_wave_deg(table.speed_rpm, verdict.chatter_frequency)
    search = PitchSearch(case, verdict.samples, limits)
    patterns = pitch_patterns(table.teeth, half_wave) if np.isfinite(verdict.limit) else ()
    kinds = itertools.groupby(patterns, key=lambda pattern: pattern.name)
    unequal = [search.find_best(list(alike)) for _, alike in kinds]
    if present := machine.build_cut(table).pitch:
        unequal.append(search.evaluate(PitchPattern(tuple(np.degrees(present).round(3).tolist()), "as it is"))[0])
    band = verdict.limit, verdict.limit_low, verdict.limit_high
    evaluation = _build_evaluation(equal, verdict.stability, band, limits, limits)
    return PitchProposal(verdict, evaluation, tuple(sorted(unequal, key=lambda judged: -judged.low)), half_wave)


class PitchSearch(NamedTuple):
    """Search for the pitches of one cut."""

    case: ProgramCase
    """Cut and tool; the pitch of the cut is ignored."""
    samples: ProgramSamples
    """Samples of the cut with equal pitch."""
    equal_limits: Floats
    """Limits with equal pitch (m), the median first."""

    def find_best(self, patterns: list[PitchPattern]) -> PitchEvaluation:
        """Find the pattern of one kind with the highest 1 % limit."""
        places = np.argsort(self.equal_limits)[:N_LOWEST_PITCH_SAMPLES].tolist()
        places += range(0, self.equal_limits.size, PITCH_SAMPLE_STEP)
        judged = dict[PitchPattern, PitchEvaluation]()
        for _ in range(MAX_PITCH_TRIES):
            calm = {pattern: self._stable_depth(pattern, np.unique(places)) for pattern in patterns}
            likely = max(patterns, key=lambda pattern: judged[pattern].low if pattern in judged else calm[pattern])
            if likely in judged:
                break
            judged[likely], limits = self.evaluate(likely)
            if judged[likely].low >= MIN_CONFIRMED_SHARE * calm[likely]:
                break
            places += np.argsort(limits)[:N_ADDED_SAMPLES].tolist()
            patterns = [pattern for pattern in patterns if calm[pattern] > judged[likely].low]
        return max(judged.values(), key=lambda judged: judged.low)

    def _stable_depth(self, pattern: PitchPattern, places: Indices) -> float:
        """Return the deepest (m) at which selected samples are stable."""
        cuts, limits = self.samples.cuts[:N_PITCH_FEEDS], self.samples.limits[:N_PITCH_FEEDS]
        few = replace(self.samples[places], cuts=tuple(with_pitch_pattern(cut, pattern) for cut in cuts), limits=limits)
        speeds = few.rows.speed_rpm[:, np.newaxis]
        mean = min(float(np.min(ZeroOrderBatch.of(few.rows.with_cut(cut)).limits(speeds)[0])) for cut in few.cuts)
        most = MAX_PROGRAM_DEPTH_RATIO * self.case.table.depth_mm / 1e3
        return find_deepest_stable(few, min(PITCH_DEPTH_FACTOR * mean, most))

    def evaluate(self, pattern: PitchPattern) -> tuple[PitchEvaluation, Floats]:
        """Evaluate a pattern; return its evaluation and the limit of each sample (m), the median first."""
        case = self.case.with_changes(pitch_deg=pattern.pitch_deg)
        result = run_monte_carlo(case)
        band = result.median.limit, result.low, result.high
        word, limits = classify_stability(case, result), _pitch_limits(result.samples, case.depth)
        return _build_evaluation(pattern, word, band, limits, self.equal_limits), limits


def _pitch_limits(samples: ProgramSamples, depth: float) -> Floats:
    """Return the limit of each sample (m), the median first."""
    limits = refine_sample_limits(samples, find_sample_limits(samples, depth))
    limits[0] = samples.limits[0]
    return np.minimum(limits, MAX_PROGRAM_DEPTH_RATIO * depth)


def _build_evaluation(
    pattern: PitchPattern, word: Stability, band: tuple[float, float, float], limits: Floats, equal: Floats
) -> PitchEvaluation:
    """Build an evaluation from sample limits and those of equal pitch (m), the median first."""
    gains = limits / equal - 1
    low, high = np.quantile(gains[1:], LIMIT_QUANTILES).tolist()
    return PitchEvaluation(pattern, word, *band, float(gains[0]), low, high, float(np.mean(gains[1:] < 0)))
