"""Find test cuts whose label, frequency or power contradicts the other cuts."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from acquisition import Remark
from lobewatch.cuts.learning import cut_likelihood
from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.posterior import USUAL_FREQUENCY_INTERVAL, NewEvidence, Posterior

MAX_WRONG_PROBABILITY = 0.5
"""Chance of a wrong label, given all cuts, from which a label is rejected."""
N_CHECK_SAMPLES = 300
"""Number of samples used to check a cut."""
MAX_FREQUENCY_DEVIATION = 4.0
"""Largest credible deviation (standard deviations) of a chatter frequency or of Kt by power; chosen."""
MIN_EXPLAINED_WEIGHT = 0.005
"""Share of the weight by the other cuts that counts as zero; chosen."""


class Contradiction(StrEnum):
    """Contradiction between a cut and the model."""

    FREQUENCY = "frequency"
    """Chatter at a frequency without a mode."""
    CHATTERS = "chatters"
    """Chatter where most samples that explain the other cuts are stable."""
    STABLE = "stable"
    """Stable where most samples that explain the other cuts chatter."""
    POWER = "power"
    """Power with another Kt than that of the cuts before it."""


@dataclass(frozen=True)
class InconsistentCut:
    """Cut with a rejected label or power, or with a frequency of no mode."""

    cut: CutEvidence
    """Rejected cut."""
    contradiction: Contradiction
    """Contradiction for which it is rejected."""
    wrong_probability: float = 0.0
    """Chance of a wrong label."""


def wrong_label_probability(evidence: NewEvidence) -> float:
    """Return the probability that the verdict of a cut is wrong on spindles that explain all cuts."""
    cut, before = evidence.cut, evidence.prior
    wrong = cut_likelihood.mislabel_probability(cut, evidence.prediction, _repeats_of(cut, before))
    return float(np.sum(before.weights * wrong))


def find_contradiction(evidence: NewEvidence) -> InconsistentCut | None:
    """Find what contradicts a cut on spindles that explain all cuts, or None."""
    cut, prediction, weights = evidence.cut, evidence.prediction, evidence.prior.weights
    wrong = wrong_label_probability(evidence)
    if np.isfinite(cut.frequency) and cut.has_chatter:
        reach = MAX_FREQUENCY_DEVIATION * cut_likelihood.CHATTER_FREQUENCY_SPREAD * cut.frequency
        near = np.any(prediction.frequency_distances(cut) < reach, axis=0)
        likelihood = cut_likelihood.log_likelihood(cut, prediction, _repeats_of(cut, evidence.prior))
        others = weights * np.exp(-cut.weight * likelihood)
        if np.sum(others * near) < MIN_EXPLAINED_WEIGHT * np.sum(others):
            return InconsistentCut(cut, Contradiction.FREQUENCY, wrong)
    if wrong <= MAX_WRONG_PROBABILITY:
        return None
    return InconsistentCut(cut, Contradiction.CHATTERS if cut.has_chatter else Contradiction.STABLE, wrong)


def is_power_inconsistent(evidence: NewEvidence) -> bool:
    """Return whether the power of a cut implies another Kt than all earlier cuts."""
    cut, before = evidence.cut, evidence.prior
    if cut.power is None:
        return False
    distance, variance = cut_likelihood.power_distance(cut, before.samples.force_factors(cut.material), before.cuts)
    mean = np.sum(before.weights * distance)
    spread = np.sqrt(np.sum(before.weights * (distance - mean) ** 2) + variance)
    return bool(abs(mean) > MAX_FREQUENCY_DEVIATION * spread)


def find_inconsistent_cuts(posterior: Posterior) -> tuple[InconsistentCut, ...]:
    """Find the cuts to reject, of those that were learned from."""
    few = posterior.resample(N_CHECK_SAMPLES)
    rejected = (find_contradiction(few.predict(cut)) for cut in posterior.cuts)
    return tuple(uncertainty for uncertainty in rejected if uncertainty is not None)


def inconsistent_cut_remarks(posterior: Posterior, rejected: Sequence[InconsistentCut], about: str) -> Iterator[Remark]:
    """Yield remarks on rejected cuts and unusual frequencies; about: the program."""
    yield from map(_inconsistent_cut_remark, rejected)
    if posterior.is_frequency_unusual:
        between = f"between {USUAL_FREQUENCY_INTERVAL[0]:g} and {USUAL_FREQUENCY_INTERVAL[1]:g} times it"
        text = f"the frequency at speed is further from that at rest than {between}, as test cuts sound"
        yield Remark("frequency-far-off", about, text, "tap again, warm, with this very tool and stick-out")


def _repeats_of(cut: CutEvidence, posterior: Posterior) -> list[CutEvidence]:
    """Return the same cut as made at other times."""
    return [other for other in posterior.cuts if other is not cut and cut.is_repeat_of(other)]


def _inconsistent_cut_remark(contradicting: InconsistentCut) -> Remark:
    """Build the remark on a rejected cut."""
    cut = contradicting.cut
    at = f"at {cut.speed_rpm:.6g} rpm, {1e3 * cut.depth:.4g} mm"
    pitch = f" at {cut.frequency:.0f} Hz" if math.isfinite(cut.frequency) else ""
    wrong = f"by the other cuts wrong with {100 * contradicting.wrong_probability:.0f} %"
    text, cure = {
        Contradiction.FREQUENCY: (
            f"chatters{pitch} {at}, where no mode is: workpiece or fixture?",
            "tap the workpiece where it is cut",
        ),
        Contradiction.CHATTERS: (
            f"chatter{pitch} {at}, {wrong}: a slip, workpiece, fixture, worn tool?",
            "cut it again, or take it out with folder_updates.exclude_entry; tap again if it stays",
        ),
        Contradiction.STABLE: (
            f"stable {at}, {wrong}: a slip, another depth or speed than told?",
            "cut it again, or take it out with folder_updates.exclude_entry",
        ),
        Contradiction.POWER: (
            f"its power {at} says another Kt than what was known before: this or an earlier one misread, another feed, "
            "another depth, worn edges?",
            "read it again, or take the cut whose power was misread out with folder_updates.exclude_entry; "
            "its word counts",
        ),
    }[contradicting.contradiction]
    return Remark("cut-unexplained", cut.id, f"{text}; not believed", cure)
