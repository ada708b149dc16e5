"""Pitches that tool makers grind: what they sum to, how uneven they are, where the closed form has the best."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lobes import Cut, PitchPattern, equal_pitch, half_wave_deg, pitch_patterns, with_pitch_pattern, zero_order_lobes
from lobes.pitch_patterns import MAX_EDGE_IMBALANCE, MAX_PITCH_DEVIATION
from lobes.tooth_force import mean_regeneration
from modal import Mode

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("teeth", [2, 3, 4, 5, 6, 7, 8, 12])
@pytest.mark.parametrize("half_wave", [1.3, 12.0])
def test_patterns_are_cutters_within_what_chips_and_balance_allow(teeth: int, half_wave: float) -> None:
    patterns = list(pitch_patterns(teeth, half_wave))
    assert patterns
    for pattern in patterns:
        cut = with_pitch_pattern(Cut(teeth, 1.0, "up", 1e9, 3e8), pattern)
        assert len(cut.pitch) == teeth
        assert sum(pattern.pitch_deg) == pytest.approx(360, abs=1e-9)
        assert (
            1 - MAX_PITCH_DEVIATION
            <= pattern.feed_ratio_range[0]
            < 1
            < pattern.feed_ratio_range[1]
            <= 1 + MAX_PITCH_DEVIATION
        )
        assert pattern.imbalance <= MAX_EDGE_IMBALANCE
    assert len(set(patterns)) == len(patterns)


def test_kinds_are_all_that_repeat_in_a_turn() -> None:
    names = {teeth: list(dict.fromkeys(p.name for p in pitch_patterns(teeth, 12.0))) for teeth in (2, 3, 4, 6)}
    assert names == {
        2: ["alternating"],
        3: ["linear"],
        4: ["alternating", "linear"],
        6: ["alternating", "linear, 2 times", "linear"],
    }
    repeats = {
        p.name: with_pitch_pattern(Cut(6, 1.0, "up", 1e9, 3e8), p).repeats_per_turn for p in pitch_patterns(6, 12.0)
    }
    assert repeats == {"alternating": 3, "linear, 2 times": 2, "linear": 1}


def test_chips_and_balance_are_those_of_the_edges() -> None:
    pattern = PitchPattern((84.0, 96.0, 84.0, 96.0), "alternating")
    assert pattern.feed_ratio_range == pytest.approx((84 / 90, 96 / 90))
    assert pattern.imbalance == pytest.approx(0, abs=1e-12)
    edges = np.radians([0, 110, 240])  # 110, 130, 120 degrees apart
    away = math.hypot(np.mean(np.cos(edges)), np.mean(np.sin(edges)))
    assert PitchPattern((110.0, 130.0, 120.0), "").imbalance == pytest.approx(away)
    assert equal_pitch(5).imbalance == pytest.approx(0, abs=1e-12)


def test_half_a_wave_between_neighbours_cancels_what_they_regenerate() -> None:
    """Budak's closed form: of an even number of teeth the sum of exp(-i w tau) vanishes."""
    speed, chatter = 6000.0, 1500.0
    difference = half_wave_deg(speed, chatter)
    assert difference == pytest.approx(12)
    pitch = tuple(np.radians(90 + difference * np.array([-1.5, -0.5, 0.5, 1.5])))
    cut = Cut(4, 1.0, "up", 1e9, 3e8, pitch=pitch)
    regenerated = mean_regeneration(cut, np.array([chatter / (4 * speed / 60)]))
    assert regenerated == pytest.approx([1 + 0j], abs=1e-9)


@pytest.mark.parametrize("speed", [4000.0, 6000.0, 9000.0])
def test_half_a_wave_is_worth_a_multiple_of_the_lowest_limit(speed: float) -> None:
    """By zero order, in one direction, where the limit of equal teeth is lowest; a quarter of a wave gains half."""
    mode, cut = Mode(1500.0, 0.03, 20e6), Cut(4, 1.0, "up", 1e9, 3e8)
    equal = zero_order_lobes([mode], None, cut, np.linspace(0.9, 1.1, 201) * speed)
    lowest = int(np.argmin(equal.depth))
    worst, chatter = float(equal.speed_rpm[lowest]), float(equal.chatter_frequency[lowest])
    half_wave, gains = half_wave_deg(worst, chatter), []
    for difference in (half_wave / 2, half_wave):
        pattern = PitchPattern((90 - difference / 2, 90 + difference / 2) * 2, "alternating")
        gains.append(
            zero_order_lobes([mode], None, with_pitch_pattern(cut, pattern), [worst]).depth[0] / equal.depth[lowest]
        )
    assert gains[0] == pytest.approx(1.47, abs=0.03)
    assert gains[1] > 5


@pytest.mark.parametrize("teeth", [0, 1])
def test_one_tooth_has_no_pitch(teeth: int) -> None:
    with pytest.raises(ValueError, match=f"teeth={teeth} .*2 flutes"):
        list(pitch_patterns(teeth, 12.0))
