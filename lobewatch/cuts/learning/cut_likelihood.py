"""One test cut as evidence, what it would do on each sample, and the likelihood of its label, frequency and power.

All that is chosen here is plausible, not measured, but for cuts that chatter.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy

from lobes import Cut, MillingRows, build_milling_system, count_pieces, growth_rate, rows_at_speeds
from lobes.floquet import largest_multipliers
from lobes.floquet.milling_rows import COARSE_CYCLES_PER_PIECE
from lobes.floquet.stability_boundary import loudest_chatter_frequency
from lobewatch.arrays import Flags, Floats
from lobewatch.cuts.chatter_detection.spectrum import fold_frequency
from lobewatch.cuts.learning.prior_samples import SpindleSamples
from lobewatch.machine.journal.entries import CutEntry, CutVerdict
from lobewatch.machine.settings.cut_tables import FEED_ANGLES
from lobewatch.machine.settings.drive_power import CutPower
from lobewatch.machine.settings.requested_cut import CutSetting
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.zero_order_batch import ZeroOrderBatch, is_force_constant

CutEntries = Sequence[CutEntry]
"""Test cuts of a machine as in its journal, oldest first."""

DRIVE_POWER_SPREAD = 0.15
"""Relative standard deviation of displayed drive power over that of the cuts, common to all cuts.

Causes: efficiency of motor, belt and gears under load, losses that the display omits, and edge forces that are not
proportional to Kt."""
EDGE_FORCE_SPREAD, UNKNOWN_EDGE_FORCE_SPREAD = 0.3, 0.5
"""Relative standard deviation of Kte over Kt if Kte is known, and if it is not.

Edges may be sharper or duller than those measured. Published values differ by a factor of three."""
POWER_READING_SPREAD = 0.05
"""Relative standard deviation of one power reading, by an unsteady display, feed or radial depth."""
CHATTER_POWER_FACTOR, CHATTER_POWER_SPREAD = 0.89, 0.08
"""Power of a chattering cut over that of a stable one, and its scatter between cuts, from time-domain simulations.

Edges that leave the cut do not rub, and thick chips between thin ones take less power. See docs/studies/cuts.md."""


@dataclass(frozen=True)
class PowerEvidence:
    """Kt by power, with errors as standard deviations of its logarithm."""

    force: float
    """Kt over the assumed Kt of the cut."""
    common_error: float
    """Error common to all readings of a material."""
    own_error: float
    """Error of this reading only."""


def estimate_force_by_power(power: CutPower, cut: Cut, chatters: bool, days: int = 1) -> PowerEvidence:
    """Estimate Kt from the drive power of a cut in a material; days: number of days that the power is averaged over."""
    of_edges = power.edge_share / (1 + power.edge_share)
    edge_spread = EDGE_FORCE_SPREAD if power.edge_known else UNKNOWN_EDGE_FORCE_SPREAD
    common = math.hypot(DRIVE_POWER_SPREAD, edge_spread * of_edges)
    median, scatter = (CHATTER_POWER_FACTOR, CHATTER_POWER_SPREAD) if chatters else (1.0, 0.0)
    own = math.hypot(POWER_READING_SPREAD, scatter) / math.sqrt(days)
    return PowerEvidence(power.tangential / cut.tangential / median, common, own)


AGED_FREQUENCY_CHANGE = 0.02
"""Relative change of the natural frequency after which a cut has 61 % of its weight; chosen."""
REPEAT_SPEED_TOLERANCE, REPEAT_DEPTH_TOLERANCE = 0.002, 0.01
"""Relative differences of speed and depth within which a cut repeats another."""


@dataclass(frozen=True)
class CutEvidence:
    """One test cut in SI units."""

    cut: Cut
    """Teeth, pitch, immersion, direction, helix, and assumed cutting coefficients."""
    speed_rpm: float
    """Spindle speed (rpm)."""
    depth: float
    """Axial depth of cut (m)."""
    verdict: CutVerdict
    """Verdict by chatter detection."""
    frequency: float = math.nan
    """Chatter frequency (Hz); NaN if not recorded."""
    feed_angles: tuple[float, ...] = (0.0,)
    """Possible feed directions as angles from x (rad); the worst counts."""
    material: int = 0
    """Number of the material. Cuts with the same number share cutting coefficients; 0 is that of the evaluated cut."""
    speed_found: bool = True
    """True if the speed was found in the recording; False if it is the commanded one."""
    frequency_ratio: float = 1.0
    """Natural frequency not rotating at the time of the cut over that of now."""
    id: str = ""
    """Number of the cut in the journal."""
    power: PowerEvidence | None = None
    """Kt by power; None without a power reading."""

    @property
    def weight(self) -> float:
        """Weight of the cut, which decreases as the natural frequency changes."""
        return math.exp(-(((self.frequency_ratio - 1) / AGED_FREQUENCY_CHANGE) ** 2) / 2)

    def is_repeat_of(self, other: "CutEvidence") -> bool:
        """Return whether another cut repeats this one, with a verdict: same program, material, speed and depth."""
        near = other.has_verdict and abs(math.log(other.speed_rpm / self.speed_rpm)) < REPEAT_SPEED_TOLERANCE
        same = (self.cut, self.material, self.feed_angles) == (other.cut, other.material, other.feed_angles)
        return near and same and abs(math.log(other.depth / self.depth)) < REPEAT_DEPTH_TOLERANCE

    @property
    def tooth_frequency(self) -> float:
        """Repetition frequency of the cut (Hz), the tooth passing frequency for equal pitches."""
        return self.cut.repeats_per_turn * self.speed_rpm / 60

    @property
    def has_verdict(self) -> bool:
        """True unless the cut is a power reading only."""
        return self.verdict != "cannot tell"

    @property
    def has_chatter(self) -> bool:
        """True if the cut was not stable."""
        return self.verdict in ("chatter", "flip")

    @property
    def has_frequency(self) -> bool:
        """True if the cut has information on natural frequencies."""
        return self.verdict == "flip" or (self.has_chatter and math.isfinite(self.frequency))


LIMIT_SPREAD = 0.05
"""Relative standard deviation of the depth limit of a cut; chosen."""
MISLABELED_SHARE = 0.03
"""Share of cuts with a wrong label; chosen: 2.7 % by chatter detection, and some by typing errors."""
UNPITCHED_MISLABELED_SHARE = 0.06
"""Share of wrong labels among chatter without a frequency, for which only the verdict is evidence; chosen."""
CHATTER_FREQUENCY_SPREAD = 0.01
"""Relative standard deviation of a chatter frequency around its prediction; chosen, see docs/studies/cuts.md."""
FOREIGN_FREQUENCY_SHARE = 0.05
"""Share of chatter frequencies without information; chosen, see docs/studies/cuts.md, How good it is."""
WRONG_KIND_SHARE = 0.1
"""Share of chatter that is recorded as the other kind (Hopf or flip); chosen."""
MULTIPLIER_ACCURACY = 1e-3
"""Relative accuracy of a multiplier."""
FLIP_ANGLE_TOLERANCE = 1e-3
"""Distance of the angle of a multiplier from pi (rad) within which chatter is of period two."""
CLEARLY_STABLE_RATIO = 2.0
"""Limit over depth beyond which a cut is stable for certain: 14 times `LIMIT_SPREAD`."""
MAX_LOG_EXCESS = 5.0
"""Largest absolute logarithm of depth over limit that counts: a hundred times `LIMIT_SPREAD`."""


class CutPrediction(NamedTuple):
    """Predicted behavior of each sample in a cut, shape (r,) each."""

    excess: Floats
    """Logarithm of depth over limit; positive if it chatters."""
    frequency: Floats
    """Folded frequency of the largest multiplier (Hz); may be NaN without evidence."""
    limit_frequency: Floats
    """Folded frequency at the limit of its speed by the zero-order approximation (Hz); may be NaN without evidence."""
    is_flip: Flags
    """True if chatter is of period two."""

    @property
    def chatter_probability(self) -> Floats:
        """Chance of chatter."""
        return np.asarray(scipy.special.ndtr(self.excess / LIMIT_SPREAD))

    @property
    def label_probability(self) -> Floats:
        """Chance of the label chatter."""
        return MISLABELED_SHARE + (1 - 2 * MISLABELED_SHARE) * self.chatter_probability

    def frequency_distances(self, cut: CutEvidence) -> Floats:
        """Return the distances of the chatter of a cut from both frequencies (Hz), shape (2, r).

        Chatter that has grown leaves the cut, and sounds like what grows most or like what is at the limit: beyond
        the limit of a pocket these are two modes or lobes.
        """
        return np.asarray(np.abs(_folded_chatter(cut) - np.array([self.frequency, self.limit_frequency])))


def predict_cut(cut: CutEvidence, samples: SpindleSamples, *, is_estimated: bool = True) -> CutPrediction:
    """Predict the result of a cut for all samples in its worst feed direction; NaN without a verdict.

    is_estimated: False for zero-order limits by search where flanks damp. Estimates are close to most of them.
    """
    if not cut.has_verdict:
        unknown = np.full(len(samples), np.nan)
        return CutPrediction(unknown, unknown, unknown, np.zeros(len(samples), dtype=np.bool_))
    rows = samples.build_rows(cut.speed_rpm, cut.cut.tangential, cut.cut.radial, cut.material)
    speed = rows.speed_rpm if cut.speed_found else rows.speed_rpm * samples.at_rest.speed_rpm
    rows = replace(rows, cut=cut.cut, frequency=rows.frequency * cut.frequency_ratio, speed_rpm=speed)
    predict = (
        partial(_predict_by_zero_order, is_estimated=is_estimated)
        if is_force_constant(cut.cut)
        else _predict_by_multipliers
    )
    fed = [predict(rows.with_feed_angle(angle), cut) for angle in cut.feed_angles]
    worst = np.argmax([prediction.excess for prediction in fed], axis=0)[np.newaxis]
    return CutPrediction(*(np.take_along_axis(np.array(part), worst, axis=0)[0] for part in zip(*fed, strict=True)))


def log_likelihood(cut: CutEvidence, prediction: CutPrediction, again: Sequence[CutEvidence] = ()) -> Floats:
    """Return the log likelihood of the recorded verdict for each sample, shape (r,).

    again: the same cut as it was made at other times, whose verdicts are known: all have one truth, so that of two
    verdicts that differ one is wrong, however near its limit the cut is. 0 without a verdict.
    """
    if not cut.has_verdict:
        return np.zeros(prediction.excess.shape)
    return np.asarray(np.log(sum(_likelihoods(cut, prediction, again))))


def mislabel_probability(cut: CutEvidence, prediction: CutPrediction, again: Sequence[CutEvidence] = ()) -> Floats:
    """Return the probability that the verdict of a cut is wrong on each sample, shape (r,)."""
    right, wrong = _likelihoods(cut, prediction, again)
    return np.asarray(wrong / (right + wrong))


def power_distance(cut: CutEvidence, force: Floats, before: Sequence[CutEvidence]) -> tuple[Floats, float]:
    """Return the log distance of Kt by power from that of each sample, and its variance.

    force: Kt of each over that of the table. The readings are log K_i = log Kt + common_i e + own_i e_i, all e
    standard normal: after those before, e is normal with 1 + sum (common_i / own_i)^2 as its inverse variance.
    ValueError for a cut without power.
    """
    if cut.power is None:
        raise ValueError(f"cut {cut.id} has no power reading")
    shared, precision = np.zeros(force.shape), 1.0
    for other in before:
        if other.power is not None and other.material == cut.material:
            shared += np.log(other.power.force / force) * other.power.common_error / other.power.own_error**2
            precision += (other.power.common_error / other.power.own_error) ** 2
    distance = np.log(cut.power.force / force) - cut.power.common_error * shared / precision
    return distance, cut.power.own_error**2 + cut.power.common_error**2 / precision


def power_log_likelihood(cut: CutEvidence, force: Floats, before: Sequence[CutEvidence]) -> Floats:
    """Return the log likelihood of the power of a cut relative to its maximum, shape (r,); 0 without a power.

    Arguments as of `power_distance`. A natural frequency that has moved since says nothing of Kt: an old one counts
    whole.
    """
    if cut.power is None:
        return np.zeros(force.shape)
    distance, variance = power_distance(cut, force, before)
    return np.asarray(-(distance**2) / (2 * variance))


def _likelihoods(cut: CutEvidence, prediction: CutPrediction, again: Sequence[CutEvidence]) -> tuple[Floats, Floats]:
    """Return the likelihood of the recorded verdict being right, and of its being wrong."""
    truths: tuple[Floats, Floats] = prediction.chatter_probability, 1 - prediction.chatter_probability
    for other in again:
        weighted = [share * word for share, word in zip(truths, _label_likelihoods(other, prediction), strict=True)]
        truths = weighted[0] / (weighted[0] + weighted[1]), weighted[1] / (weighted[0] + weighted[1])
    chatters, stable = (share * word for share, word in zip(truths, _label_likelihoods(cut, prediction), strict=True))
    return (chatters, stable) if cut.has_chatter else (stable, chatters)


def _label_likelihoods(cut: CutEvidence, prediction: CutPrediction) -> tuple[Floats, Floats]:
    """Return the likelihood of the recorded verdict if the cut chatters, and if it is stable."""
    ones = np.ones(prediction.excess.shape)
    if not cut.has_chatter:
        return MISLABELED_SHARE * ones, (1 - MISLABELED_SHARE) * ones
    if not cut.has_frequency:
        return (1 - UNPITCHED_MISLABELED_SHARE) * ones, UNPITCHED_MISLABELED_SHARE * ones
    return (1 - MISLABELED_SHARE) * _frequency_likelihood(cut, prediction), MISLABELED_SHARE / 2 * ones


def max_log_likelihood(cut: CutEvidence) -> float:
    """Return the largest possible `log_likelihood`: of a spindle that does what was recorded."""
    if not cut.has_frequency:
        return 0.0
    base = np.atleast_1d(_folded_chatter(cut))
    same = CutPrediction(np.array([np.inf]), base, base, np.array([cut.verdict == "flip"]))
    return float(log_likelihood(cut, same)[0])


def _frequency_likelihood(cut: CutEvidence, prediction: CutPrediction) -> Floats:
    """Return the likelihood of recorded kind and frequency if the cut chatters."""
    kind = np.where(prediction.is_flip == (cut.verdict == "flip"), 1 - WRONG_KIND_SHARE, WRONG_KIND_SHARE)
    wide = CHATTER_FREQUENCY_SPREAD * (cut.frequency if np.isfinite(cut.frequency) else cut.tooth_frequency)
    distances = prediction.frequency_distances(cut)
    near = np.exp(-((distances / wide) ** 2) / 2) / (wide * np.sqrt(np.pi / 2))
    anywhere = 2 / cut.tooth_frequency
    near = np.mean(np.where(np.isfinite(distances), near, anywhere), axis=0)
    return np.asarray(kind * ((1 - FOREIGN_FREQUENCY_SHARE) * near + FOREIGN_FREQUENCY_SHARE * anywhere) / anywhere)


def _folded_chatter(cut: CutEvidence) -> Floats:
    """Return the chatter frequency, or that of period two, folded by the teeth (Hz)."""
    return fold_frequency(cut.frequency if np.isfinite(cut.frequency) else cut.tooth_frequency / 2, cut.tooth_frequency)


def _predict_by_zero_order(rows: MillingRows, cut: CutEvidence, *, is_estimated: bool) -> CutPrediction:
    """Predict a cut whose force is constant by the zero-order approximation."""
    mean = ZeroOrderBatch.of(rows)
    limit, at_limit = _limits_near(mean, cut.depth, is_estimated=is_estimated)
    excess = _limit_excess(np.log(np.maximum(cut.depth / limit, 1e-9)))
    frequency = at_limit.copy()
    beyond = np.flatnonzero(excess > 0) if cut.has_frequency else np.empty(0, dtype=np.intp)
    if beyond.size:
        _, loudest = mean[beyond].fastest_growth(rows.speed_rpm[beyond], cut.depth)
        frequency[beyond] = np.where(np.isfinite(loudest), loudest, frequency[beyond])
    base, at_limit = (fold_frequency(part, 1 / rows.tooth_period) for part in (frequency, at_limit))
    return CutPrediction(excess, base, at_limit, np.zeros(len(rows), dtype=bool))


def _limits_near(batch: ZeroOrderBatch, depth: float, *, is_estimated: bool = True) -> tuple[Floats, Floats]:
    """Return limits (m) and chatter frequencies (Hz), with process damping only up to twice a depth (m)."""
    deepest = CLEARLY_STABLE_RATIO * depth if np.any(batch.rows.process_damping) else np.inf
    find_limits = batch.estimate_limits if is_estimated else batch.limits
    limit, chatter = find_limits(batch.rows.speed_rpm[:, np.newaxis], deepest)
    return limit[:, 0], chatter[:, 0]


def _predict_by_multipliers(rows: MillingRows, cut: CutEvidence) -> CutPrediction:
    """Predict a cut by semi-discretization at its depth; the excess follows from the growth rate.

    Growth of the logarithm of the motion over the decay that the spindle has without a cut.
    """
    depth, unknown = np.full((len(rows), 1), cut.depth), np.full(len(rows), np.nan)
    quiet = np.min(rows.damping_ratio * rows.frequency, axis=1) * rows.tooth_period
    if not cut.has_frequency:
        growth = growth_rate(rows, depth, count_pieces(rows, cut.depth, COARSE_CYCLES_PER_PIECE))[:, 0]
        return CutPrediction(_limit_excess(growth / quiet), unknown, unknown, np.zeros(len(rows), dtype=np.bool_))
    multiplier = largest_multipliers(rows, depth, count_pieces(rows, cut.depth), MULTIPLIER_ACCURACY)[:, 0]
    excess = _limit_excess(np.log(np.maximum(np.abs(multiplier), 1e-9)) / quiet)
    angle, teeth = np.abs(np.angle(multiplier)), 1 / rows.tooth_period
    _, at_limit = _limits_near(ZeroOrderBatch.of(rows), cut.depth)
    is_flip = np.pi - angle < FLIP_ANGLE_TOLERANCE
    return CutPrediction(excess, angle / (2 * np.pi) * teeth, fold_frequency(at_limit, teeth), is_flip)


def _limit_excess(excess: Floats) -> Floats:
    return np.clip(excess, -MAX_LOG_EXCESS, MAX_LOG_EXCESS)


class ExpectedChatter(NamedTuple):
    """Expected chatter of a cut in its worst feed direction."""

    stable: bool
    """True if no multiplier reaches 1."""
    frequency: float
    """Frequency of the largest multiplier (Hz), the chatter frequency at this depth."""


def predict_chatter(setting: CutSetting, assembly: Assembly, speed_rpm: float) -> ExpectedChatter:
    """Predict whether a cut chatters at its depth and a speed (rpm), and at which frequency.

    The multiplier is that of the cut's own depth. ValueError for an assembly without modes.
    """
    system = build_milling_system(assembly.x, assembly.y, assembly.principal_directions.sign_patterns[0])
    axes = FEED_ANGLES.values() if setting.feed == "both" else (FEED_ANGLES[setting.feed],)
    cuts = [replace(setting.cut, feed_angle=angle) for angle in axes]
    depth, speed = np.array([[setting.depth]]), np.array([speed_rpm])
    fed = [rows_at_speeds(system, cut, speed) for cut in cuts]
    multipliers = [largest_multipliers(rows, depth, count_pieces(rows, setting.depth))[0] for rows in fed]
    worst = int(np.argmax([abs(multiplier[0]) for multiplier in multipliers]))
    repeats = np.array([setting.cut.repeats_per_turn * speed_rpm / 60])
    frequency = loudest_chatter_frequency(system, cuts[worst], multipliers[worst], depth[0], repeats)
    return ExpectedChatter(bool(abs(multipliers[worst][0]) < 1), float(frequency[0]))
