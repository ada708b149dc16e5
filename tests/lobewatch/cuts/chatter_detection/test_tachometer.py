"""Tachometer with a cut: used if the spectrum allows it, else contradicted."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.cuts.chatter_detection.cut_evaluation import CutEvaluation, CutRecording, evaluate_recording

RATE, SPEED, TEETH = 25600.0, 12077.0, 4
TURN = SPEED / 60
CUT = slice(round(0.5 * RATE), round(1.7 * RATE))


def sound(lines: list[tuple[float, float]], noise: float = 0.05) -> NDArray[np.float64]:
    """Air, 1.2 s of lines (Hz, m/s^2), air."""
    random, time = np.random.default_rng(0), np.arange(round(2 * RATE)) / RATE
    inside = (time > 0.5) & (time < 1.7)
    cut = sum(loud * np.sin(2 * np.pi * frequency * time + random.uniform(0, 6)) for frequency, loud in lines)
    return np.asarray(random.normal(scale=noise, size=time.size) + inside * cut)


def comb(chatter: float | None = None) -> list[tuple[float, float]]:
    """Tooth passing, run-out, and chatter where it is wanted."""
    lines = [(4 * k * TURN, 20.0 / k) for k in range(1, 12)] + [(k * TURN, 1.0) for k in (2, 3, 5, 6, 7)]
    return lines + ([] if chatter is None else [(chatter + 4 * k * TURN, 30.0 * 0.2**k) for k in range(4)])


def heard(signal: NDArray[np.float64], measured: float | None, commanded: float = 12_000.0) -> CutEvaluation:
    speed = None if measured is None else np.full(signal.size, measured)
    (cut,) = evaluate_recording(CutRecording(signal, RATE, TEETH, 0.5, commanded, measured_rpm=speed))
    return cut


@pytest.mark.parametrize(("chatter", "word"), [(None, "stable"), (1712.3, "chatter")])
def test_a_speed_that_was_set_a_quarter_off_is_mended_by_the_tachometer(chatter: float | None, word: str) -> None:
    signal = sound(comb(chatter))
    assert heard(signal, None, 15_000.0).reason == "speed-not-found"
    followed = heard(signal, 12_078.0, 15_000.0)
    assert followed.verdict == word
    assert followed.speed_rpm == pytest.approx(SPEED, rel=2e-5)
    assert followed.measured_rpm == 12_078.0


@pytest.mark.parametrize("wrong", [2 * SPEED, SPEED / 2, 60 * SPEED, 0.96 * SPEED, 0.75 * SPEED])
@pytest.mark.parametrize("chatter", [None, 1712.3])
def test_what_the_lines_contradict_is_not_followed(wrong: float, chatter: float | None) -> None:
    cut = heard(sound(comb(chatter)), wrong)
    assert (cut.verdict, cut.reason) == ("cannot tell", "tacho-contradicts")
    assert cut.distant_rpm == pytest.approx(SPEED, rel=1e-4)


def test_a_whole_multiple_of_what_was_set_is_pulses_counted_wrong_even_where_the_lines_say_nothing() -> None:
    assert heard(sound([(4 * TURN, 3.0)]), 2 * SPEED).reason == "tacho-contradicts"


def test_where_the_lines_make_no_speed_the_tachometer_is_enough() -> None:
    few = [(4 * TURN, 1.2), (13 * TURN, 0.4), (29 * TURN, 0.2)]
    assert heard(sound(few), None).reason == "speed-not-found"
    cut = heard(sound(few), SPEED)
    assert (cut.verdict, cut.speed_rpm) == ("stable", SPEED)


def test_noise_and_a_pump_that_are_switched_on_are_no_cut_of_a_spindle_that_turns() -> None:
    random = np.random.default_rng(0)
    noise = sound([], 0.05)
    noise[CUT] += random.normal(scale=1.0, size=CUT.stop - CUT.start)
    assert heard(noise, SPEED).reason == "speed-not-found"
    pump = sound([(97.3 * k, 1.0 / k) for k in range(1, 12)])
    assert heard(pump, SPEED).verdict == "cannot tell"


def test_a_tachometer_that_is_silent_in_the_cut_is_none() -> None:
    signal = sound(comb())
    speed = np.full(signal.size, SPEED)
    speed[CUT] = np.nan
    (cut,) = evaluate_recording(CutRecording(signal, RATE, TEETH, 0.5, 12_000.0, measured_rpm=speed))
    assert cut.verdict == "stable"
    assert cut.measured_rpm is not None
    assert np.isnan(cut.measured_rpm)
