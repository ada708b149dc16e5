"""Next test cut: can be set, more likely stable than not, with a gain; none without a gain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from speed_grid import list_speeds

from lobes import Cut, stability_boundary, zero_order_lobes
from lobewatch.cuts.learning.cut_likelihood import CutEvidence, predict_cut
from lobewatch.cuts.learning.suggestion import compare_zero_order, floor_depth, suggest_cut
from modal import Mode
from tests.lobewatch.cuts.learning.conftest import Mill


def test_a_suggested_cut_can_be_set_and_is_more_likely_stable_than_not(mill: Mill) -> None:
    learnt, grid = mill.prior, mill.grid
    for left in (5, 1):
        found = suggest_cut(learnt, grid, (), left)
        assert found is not None
        assert found.speed_rpm % 10 == 0
        assert found.speed_rpm in grid.speeds
        assert found.depth * 1e3 / 0.05 == pytest.approx(round(found.depth * 1e3 / 0.05))
        assert found.depth <= 0.012
        assert found.chatter_probability < 0.5
        chance = predict_cut(grid.build_evidence(found.speed_rpm, found.depth), learnt.samples).label_probability
        assert found.chatter_probability == pytest.approx(np.mean(chance), abs=0.07)
        assert found.most_informative in learnt.intervals


def test_the_first_cut_is_about_as_deep_as_the_program_or_hardly_chatters_and_then_cuts_are_bolder(mill: Mill) -> None:
    careful = suggest_cut(mill.prior, mill.grid, (), 5)
    assert careful is not None
    assert careful.chatter_probability <= 0.2
    heard = mill.hear(careful.speed_rpm, careful.depth)
    bold = suggest_cut(mill.prior, mill.grid, (heard,), 4)
    assert bold is not None
    assert bold.chatter_probability > 0.2
    programmed = bold.depth / 1.5
    first = suggest_cut(mill.prior, mill.grid, (), 5, programmed=programmed)
    assert first is not None
    assert first.chatter_probability <= 0.2 or first.depth <= 1.5 * programmed
    assert suggest_cut(mill.prior, mill.grid, (), 5, programmed=mill.grid.max_depths[0]) != careful


def test_cuts_lead_to_more_chips_and_end_where_nothing_is_to_be_gained(mill: Mill) -> None:
    mill.force = 0.9
    learnt, grid, cuts = mill.prior, mill.grid, list[CutEvidence]()
    for left in (4, 3, 2, 1):
        found = suggest_cut(learnt, grid, cuts, left)
        if found is None:
            break
        cuts.append(mill.hear(found.speed_rpm, found.depth))
        learnt = learnt.learn_from(cuts[-1])
    best = max(cut.speed_rpm * cut.depth for cut in cuts if not cut.has_chatter)
    x, y = (mode.scaled(0.985, 1.0, "") for mode in (mill.x, mill.y))
    truly = replace(mill.cut, tangential=0.9 * mill.cut.tangential, radial=0.9 * mill.cut.radial)
    limits = np.minimum(zero_order_lobes([x], [y], truly, grid.speeds).depth, grid.max_depths)
    assert best > 0.85 * max(speed * floor_depth(limit) for speed, limit in zip(grid.speeds, limits, strict=True))
    ceiling = CutEvidence(mill.cut, 20000, 0.012, "stable")
    assert suggest_cut(learnt, grid, [*cuts, ceiling], 1) is None


def test_depths_are_rounded_inwards_and_the_flutes_are_respected(mill: Mill) -> None:
    assert [floor_depth(depth / 1e3) * 1e3 for depth in (1.0, 1.049, 0.04)] == pytest.approx([1.0, 1.0, 0.0])
    shallow = mill.grid._replace(max_depths=np.full(mill.grid.speeds.shape, 0.00052))
    found = suggest_cut(mill.prior, shallow, (), 1)
    assert found is not None
    assert found.depth == pytest.approx(0.0005)


def test_zero_order_is_corrected_where_it_is_not_exact(mill: Mill) -> None:
    speeds = np.array([5000.0, 9000.0, 15000.0, 18000.0])
    assert np.all(compare_zero_order([mill.x], [mill.y], mill.cut, (0.0,), speeds, 0.02) == 1)
    slender = Cut(2, 0.1, "down", 1.4e9, 5e8)
    share = compare_zero_order([mill.x], [mill.y], slender, (0.0,), speeds, 0.02)
    true = stability_boundary([mill.x], [mill.y], slender, speeds, 0.02).depth
    mean = zero_order_lobes([mill.x], [mill.y], slender, speeds).depth
    assert share == pytest.approx(np.minimum(true, 0.02) / np.minimum(mean, 0.02))
    assert np.max(np.abs(share - 1)) > 0.1


def test_zero_order_is_believed_between_a_tenth_and_three_times_the_truth(mill: Mill) -> None:
    """At low immersion both limits leave these somewhere between 4000 and 30 000 rpm; where none is deep it is 1."""
    speeds, slender = list_speeds(4000, 30000), Cut(1, 0.03, "down", 2.8e9, 2e8)
    share = compare_zero_order([mill.x], [mill.y], slender, (0.0,), speeds, 0.5)
    true = np.minimum(stability_boundary([mill.x], [mill.y], slender, speeds, 0.5).depth, 0.5)
    ratio = true / np.minimum(zero_order_lobes([mill.x], [mill.y], slender, speeds).depth, 0.5)
    assert np.max(ratio) > 3.6
    assert np.max(share) == 3.0
    assert np.min(share) >= 0.1
    assert np.all(compare_zero_order([mill.x], [mill.y], slender, (0.0,), speeds, 1e-5) == 1)


def test_zero_order_is_compared_in_the_worst_direction_of_feed() -> None:
    mill = Mill(cut=Cut(2, 0.1, "down", 1.4e9, 5e8))
    speeds = np.array([9000.0, 15000.0])
    angles = (0.0, np.pi / 2)
    share = compare_zero_order([mill.x], [mill.y], mill.cut, angles, speeds, 0.05)
    cuts = [replace(mill.cut, feed_angle=angle) for angle in angles]
    true = np.min([stability_boundary([mill.x], [mill.y], cut, speeds, 0.05).depth for cut in cuts], axis=0)
    mean = np.min([zero_order_lobes([mill.x], [mill.y], cut, speeds).depth for cut in cuts], axis=0)
    assert share == pytest.approx(np.minimum(true, 0.05) / np.minimum(mean, 0.05))


def test_the_gain_is_that_over_the_best_cut_so_far_by_the_chance_that_it_is_stable(mill: Mill) -> None:
    grid, learnt = mill.grid, mill.prior
    best = CutEvidence(mill.cut, 8000, 1e-3, "stable")
    louder = CutEvidence(mill.cut, 20000, 3e-3, "chatter")
    suggestion = suggest_cut(learnt, grid, [best, louder], 1)
    assert suggestion is not None
    rate = suggestion.speed_rpm * suggestion.depth
    assert suggestion.gain == pytest.approx((1 - suggestion.chatter_probability) * (rate - 8.0) / 8.0)
    first = suggest_cut(learnt, grid, (), 1)
    assert first is not None
    assert first.gain == np.inf


def test_a_gain_below_half_a_percent_of_the_best_so_far_is_none(mill: Mill) -> None:
    """One speed, at which any spindle is stable over the whole flute length: the gain is certain."""
    grid = mill.grid._replace(speeds=np.array([12000.0]), max_depths=np.array([2e-4]), zero_order_trust=np.ones(1))
    rate = 12000 * 2e-4
    for gain, is_worth in ((0.0055, True), (0.0045, False)):
        best = CutEvidence(mill.cut, rate / (1 + gain) / 1e-4, 1e-4, "stable")
        suggestion = suggest_cut(mill.prior, grid, [best], 1)
        assert (suggestion is not None) is is_worth
        if suggestion is not None:
            assert suggestion.gain == pytest.approx(gain, rel=1e-3)


def test_a_cut_settles_what_its_outcome_depends_on_most() -> None:
    """Force if lobes are far away; frequency on the steep side of a pocket of a slender spindle."""
    plain = Mill()
    grid = plain.grid._replace(speeds=np.array([4500.0]), max_depths=np.array([0.012]), zero_order_trust=np.ones(1))
    suggestion = suggest_cut(plain.prior, grid, (), 1)
    assert suggestion is not None
    assert suggestion.most_informative == "tangential"
    steep = Mill(x=Mode(1400.0, 0.001, 2.5e7), y=Mode(1400.0, 0.001, 2.5e7))
    settled = set()
    for speed in (19600.0, 20400.0, 20800.0):
        grid = steep.grid._replace(speeds=np.array([speed]), max_depths=np.array([0.012]), zero_order_trust=np.ones(1))
        suggestion = suggest_cut(steep.prior, grid, (), 1)
        settled |= {suggestion.most_informative} if suggestion else set()
    assert settled & {"frequency_x", "frequency_y"}


def test_where_zero_order_is_not_exact_a_cut_is_made_shallower_until_it_is_likely_stable() -> None:
    """Zero order is made three times too shallow: its proposals chatter."""
    mill = Mill(cut=Cut(2, 0.3, "down", 1.4e9, 5e8))
    grid = mill.grid._replace(zero_order_trust=np.full(mill.grid.speeds.shape, 1.7))
    suggestion = suggest_cut(mill.prior, grid, (), 1)
    assert suggestion is not None
    chance = predict_cut(
        grid.build_evidence(suggestion.speed_rpm, suggestion.depth), mill.prior.samples
    ).label_probability
    assert np.mean(chance) < 0.55
    assert floor_depth(suggestion.depth) == suggestion.depth
