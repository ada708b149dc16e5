"""Predict what a cut does on each sample, and the likelihood of its label."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy

from lobes import MillingRows, build_milling_system, count_pieces, rows_at_speeds
from lobes.floquet import largest_multipliers
from lobes.floquet.stability_boundary import loudest_chatter_frequency
from lobewatch.arrays import Flags, Floats
from lobewatch.cuts.chatter_detection.spectrum import fold_frequency
from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.prior_samples import SpindleSamples
from lobewatch.machine.settings.cut_tables import FEED_ANGLES
from lobewatch.machine.settings.requested_cut import CutSetting
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.zero_order_batch import ZeroOrderBatch, is_force_constant

LIMIT_SPREAD = 0.05
"""Relative standard deviation of the depth limit of a cut; chosen."""
MISLABELED_SHARE = 0.03
"""Share of cuts with a wrong label; chosen: 2.7 % by chatter detection, and some by typing errors."""
UNPITCHED_MISLABELED_SHARE = 0.06
"""Share of wrong labels among chatter without a frequency, for which only the verdict is evidence; chosen."""
CHATTER_FREQUENCY_SPREAD = 0.01
"""Relative standard deviation of a chatter frequency around its prediction; chosen, see docs/cuts.md."""
FOREIGN_FREQUENCY_SHARE = 0.05
"""Share of chatter frequencies without information; chosen, see docs/cuts.md, How good it is."""
WRONG_KIND_SHARE = 0.1
"""Share of chatter that is recorded as the other kind (Hopf or flip); chosen."""
MULTIPLIER_ACCURACY = 1e-3
"""Relative accuracy of a multiplier."""
FLIP_ANGLE_TOLERANCE = 1e-3
"""Distance of the angle of a multiplier from pi (rad) within which chatter is of period two."""
MAX_LOG_EXCESS = 5.0
"""Largest absolute logarithm of depth over limit that counts: a hundred times `LIMIT_SPREAD`."""


class CutPrediction(NamedTuple):
    """Predicted behavior of each sample in a cut, shape (r,) each."""

    excess: Floats
    """Logarithm of depth over limit; positive if it chatters."""
    frequency: Floats
    """Frequency of the largest multiplier (Hz), folded to 0 to half the tooth frequency; NaN if unknown."""
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


def predict_cut(cut: CutEvidence, samples: SpindleSamples) -> CutPrediction:
    """Predict what samples would do in the worst feed direction of a cut, at its own depth."""
    rows = samples.build_rows(cut.speed_rpm, cut.cut.tangential, cut.cut.radial, cut.material)
    speed = rows.speed_rpm if cut.speed_found else rows.speed_rpm * samples.at_rest.speed_rpm
    rows = replace(rows, cut=cut.cut, frequency=rows.frequency * cut.frequency_ratio, speed_rpm=speed)
    predict = _predict_by_zero_order if is_force_constant(cut.cut) else _predict_by_multipliers
    fed = [predict(rows.with_feed_angle(angle), cut) for angle in cut.feed_angles]
    worst = np.argmax([prediction.excess for prediction in fed], axis=0)[np.newaxis]
    return CutPrediction(*(np.take_along_axis(np.array(part), worst, axis=0)[0] for part in zip(*fed, strict=True)))


def log_likelihood(cut: CutEvidence, prediction: CutPrediction, again: Sequence[CutEvidence] = ()) -> Floats:
    """Return the log likelihood of the recorded verdict for each sample, shape (r,).

    again: the same cut as it was made at other times, whose verdicts are known: all have one truth, so that of two
    verdicts that differ one is wrong, however near its limit the cut is.
    """
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
        raise ValueError(f"cut {cut.id} has no power; ask for one that has")
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


def _predict_by_zero_order(rows: MillingRows, cut: CutEvidence) -> CutPrediction:
    """Predict a cut whose force is constant by the zero-order approximation."""
    mean = ZeroOrderBatch.of(rows)
    limit, at_limit = (table[:, 0] for table in mean.limits(rows.speed_rpm[:, np.newaxis]))
    excess = np.clip(np.log(cut.depth / limit), -MAX_LOG_EXCESS, MAX_LOG_EXCESS)
    frequency = at_limit.copy()
    beyond = np.flatnonzero(excess > 0) if cut.has_frequency else np.empty(0, dtype=np.intp)
    if beyond.size:
        unstable = ZeroOrderBatch(mean.rows[beyond], mean.force[beyond])
        _, loudest = unstable.fastest_growth(rows.speed_rpm[beyond], cut.depth)
        frequency[beyond] = np.where(np.isfinite(loudest), loudest, frequency[beyond])
    base, at_limit = (fold_frequency(part, 1 / rows.tooth_period) for part in (frequency, at_limit))
    return CutPrediction(excess, base, at_limit, np.zeros(len(rows), dtype=bool))


def _predict_by_multipliers(rows: MillingRows, cut: CutEvidence) -> CutPrediction:
    """Predict a cut by semi-discretization at its depth; the excess follows from the growth rate.

    Growth of the logarithm of the motion over the decay that the spindle has without a cut.
    """
    depth = np.full((len(rows), 1), cut.depth)
    multiplier = largest_multipliers(rows, depth, count_pieces(rows, cut.depth), MULTIPLIER_ACCURACY)[:, 0]
    quiet = np.min(rows.damping_ratio * rows.frequency, axis=1) * rows.tooth_period
    excess = np.clip(np.log(np.maximum(np.abs(multiplier), 1e-9)) / quiet, -MAX_LOG_EXCESS, MAX_LOG_EXCESS)
    angle = np.abs(np.angle(multiplier))
    teeth, at_limit = 1 / rows.tooth_period, np.full(len(rows), np.nan)
    if cut.has_frequency:
        at_limit = ZeroOrderBatch.of(rows).limits(rows.speed_rpm[:, np.newaxis])[1][:, 0]
    is_flip = np.pi - angle < FLIP_ANGLE_TOLERANCE
    return CutPrediction(excess, angle / (2 * np.pi) * teeth, fold_frequency(at_limit, teeth), is_flip)


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
