"""Which cuts contradict what was learnt, at the edges of chance, and what is said of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from lobewatch.cuts.learning.contradicting import (
    ContradictingCut,
    Contradiction,
    contradiction,
    contradiction_remarks,
    learn_from_consistent,
)
from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.likelihood import CutPrediction
from lobewatch.cuts.learning.posterior import NewEvidence
from tests.lobewatch.cuts.learning.conftest import SLOT, Mill

STABLE = CutEvidence(SLOT, 12000, 3e-3, "stable", id="c7")
CHATTER = CutEvidence(SLOT, 12000, 3e-3, "chatter", 1750.0, id="c8")
"""Chatter that is folded to 150 Hz."""


def evidence(cut: CutEvidence, share: float, base: float = 150.0) -> NewEvidence:
    """A cut of which a share of the weight says chatter at a folded frequency (Hz), the others that it is stable."""
    before = replace(Mill().prior, log_weight=np.log([share, 1 - share]))
    before = replace(before, draws=before.draws[:2])
    frequencies = np.array([base, 390.0])
    prediction = CutPrediction(np.array([5.0, -5.0]), frequencies, frequencies, np.zeros(2, dtype=bool))
    return NewEvidence(before, cut, prediction)


@pytest.mark.parametrize(("chance", "is_odd"), [(0.029, True), (0.031, False)])
def test_a_cut_contradicts_where_all_else_gives_it_less_than_3_percent(chance: float, is_odd: bool) -> None:
    share = (chance - 0.02) / 0.96
    without = replace(CHATTER, frequency=math.nan)
    chatters, stable = contradiction(evidence(without, share)), contradiction(evidence(STABLE, 1 - share))
    assert (chatters, stable) == ((Contradiction.CHATTERS, Contradiction.STABLE) if is_odd else (None, None))


@pytest.mark.parametrize(("off", "is_odd"), [(69.0, False), (71.0, True)])
def test_chatter_contradicts_where_its_frequency_is_four_standard_deviations_from_all(off: float, is_odd: bool) -> None:
    """Standard deviation: 1 % of 1750 Hz."""
    told = contradiction(evidence(CHATTER, 0.999, 150.0 + off))
    assert told is (Contradiction.FREQUENCY if is_odd else None)
    assert contradiction(evidence(replace(CHATTER, frequency=math.nan), 0.999, 150.0 + off)) is None


@pytest.mark.parametrize(("share", "is_odd"), [(0.004, True), (0.006, False)])
def test_chatter_of_half_a_percent_of_the_weight_is_explained(share: float, is_odd: bool) -> None:
    found = evidence(CHATTER, share)
    chatters = replace(found, prediction=found.prediction._replace(excess=np.array([5.0, 5.0])))
    assert contradiction(chatters) is (Contradiction.FREQUENCY if is_odd else None)


def test_a_cut_that_contradicts_those_before_it_is_learnt_from_where_those_after_explain_it(mill: Mill) -> None:
    stable = CutEvidence(mill.cut, 12000, 1.6e-3, "stable")
    shallow, deep = (CutEvidence(mill.cut, 12000, depth, "chatter") for depth in (1.1e-3, 1.65e-3))
    learnt, left_out = learn_from_consistent(mill.prior, [stable, shallow])
    assert (learnt.cuts, left_out) == ((stable,), (ContradictingCut(shallow, Contradiction.CHATTERS),))
    learnt, left_out = learn_from_consistent(mill.prior, [stable, shallow, deep])
    assert (learnt.cuts, left_out) == ((stable, deep, shallow), ())


def test_each_contradiction_is_said_with_its_cause(mill: Mill) -> None:
    odd = [
        ContradictingCut(CHATTER, Contradiction.FREQUENCY),
        ContradictingCut(replace(CHATTER, frequency=math.nan), Contradiction.CHATTERS),
        ContradictingCut(STABLE, Contradiction.STABLE),
    ]
    remarks = list(contradiction_remarks(mill.prior, odd, "A"))
    assert [(remark.code, remark.about) for remark in remarks] == [
        ("cut-unexplained", "c8"), ("cut-unexplained", "c8"), ("cut-unexplained", "c7"),
    ]  # fmt: skip
    texts = [str(remark) for remark in remarks]
    assert "chatters at 1750 Hz at 12000 rpm, 3 mm, where no mode is" in texts[0]
    assert "chatters at 12000 rpm, 3 mm, which no spindle does" in texts[1]
    assert "stable at 12000 rpm, 3 mm, which no spindle is" in texts[2]
