"""Combs among lines made by hand, and the speed of cuts whose spindle wavers."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.cuts.chatter_detection.spectrum import SpectralPeaks, compute_spectra, fold_frequency, remove_skirts
from lobewatch.cuts.chatter_detection.spindle_speed import find_speed_of_spectra
from lobewatch.cuts.chatter_detection.tooth_passing_comb import find_comb

Floats = NDArray[np.float64]
RATE, BIN, TURN = 25600.0, 0.8, 201.2837


def lines(frequencies: Floats | list[float], loud: float = 1.0) -> SpectralPeaks:
    frequency = np.array(frequencies)
    return SpectralPeaks(frequency, np.full(frequency.size, loud), np.full(frequency.size, 1e4))


def comb_of(frequencies: Floats | list[float], off: float = 0.0, around: float = 0.05, rate: float = RATE) -> float:
    """Frequency that is found (Hz), with the speed set so far off; NaN without one."""
    comb = find_comb(lines(frequencies), BIN, rate, 4, TURN / (1 + off), around)
    return np.nan if comb is None else comb.frequency


@pytest.mark.parametrize("off", [-0.049, -0.02, 0.0, 0.013, 0.049])
def test_a_comb_is_found_up_to_5_percent_from_the_speed_that_was_set(off: float) -> None:
    assert comb_of([k * TURN for k in (4, 5, 8, 12)], off) == pytest.approx(TURN, rel=1e-9)


def test_a_comb_further_away_is_none() -> None:
    assert np.isnan(comb_of([k * TURN for k in (4, 5, 8, 12)], 0.055))


def test_three_multiples_are_a_comb_and_two_are_none() -> None:
    """Multiples of tooth passing; three multiples of the spindle frequency may be chance."""
    assert comb_of([k * TURN for k in (4, 8, 12)]) == pytest.approx(TURN, rel=1e-9)
    assert np.isnan(comb_of([k * TURN for k in (3, 8, 13)]))
    assert np.isnan(comb_of([k * TURN for k in (4, 8)]))


def test_lines_anywhere_are_no_comb() -> None:
    """None in 200 sets of 12 random peaks: a comb by chance is rarer than one in ten thousand."""
    random = np.random.default_rng(3)
    assert all(np.isnan(comb_of(random.uniform(200, 9000, 12))) for _ in range(200))


def test_multiples_that_a_slow_sample_rate_folds_back_are_a_comb_too() -> None:
    """At 1650 Hz: 201, 403, 604 and 805 Hz are in band, 1208 and 1610 Hz alias to 442 and 40 Hz."""
    rate, orders = 1650.0, np.array([3, 4, 5, 6, 9])
    heard = fold_frequency(orders * TURN, rate)
    assert comb_of(heard, rate=rate) == pytest.approx(TURN, rel=1e-6)
    assert np.isnan(comb_of(heard))


def test_of_two_combs_that_which_explains_more_lines_is_taken() -> None:
    near = 1.003 * TURN
    both = [k * TURN for k in (4, 8, 12, 16, 20)] + [k * near for k in (5, 9, 13)]
    assert comb_of(both) == pytest.approx(TURN, rel=1e-6)


def test_the_slope_of_a_loud_line_is_no_line() -> None:
    heard = SpectralPeaks(
        np.array([800.0, 802.4, 797.0, 809.0, 1600.0]), np.array([10.0, 2.0, 4.0, 2.0, 2.0]), np.full(5, 1e4)
    )
    assert remove_skirts(heard, BIN).frequency.tolist() == [800.0, 797.0, 809.0, 1600.0]


def swelling(random: np.random.Generator, rate: float, turn: float) -> Floats:
    """Simulate a cut on a slow sensor: tooth passing of four teeth and its double, swelling and fading.

    2 s; turn in Hz.
    """
    size = round(2.0 * rate)
    cut = random.normal(scale=0.05, size=size)
    for order, loud in ((4, 20.0), (8, 14.0), (12, 0.6), (5, 0.3)):
        slow = np.convolve(random.normal(size=size + 400), np.hanning(401), "valid")
        cut += loud * (1 + 0.2 * slow / np.std(slow)) * np.sin(2 * np.pi * order * turn * np.arange(size) / rate)
    return cut


def test_the_slopes_of_two_strong_lines_are_no_spindle() -> None:
    """Distances of all peaks would miss 8 of 30 cuts."""
    rate, turn = 1650.0, 66.65
    speeds = []
    for seed in range(30):
        random = np.random.default_rng(seed)
        cut = swelling(random, rate, turn)
        air = random.normal(scale=0.05, size=cut.size)
        spectra, quiet = (compute_spectra(part, rate) for part in (cut, air))
        speeds.append(find_speed_of_spectra(spectra, quiet, 4, 4000.0 / 60))
    away = np.array([abs(speed.frequency / turn - 1) for speed in speeds if speed is not None])
    assert np.all(away < 1e-3)
    assert away.size >= 24
