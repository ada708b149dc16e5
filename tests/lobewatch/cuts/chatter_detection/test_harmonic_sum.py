"""Combs of harmonics that are individually below the noise, in synthetic signals."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.cuts.chatter_detection.cut_evaluation import evaluate_cut
from lobewatch.cuts.chatter_detection.peak_classification import find_cut_peaks
from lobewatch.cuts.chatter_detection.spectrum import compute_spectra, find_peaks
from lobewatch.cuts.chatter_detection.spindle_speed import find_speed_of_spectra
from lobewatch.cuts.chatter_detection.tooth_passing_comb import find_comb_by_sum

Floats = NDArray[np.float64]
RATE, SIZE, TURN, TEETH = 3200.0, 6400, 66.65, 4
WEAK = 0.11
"""Amplitude of a sine beside noise of 1 whose power is about ten times that of the noise in the spectrum."""
AIR = 0.1
"""Noise in air."""


def noise(seed: int) -> Floats:
    return np.random.default_rng(seed).normal(size=SIZE)


def air_of(seed: int) -> Floats:
    return AIR * noise(1000 + seed)


def comb(orders: list[int], loud: float = WEAK, turn: float = TURN) -> Floats:
    """Sines at multiples of a turn (Hz), each with a phase of its own."""
    time = np.arange(SIZE) / RATE
    return np.asarray(sum(loud * np.sin(2 * np.pi * k * turn * time + k * k) for k in orders))


def sum_of(cut: Floats, air: Floats, frequency: float = TURN) -> float:
    """Frequency of the comb near one (Hz); NaN without one."""
    spectra, quiet = compute_spectra(cut, RATE), compute_spectra(air, RATE)
    speed = find_comb_by_sum(spectra, quiet, find_cut_peaks(spectra, quiet), TEETH, frequency, 0.05)
    return np.nan if speed is None else speed.frequency


def test_sixteen_weak_multiples_of_which_few_stand_clear_have_one_speed() -> None:
    """0.02 % is less than a bin at the sixteenth; single lines give a speed in less than half of these."""
    speeds, by_lines = [], 0
    for seed in range(20):
        cut = noise(seed) + comb(list(range(1, 17)))
        by_lines += len(find_peaks(compute_spectra(cut, RATE)[0])) > 4
        speeds.append(sum_of(cut, air_of(seed), TURN * 1.03))
    assert by_lines < 10
    assert speeds == pytest.approx([TURN] * 20, rel=2e-4)


def test_find_speed_detects_them_too() -> None:
    spectra, quiet = (compute_spectra(part, RATE) for part in (noise(1) + comb(list(range(1, 17))), air_of(2)))
    speed = find_speed_of_spectra(spectra, quiet, TEETH, TURN * 1.02)
    assert speed is not None
    assert speed.frequency == pytest.approx(TURN, rel=2e-4)


def test_noise_is_no_comb() -> None:
    assert np.all(np.isnan([sum_of(noise(seed), air_of(seed)) for seed in range(100)]))


def test_lines_anywhere_are_no_comb() -> None:
    random = np.random.default_rng(5)
    time = np.arange(SIZE) / RATE
    for seed in range(40):
        tones = np.sum([np.sin(2 * np.pi * f * time) for f in random.uniform(50, 1500, 8)], axis=0)
        assert np.isnan(sum_of(noise(seed) + tones, air_of(seed)))


def test_what_is_as_loud_in_air_does_not_count() -> None:
    heard = comb(list(range(1, 17)), 0.2)
    assert np.isnan(sum_of(noise(1) + heard, air_of(2) + heard))
    assert sum_of(noise(1) + heard, air_of(2) + 0.1 * heard) == pytest.approx(TURN, rel=2e-4)


def test_a_part_of_another_comb_is_none() -> None:
    """Tooth passing of four teeth is on every third multiple of 4 / 3 of the speed: no cutter of four sounds so."""
    heard = comb(list(range(4, 17, 4)), 1.0)
    assert sum_of(noise(3) + heard, air_of(4)) == pytest.approx(TURN, rel=2e-4)
    assert np.isnan(sum_of(noise(3) + heard, air_of(4), TURN * 4 / 3))


def test_weak_side_bands_of_a_line_next_to_a_multiple_are_no_comb() -> None:
    """All 1 Hz above multiples, four turns apart: another speed fits them nearly, and none exactly."""
    time = np.arange(SIZE) / RATE
    bands = np.sum([WEAK * np.sin(2 * np.pi * (k * TURN + 1.0) * time + k) for k in (6, 10, 14)], axis=0)
    assert np.all(np.isnan([sum_of(noise(seed) + bands, air_of(seed)) for seed in range(20)]))


def test_of_weak_multiples_more_are_believed_near_the_speed_that_was_set() -> None:
    weak, believed = comb([3, 4, 8], 0.13), []
    for off in (1.0, 1.03):
        speeds = [
            find_speed_of_spectra(
                compute_spectra(noise(seed) + weak, RATE), compute_spectra(air_of(seed), RATE), TEETH, TURN * off
            )
            for seed in range(20)
        ]
        heard = [speed.frequency for speed in speeds if speed is not None]
        assert heard == pytest.approx([TURN] * len(heard), rel=1e-3)
        believed.append(len(heard))
    assert believed[0] > believed[1] > 0


def test_two_lines_are_no_comb() -> None:
    assert np.isnan(sum_of(noise(3) + comb([4, 5], 1.0), air_of(4)))


def test_a_speed_that_is_set_25_percent_too_low_is_named_and_no_verdict_uses_it() -> None:
    """Order 16 of 3/4 of the speed is order 12, a loud line each: the first two tooth passings would be chatter."""
    cut = noise(7) + comb([4, 8, 12, 16], 1.0) + comb([1, 2, 3, 5, 6, 7, 9, 10, 11])
    heard = evaluate_cut(cut, air_of(8), RATE, TEETH, 0.5, 60 * TURN * 0.75)
    assert (heard.verdict, heard.reason) == ("cannot tell", "speed-not-found")
    assert heard.distant_rpm == pytest.approx(60 * TURN, rel=1e-3)


def test_of_a_cut_that_sounds_as_air_does_the_speed_is_named_and_no_word() -> None:
    heard = comb(list(range(1, 17)), 0.2)
    for air in (air_of(2) + heard, np.empty(0)):
        told = evaluate_cut(noise(1) + heard, air, RATE, TEETH, 0.5, 60 * TURN * 1.01)
        assert (told.verdict, told.reason) == ("cannot tell", "no-air")
        assert told.speed_rpm == pytest.approx(60 * TURN, rel=2e-4)


def test_of_a_cut_that_sounds_as_air_does_a_speed_far_from_the_one_that_was_set_is_named_elsewhere() -> None:
    heard = comb([4, 8, 12, 16], 1.0) + comb([1, 2, 3, 5, 6, 7, 9, 10, 11], 0.2)
    told = evaluate_cut(noise(1) + heard, air_of(2) + heard, RATE, TEETH, 0.5, 60 * TURN * 0.75)
    assert (told.verdict, told.reason) == ("cannot tell", "speed-not-found")
    assert told.distant_rpm == pytest.approx(60 * TURN, rel=1e-3)
