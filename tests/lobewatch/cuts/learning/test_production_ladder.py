"""Ladder of ordinary cuts: risk, gain, effect of chatter and power, and a doubted stable verdict."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lobewatch.arrays import Floats
from lobewatch.cuts.learning import suggestion
from lobewatch.cuts.learning.cut_likelihood import CutEvidence, PowerEvidence, predict_cut
from lobewatch.cuts.learning.posterior import build_prior
from lobewatch.cuts.learning.process_damping import ProcessDamping
from lobewatch.cuts.learning.production_ladder import MAX_CUT_RISK, N_LADDER_SAMPLES, Ladder, find_ladder
from lobewatch.cuts.learning.repeated_cuts import find_questioned_cut
from lobewatch.cuts.learning.suggestion import CutGrid, find_cut_to_ask, suggest_cut
from lobewatch.verdicts.zero_order_batch import ZeroOrderBatch
from tests.lobewatch.cuts.learning.conftest import SLOT, Mill, doubt


def stable(depth: float, speed: float = 9000.0, name: str = "c1") -> CutEvidence:
    return CutEvidence(SLOT, speed, depth, "stable", id=name)


def chatter(depth: float, speed: float = 9000.0) -> CutEvidence:
    return CutEvidence(SLOT, speed, depth, "chatter")


@pytest.fixture(scope="module")
def mill() -> Mill:
    return Mill()


@pytest.fixture(scope="module")
def ladder(mill: Mill) -> Ladder:
    return find_ladder(mill.prior, mill.grid, (), (), None)


def test_each_step_removes_more_and_hardly_chatters_after_the_steps_before(mill: Mill, ladder: Ladder) -> None:
    posterior, rate = mill.prior, 0.0
    assert 1 <= len(ladder.steps) <= 3
    for step in ladder.steps:
        made = mill.grid.build_evidence(step.speed_rpm, step.depth)
        chance = np.sum(posterior.weights * predict_cut(made, posterior.samples).chatter_probability)
        assert step.chatter_probability <= MAX_CUT_RISK
        assert chance <= MAX_CUT_RISK + 0.02
        assert step.removal_rate > rate
        posterior, rate = posterior.learn_from(made), step.removal_rate


def test_the_chance_of_a_step_counts_the_error_of_the_speed(mill: Mill, ladder: Ladder) -> None:
    first, few = ladder.steps[0], mill.prior.resample(N_LADDER_SAMPLES).samples
    made = replace(mill.grid.build_evidence(first.speed_rpm, first.depth), speed_found=False)
    assert first.chatter_probability == pytest.approx(np.mean(predict_cut(made, few).chatter_probability))
    assert np.ptp(few.at_rest.speed_rpm) > 0


def test_no_step_rests_on_estimated_limits(mill: Mill, monkeypatch: pytest.MonkeyPatch) -> None:
    estimate = ZeroOrderBatch.estimate_limits

    def estimate_too_deep(*given: Any) -> tuple[Floats, Floats]:
        limits, frequencies = estimate(*given)
        return 1.3 * limits, frequencies

    monkeypatch.setattr(ZeroOrderBatch, "estimate_limits", estimate_too_deep)
    assert find_ladder(mill.prior, mill.grid, (), (), None, 1).steps == ()


def test_ladder_and_search_expect_some_process_damping(mill: Mill, monkeypatch: pytest.MonkeyPatch) -> None:
    prior = build_prior(mill.middle, doubt(), 200, damping=ProcessDamping(0.0, 5e5, 0.02))
    speeds = np.array([1000.0, 1200.0])
    grid = CutGrid(SLOT, (0.0,), speeds, np.full(2, 0.006), np.ones(2))
    (likely,) = find_ladder(prior, grid, (), (), None, 1).steps
    tried = suggest_cut(prior, grid, (), 5, (), 0.002)
    monkeypatch.setattr(suggestion, "ABSENT_DAMPING_FACTOR", 1.0)
    (unlikely,) = find_ladder(prior, grid, (), (), None, 1).steps
    assert likely.removal_rate > unlikely.removal_rate
    hardly = suggest_cut(prior, grid, (), 5, (), 0.002)
    assert tried is not None
    assert hardly is not None
    assert tried.speed_rpm * tried.depth > hardly.speed_rpm * hardly.depth


def test_no_step_gains_less_than_what_runs(mill: Mill, ladder: Ladder) -> None:
    first = ladder.steps[0]
    running = first.speed_rpm, first.depth
    assert find_ladder(mill.prior, mill.grid, (), (), running, 1).steps == ()
    (step,) = find_ladder(mill.prior, mill.grid, (), (), (first.speed_rpm, 0.5 * first.depth), 1).steps
    assert step.gain == pytest.approx(1.0)


def test_without_a_better_cut_the_running_one_teaches_kt_by_its_power_once(mill: Mill, ladder: Ladder) -> None:
    running, power = (ladder.steps[0].speed_rpm, ladder.steps[0].depth), PowerEvidence(1.0, 0.15, 0.05)
    now, deeper = find_ladder(mill.prior, mill.grid, (), (), running, 2, power).steps
    assert (now.speed_rpm, now.depth, now.gain) == (*running, 0.0)
    assert deeper.gain > 0.03
    learnt = mill.prior.learn_from(replace(stable(running[1], running[0]), power=replace(power, force=2.0)))
    assert find_ladder(learnt, mill.grid, (), (), running, 1, power).steps == ()


def test_a_low_power_leads_deeper_and_chatter_less_deep(mill: Mill, ladder: Ladder) -> None:
    first = ladder.steps[0]
    read = CutEvidence(SLOT, first.speed_rpm, first.depth, "cannot tell", power=PowerEvidence(0.8, 0.15, 0.05))
    deeper = find_ladder(mill.prior.learn_from(read), mill.grid, (), (), None, 1).steps[0]
    assert deeper.removal_rate > 1.1 * first.removal_rate
    made = replace(chatter(first.depth, first.speed_rpm), frequency=1720.0)
    less = find_ladder(mill.prior.learn_from(made), mill.grid, [made], (), None, 1).steps
    assert all(step.removal_rate < first.removal_rate for step in less)


def test_three_deeper_cuts_that_chatter_put_one_stable_word_in_question(mill: Mill) -> None:
    word, deeper = (
        stable(2e-3),
        [chatter(depth, speed) for depth, speed in ((2.2e-3, 9000), (3e-3, 7000), (2.5e-3, 9e3))],
    )
    assert find_questioned_cut([word, *deeper]) == word
    assert find_questioned_cut([word, *deeper[:2]]) is None
    assert find_questioned_cut([word, *deeper, replace(word, id="c5")]) is None
    assert find_questioned_cut([word, *deeper[:2], chatter(1.9e-3)]) is None
    assert find_questioned_cut([word, *deeper, stable(3.5e-3, name="c5")]) is None
    found = find_ladder(mill.prior, mill.grid, [word, *deeper], (), None)
    assert (found.steps, found.questioned) == ((), word)


def test_a_questioned_word_is_suggested_again_while_another_cut_is_left_and_else_only_asked(mill: Mill) -> None:
    made = [stable(2e-3), *(chatter(depth) for depth in (3e-3, 2.6e-3, 2.3e-3))]
    learnt = mill.learnt_from(made)
    assert find_cut_to_ask(learnt, made) == made[0]
    suggestion, last = (suggest_cut(learnt, mill.grid, made, left) for left in (3, 1))
    assert suggestion is not None
    assert (suggestion.repeats, suggestion.speed_rpm, suggestion.depth) == ("c1", 9000.0, 2e-3)
    assert last is not None
    assert last.repeats == ""
