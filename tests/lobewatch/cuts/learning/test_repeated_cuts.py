"""Which places test cuts have taken, and which cut is asked for once more."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from lobewatch.cuts.learning import suggestion
from lobewatch.cuts.learning.cut_likelihood import CutEvidence
from lobewatch.cuts.learning.posterior import find_inconsistent_cuts
from lobewatch.cuts.learning.repeated_cuts import find_cut_to_repeat, is_setting_taken
from lobewatch.cuts.learning.suggestion import CutGrid, find_cut_to_ask, suggest_cut
from tests.lobewatch.cuts.learning.conftest import SLOT, Mill

CHATTER = CutEvidence(SLOT, 9000, 12.2e-3, "chatter", 700.0, id="c2")
STABLE = replace(CHATTER, verdict="stable", frequency=math.nan, id="c3")


@pytest.mark.parametrize(("speed", "depth", "taken"), [
    (9000, 12.1e-3, True), (9000, 20e-3, True), (9080, 12.2e-3, True), (8920, 11.2e-3, True),
    (9000, 10.9e-3, False), (9100, 12.2e-3, False), (8900, 20e-3, False),
])  # fmt: skip
def test_chatter_that_is_not_believed_takes_its_place_a_tenth_above_it_and_all_below(
    speed: float, depth: float, taken: bool
) -> None:
    assert is_setting_taken(speed, depth, [CHATTER], [CHATTER]) is taken
    assert not is_setting_taken(speed, depth, [STABLE], [STABLE])


@pytest.mark.parametrize(("depth", "taken"), [(12.1e-3, True), (11.8e-3, True), (11.6e-3, False), (20e-3, True)])
def test_chatter_that_is_believed_takes_4_percent_above_it(depth: float, taken: bool) -> None:
    assert is_setting_taken(8920, depth, [CHATTER]) is taken
    assert not is_setting_taken(8920, depth, [STABLE])
    assert not is_setting_taken(8900, depth, [CHATTER])


def test_a_place_is_free_again_where_the_same_cut_was_stable_later_and_not_before() -> None:
    assert not is_setting_taken(9000, 12.1e-3, [CHATTER, STABLE])
    assert is_setting_taken(9000, 12.1e-3, [STABLE, CHATTER])
    assert is_setting_taken(9000, 12.1e-3, [CHATTER, replace(STABLE, depth=11e-3)])


def test_a_cut_that_is_not_believed_is_asked_for_once_and_never_a_third_time() -> None:
    other = replace(STABLE, speed_rpm=12000.0, id="c1")
    assert find_cut_to_repeat([other, CHATTER], [CHATTER]) is CHATTER
    assert find_cut_to_repeat([other, CHATTER], []) is None
    for second in (STABLE, replace(CHATTER, id="c3")):
        assert find_cut_to_repeat([other, CHATTER, second], [CHATTER, second]) is None
    assert find_cut_to_repeat([CHATTER, replace(CHATTER, depth=11e-3)], [CHATTER]) is CHATTER


def test_the_cut_suggested_is_the_one_that_is_not_believed_then_never_where_it_chattered(mill: Mill) -> None:
    """Chatter far below all that is stable, twice: no cut there or hardly shallower, whatever the others say."""
    speed = float(mill.grid.speeds[np.argmin(np.abs(mill.grid.speeds - 18000))])
    cuts = [CutEvidence(mill.cut, speed, depth, "stable", id=f"c{k}") for k, depth in enumerate((2e-3, 2.5e-3))]
    odd = CutEvidence(mill.cut, speed, 1e-3, "chatter", id="c2")
    learnt = mill.learnt_from([*cuts, odd])
    again = suggest_cut(learnt, mill.grid, [*cuts, odd], 2, [odd])
    assert again is not None
    assert (again.speed_rpm, again.depth, again.repeats) == (speed, 1e-3, "c2")
    assert again.chatter_probability < 0.1
    twice = [*cuts, odd, replace(odd, id="c3")]
    following = suggest_cut(learnt, mill.grid, twice, 2, [odd, twice[-1]])
    assert following is not None
    assert following.repeats == ""
    assert abs(math.log(following.speed_rpm / speed)) >= 0.01


def test_the_last_cut_does_not_ask_for_a_stable_one_that_is_not_believed(mill: Mill) -> None:
    """Stable far deeper than all that chatters: with one cut left a chance to be right about it gains nothing."""
    speed = float(mill.grid.speeds[np.argmin(np.abs(mill.grid.speeds - 18000))])
    cuts = [CutEvidence(mill.cut, speed, depth, "chatter", id=f"c{k}") for k, depth in enumerate((4e-3, 3e-3))]
    odd = CutEvidence(mill.cut, speed, 8e-3, "stable", id="c2")
    learnt = mill.learnt_from([*cuts, odd])
    found = {left: suggest_cut(learnt, mill.grid, [*cuts, odd], left, [odd]) for left in (2, 1)}
    assert {left: cut.repeats for left, cut in found.items() if cut} == {2: "c2", 1: ""}


def test_the_last_cut_gains_where_a_doubtful_stable_one_chattered(mill: Mill, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stable far above the limit, and chatter hardly deeper: without more doubt the last cut would be deeper too."""
    mill.force = 1.3
    speeds = mill.grid.speeds[np.abs(np.log(mill.grid.speeds / 18000)) < 0.05]
    grid = CutGrid(SLOT, (0.0,), speeds, np.full(speeds.shape, 0.012), np.ones(speeds.shape))
    speed, limit = float(speeds[np.argmin(np.abs(speeds - 18000))]), mill.chatter(18000).depth
    stable = [CutEvidence(SLOT, speed, share * limit, "stable", id=f"c{share}") for share in (0.5, 1.4)]
    cuts = [*stable, *(mill.hear(speed, share * limit) for share in (1.82, 1.57))]
    learnt, rates = mill.learnt_from(cuts), list[float]()
    assert find_cut_to_ask(learnt, cuts) == stable[1]
    for odds in (suggestion.ASKED_CUT_ODDS, 1):
        monkeypatch.setattr(suggestion, "ASKED_CUT_ODDS", odds)
        last = suggest_cut(learnt, grid, cuts)
        assert last is not None
        rates.append(last.speed_rpm * last.depth / (stable[1].speed_rpm * stable[1].depth))
    assert rates[0] < 1 < rates[1]


def test_a_verdict_that_is_doubtful_is_asked_for_again_once_while_another_cut_is_left(mill: Mill) -> None:
    """An equal depth 1.5 % faster was stable: the label is more likely right than wrong, but worth a cut."""
    speed = float(mill.grid.speeds[np.argmin(np.abs(mill.grid.speeds - 18000))])
    places = [(speed, 1.5e-3, "stable"), (speed, 2e-3, "chatter"), (1.015 * speed, 2e-3, "stable")]
    cuts = [CutEvidence(mill.cut, *place, id=f"c{k}") for k, place in enumerate(places, 1)]  # type: ignore[arg-type]
    learnt = mill.learnt_from(cuts)
    assert find_inconsistent_cuts(learnt) == ()
    again = suggest_cut(learnt, mill.grid, cuts, 2)
    assert again is not None
    assert (again.speed_rpm, again.depth, again.repeats) == (speed, 2e-3, "c2")
    last = suggest_cut(learnt, mill.grid, cuts, 1)
    assert last is None or not last.repeats
    twice = [*cuts, replace(cuts[1], id="c4")]
    third = suggest_cut(mill.learnt_from(twice), mill.grid, twice, 2)
    assert third is None or third.repeats != "c2"


def test_chatter_is_asked_for_again_where_no_frequency_speaks_for_it(mill: Mill) -> None:
    """6 % less deep than the limit, at the frequency that the spindle has there."""
    chatter = mill.chatter(12000)
    told = replace(chatter, depth=0.85 * chatter.depth, id="c1")
    for cut, repeats in ((told, ""), (replace(told, frequency=math.nan), "c1")):
        found = suggest_cut(mill.prior.learn_from(cut), mill.grid, [cut], 3)
        assert found is not None
        assert found.repeats == repeats


def test_chatter_is_not_asked_for_again_where_a_stable_label_is_more_doubtful(mill: Mill) -> None:
    """Stable between two cuts that chatter, and deeper."""
    first, last = (replace(mill.chatter(speed), frequency=math.nan) for speed in (12000, 12400))
    between = CutEvidence(mill.cut, 12200, 1.1 * first.depth, "stable")
    cuts = [first, between, last]
    found = suggest_cut(mill.learnt_from(cuts), mill.grid, cuts, 2)
    assert found is not None
    assert found.repeats == ""
    assert (found.speed_rpm, found.depth) not in [(cut.speed_rpm, cut.depth) for cut in cuts]
