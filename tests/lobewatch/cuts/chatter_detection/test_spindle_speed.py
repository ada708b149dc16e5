"""The true speed among votes, on lines made by hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.cuts.chatter_detection.spectrum import SpectralPeaks, Spectrum, compute_spectra
from lobewatch.cuts.chatter_detection.spindle_speed import (
    choose_common_speed,
    find_speed_by_votes,
    find_speed_of_spectra,
    find_unique_speed,
)
from lobewatch.cuts.chatter_detection.tooth_passing_comb import SpindleSpeed

pytestmark = pytest.mark.quick

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


STRAYS = (317.31, 1093.77, 1531.19, 2713.43, 3391.71, 4177.93, 5519.87, 6120.71, 6607.43, 7213.13, 7789.91)


@pytest.mark.parametrize("off", [-0.015, 0.003, 0.015])
def test_a_speed_with_a_clear_lead_in_votes_is_found_among_strays(off: float) -> None:
    """Two tones of chatter with side bands one tooth apart, among as many strays."""
    chatter = [tone + k * TURN for tone in (1712.3, 1833.7) for k in (-8, -4, 0, 4, 8, 12)]
    speed = find_unique_speed(lines([*chatter, *STRAYS]), BIN, 4, TURN / (1 + off))
    assert speed is not None
    assert speed.frequency == pytest.approx(TURN, rel=1e-5)
    assert find_unique_speed(lines(STRAYS), BIN, 4, TURN / (1 + off)) is None
    assert find_unique_speed(lines([*chatter[:5], *STRAYS]), BIN, 4, TURN / (1 + off)) is None


def test_two_speeds_with_as_many_lines_are_none() -> None:
    comb = [k * TURN for k in range(4, 40, 4)]
    other = [k * 1.01 * TURN for k in range(4, 40, 4)]
    assert find_unique_speed(lines(comb), BIN, 4, TURN) is not None
    assert find_unique_speed(lines([*comb, *other]), BIN, 4, TURN) is None


@pytest.mark.parametrize(("teeth", "is_found"), [(2, True), (3, False), (4, True)])
def test_even_multiples_only_are_no_speed_of_three_teeth(teeth: int, is_found: bool) -> None:
    """Half of a chatter frequency is near the set speed, but three teeth make no even multiples only."""
    speed = find_unique_speed(lines([2 * k * TURN for k in range(1, 9)]), BIN, teeth, TURN)
    assert (speed is not None) is is_found


def spectra_of(*axes: Sequence[tuple[float, float]], seconds: float = 1.0) -> tuple[list[Spectrum], list[Spectrum]]:
    """Spectra of axes of tones (Hz, amplitude) in noise, and of their air."""
    random, time = np.random.default_rng(7), np.arange(round(seconds * RATE)) / RATE
    sounds = [sum(a * np.cos(2 * np.pi * f * time + f) for f, a in axis) for axis in axes]
    noise = 0.02 * random.normal(size=(2, len(axes), time.size))
    return compute_spectra(noise[0] + np.array(sounds), RATE), compute_spectra(noise[1], RATE)


@pytest.mark.parametrize("other", [0.9971, 1.003])
def test_all_axes_together_have_the_speed_of_one_of_them(other: float) -> None:
    """A third axis with the comb of another spindle is louder than two that agree."""
    comb = [(4 * k * TURN, 1.0 / k) for k in range(1, 9)]
    beside = [(4 * k * other * TURN, 3.0 / k**0.5) for k in range(1, 12)]
    spectra, air = spectra_of(comb, [(f * 1.00001, 0.8 * a) for f, a in comb], beside)
    alone = [find_speed_of_spectra([one], [quiet], 4, TURN) for one, quiet in zip(spectra, air, strict=True)]
    together = find_speed_of_spectra(spectra, air, 4, TURN)
    assert together is not None
    assert min(abs(together.frequency / one.frequency - 1) for one in alone if one is not None) < 1e-3


def speed_at(rpm: float, agreeing: int = 5) -> SpindleSpeed:
    return SpindleSpeed(rpm / 60, 1e-3, 1.0, agreeing, 1.0)


@pytest.mark.parametrize(
    ("together", "alone", "chosen"),
    [
        (6980.0, (7000.0, 7001.0), 7000.0),
        (6980.0, (6960.0, 7000.0, 7001.0), 7000.0),
        (7000.0, (6980.0, 7001.0), 7000.0),
        (7000.0, (), 7000.0),
        (None, (7000.0, 7001.0), 7000.0),
        (None, (7000.0, 6960.0), None),
        (None, (), None),
    ],
)
def test_all_axes_together_have_the_speed_of_most_that_agree(
    together: float | None, alone: tuple[float, ...], chosen: float | None
) -> None:
    found = choose_common_speed(None if together is None else speed_at(together), [speed_at(rpm) for rpm in alone])
    assert (None if found is None else found.frequency * 60) == (None if chosen is None else pytest.approx(chosen))
