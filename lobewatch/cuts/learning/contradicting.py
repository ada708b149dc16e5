"""Cuts that contradict the model beyond chance: left out with their likely cause, never averaged in."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from acquisition import Remark
from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.likelihood import FREQUENCY, MISJUDGED
from lobewatch.cuts.learning.posterior import USUAL, NewEvidence, Posterior

CHANCE = MISJUDGED + 0.01
"""Chance below which what was heard is beyond chance: hardly more than that it was misheard; chosen."""
AWAY = 4.0
"""Distance from all frequencies predicted (standard deviations) at which chatter is that of something else; chosen."""
NONE = 0.005
"""Share of the weight that counts as nothing; chosen."""


class Contradiction(StrEnum):
    """In what a cut contradicts the model."""

    FREQUENCY = "frequency"
    """It chatters where no mode is."""
    CHATTERS = "chatters"
    """It chatters where all spindles that explain the other cuts are stable."""
    STABLE = "stable"
    """It is stable where all of them chatter."""


@dataclass(frozen=True)
class ContradictingCut:
    """A cut that is left out."""

    cut: CutEvidence
    """The cut."""
    why: Contradiction
    """Contradiction for which it is left out."""


def contradiction(evidence: NewEvidence) -> Contradiction | None:
    """Whether a cut contradicts what was learnt from others; None where it may be chance."""
    cut, prediction, weights = evidence.cut, evidence.prediction, evidence.before.weights
    chatters = float(np.sum(weights * prediction.chance))
    if (chatters if cut.chatters else 1 - chatters) < CHANCE:
        return Contradiction.CHATTERS if cut.chatters else Contradiction.STABLE
    if not np.isfinite(cut.frequency) or not cut.chatters:
        return None
    near = np.any(prediction.distances(cut) < AWAY * FREQUENCY * cut.frequency, axis=0)
    return Contradiction.FREQUENCY if np.sum(weights * near) < NONE else None


def learn_from_consistent(
    start: Posterior, cuts: Sequence[CutEvidence]
) -> tuple[Posterior, tuple[ContradictingCut, ...]]:
    """Learn from those cuts that do not contradict what was learnt before them; and the others.

    A cut that contradicts those before it is asked again once all others are learnt.
    """
    learnt, doubtful = start, list[CutEvidence]()
    for cut in cuts:
        evidence = learnt.predict(cut)
        if contradiction(evidence) is None:
            learnt = evidence.learn()
        else:
            doubtful.append(cut)
    contradicting = list[ContradictingCut]()
    for cut in doubtful:
        evidence = learnt.predict(cut)
        why = contradiction(evidence)
        learnt = evidence.learn() if why is None else learnt
        contradicting += [] if why is None else [ContradictingCut(cut, why)]
    return learnt, tuple(contradicting)


def contradiction_remarks(learnt: Posterior, contradicting: Sequence[ContradictingCut], about: str) -> Iterator[Remark]:
    """What was left out, and where the spindle is not what it was tapped as; about: the program."""
    yield from map(_contradiction_remark, contradicting)
    if learnt.is_far_off:
        between = f"between {USUAL[0]:g} and {USUAL[1]:g} times it"
        text = f"f_n at speed is further from that at rest than {between}, as test cuts sound"
        yield Remark("frequency-far-off", about, text, "tap again, warm, with this very tool and stick-out")


def _contradiction_remark(contradicting: ContradictingCut) -> Remark:
    """Remark on a cut that no spindle explains which explains the others."""
    cut = contradicting.cut
    at = f"at {cut.speed_rpm:.6g} rpm, {1e3 * cut.depth:.4g} mm"
    pitch = f" at {cut.frequency:.0f} Hz" if math.isfinite(cut.frequency) else ""
    text, cure = {
        Contradiction.FREQUENCY: (
            f"chatters{pitch} {at}, where no mode is: workpiece or fixture?",
            "tap the workpiece where it is cut",
        ),
        Contradiction.CHATTERS: (
            f"chatters{pitch} {at}, which no spindle does that explains the others: workpiece, fixture, worn tool?",
            "cut it again; tap again if it stays",
        ),
        Contradiction.STABLE: (
            f"stable {at}, which no spindle is that explains the others: another depth or speed than told?",
            "cut it again, or take it out with lobewatch exclude",
        ),
    }[contradicting.why]
    return Remark("cut-unexplained", cut.id, f"{text}; left out", cure)
