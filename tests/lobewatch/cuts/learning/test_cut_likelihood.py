"""Likelihood of recorded cuts, in closed form for given predictions."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.special import ndtr

from lobes import Cut, stability_boundary, zero_order_lobes
from lobewatch.cuts.learning.cut_likelihood import (
    CutEvidence,
    CutPrediction,
    log_likelihood,
    max_log_likelihood,
    mislabel_probability,
    predict_cut,
)
from lobewatch.cuts.learning.posterior import build_prior
from lobewatch.cuts.learning.prior_samples import SpindleSamples
from tests.lobewatch.cuts.learning.conftest import SLOT, Mill, doubt

pytestmark = pytest.mark.quick

TEETH = 800.0
"""Tooth frequency of a slot at 12 000 rpm (Hz)."""
CHATTER = CutEvidence(SLOT, 12000, 3e-3, "chatter", 1750.0)
"""Chatter that is folded to 150 Hz."""


def predicted(base: float, at_limit: float, excess: float = 5.0, flip: bool = False) -> CutPrediction:
    """Predict one spindle."""
    return CutPrediction(np.array([excess]), np.array([base]), np.array([at_limit]), np.array([flip]))


def log_of(cut: CutEvidence, prediction: CutPrediction) -> float:
    """Logarithm of the likelihood on one spindle."""
    return float(log_likelihood(cut, prediction)[0])


def middle(mill: Mill) -> SpindleSamples:
    """One spindle in the middle of the prior."""
    draws = mill.prior.samples[:1]
    draws.normal[:] = 0.0
    return draws


@pytest.mark.parametrize("depth", [0.9, 0.95, 1.0, 1.03, 1.1])
def test_a_cut_is_detected_to_chatter_by_a_normal_edge_of_5_percent_but_for_wrong_labels(depth: float) -> None:
    """3 %, of chatter without a frequency 6 %."""
    chance = predicted(0.0, 0.0, math.log(depth)).label_probability[0]
    assert chance == pytest.approx(0.03 + 0.94 * ndtr(math.log(depth) / 0.05))
    stable = replace(CHATTER, verdict="stable", frequency=math.nan)
    assert log_of(stable, predicted(0.0, 0.0, math.log(depth))) == pytest.approx(math.log(1 - chance))
    untold = replace(CHATTER, frequency=math.nan)
    wrong_or_right = 0.06 + 0.88 * ndtr(math.log(depth) / 0.05)
    assert log_of(untold, predicted(0.0, 0.0, math.log(depth))) == pytest.approx(math.log(wrong_or_right))


@pytest.mark.parametrize("depth", [0.9, 0.97, 1.0, 1.1])
def test_the_same_cut_made_twice_has_one_truth(depth: float) -> None:
    """One of two contrary labels is wrong, even near the limit: stable 3 %, chatter without frequency 6 %."""
    prediction = predicted(0.0, 0.0, math.log(depth))
    chatter, stable = replace(CHATTER, frequency=math.nan), replace(CHATTER, verdict="stable", frequency=math.nan)
    chance = ndtr(math.log(depth) / 0.05)
    differ = log_of(chatter, prediction) + float(log_likelihood(stable, prediction, [chatter])[0])
    chatters, quiet = chance * 0.94 * 0.03, (1 - chance) * 0.06 * 0.97
    assert differ == pytest.approx(math.log(chatters + quiet))
    alike = log_of(chatter, prediction) + float(log_likelihood(chatter, prediction, [chatter])[0])
    assert alike == pytest.approx(math.log(chance * 0.94**2 + (1 - chance) * 0.06**2))
    assert mislabel_probability(chatter, prediction, [stable])[0] == pytest.approx(quiet / (chatters + quiet))
    assert mislabel_probability(stable, prediction, [chatter])[0] == pytest.approx(chatters / (chatters + quiet))


def test_a_cut_is_another_one_again_at_its_speed_and_depth_in_its_material() -> None:
    again = replace(CHATTER, speed_rpm=12000 * 1.0015, depth=3e-3 * 1.008, verdict="stable", frequency=math.nan)
    assert CHATTER.is_repeat_of(again)
    others: list[dict[str, Any]] = [
        {"speed_rpm": 12030.0},
        {"depth": 3.05e-3},
        {"material": 1},
        {"cut": replace(SLOT, immersion=0.5)},
    ]
    for other in others:
        assert not CHATTER.is_repeat_of(replace(again, **other))


def test_a_frequency_far_from_both_says_nothing_in_5_percent_and_one_that_is_met_speaks_for_the_spindle() -> None:
    """Against a frequency that may be anywhere between 0 and half of tooth passing, a width of 1 % of 1750 Hz."""
    nowhere, wide = math.log(0.97) + math.log(0.9), 17.5
    assert log_of(CHATTER, predicted(390.0, 10.0)) == pytest.approx(nowhere + math.log(0.05), abs=1e-6)
    for off in (0.0, -10.0, 17.5, 30.0):
        peak = TEETH / 2 * math.sqrt(2 / math.pi) / wide * math.exp(-((off / wide) ** 2) / 2)
        both, growing, limit = (
            log_of(CHATTER, prediction)
            for prediction in (
                predicted(150 + off, 150 + off),
                predicted(150 + off, 390.0),
                predicted(390.0, 150 + off),
            )
        )
        assert both == pytest.approx(nowhere + math.log(0.95 * peak + 0.05), abs=1e-6)
        assert growing == limit == pytest.approx(nowhere + math.log(0.95 * peak / 2 + 0.05), abs=1e-6)


def test_a_frequency_that_is_not_predicted_speaks_neither_for_nor_against_a_spindle() -> None:
    unknown = log_of(CHATTER, predicted(math.nan, math.nan))
    assert unknown == pytest.approx(math.log(0.97) + math.log(0.9))
    assert log_of(CHATTER, predicted(390.0, 10.0)) < unknown < log_of(CHATTER, predicted(150.0, 150.0))


def test_period_two_is_distinguished_from_other_chatter_in_nine_of_ten() -> None:
    flip = replace(CHATTER, verdict="flip", frequency=math.nan)
    for cut, base in ((CHATTER, 150.0), (flip, TEETH / 2)):
        is_flip = cut.verdict == "flip"
        alike, unlike = (log_of(cut, predicted(base, base, flip=kind)) for kind in (is_flip, not is_flip))
        assert alike - unlike == pytest.approx(math.log(0.9 / 0.1))
        assert max_log_likelihood(cut) == pytest.approx(alike)
    wide = 0.01 * TEETH
    far = predicted(TEETH / 2 - 2 * wide, math.nan, flip=True)
    peak = TEETH / 2 * math.sqrt(2 / math.pi) / wide * math.exp(-2)
    assert log_of(flip, far) == pytest.approx(math.log(0.97 * 0.9 * (0.95 * (peak + 1) / 2 + 0.05)), abs=1e-6)


def test_what_was_not_reported_is_as_likely_as_can_be_where_a_cut_chatters() -> None:
    assert max_log_likelihood(replace(CHATTER, frequency=math.nan)) == 0.0
    assert max_log_likelihood(replace(CHATTER, verdict="stable", frequency=math.nan)) == 0.0


def test_a_stable_spindle_is_as_likely_to_be_taken_for_chatter_of_any_sound() -> None:
    """With 3 %, wherever its own modes are; the kind that is written down is either with a half. Untold with 6 %."""
    for base in (150.0, 390.0):
        quiet = predicted(base, base, excess=-5.0)
        assert log_of(CHATTER, quiet) == pytest.approx(math.log(0.03 / 2))
        assert log_of(replace(CHATTER, frequency=math.nan), quiet) == pytest.approx(math.log(0.06))
        assert mislabel_probability(CHATTER, quiet)[0] == pytest.approx(1.0)


def test_a_verdict_is_wrong_with_3_percent_where_either_is_as_likely_and_chatter_without_a_frequency_with_6() -> None:
    at_limit, untold = predicted(150.0, 150.0, excess=0.0), replace(CHATTER, frequency=math.nan)
    stable = replace(untold, verdict="stable")
    assert mislabel_probability(untold, at_limit)[0] == pytest.approx(0.06)
    assert mislabel_probability(stable, at_limit)[0] == pytest.approx(0.03)
    assert mislabel_probability(stable, predicted(150.0, 150.0, excess=0.05))[0] == pytest.approx(
        0.03 * ndtr(1.0) / (0.03 * ndtr(1.0) + 0.97 * ndtr(-1.0))
    )


def test_of_several_directions_of_feed_the_worst_counts() -> None:
    mill = Mill(cut=replace(SLOT, immersion=0.3))
    limits = {
        angle: zero_order_lobes([mill.x], [mill.y], replace(mill.cut, feed_angle=angle), [9000.0]).depth[0]
        for angle in (0.0, 0.7, np.pi / 2)
    }
    cut = CutEvidence(mill.cut, 9000, 1e-3, "stable")
    excess = {angle: predict_cut(replace(cut, feed_angles=(angle,)), middle(mill)).excess[0] for angle in limits}
    assert len(set(excess.values())) > 1
    both = predict_cut(replace(cut, feed_angles=tuple(limits)), middle(mill))
    assert both.excess[0] == max(excess.values())


def test_a_speed_that_was_not_found_is_as_far_off_as_the_uncertainty_of_the_machine_says(mill: Mill) -> None:
    draws = mill.prior.samples[:5]
    draws.normal[:] = 0.0
    cut = CutEvidence(mill.cut, 12000, 2e-3, "stable")
    found, commanded = (predict_cut(replace(cut, speed_found=sure), draws).excess for sure in (True, False))
    assert np.ptp(found) == 0
    off = draws.at_rest.speed_rpm
    assert 0.002 < np.ptp(off) < 0.02
    at_true = [predict_cut(replace(cut, speed_rpm=12000 * factor), draws).excess[0] for factor in off]
    assert commanded == pytest.approx(at_true)


def test_an_old_cut_was_made_with_a_frequency_that_was_higher(mill: Mill) -> None:
    """The result is that of a spindle with modes 3 % higher."""
    stiff = Mill(x=mill.x.scaled(1.03, 1.0, ""), y=mill.y.scaled(1.03, 1.0, ""))
    cut = CutEvidence(mill.cut, 12000, 2e-3, "stable")
    old = predict_cut(replace(cut, frequency_ratio=1.03), middle(mill)).excess[0]
    assert old == pytest.approx(predict_cut(cut, middle(stiff)).excess[0], abs=1e-9)
    assert old != pytest.approx(predict_cut(cut, middle(mill)).excess[0], abs=1e-3)


def test_the_excess_is_the_logarithm_of_depth_over_limit_and_clipped_far_from_it(mill: Mill) -> None:
    draws = middle(mill)
    shallow, deep = (predict_cut(CutEvidence(mill.cut, 12000, depth, "stable"), draws) for depth in (1e-3, 1.1e-3))
    assert deep.excess[0] - shallow.excess[0] == pytest.approx(math.log(1.1))
    assert predict_cut(CutEvidence(mill.cut, 12000, 1e3, "stable"), draws).excess[0] == 5
    assert predict_cut(CutEvidence(mill.cut, 12000, 1e-9, "stable"), draws).excess[0] == -5


def test_by_semi_discretisation_kind_and_frequency_are_those_of_the_boundary() -> None:
    """A slender cut in a flip lobe and in a Hopf lobe, at its limit."""
    cut = Cut(2, 0.1, "down", 1.4e9 / 1.1, 5e8 / 1.1)
    mill = Mill(cut=cut, y=Mill().x)
    draws = build_prior(mill.middle, doubt(), 2).samples[:1]
    draws.normal[:] = 0.0
    ratios = {name: float(values[0]) for name, values in draws.ratios().items()}
    mode = mill.x.scaled(ratios["frequency_x"], ratios["stiffness_x"], "")
    mode = replace(mode, damping_ratio=mill.x.damping_ratio * ratios["damping_x"])
    speeds = np.arange(9000.0, 24000.0, 500.0)
    pushed = replace(cut, tangential=1.4e9, radial=5e8)
    boundary = stability_boundary([mode], [mode], pushed, speeds, 0.05)
    kinds = set()
    for speed, depth, chatter, kind in zip(
        speeds, boundary.depth, boundary.chatter_frequency, boundary.kind, strict=True
    ):
        if not math.isfinite(depth) or depth > 0.04:
            continue
        teeth = 2 * speed / 60
        prediction = predict_cut(CutEvidence(cut, speed, 1.001 * depth, "chatter", chatter), draws)
        kinds.add(bool(prediction.is_flip[0]))
        assert prediction.is_flip[0] == (str(kind) == "flip")
        assert prediction.excess[0] == pytest.approx(0.0, abs=0.05)
        folded = min(chatter % teeth, teeth - chatter % teeth)
        assert prediction.frequency[0] == pytest.approx(folded, abs=0.01 * teeth)
    assert kinds == {True, False}


@pytest.mark.parametrize("depth", [1e-3, 4e-3])
def test_a_cut_has_the_same_excess_with_and_without_its_frequency(depth: float) -> None:
    """Growth and Floquet multipliers agree where the force changes with the angle."""
    mill = Mill(cut=replace(SLOT, immersion=0.3))
    told = CutEvidence(mill.cut, 9000, depth, "chatter", 900.0)
    excess = [predict_cut(cut, middle(mill)).excess[0] for cut in (told, replace(told, frequency=math.nan))]
    assert 0.01 < abs(excess[0]) < 4
    assert excess[1] == pytest.approx(excess[0], rel=0.02)
