"""The true speed among votes, on lines made by hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.cuts.chatter_detection.spectrum import SpectralPeaks, Spectrum
from lobewatch.cuts.chatter_detection.spindle_speed import find_speed_by_votes

RATE, BIN, TURN = 25600.0, 0.8, 201.2837
EMPTY: NDArray[np.float64] = np.zeros(0)
SPECTRUM = Spectrum(EMPTY, EMPTY, EMPTY, BIN, RATE)


def lines(frequencies: Sequence[float], clearness: float = 1e4) -> SpectralPeaks:
    frequency = np.array(frequencies)
    return SpectralPeaks(frequency, np.linspace(2.0, 1.0, frequency.size), np.full(frequency.size, clearness))


def speed_of(frequencies: Sequence[float], commanded: float) -> float:
    """Find the frequency of a cutter with four teeth (Hz), or NaN."""
    cut = lines(frequencies)
    speed = find_speed_by_votes(cut, cut, SPECTRUM, 4, commanded)
    return np.nan if speed is None else speed.frequency


COMB = [k * TURN for k in (4, 5, 8, 9, 12, 16)]


@pytest.mark.parametrize("off", [-0.0205, -0.013, -0.002, 0.0, 0.007, 0.0205])
def test_a_comb_has_one_speed_up_to_2_1_percent_from_the_one_that_was_set(off: float) -> None:
    assert speed_of(COMB, TURN / (1 + off)) == pytest.approx(TURN, rel=1e-9)


@pytest.mark.parametrize("off", [-0.023, 0.023])
def test_a_speed_further_away_is_not_looked_for(off: float) -> None:
    assert speed_of(COMB, TURN / (1 + off)) != pytest.approx(TURN, rel=1e-4)


@pytest.mark.parametrize("off", [-0.015, 0.004, 0.015])
def test_chatter_alone_has_the_speed_of_its_side_bands(off: float) -> None:
    chatter = [1712.3 + k * TURN for k in range(-4, 5)]
    assert speed_of(chatter, TURN / (1 + off)) == pytest.approx(TURN, rel=1e-9)


def test_three_lines_must_agree_beyond_the_one_that_the_speed_follows_from() -> None:
    four = [4 * TURN, 8 * TURN, 12 * TURN, 16 * TURN]
    assert speed_of(four, TURN * 1.001) == pytest.approx(TURN, rel=1e-9)
    assert np.isnan(speed_of(four[:3], TURN * 1.001))
    assert np.isnan(speed_of(four[:1], TURN))


@pytest.mark.parametrize(("strays", "is_found"), [(5, True), (7, False)])
def test_half_of_the_lines_must_belong_to_the_lattice(strays: int, is_found: bool) -> None:
    beside = [317.31, 1093.77, 1531.19, 2713.43, 3391.71, 4177.93, 5519.87][:strays]
    found = speed_of([*COMB, *beside], TURN * 1.003)
    assert (found == pytest.approx(TURN, rel=1e-6)) is is_found


def test_lines_must_have_another_one_or_two_turns_or_teeth_away() -> None:
    """Multiples 4, 7, 18, 31 and 45 fit any of the speeds near, and none has a neighbour; 4, 8, 9, 13 and 21 have."""
    assert np.isnan(speed_of([k * TURN for k in (4, 7, 18, 31, 45)], TURN * 1.002))
    assert speed_of([k * TURN for k in (4, 8, 9, 13, 21)], TURN * 1.002) == pytest.approx(TURN, rel=1e-9)
    assert speed_of([k * TURN for k in (3, 5, 20, 28)], TURN * 1.002) == pytest.approx(TURN, rel=1e-9)
