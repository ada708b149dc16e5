"""What cuts teach: the right way, of the right number, and no more than they say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lobes import Cut, stability_boundary
from lobewatch.cuts.learning.contradicting import Contradiction, contradiction, learn_from_consistent
from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.likelihood import MISJUDGED, log_likelihood, most_likely, predict_cut
from lobewatch.cuts.learning.posterior import Posterior
from lobewatch.cuts.listening.fold_frequency import fold_frequency
from lobewatch.machine.journal.heard_cut import CutWord
from modal import Mode
from tests.lobewatch.cuts.learning.conftest import Mill

TEETH = 800.0
"""Tooth frequency at 12 000 rpm (Hz)."""


def likelihood(cut: CutEvidence, learnt: Posterior) -> np.ndarray:
    return np.exp(log_likelihood(cut, predict_cut(cut, learnt.draws)))


def test_the_prior_is_that_of_the_design(mill: Mill) -> None:
    intervals = mill.prior.intervals
    assert intervals["frequency_x"].mean == pytest.approx(0.985, abs=0.003)
    assert intervals["frequency_y"].std == pytest.approx(0.0237, rel=0.1)
    assert (intervals["damping_x"].mean, intervals["damping_x"].std) == pytest.approx((1.1, 0.275), rel=0.08)
    assert (intervals["stiffness_y"].mean, intervals["stiffness_y"].std) == pytest.approx((1.0, 0.10), rel=0.08)
    assert (intervals["tangential"].mean, intervals["tangential"].std) == pytest.approx((1.1, 0.355), rel=0.09)
    draws = mill.prior.draws.ratios()
    assert abs(np.corrcoef(draws["frequency_x"], draws["frequency_y"])[0, 1]) < 0.1


def test_a_shallow_cut_is_stable_and_a_deep_one_chatters_but_for_cuts_that_are_misheard(mill: Mill) -> None:
    stable, chatters = (CutEvidence(mill.cut, 12000, 1e-5, word) for word in ("stable", "chatter"))
    assert likelihood(stable, mill.prior) == pytest.approx(1 - MISJUDGED)
    assert likelihood(chatters, mill.prior) == pytest.approx(MISJUDGED)
    deep = replace(chatters, depth=0.05)
    assert likelihood(deep, mill.prior) == pytest.approx(1 - MISJUDGED)


@pytest.mark.parametrize(
    ("word", "frequency"), [("chatter", 1450.0), ("chatter", np.nan), ("flip", np.nan), ("stable", np.nan)]
)
def test_nothing_is_likelier_than_to_do_what_was_heard(mill: Mill, word: CutWord, frequency: float) -> None:
    cut = CutEvidence(mill.cut, 12000, 1e-5 if word == "stable" else 0.05, word, frequency)
    most, likelihoods = most_likely(cut), np.log(likelihood(cut, mill.prior))
    assert np.max(likelihoods) <= most
    if word != "flip":
        assert np.max(likelihoods) == pytest.approx(most, abs=0.75)


@pytest.mark.parametrize("cut", [Cut(4, 1.0, "down", 1.4e9, 5e8), Cut(2, 1.0, "down", 1.4e9, 5e8)])
def test_the_edge_lies_at_the_limit(cut: Cut) -> None:
    mill = Mill(cut=cut)
    middle = mill.prior.draws[:1]
    middle.normal[:] = 0.0
    ratios = middle.ratios()
    x, y = (
        Mode(
            mode.frequency * ratios[f"frequency_{side}"][0],
            mode.damping_ratio * ratios[f"damping_{side}"][0],
            mode.stiffness,
        )
        for mode, side in ((mill.x, "x"), (mill.y, "y"))
    )
    pushed = replace(cut, tangential=1.1 * cut.tangential, radial=1.1 * cut.radial)
    limit = stability_boundary([x], [y], pushed, [12000.0], 0.02).depth[0]
    shares = (0.8, 1.0, 1.25)
    chances = [predict_cut(CutEvidence(cut, 12000, limit * share, "stable"), middle).chance[0] for share in shares]
    assert chances[0] < 0.05
    assert 0.4 < chances[1] < 0.6
    assert chances[2] > 0.95


def test_a_chatter_frequency_is_compared_at_the_depth_of_the_cut_and_modulo_the_teeth(mill: Mill) -> None:
    cut = mill.hear(12000, 4e-3)
    assert cut.chatters
    assert cut.tooth_frequency == TEETH
    middle = mill.prior.draws[:1]
    middle.normal[:] = 0.0
    prediction = predict_cut(cut, middle)
    assert fold_frequency(cut.frequency, TEETH) == pytest.approx(prediction.base[0], abs=0.01 * cut.frequency)
    heard, alias, beside = (
        log_likelihood(replace(cut, frequency=cut.frequency + off), prediction)[0] for off in (0, TEETH, 60)
    )
    assert alias == pytest.approx(heard, abs=0.6)
    assert beside < heard - 2


def test_a_deep_stable_cut_lowers_kt_and_chatter_in_a_shallow_one_raises_it(mill: Mill) -> None:
    before = mill.prior.intervals["tangential"].mean
    stable = mill.prior.learn_from(CutEvidence(mill.cut, 12000, 2.2e-3, "stable"))
    chatter = mill.prior.learn_from(CutEvidence(mill.cut, 12000, 0.8e-3, "chatter"))
    assert stable.intervals["tangential"].mean < 0.85 * before
    assert chatter.intervals["tangential"].mean > 1.05 * before
    assert stable.frequencies == chatter.frequencies == 0


def test_chatter_teaches_the_frequency_of_the_direction_that_it_is_of() -> None:
    mill = Mill(frequency=(0.985, 0.945))
    learnt = mill.prior
    for speed, depth in ((9500, 3e-3), (11000, 3e-3), (13500, 3e-3)):
        learnt = learnt.learn_from(mill.hear(speed, depth))
    assert learnt.frequencies == 3
    found = learnt.intervals["frequency_y"]
    assert found.low < 0.945 < found.high < 0.98
    assert found.std < 0.6 * mill.prior.intervals["frequency_y"].std
    assert learnt.intervals["frequency_x"].std > 0.7 * mill.prior.intervals["frequency_x"].std


def test_three_frequencies_notice_what_is_far_from_the_prior_and_one_does_not() -> None:
    mill = Mill(frequency=(0.985, 0.905))
    learnt = mill.prior.learn_from(mill.chatter(11000))
    assert learnt.intervals["frequency_y"].low < 0.92
    assert not learnt.is_far_off
    for speed in (12000, 13500):
        learnt = learnt.learn_from(mill.chatter(speed))
    assert learnt.intervals["frequency_y"].high < 0.945
    assert learnt.is_far_off


def test_old_cuts_are_of_a_frequency_that_has_fallen_since(mill: Mill) -> None:
    now = then = mill.prior
    for speed in (9500, 13500):
        cut = mill.chatter(speed)
        now, then = now.learn_from(cut), then.learn_from(replace(cut, moved=1.02))
    assert then.intervals["frequency_y"].mean < now.intervals["frequency_y"].mean - 0.004
    assert [replace(cut, moved=moved).weight for moved in (1.0, 0.98, 1.05)] == pytest.approx(
        [1, 0.607, 0.044], abs=1e-3
    )


def test_another_material_teaches_the_spindle_but_not_the_force_of_this_one() -> None:
    mill = Mill(frequency=(0.985, 0.945))
    before = other = mill.prior
    for speed in (9500, 13500):
        other = other.learn_from(replace(mill.hear(speed, 3e-3), material=1))
    assert other.intervals["frequency_y"].std < 0.75 * before.intervals["frequency_y"].std
    assert other.intervals["tangential"].std > 0.8 * before.intervals["tangential"].std


def test_a_cut_in_another_material_may_come_first(mill: Mill) -> None:
    cuts = [replace(mill.hear(9500, 3e-3), material=1), mill.hear(13500, 3e-3)]
    learnt, left_out = learn_from_consistent(mill.prior, cuts)
    assert (learnt.cuts, left_out) == (tuple(cuts), ())


def test_learning_is_the_same_again_and_few_draws_are_made_anew() -> None:
    mill = Mill(frequency=(0.985, 0.945))
    cuts = [mill.chatter(speed) for speed in (9500, 13500, 11000)]
    once, again = (learn_from_consistent(mill.prior, cuts)[0] for _ in range(2))
    assert np.array_equal(once.draws.normal, again.draws.normal)
    assert np.array_equal(once.log_weight, again.log_weight)
    assert once.refreshed == 1
    assert once.size > 100


def test_what_contradicts_is_named_and_left_out(mill: Mill) -> None:
    cuts = [CutEvidence(mill.cut, 12000, depth, "stable") for depth in (1e-3, 1.4e-3, 1.5e-3)]
    odd = CutEvidence(mill.cut, 12000, 0.3e-3, "chatter")
    learnt, left_out = learn_from_consistent(mill.prior, [*cuts, odd])
    assert learnt.cuts == tuple(cuts)
    assert [(contradicting.cut, contradicting.why) for contradicting in left_out] == [(odd, Contradiction.CHATTERS)]
    deep = CutEvidence(mill.cut, 8000, 0.03, "stable")
    assert contradiction(learnt.predict(deep)) is Contradiction.STABLE
    cut = mill.hear(20000, 4e-3)
    assert contradiction(learnt.predict(cut)) is None
    assert contradiction(learnt.predict(replace(cut, frequency=1150.0))) is Contradiction.FREQUENCY
