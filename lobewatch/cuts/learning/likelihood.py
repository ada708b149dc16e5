"""How likely it is that a cut sounded as it was heard, for each of many spindles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from lobes import MillingRows, piece_numbers
from lobes.floquet import largest_multipliers
from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.priors import Draws
from lobewatch.cuts.listening.fold_frequency import fold_frequency
from lobewatch.verdicts.mean_force import MeanForce, is_constant

EDGE = 0.05
"""Standard deviation of the depth, relative, within which a cut is stable or not; chosen."""
MISJUDGED = 0.03
"""Share of cuts that are written down as what they are not; chosen: 2.7 % are heard wrong, some are typed wrong."""
UNTOLD = 0.06
"""The same of chatter of which no frequency was told, so that nothing speaks for it but the word; chosen."""
FREQUENCY = 0.01
"""Standard deviation of a chatter frequency against the one predicted, relative; chosen, see docs/cuts.md."""
STRANGE = 0.05
"""Share of chatter frequencies that say nothing; chosen, see docs/cuts.md, How good it is."""
OTHER_KIND = 0.1
"""Share of chatter that is heard as that of the other kind; chosen."""
ACCURACY = 1e-3
"""Accuracy of a multiplier, relative."""
REAL = 1e-3
"""Distance of the angle of a multiplier from pi (rad) up to which it is that of period two."""
FARTHEST = 5.0
"""Largest logarithm of depth over limit that counts, either way: a hundred times `EDGE`."""

Floats = NDArray[np.float64]


class CutPrediction(NamedTuple):
    """What each spindle would do in a cut, shape (r,) each."""

    excess: Floats
    """Logarithm of depth over limit; positive where it chatters."""
    base: Floats
    """Frequency of what grows most, folded to between 0 and half the tooth frequency (Hz); NaN where not known."""
    at_limit: Floats
    """Folded frequency at the limit of its speed, by zero order (Hz); may be NaN where the cut says nothing of any."""
    flip: NDArray[np.bool_]
    """Whether that is of period two."""

    @property
    def chatters(self) -> Floats:
        """Chance that it chatters."""
        return np.asarray(scipy.special.ndtr(self.excess / EDGE))

    @property
    def chance(self) -> Floats:
        """Chance that it is written down as chatter."""
        return MISJUDGED + (1 - 2 * MISJUDGED) * self.chatters

    def distances(self, cut: CutEvidence) -> Floats:
        """Distances of the chatter of a cut from both frequencies (Hz), shape (2, r).

        Chatter that has grown leaves the cut, and sounds like what grows most or like what is at the limit: beyond the
        limit of a pocket these are two modes or lobes.
        """
        return np.asarray(np.abs(_folded_chatter(cut) - np.array([self.base, self.at_limit])))


def predict_cut(cut: CutEvidence, draws: Draws) -> CutPrediction:
    """What draws would do in the worst of the directions of feed of a cut, at its own depth."""
    rows = draws.rows(cut.speed_rpm, cut.cut.tangential, cut.cut.radial, cut.material)
    speed = rows.speed_rpm if cut.speed_found else rows.speed_rpm * draws.at_rest.speed_rpm
    rows = replace(rows, cut=cut.cut, frequency=rows.frequency * cut.moved, speed_rpm=speed)
    predict = _by_mean_force if is_constant(cut.cut) else _by_multipliers
    fed = [predict(rows.fed_at(angle), cut) for angle in cut.feed_angles]
    worst = np.argmax([prediction.excess for prediction in fed], axis=0)[np.newaxis]
    return CutPrediction(*(np.take_along_axis(np.array(part), worst, axis=0)[0] for part in zip(*fed, strict=True)))


def log_likelihood(cut: CutEvidence, prediction: CutPrediction, again: Sequence[CutEvidence] = ()) -> Floats:
    """Logarithm of the likelihood of what was written down, shape (r,).

    again: the same cut as it was made at other times, whose words are known: all have one truth, so that of two words
    that differ one is wrong, however near its limit the cut is.
    """
    return np.asarray(np.log(sum(_likelihoods(cut, prediction, again))))


def misheard(cut: CutEvidence, prediction: CutPrediction, again: Sequence[CutEvidence] = ()) -> Floats:
    """Chance that the word of a cut is wrong, of spindles that are the truth, shape (r,); again: as above."""
    right, wrong = _likelihoods(cut, prediction, again)
    return np.asarray(wrong / (right + wrong))


def power_distance(cut: CutEvidence, force: Floats, before: Sequence[CutEvidence]) -> tuple[Floats, float]:
    """Logarithm of Kt by power over that of each spindle, less what readings before it say of the error that all share,
    shape (r,), and its variance.

    force: Kt of each over that of the table. The readings are log K_i = log Kt + common_i e + own_i e_i, all e standard
    normal: after those before, e is normal with 1 + sum (common_i / own_i)^2 as its inverse variance. ValueError for a
    cut without power.
    """
    if cut.power is None:
        raise ValueError(f"cut {cut.id} has no power; ask for one that has")
    shared, precision = np.zeros(force.shape), 1.0
    for other in before:
        if other.power is not None and other.material == cut.material:
            shared += np.log(other.power.force / force) * other.power.common / other.power.own**2
            precision += (other.power.common / other.power.own) ** 2
    distance = np.log(cut.power.force / force) - cut.power.common * shared / precision
    return distance, cut.power.own**2 + cut.power.common**2 / precision


def power_log_likelihood(cut: CutEvidence, force: Floats, before: Sequence[CutEvidence]) -> Floats:
    """Logarithm of the likelihood of its power over the largest that it can be, shape (r,); 0 where nobody has read it.

    Arguments as of `power_distance`. A natural frequency that has moved since says nothing of Kt: an old one counts
    whole.
    """
    if cut.power is None:
        return np.zeros(force.shape)
    distance, variance = power_distance(cut, force, before)
    return np.asarray(-(distance**2) / (2 * variance))


def _likelihoods(cut: CutEvidence, prediction: CutPrediction, again: Sequence[CutEvidence]) -> tuple[Floats, Floats]:
    """Likelihood of what was written down with its word right, and with it wrong."""
    truths: tuple[Floats, Floats] = prediction.chatters, 1 - prediction.chatters
    for other in again:
        told = [share * word for share, word in zip(truths, _words(other, prediction), strict=True)]
        truths = told[0] / (told[0] + told[1]), told[1] / (told[0] + told[1])
    chatters, stable = (share * word for share, word in zip(truths, _words(cut, prediction), strict=True))
    return (chatters, stable) if cut.chatters else (stable, chatters)


def _words(cut: CutEvidence, prediction: CutPrediction) -> tuple[Floats, Floats]:
    """Likelihood of what was written down where it chatters, and where it is stable; a wrong word sounds anyhow."""
    ones = np.ones(prediction.excess.shape)
    if not cut.chatters:
        return MISJUDGED * ones, (1 - MISJUDGED) * ones
    if not cut.has_frequency:
        return (1 - UNTOLD) * ones, UNTOLD * ones
    return (1 - MISJUDGED) * _sound(cut, prediction), MISJUDGED / 2 * ones


def most_likely(cut: CutEvidence) -> float:
    """The largest that `log_likelihood` can be: of a spindle that would do what was heard."""
    if not cut.has_frequency:
        return 0.0
    base = np.atleast_1d(_folded_chatter(cut))
    same = CutPrediction(np.array([np.inf]), base, base, np.array([cut.word == "flip"]))
    return float(log_likelihood(cut, same)[0])


def _sound(cut: CutEvidence, prediction: CutPrediction) -> Floats:
    """Likelihood of kind and frequency that were told, where it chatters."""
    alike = prediction.flip == (cut.word == "flip")
    kind = np.where(alike, 1 - OTHER_KIND, OTHER_KIND)
    wide = FREQUENCY * (cut.frequency if np.isfinite(cut.frequency) else cut.tooth_frequency)
    distances = prediction.distances(cut)
    near = np.exp(-((distances / wide) ** 2) / 2) / (wide * np.sqrt(np.pi / 2))
    anywhere = 2 / cut.tooth_frequency
    near = np.mean(np.where(np.isfinite(distances), near, anywhere), axis=0)
    return np.asarray(kind * ((1 - STRANGE) * near + STRANGE * anywhere) / anywhere)


def _folded_chatter(cut: CutEvidence) -> Floats:
    """Chatter frequency that was heard, or that of period two where none was told, folded by the teeth (Hz)."""
    chatter = cut.frequency if np.isfinite(cut.frequency) else cut.tooth_frequency / 2
    return fold_frequency(chatter, cut.tooth_frequency)


def _by_mean_force(rows: MillingRows, cut: CutEvidence) -> CutPrediction:
    """Prediction where the mean force is all of it."""
    mean = MeanForce.of(rows)
    limit, at_limit = (table[:, 0] for table in mean.limits(rows.speed_rpm[:, np.newaxis]))
    excess = np.clip(np.log(cut.depth / limit), -FARTHEST, FARTHEST)
    frequency = at_limit.copy()
    beyond = np.flatnonzero(excess > 0) if cut.has_frequency else np.empty(0, dtype=np.intp)
    if beyond.size:
        _, loudest = MeanForce(mean.rows[beyond], mean.force[beyond]).loudest(rows.speed_rpm[beyond], cut.depth)
        frequency[beyond] = np.where(np.isfinite(loudest), loudest, frequency[beyond])
    teeth = 1 / rows.tooth_period
    base, at_limit = (fold_frequency(part, teeth) for part in (frequency, at_limit))
    return CutPrediction(excess, base, at_limit, np.zeros(len(rows), dtype=bool))


def _by_multipliers(rows: MillingRows, cut: CutEvidence) -> CutPrediction:
    """Prediction by semi-discretisation at the depth of the cut; its distance from the limit is that of its growth.

    Growth of the logarithm of the motion over the decay that the spindle has without a cut.
    """
    depth = np.full((len(rows), 1), cut.depth)
    multiplier = largest_multipliers(rows, depth, piece_numbers(rows, cut.depth), ACCURACY)[:, 0]
    quiet = np.min(rows.damping_ratio * rows.frequency, axis=1) * rows.tooth_period
    excess = np.clip(np.log(np.maximum(np.abs(multiplier), 1e-9)) / quiet, -FARTHEST, FARTHEST)
    angle = np.abs(np.angle(multiplier))
    teeth, at_limit = 1 / rows.tooth_period, np.full(len(rows), np.nan)
    if cut.has_frequency:
        at_limit = MeanForce.of(rows).limits(rows.speed_rpm[:, np.newaxis])[1][:, 0]
    return CutPrediction(excess, angle / (2 * np.pi) * teeth, fold_frequency(at_limit, teeth), np.pi - angle < REAL)
