"""Next speeds by sound: the classic rule, several modes, depth, contradictions and bad input."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lobewatch.cuts.learning import sampled_lobes
from lobewatch.cuts.learning.next_speed import HeardCut, suggest_speeds
from lobewatch.cuts.learning.sampled_lobes import MAX_LOBE_GAIN, sample_lobes

RANGE = (8000.0, 24000.0)


def chatter(speed: float, frequency: float, depth: float = 1e-3) -> HeardCut:
    return HeardCut(speed, "chatter", frequency, depth)


def test_the_first_speeds_are_tooth_passing_at_a_whole_share_of_the_chatter_frequency() -> None:
    found = suggest_speeds([chatter(18000, 1370)], 2, RANGE)
    assert found.reason == ""
    assert [speed.lobe for speed in found.speeds] == [2, 3, 4]
    for speed in found.speeds:
        assert speed.speed_rpm == pytest.approx(60 * 1370 / (2 * speed.lobe), rel=0.025)
        assert speed.speed_rpm <= 60 * 1370 / (2 * speed.lobe)  # f_c is above the natural frequency
        assert speed.window_rpm[0] <= speed.speed_rpm <= speed.window_rpm[1]
        assert speed.depth == 1e-3
    gains = [speed.relative_depth for speed in found.speeds]
    assert gains == sorted(gains, reverse=True)
    assert gains[0] > 1.5


@settings(max_examples=6, deadline=None)
@given(scale=st.floats(0.3, 3.0), teeth=st.integers(2, 4))
def test_speeds_scale_with_the_chatter_frequency(scale: float, teeth: int) -> None:
    low, high = RANGE
    one = suggest_speeds([chatter(18000, 1370)], 2, RANGE).speeds[0]
    factor = scale * 2 / teeth
    scaled = [chatter(18000 * factor, 1370 * scale)]
    other = suggest_speeds(scaled, teeth, (low * factor, high * factor)).speeds[0]
    assert other.speed_rpm == pytest.approx(one.speed_rpm * factor, rel=3e-3)
    assert other.relative_depth == pytest.approx(one.relative_depth, rel=1e-6)


def test_a_second_frequency_of_the_same_mode_moves_the_speed_between_both() -> None:
    first = suggest_speeds([chatter(18000, 1370)], 2, RANGE).speeds[0]
    second = suggest_speeds([chatter(18000, 1370), chatter(22000, 1310)], 2, RANGE).speeds[0]
    assert second.lobe == first.lobe
    assert second.frequency == pytest.approx(first.frequency * 1340 / 1370, rel=1e-6)


def test_a_side_band_counts_as_its_mode() -> None:
    """At 15 000 rpm and two flutes, 870 Hz is the side band of 1370 Hz."""
    found = suggest_speeds([chatter(18000, 1370), chatter(15000, 870)], 2, RANGE)
    assert [speed.frequency for speed in found.speeds] == pytest.approx([1370 / 1.015] * 3)


def test_a_second_mode_excludes_speeds_that_are_bad_for_it() -> None:
    """At 20 200 rpm, a mode at 1010 Hz is half a tooth passing off a pocket."""
    alone = suggest_speeds([chatter(18000, 1370)], 2, RANGE).speeds[0]
    both = suggest_speeds([chatter(18000, 1370), chatter(alone.speed_rpm, 1010)], 2, RANGE).speeds[0]
    assert abs(both.speed_rpm / alone.speed_rpm - 1) > 0.02


def test_no_speed_is_tried_twice_and_then_the_depth_is_reduced() -> None:
    cuts = [chatter(18000, 1370)]
    for _ in range(2):
        found = suggest_speeds(cuts, 2, RANGE)
        assert found.reason == ""
        assert all(abs(math.log(found.speeds[0].speed_rpm / cut.speed_rpm)) > 0.015 for cut in cuts)
        cuts.append(chatter(found.speeds[0].speed_rpm, 1370))
    found = suggest_speeds(cuts, 2, RANGE)
    assert found.reason == "no-deep-speed"
    assert found.speeds[0].depth == pytest.approx(0.7e-3)
    assert suggest_speeds([*cuts, chatter(*found.speeds[0][:1], 1370, 0.7e-3)], 2, RANGE).reason == ""


def test_a_stable_cut_ends_the_search_and_a_contradicting_one_begins_it_again() -> None:
    stable = HeardCut(20200, "stable", depth=1e-3)
    assert suggest_speeds([chatter(18000, 1370), stable], 2, RANGE).reason == "stable"
    later = chatter(20210, 1350, 0.9e-3)
    found = suggest_speeds([chatter(18000, 1370), stable, later], 2, RANGE)
    assert (found.reason, found.contradicting) == ("", (stable,))
    deeper = later._replace(depth=1.1e-3)
    assert suggest_speeds([chatter(18000, 1370), stable, deeper], 2, RANGE).contradicting == ()


@pytest.mark.parametrize(
    ("cuts", "reason"),
    [
        ([], "no-verdict"),
        ([chatter(18000, math.nan)], "no-chatter-frequency"),
        ([HeardCut(18000, "stable")], "stable"),
    ],
)
def test_without_a_chatter_frequency_there_is_no_speed(cuts: list[HeardCut], reason: str) -> None:
    found = suggest_speeds(cuts, 2, RANGE)
    assert (found.reason, found.speeds) == (reason, ())


def test_a_range_without_a_pocket_says_so() -> None:
    assert suggest_speeds([chatter(18000, 1370)], 2, (14500.0, 19000.0)).reason == "no-speed-in-range"
    assert suggest_speeds([chatter(18000, 1370)], 2, (50000.0, 90000.0)).reason == "no-speed-in-range"


def test_samples_without_a_lobe_in_the_range_count_as_stable() -> None:
    """Tooth passing is 7 to 10 times a frequency, above the fastest lobe of some samples."""
    limits = sample_lobes([200.0], 4, np.geomspace(20_000.0, 30_000.0, 20)).limits
    assert np.all(limits >= 1)
    is_free = np.all(limits == MAX_LOBE_GAIN, axis=1)
    assert 0 < np.count_nonzero(is_free) < len(limits) / 2
    assert np.all(np.min(limits[~is_free], axis=1) == 1)
    found = suggest_speeds([chatter(25_000, 200)], 4, (20_000.0, 30_000.0))
    assert all(math.isfinite(speed.relative_depth) for speed in found.speeds)


def test_thousands_of_waves_between_two_teeth_leave_no_pocket_and_take_no_longer() -> None:
    """One flute at 100 to 300 rpm passes 1000 to 3000 waves of 5000 Hz."""
    limits, frequencies = sample_lobes([5000.0], 1, np.geomspace(100.0, 300.0, 220))
    assert np.all(limits == 1)
    assert np.all(np.abs(np.log(frequencies / 5000)) < math.log(3))
    found = suggest_speeds([chatter(200, 5000)], 1, (100.0, 300.0))
    assert found.speeds[0].relative_depth == pytest.approx(1)


def test_lobes_of_many_waves_count_by_their_lowest_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    speeds = np.geomspace(2400.0, 4800.0, 60)  # 62 to 125 waves
    lobes = sample_lobes([5000.0], 1, speeds)
    monkeypatch.setattr(sampled_lobes, "MAX_WAVES", 1e4)
    exact = sample_lobes([5000.0], 1, speeds)
    assert np.max(np.abs(np.log(lobes.limits / exact.limits))) < math.log(1.2)
    relative, expected = (found.limits / found.limits[:, -1:] for found in (lobes, exact))  # other lowest limits
    is_same = np.isclose(relative, expected, rtol=1e-9)
    is_same[:, -1] = False
    assert np.array_equal(lobes.frequencies[is_same], exact.frequencies[is_same], equal_nan=True)
    assert np.count_nonzero(is_same) > is_same.size / 4


def test_lobes_have_limits_at_all_speeds_between_their_frequencies(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten times as many frequencies give the same pockets."""
    monkeypatch.setattr(sampled_lobes, "N_SAMPLES", 60)
    speeds = np.geomspace(*RANGE, 220)
    few = sample_lobes([1370.0], 2, speeds).limits
    monkeypatch.setattr(sampled_lobes, "N_FREQUENCIES", 10 * sampled_lobes.N_FREQUENCIES + 1)
    many = sample_lobes([1370.0], 2, speeds).limits
    assert np.quantile(np.abs(np.log(few / many)), 0.99) < math.log(1.3)
    deepest = np.max(few, axis=1) / np.max(many, axis=1)
    assert np.quantile(np.abs(np.log(deepest)), 0.9) < math.log(1.2)


def test_without_a_pocket_the_next_cut_is_less_deep() -> None:
    found = suggest_speeds([chatter(18000, 1370)], 2, (14500.0, 19000.0))
    assert found.speeds[0].depth == pytest.approx(0.7e-3)
    assert all(14500 <= speed.speed_rpm <= 19000 for speed in found.speeds)


@pytest.mark.parametrize(
    ("depth", "following"),
    [(1e-3, [1e-3, 0.7e-3, 0.45e-3, 0.3e-3]), (0.1e-3, [0.1e-3, 0.05e-3, 0.035e-3])],  # steps of 0.05 mm, rounded down
)
def test_from_the_second_chatter_on_each_cut_is_less_deep(depth: float, following: list[float]) -> None:
    cuts, depths = [chatter(18000, 1370, depth)], []
    for _ in following:
        best = suggest_speeds(cuts, 2, RANGE).speeds[0]
        cuts.append(chatter(best.speed_rpm, 1370, best.depth))
        depths.append(best.depth)
    assert depths == pytest.approx(following)


def test_a_later_stable_cut_does_not_outweigh_chatter() -> None:
    cuts = [chatter(18000, 1370), HeardCut(18000, "stable", depth=1e-3)]
    found = suggest_speeds(cuts, 2, RANGE)
    assert (found.reason, found.contradicting) == ("", (cuts[1],))


def test_an_unknown_depth_stays_unknown() -> None:
    found = suggest_speeds([HeardCut(18000, "chatter", 1370)], 2, RANGE)
    assert math.isnan(found.speeds[0].depth)


@pytest.mark.parametrize(("teeth", "range_rpm"), [(0, RANGE), (2, (9000.0, 8000.0)), (2, (0.0, 8000.0))])
def test_bad_values_are_rejected(teeth: int, range_rpm: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="teeth="):
        suggest_speeds([chatter(18000, 1370)], teeth, range_rpm)
