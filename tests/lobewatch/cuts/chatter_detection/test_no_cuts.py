"""Recordings without a plain cut: music, two spindles, speed ramps, interrupted cuts, hum, coolant."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.cuts.chatter_detection.cut_evaluation import (
    CutEvaluation,
    CutRecording,
    evaluate_cut,
    evaluate_recording,
)

Floats = NDArray[np.float64]
RATE, TURN, TEETH = 12800.0, 201.2837, 4
SECONDS = 4.0
TIME: Floats = np.arange(round(SECONDS * RATE)) / RATE


def heard_in(signal: Floats, rpm: float = 60 * TURN) -> list[CutEvaluation]:
    return evaluate_recording(CutRecording(signal, RATE, TEETH, 0.5, rpm))


def noise(seed: int, loud: float = 0.05) -> Floats:
    return np.random.default_rng(seed).normal(scale=loud, size=TIME.size)


def teeth(turn: Floats | float = TURN, loud: float = 20.0) -> Floats:
    """Tooth passing of a cut whose spindle turns so fast (Hz), which may change."""
    phase = 2 * np.pi * np.cumsum(np.broadcast_to(np.asarray(turn, np.float64), TIME.shape)) / RATE
    return sum((loud / k * np.sin(TEETH * k * phase + k) for k in range(1, 8)), np.zeros(TIME.size))


def between(begin: float, end: float) -> Floats:
    return np.where((begin <= TIME) & (end > TIME), 1.0, 0.0)


@pytest.mark.parametrize("seed", range(8))
def test_music_is_no_cut(seed: int) -> None:
    """Notes with overtones that change twice a second, after a second of silence."""
    random, music = np.random.default_rng(seed), noise(seed, 1e-3)
    for begin in np.arange(1.0, SECONDS, 0.5):
        for note in random.integers(-12, 24, 4):
            tone = 440 * 2 ** (note / 12)
            waves = sum(np.sin(2 * np.pi * k * tone * TIME) / k for k in range(1, 5))
            music += between(begin, begin + 0.5) * np.exp(2 * (begin - TIME).clip(None, 0)) * waves
    assert {heard.verdict for heard in heard_in(music, random.uniform(4000, 15000))} == {"cannot tell"}


def test_of_two_spindles_that_which_was_set_is_detected_and_the_other_is_no_chatter() -> None:
    """The other cuts all the time, at a speed of its own."""
    (heard,) = heard_in(teeth(157.31, 4.0) + between(1.0, 3.0) * teeth() + noise(1))
    assert heard.verdict == "stable"
    assert heard.speed_rpm == pytest.approx(60 * TURN, rel=1e-4)


@pytest.mark.parametrize("change", [0.03, 0.1, 0.3])
def test_a_speed_that_ramps_is_not_taken_for_one(change: float) -> None:
    """From the speed that was set, over the cut."""
    turn = TURN * (1 + change * np.clip((TIME - 1.0) / 2.0, 0, 1))
    (heard,) = heard_in(between(1.0, 3.0) * teeth(turn) + noise(2))
    assert heard.verdict == "cannot tell"


@pytest.mark.parametrize(("seconds", "pause"), [(0.7, 0.3), (0.6, 0.6)])
def test_interrupted_cuts_are_reported_each(seconds: float, pause: float) -> None:
    begins = np.arange(0.5, SECONDS - seconds, seconds + pause)
    cuts = heard_in(sum(between(begin, begin + seconds) for begin in begins) * teeth() + noise(3))
    assert [heard.parts.begin for heard in cuts] == pytest.approx(list(begins), abs=0.04)
    assert {heard.verdict for heard in cuts} == {"stable"}


def test_a_spindle_that_starts_and_warms_up_is_no_cut() -> None:
    """Standing, then turning: unbalance and its double, a bearing, more noise."""
    turning = (
        3 * np.sin(2 * np.pi * TURN * TIME) + np.sin(4 * np.pi * TURN * TIME) + np.sin(2 * np.pi * 7.13 * TURN * TIME)
    )
    assert {heard.verdict for heard in heard_in(between(1.0, 4.0) * (turning + noise(4, 0.5)) + noise(5))} == {
        "cannot tell"
    }


@pytest.mark.parametrize("mains", [50.0, 60.0])
def test_mains_hum_that_is_switched_on_is_no_cut(mains: float) -> None:
    hum = sum(np.sin(2 * np.pi * k * mains * TIME) / k for k in (1, 2, 3, 4, 5, 7, 9, 11, 13))
    for rpm in (4300.0, 7700.0, 60 * TURN):  # at 3000 or 3600 rpm nobody could tell it from the spindle
        assert {heard.verdict for heard in heard_in(between(1.0, 3.0) * 5 * hum + noise(6), rpm)} == {"cannot tell"}


def test_coolant_that_is_switched_on_is_no_cut_and_hides_none() -> None:
    coolant = between(0.6, 4.0) * noise(7, 0.5)
    assert {heard.verdict for heard in heard_in(coolant + noise(8))} == {"cannot tell"}
    (heard,) = heard_in(coolant + between(1.5, 3.5) * teeth() + noise(8))
    assert heard.verdict == "stable"


def test_a_clipped_cut_is_no_chatter() -> None:
    """Clipping creates multiples of the spindle frequency only; reported clipping is an overload."""
    signal = np.clip(between(1.0, 3.0) * teeth() + noise(9), -12.0, 12.0)
    assert [heard.verdict for heard in heard_in(signal)] == ["stable"]
    clipped = np.abs(signal) >= 12.0
    (heard,) = evaluate_recording(CutRecording(signal, RATE, TEETH, 0.5, 60 * TURN, clipped))
    assert heard.reason == "overload"


def tone(loud: float = 4.0) -> Floats:
    """Return a single tone that no multiple explains."""
    return loud * np.sin(2 * np.pi * 1234.5 * TIME)


def test_a_tone_of_the_shop_that_comes_and_goes_in_air_is_none_of_the_cut() -> None:
    """It sounds in a seventh of the air, and all the time in the cut, as loud."""
    cut, shop = between(2.2, 3.8) * teeth(), (between(0.2, 0.5) + between(2.2, 3.8)) * tone()
    (heard,) = heard_in(cut + shop + noise(10, 1.0))
    assert heard.verdict == "stable"
    (heard,) = heard_in(cut + between(2.2, 3.8) * tone() + noise(10, 1.0))
    assert heard.reason == "unexplained-tone"


def test_a_tone_that_is_far_fainter_in_air_is_of_the_cut() -> None:
    """A fifth of its amplitude is less than a ninth of its power."""
    (heard,) = heard_in(between(2.2, 3.8) * (teeth() + tone()) + between(0.8, 1.3) * tone(4.0 / 5) + noise(11))
    assert heard.reason == "unexplained-tone"


def test_a_spindle_that_slows_down_in_air_explains_no_tone_of_the_cut() -> None:
    """A multiple of it passes the tone, as loud, by 10 % of that a second."""
    late = TIME[TIME < 1.5] - 0.75
    air = noise(12, 1.0)[: late.size] + 4.0 * np.sin(2 * np.pi * (1234.5 * late - 60 * late**2))
    heard = evaluate_cut(teeth() + tone() + noise(13, 1.0), air, RATE, TEETH, 0.5, 60 * TURN)
    assert heard.reason == "unexplained-tone"
