"""Learning from cuts: right direction, right size, and no more than the evidence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lobes import Cut, stability_boundary
from lobewatch.cuts.chatter_detection.spectrum import fold_frequency
from lobewatch.cuts.learning.cut_likelihood import (
    MISLABELED_SHARE,
    UNPITCHED_MISLABELED_SHARE,
    CutEvidence,
    log_likelihood,
    max_log_likelihood,
    predict_cut,
)
from lobewatch.cuts.learning.posterior import Contradiction, Posterior, build_prior, find_inconsistent_cuts
from lobewatch.machine.journal.entries import CutVerdict
from modal import Mode
from tests.lobewatch.cuts.learning.conftest import Mill, doubt

TEETH = 800.0
"""Tooth frequency at 12 000 rpm (Hz)."""


def likelihood(cut: CutEvidence, learnt: Posterior) -> np.ndarray:
    return np.exp(log_likelihood(cut, predict_cut(cut, learnt.samples)))


def test_the_prior_is_that_of_the_design(mill: Mill) -> None:
    intervals = mill.prior.intervals
    assert intervals["frequency_x"].mean == pytest.approx(0.975, abs=0.003)
    assert intervals["frequency_y"].std == pytest.approx(0.0237, rel=0.1)
    assert (intervals["damping_x"].mean, intervals["damping_x"].std) == pytest.approx((1.1, 0.275), rel=0.08)
    assert (intervals["stiffness_y"].mean, intervals["stiffness_y"].std) == pytest.approx((1.0, 0.10), rel=0.08)
    assert (intervals["tangential"].mean, intervals["tangential"].std) == pytest.approx((1.1, 0.355), rel=0.09)
    draws = mill.prior.samples.ratios()
    assert abs(np.corrcoef(draws["frequency_x"], draws["frequency_y"])[0, 1]) < 0.1


def test_a_shallow_cut_is_stable_and_a_deep_one_chatters_but_for_cuts_that_are_misheard(mill: Mill) -> None:
    stable, chatters = (CutEvidence(mill.cut, 12000, 1e-5, word) for word in ("stable", "chatter"))
    assert likelihood(stable, mill.prior) == pytest.approx(1 - MISLABELED_SHARE)
    assert likelihood(chatters, mill.prior) == pytest.approx(UNPITCHED_MISLABELED_SHARE)
    deep = replace(chatters, depth=0.05)
    assert likelihood(deep, mill.prior) == pytest.approx(1 - UNPITCHED_MISLABELED_SHARE)


@pytest.mark.parametrize(
    ("word", "frequency"), [("chatter", 1450.0), ("chatter", np.nan), ("flip", np.nan), ("stable", np.nan)]
)
def test_nothing_is_likelier_than_to_do_what_was_detected(mill: Mill, word: CutVerdict, frequency: float) -> None:
    cut = CutEvidence(mill.cut, 12000, 1e-5 if word == "stable" else 0.05, word, frequency)
    most, likelihoods = max_log_likelihood(cut), np.log(likelihood(cut, mill.prior))
    assert np.max(likelihoods) <= most
    if word != "flip":
        assert np.max(likelihoods) == pytest.approx(most, abs=0.75)


@pytest.mark.parametrize("cut", [Cut(4, 1.0, "down", 1.4e9, 5e8), Cut(2, 1.0, "down", 1.4e9, 5e8)])
def test_the_edge_is_at_the_limit(cut: Cut) -> None:
    mill = Mill(cut=cut)
    middle = mill.prior.samples[:1]
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
    chances = [
        predict_cut(CutEvidence(cut, 12000, limit * share, "stable"), middle).label_probability[0] for share in shares
    ]
    assert chances[0] < 0.05
    assert 0.4 < chances[1] < 0.6
    assert chances[2] > 0.95


def test_a_chatter_frequency_is_compared_at_the_depth_of_the_cut_and_modulo_the_teeth(mill: Mill) -> None:
    cut = mill.hear(12000, 4e-3)
    assert cut.has_chatter
    assert cut.tooth_frequency == TEETH
    middle = mill.prior.samples[:1]
    middle.normal[:] = 0.0
    prediction = predict_cut(cut, middle)
    assert fold_frequency(cut.frequency, TEETH) == pytest.approx(prediction.frequency[0], abs=0.01 * cut.frequency)
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
    assert stable.n_frequencies == chatter.n_frequencies == 0


def test_chatter_teaches_the_frequency_of_the_direction_that_it_is_of() -> None:
    mill = Mill(frequency=(0.985, 0.945))
    learnt = mill.prior
    for speed, depth in ((9500, 3e-3), (11000, 3e-3), (13500, 3e-3)):
        learnt = learnt.learn_from(mill.hear(speed, depth))
    assert learnt.n_frequencies == 3
    found = learnt.intervals["frequency_y"]
    assert found.low < 0.945 < found.high < 0.985
    assert found.std < 0.6 * mill.prior.intervals["frequency_y"].std
    assert learnt.intervals["frequency_x"].std > 0.7 * mill.prior.intervals["frequency_x"].std


def test_three_frequencies_notice_what_is_far_from_the_prior_and_one_does_not() -> None:
    mill = Mill(frequency=(0.985, 0.905))
    learnt = mill.prior.learn_from(mill.chatter(11000))
    assert learnt.intervals["frequency_y"].low < 0.92
    assert not learnt.is_frequency_unusual
    for speed in (12000, 13500):
        learnt = learnt.learn_from(mill.chatter(speed))
    assert learnt.intervals["frequency_y"].high < 0.945
    assert learnt.is_frequency_unusual


def test_old_cuts_are_of_a_frequency_that_has_fallen_since(mill: Mill) -> None:
    now = then = mill.prior
    for speed in (9500, 13500):
        cut = mill.chatter(speed)
        now, then = now.learn_from(cut), then.learn_from(replace(cut, frequency_ratio=1.02))
    assert then.intervals["frequency_y"].mean < now.intervals["frequency_y"].mean - 0.004
    assert [replace(cut, frequency_ratio=moved).weight for moved in (1.0, 0.98, 1.05)] == pytest.approx(
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
    learnt = mill.learnt_from(cuts)
    assert (learnt.cuts, find_inconsistent_cuts(learnt)) == (tuple(cuts), ())


def test_learning_is_the_same_again_and_few_samples_are_made_again() -> None:
    mill = Mill(frequency=(0.985, 0.945))
    cuts = [mill.chatter(speed) for speed in (9500, 13500, 11000)]
    once, again = (mill.learnt_from(cuts) for _ in range(2))
    assert np.array_equal(once.samples.normal, again.samples.normal)
    assert np.array_equal(once.log_weight, again.log_weight)
    assert once.n_refreshed == 1
    assert once.effective_size > 100


def test_what_contradicts_is_named_and_teaches_nothing(mill: Mill) -> None:
    cuts = [CutEvidence(mill.cut, 12000, depth, "stable") for depth in (1e-3, 1.4e-3, 1.5e-3)]
    odd = CutEvidence(mill.cut, 12000, 0.3e-3, "chatter")
    without, learnt = mill.learnt_from(cuts), mill.learnt_from([*cuts, odd])
    assert [(doubt.cut, doubt.contradiction) for doubt in find_inconsistent_cuts(learnt)] == [
        (odd, Contradiction.CHATTERS)
    ]
    assert learnt.intervals["tangential"].mean == pytest.approx(without.intervals["tangential"].mean, rel=0.01)
    deep = CutEvidence(mill.cut, 8000, 0.03, "stable")
    assert [doubt.contradiction for doubt in find_inconsistent_cuts(without.learn_from(deep))] == [Contradiction.STABLE]
    cut = mill.hear(20000, 4e-3)
    assert find_inconsistent_cuts(without.learn_from(cut)) == ()
    elsewhere = find_inconsistent_cuts(without.learn_from(replace(cut, frequency=1150.0)))
    assert [doubt.contradiction for doubt in elsewhere] == [Contradiction.FREQUENCY]


def weighted(*log_weight: float, cuts: tuple[CutEvidence, ...] = ()) -> Posterior:
    """Weight the first samples of a prior."""
    learnt = Mill().prior
    return learnt._replace(samples=learnt.samples[: len(log_weight)], log_weight=np.array(log_weight), cuts=cuts)


def test_weights_are_shares_whatever_their_logarithms_begin_at() -> None:
    learnt = weighted(-2000.0, -2000.0 + np.log(3.0))
    assert learnt.weights == pytest.approx([0.25, 0.75])
    assert learnt.effective_size == pytest.approx(1 / (0.25**2 + 0.75**2))


def test_intervals_hold_95_percent_of_the_weight() -> None:
    """For 700 samples, half with ten times the weight, against the weighted distribution."""
    log_weight = np.where(np.arange(700) % 2 == 0, 0.0, np.log(10.0))
    learnt = Mill().prior._replace(log_weight=log_weight)
    values, interval = learnt.samples.ratios()["tangential"], learnt.intervals["tangential"]
    assert np.sum(learnt.weights[values < interval.low]) == pytest.approx(0.025, abs=0.003)
    assert np.sum(learnt.weights[values > interval.high]) == pytest.approx(0.025, abs=0.003)
    assert interval.mean == pytest.approx(np.sum(learnt.weights * values))
    assert interval.std**2 == pytest.approx(np.sum(learnt.weights * values**2) - interval.mean**2)


def test_frequencies_stay_open_until_chatter_was_detected_twice(mill: Mill) -> None:
    chatter = CutEvidence(mill.cut, 12000, 3e-3, "chatter", 1450.0)
    stable, untold = replace(chatter, verdict="stable"), replace(chatter, frequency=np.nan)
    for cuts, is_open in (((chatter, stable, untold), True), ((chatter, chatter), False), ((), True)):
        intervals = weighted(*[0.0] * 5, *[-50.0] * 100, cuts=cuts).intervals
        for side in "xy":
            interval = intervals[f"frequency_{side}"]
            assert (interval.low <= 0.90 and interval.high >= 1.05) is is_open
        assert intervals["stiffness_x"].high < 1.3
    flip = replace(untold, verdict="flip")
    assert weighted(0.0, 0.0, cuts=(flip, flip)).n_frequencies == 2


@pytest.mark.parametrize(("off", "share", "is_far"), [
    (0.934, 0.51, True), (0.936, 0.51, False), (1.016, 0.51, True), (1.014, 0.51, False), (0.92, 0.49, False),
])  # fmt: skip
def test_a_spindle_is_far_off_where_more_than_half_of_the_weight_is_outside_of_95_percent(
    mill: Mill, off: float, share: float, is_far: bool
) -> None:
    chatter = CutEvidence(mill.cut, 12000, 3e-3, "chatter", 1450.0)
    values = np.linspace(-6, 6, 4001)
    for column in (0, 1):
        learnt = mill.prior
        draws = learnt.samples[np.zeros(4001, dtype=np.intp)]
        draws.normal[:] = 0.0
        draws.normal[:, column] = values
        frequency = draws.ratios()["frequency_x" if column == 0 else "frequency_y"]
        place = int(np.argmin(np.abs(frequency - off)))
        both = draws[np.array([place, 2000])]
        log_weight = np.log([share, 1 - share])
        assert (
            learnt._replace(samples=both, log_weight=log_weight, cuts=(chatter, chatter)).is_frequency_unusual is is_far
        )
        assert not learnt._replace(samples=both, log_weight=log_weight, cuts=(chatter,)).is_frequency_unusual


def test_samples_that_are_ruled_out_are_not_inspected_any_more(mill: Mill) -> None:
    learnt = weighted(0.0, np.log(1.3e-6), np.log(0.7e-6), -1.0)
    evidence = learnt.predict(CutEvidence(mill.cut, 12000, 2e-3, "stable"))
    assert len(evidence.prior.samples) == len(evidence.prediction.excess) == 3
    assert evidence.prior.log_weight.tolist() == [0.0, np.log(1.3e-6), -1.0]


def test_a_cut_weights_samples_by_its_likelihood_and_an_old_one_less(mill: Mill) -> None:
    cut = CutEvidence(mill.cut, 12000, 1.2e-3, "stable")
    for moved in (1.0, 1.03):
        evidence = mill.prior.predict(replace(cut, frequency_ratio=moved))
        learnt = evidence.update()
        weight = np.exp(-(((moved - 1) / 0.02) ** 2) / 2)
        assert learnt.log_weight == pytest.approx(weight * np.log(1 - evidence.prediction.label_probability))
        assert (learnt.cuts, learnt.n_refreshed) == ((evidence.cut,), 0)


def test_samples_are_drawn_as_often_as_their_weight_says_but_for_one() -> None:
    learnt = weighted(*np.log([0.5, 0.25, 0.2, 0.05]))
    sample = learnt.draw(40)
    counts = [int(np.sum(np.all(sample.normal == normal, axis=1))) for normal in learnt.samples.normal]
    assert sum(counts) == 40
    assert np.abs(np.array(counts) - [20, 10, 8, 2]).max() <= 1


def test_samples_that_are_made_again_are_those_of_prior_and_likelihood() -> None:
    """Against 12 000 weighted samples: mean and spread after three cuts."""
    mill = Mill(frequency=(0.985, 0.945))
    cuts = [mill.chatter(speed) for speed in (9500, 13500, 11000)]
    few, many = mill.prior, build_prior(mill.middle, doubt(), 12000, seed=1)
    for cut in cuts:
        few = few.learn_from(cut)
        many = many._replace(log_weight=many.log_weight + log_likelihood(cut, predict_cut(cut, many.samples)))
    assert few.n_refreshed >= 1
    assert len(few.samples) == 500
    many = many._replace(cuts=few.cuts)
    assert many.effective_size > 300
    for name, interval in few.intervals.items():
        weighted_only = many.intervals[name]
        assert interval.mean == pytest.approx(weighted_only.mean, abs=0.3 * weighted_only.std), name
        assert interval.std == pytest.approx(weighted_only.std, rel=0.25), name
