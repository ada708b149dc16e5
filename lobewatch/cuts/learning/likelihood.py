"""How likely it is that a cut sounded as it was heard, for each of many spindles."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from lobes import MillingRows, piece_numbers
from lobes.floquet import largest_multipliers
from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.priors import Draws
from lobewatch.cuts.listening.fold_frequency import fold_frequency
from lobewatch.verdicts.mean_force import MeanForce, is_constant

EDGE = 0.05
"""Standard deviation of the depth, relative, within which a cut is stable or not."""
MISJUDGED = 0.02
"""Share of cuts that are heard as what they are not."""
FREQUENCY = 0.01
"""Standard deviation of a chatter frequency against the one predicted, relative."""
STRANGE = 0.05
"""Share of chatter frequencies that say nothing."""
OTHER_KIND = 0.1
"""Share of chatter that is heard as that of the other kind."""
ACCURACY = 1e-3
"""Of a multiplier."""
REAL = 1e-3
"""A multiplier whose angle is this near to pi (rad) is that of period two."""

Floats = NDArray[np.float64]


class CutPrediction(NamedTuple):
    """What each spindle would do in a cut, shape (r,) each."""

    excess: Floats
    """Logarithm of depth over limit; positive where it chatters."""
    base: Floats
    """Frequency of what grows most, folded to between 0 and half the tooth frequency (Hz); NaN where not known."""
    at_limit: Floats
    """The same at the limit at its speed, by zero order; may be NaN where the cut says nothing of frequencies."""
    flip: NDArray[np.bool_]
    """Whether that is of period two."""

    @property
    def chance(self) -> Floats:
        """That it is heard to chatter."""
        return np.asarray(MISJUDGED + (1 - 2 * MISJUDGED) * ndtr(self.excess / EDGE))

    def off(self, seen: CutEvidence, tooth_frequency: float) -> Floats:
        """How far what was heard is from both frequencies (Hz), shape (2, r).

        Chatter that has grown leaves the cut, and sounds like what grows most or like what is at the limit: beyond the
        limit of a pocket these are two modes or lobes.
        """
        heard = fold_frequency(_heard_base(seen, tooth_frequency), tooth_frequency)
        return np.asarray(np.abs(heard - np.array([self.base, self.at_limit])))


def predict_cut(seen: CutEvidence, draws: Draws) -> CutPrediction:
    """In the worst of its directions of feed, at its own depth."""
    rows = draws.rows(seen.speed_rpm, seen.cut.tangential, seen.cut.radial, seen.material)
    speed = rows.speed_rpm if seen.speed_found else rows.speed_rpm * draws.at_rest.speed_rpm
    rows = replace(rows, cut=seen.cut, frequency=rows.frequency * seen.moved, speed_rpm=speed)
    way = _by_mean_force if is_constant(seen.cut) else _by_multipliers
    found = [way(rows.fed_at(angle), seen) for angle in seen.feed_angles]
    worst = np.argmax([one.excess for one in found], axis=0)[np.newaxis]
    return CutPrediction(*(np.take_along_axis(np.array(part), worst, axis=0)[0] for part in zip(*found, strict=True)))


def log_likelihood(seen: CutEvidence, guess: CutPrediction, tooth_frequency: float) -> Floats:
    """Logarithm of the likelihood of what was heard, shape (r,)."""
    if not seen.chatters:
        return np.asarray(np.log(1 - guess.chance))
    return np.asarray(np.log(guess.chance) + _log_of_sound(seen, guess, tooth_frequency))


def most_likely(seen: CutEvidence, tooth_frequency: float) -> float:
    """The largest that `log_likelihood` can be: of a spindle that would do what was heard."""
    if not seen.has_frequency:
        return 0.0
    base = np.atleast_1d(fold_frequency(_heard_base(seen, tooth_frequency), tooth_frequency))
    same = CutPrediction(np.array([np.inf]), base, base, np.array([seen.word == "flip"]))
    return float(log_likelihood(seen, same, tooth_frequency)[0])


def _log_of_sound(seen: CutEvidence, guess: CutPrediction, tooth_frequency: float) -> Floats:
    """Of kind and frequency, where it chatters; 0 where neither was told."""
    if not seen.has_frequency:
        return np.zeros(guess.excess.shape)
    alike = guess.flip == (seen.word == "flip")
    kind = np.where(alike, 1 - OTHER_KIND, OTHER_KIND)
    wide = FREQUENCY * (seen.frequency if np.isfinite(seen.frequency) else tooth_frequency)
    off = guess.off(seen, tooth_frequency)
    near = np.exp(-((off / wide) ** 2) / 2) / (wide * np.sqrt(np.pi / 2))
    anywhere = 2 / tooth_frequency
    near = np.mean(np.where(np.isfinite(off), near, anywhere), axis=0)
    return np.asarray(np.log(kind * ((1 - STRANGE) * near + STRANGE * anywhere) / anywhere))


def _heard_base(seen: CutEvidence, tooth_frequency: float) -> float:
    """Chatter frequency that was heard (Hz), or that of period two where none was told."""
    return seen.frequency if np.isfinite(seen.frequency) else tooth_frequency / 2


def _by_mean_force(rows: MillingRows, seen: CutEvidence) -> CutPrediction:
    """Where that is all of the force."""
    mean = MeanForce.of(rows)
    limit, at_limit = (table[:, 0] for table in mean.limits(rows.speed_rpm[:, np.newaxis]))
    excess = np.clip(np.log(seen.depth / limit), -5, 5)
    frequency = at_limit.copy()
    beyond = np.flatnonzero(excess > 0) if seen.has_frequency else np.empty(0, dtype=np.intp)
    if beyond.size:
        _, own = MeanForce(mean.rows[beyond], mean.force[beyond]).loudest(rows.speed_rpm[beyond], seen.depth)
        frequency[beyond] = np.where(np.isfinite(own), own, frequency[beyond])
    teeth = 1 / rows.tooth_period
    return CutPrediction(
        excess, fold_frequency(frequency, teeth), fold_frequency(at_limit, teeth), np.zeros(len(rows), dtype=bool)
    )


def _by_multipliers(rows: MillingRows, seen: CutEvidence) -> CutPrediction:
    """By semi-discretisation at the depth of the cut; how far it is from the limit by its growth over that at rest."""
    depth = np.full((len(rows), 1), seen.depth)
    multiplier = largest_multipliers(rows, depth, piece_numbers(rows, seen.depth), ACCURACY)[:, 0]
    quiet = np.min(rows.damping_ratio * rows.frequency, axis=1) * rows.tooth_period
    excess = np.clip(np.log(np.maximum(np.abs(multiplier), 1e-9)) / quiet, -5, 5)
    angle = np.abs(np.angle(multiplier))
    teeth, at_limit = 1 / rows.tooth_period, np.full(len(rows), np.nan)
    if seen.has_frequency:
        at_limit = MeanForce.of(rows).limits(rows.speed_rpm[:, np.newaxis])[1][:, 0]
    return CutPrediction(excess, angle / (2 * np.pi) * teeth, fold_frequency(at_limit, teeth), np.pi - angle < REAL)
