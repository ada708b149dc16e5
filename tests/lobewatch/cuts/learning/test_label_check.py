"""Cuts that contradict the learned model, at the limits of chance, and their remarks."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from lobewatch.cuts.learning.cut_likelihood import CutEvidence, CutPrediction, log_likelihood
from lobewatch.cuts.learning.posterior import (
    Contradiction,
    InconsistentCut,
    NewEvidence,
    find_contradiction,
    find_inconsistent_cuts,
    inconsistent_cut_remarks,
)
from tests.lobewatch.cuts.learning.conftest import SLOT, Mill

STABLE = CutEvidence(SLOT, 12000, 3e-3, "stable", id="c7")
CHATTER = CutEvidence(SLOT, 12000, 3e-3, "chatter", 1750.0, id="c8")
"""Chatter that is folded to 150 Hz."""


def evidence(cut: CutEvidence, share: float, base: float = 150.0) -> NewEvidence:
    """Build a cut that a share of the weight predicts to chatter at a folded frequency (Hz)."""
    before = Mill().prior._replace(log_weight=np.log([share, 1 - share]))
    before = before._replace(samples=before.samples[:2])
    frequencies = np.array([base, 390.0])
    prediction = CutPrediction(np.array([5.0, -5.0]), frequencies, frequencies, np.zeros(2, dtype=bool))
    return NewEvidence(before, cut, prediction)


@pytest.mark.parametrize(("share", "is_odd"), [(0.029, True), (0.031, False)])
def test_a_cut_is_not_believed_where_all_else_gives_it_less_than_it_is_to_be_wrong(share: float, is_odd: bool) -> None:
    """With weights learned from the cut: 3 % of the weight before it are half of that after it."""
    without = replace(CHATTER, frequency=math.nan)
    after = share * 0.97 / (share * 0.97 + (1 - share) * 0.03)
    chatters, stable = find_contradiction(evidence(without, after)), find_contradiction(evidence(STABLE, 1 - after))
    assert (chatters is not None) is (stable is not None) is is_odd
    if is_odd:
        assert chatters is not None
        assert stable is not None
        assert (chatters.contradiction, stable.contradiction) == (Contradiction.CHATTERS, Contradiction.STABLE)
        assert [chatters.wrong_probability, stable.wrong_probability] == pytest.approx([1 - after] * 2)


@pytest.mark.parametrize(("off", "is_odd"), [(69.0, False), (71.0, True)])
def test_chatter_contradicts_where_its_frequency_is_four_standard_deviations_from_all(off: float, is_odd: bool) -> None:
    """Standard deviation: 1 % of 1750 Hz."""
    told = find_contradiction(evidence(CHATTER, 0.999, 150.0 + off))
    assert (told and told.contradiction) is (Contradiction.FREQUENCY if is_odd else None)
    assert find_contradiction(evidence(replace(CHATTER, frequency=math.nan), 0.999, 150.0 + off)) is None


@pytest.mark.parametrize(("share", "is_odd"), [(0.004, True), (0.006, False)])
def test_chatter_of_half_a_percent_of_the_weight_by_the_others_is_explained(share: float, is_odd: bool) -> None:
    found = evidence(CHATTER, share)
    prediction = found.prediction._replace(excess=np.array([5.0, 5.0]))
    log_weight = np.log([share, 1 - share]) + log_likelihood(CHATTER, prediction)
    learnt = found.prior._replace(log_weight=log_weight)
    chatters = found._replace(prior=learnt, prediction=prediction)
    odd = find_contradiction(chatters)
    assert (odd and odd.contradiction) is (Contradiction.FREQUENCY if is_odd else None)


def test_a_cut_that_contradicts_those_before_it_is_believed_where_those_after_explain_it(mill: Mill) -> None:
    stable = CutEvidence(mill.cut, 12000, 1.6e-3, "stable")
    shallow, deep = (CutEvidence(mill.cut, 12000, depth, "chatter") for depth in (0.9e-3, 1.65e-3))
    (odd,) = find_inconsistent_cuts(mill.learnt_from([stable, replace(stable, depth=1.7e-3), shallow]))
    assert (odd.cut, odd.contradiction) == (shallow, Contradiction.CHATTERS)
    assert odd.wrong_probability > 0.9
    again = [stable, shallow, deep, replace(shallow, depth=0.95e-3), replace(shallow, speed_rpm=12100)]
    (odd,) = find_inconsistent_cuts(mill.learnt_from(again))
    assert (odd.cut, odd.contradiction) == (stable, Contradiction.STABLE)


def test_each_contradiction_is_reported_with_its_cause(mill: Mill) -> None:
    odd = [
        InconsistentCut(CHATTER, Contradiction.FREQUENCY),
        InconsistentCut(replace(CHATTER, frequency=math.nan), Contradiction.CHATTERS, 0.871),
        InconsistentCut(STABLE, Contradiction.STABLE, 0.6),
        InconsistentCut(STABLE, Contradiction.POWER),
    ]
    remarks = list(inconsistent_cut_remarks(mill.prior, odd, "A"))
    assert [(remark.code, remark.about) for remark in remarks] == [
        ("cut-unexplained", "c8"), ("cut-unexplained", "c8"), ("cut-unexplained", "c7"), ("cut-unexplained", "c7"),
    ]  # fmt: skip
    texts = [str(remark) for remark in remarks]
    facts = (
        ("chatter at 1750 Hz", "workpiece"), ("chatter at 12000 rpm", "87 %"),
        ("stable at 12000 rpm", "60 %"), ("power at 12000 rpm", "Kt"),
    )  # fmt: skip
    for text, own in zip(texts, facts, strict=True):
        assert all(fact in text for fact in (*own, "12000 rpm, 3 mm")), text
