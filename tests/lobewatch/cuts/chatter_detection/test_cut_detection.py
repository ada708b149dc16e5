"""Parts of a recording: noise that gets louder at times that are known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.cuts.chatter_detection.cut_detection import CutParts, find_cuts

pytestmark = pytest.mark.quick

Floats = NDArray[np.float64]
RATE, TURN = 25600.0, 0.005
PIECE = 0.02
"""Half of the length of the pieces that are compared (s)."""


def recording(length: float, *loud: tuple[float, float], power: float = 4.0, low: float = 0.0) -> Floats:
    """Noise over a length (s) with so many times the power between times (s); low: amplitude of an added 60 Hz tone."""
    random, time = np.random.default_rng(11), np.arange(round(length * RATE)) / RATE
    scale = np.ones(time.size)
    for begin, end in loud:
        scale[(time >= begin) & (time < end)] = np.sqrt(power)
    return scale * (random.normal(size=time.size) + low * np.sin(2 * np.pi * 60 * time))


def parts_of(signal: Floats, turn: float = TURN) -> CutParts:
    (parts,) = find_cuts(signal, RATE, turn)
    return parts


@pytest.mark.parametrize(("begin", "end"), [(0.5, 1.3), (0.2, 1.0), (1.1, 1.7)])
def test_a_cut_is_between_its_times_and_is_listened_to_from_a_tenth_of_a_second_on(begin: float, end: float) -> None:
    parts = parts_of(recording(2.0, (begin, end)))
    assert parts.reason == ""
    assert parts.begin == pytest.approx(begin, abs=PIECE)
    assert parts.end == pytest.approx(end, abs=PIECE)
    assert parts.cut.start / RATE == pytest.approx(begin + 0.1 + PIECE, abs=PIECE)
    assert end - 3 * PIECE < parts.cut.stop / RATE < end
    air = parts.air.start / RATE, parts.air.stop / RATE
    wanted = (0.0, begin) if begin > 2.0 - end else (end, 2.0)
    assert air == pytest.approx(wanted, abs=2 * PIECE)
    assert air[1] <= begin or air[0] >= end


def test_of_a_long_cut_its_last_two_seconds_are_listened_to() -> None:
    parts = parts_of(recording(5.0, (0.5, 4.5)))
    assert (parts.cut.stop - parts.cut.start) / RATE == 2.0
    assert parts.cut.stop / RATE == pytest.approx(4.45, abs=PIECE)


@pytest.mark.parametrize(("power", "reason"), [(1.3, "no-cut"), (2.2, "")])
def test_a_cut_is_louder_than_air_by_a_fifth_of_a_decade(power: float, reason: str) -> None:
    assert parts_of(recording(2.0, (0.5, 1.5), power=power)).reason == reason


@pytest.mark.parametrize(("length", "reason"), [(0.1, "no-cut"), (0.25, "too-short"), (0.4, "too-short"), (0.7, "")])
def test_what_is_short_is_a_knock_or_too_short_to_be_classified(length: float, reason: str) -> None:
    assert parts_of(recording(2.0, (0.6, 0.6 + length))).reason == reason


@pytest.mark.parametrize(("length", "reason"), [(0.53, "too-short"), (0.6, "no-cut")])
def test_a_recording_has_air_and_cut_at_least(length: float, reason: str) -> None:
    assert parts_of(recording(length)).reason == reason


@pytest.mark.parametrize(("turn", "reason"), [(0.06, "no-cut"), (0.08, "too-short")])
def test_pieces_hold_two_turns_and_a_recording_four_pieces(turn: float, reason: str) -> None:
    assert parts_of(recording(0.6), turn).reason == reason


@pytest.mark.parametrize(("pause", "times"), [(0.1, [(0.5, 2.2)]), (0.25, [(0.5, 1.2), (1.45, 2.2)])])
def test_a_short_pause_belongs_to_a_cut_and_a_long_one_makes_two(
    pause: float, times: list[tuple[float, float]]
) -> None:
    cuts = find_cuts(recording(3.0, (0.5, 1.2), (1.2 + pause, 2.2)), RATE, TURN)
    heard = np.array([(parts.begin, parts.end) for parts in cuts])
    assert heard == pytest.approx(np.array(times), abs=PIECE)
    assert [parts.reason for parts in cuts] == [""] * len(times)


def test_what_is_too_short_next_to_a_cut_is_none() -> None:
    """A chip, an edge that rubs on its way out."""
    parts = parts_of(recording(4.0, (0.5, 2.5), (3.0, 3.3)))
    assert parts.end == pytest.approx(2.5, abs=PIECE)
    parts = parts_of(recording(8.0, (0.5, 5.0), (6.0, 6.7)))
    assert parts.end == pytest.approx(5.0, abs=PIECE)
    parts = parts_of(recording(8.0, (1.0, 1.5), (2.5, 7.0)))
    assert parts.reason == ""
    assert (parts.begin, parts.end) == pytest.approx((2.5, 7.0), abs=PIECE)


def test_air_that_gets_a_little_louder_is_no_cut_next_to_one_that_is_far_louder() -> None:
    """Fans and pumps add 4 dB when they start and stop; the cut is 30 dB louder."""
    signal = recording(8.0, (3.0, 5.0), power=1000.0)
    signal[round(6.0 * RATE) :] *= np.sqrt(2.5)
    parts = parts_of(signal)
    assert (parts.begin, parts.end) == pytest.approx((3.0, 5.0), abs=PIECE)


def test_an_entry_that_is_louder_than_the_cut_is_none_of_its_own() -> None:
    """An impact of half a second, ten times the power of the steady part, before 3 s that are 16 times that of air."""
    signal = recording(5.0, (1.0, 4.5), power=16.0)
    signal[round(1.0 * RATE) : round(1.5 * RATE)] *= np.sqrt(10)
    parts = parts_of(signal)
    assert (parts.begin, parts.end) == pytest.approx((1.0, 4.5), abs=PIECE)
    assert parts.steady_begin == pytest.approx(1.55, abs=3 * PIECE)
    assert parts.steady_end == pytest.approx(4.5, abs=3 * PIECE)


def test_silence_of_the_file_is_no_air() -> None:
    signal = np.concatenate([np.zeros(round(2 * RATE)), recording(3.0, (1.0, 2.5))])
    parts = parts_of(signal)
    assert (parts.begin, parts.end) == pytest.approx((3.0, 4.5), abs=PIECE)
    assert parts.air.start / RATE == pytest.approx(2.0, abs=2 * PIECE)


def test_several_axes_have_the_cut_of_the_one_that_detects_it() -> None:
    deaf, clear = recording(3.0), recording(3.0, (1.0, 2.0))
    (parts,) = find_cuts(np.stack([deaf, clear]), RATE, TURN)
    assert (parts.begin, parts.end) == pytest.approx((1.0, 2.0), abs=PIECE)


@pytest.mark.parametrize(("air", "reason"), [(0.12, "no-air"), (0.3, "")])
def test_a_cut_needs_air_next_to_it(air: float, reason: str) -> None:
    parts = parts_of(recording(1.5 + air, (air, 1.5 + air)))
    assert parts.reason == reason


def test_air_may_be_a_twentieth_of_a_recording_and_anywhere_in_it() -> None:
    for loud in (((0.2, 4.0),), ((0.0, 3.8),)):
        assert parts_of(recording(4.0, *loud)).reason == ""


def test_what_is_below_100_hz_makes_no_cut() -> None:
    """A floor that shakes 20 times as hard for a second, at 60 Hz; at 200 Hz it would be detected."""
    time = np.arange(round(2.0 * RATE)) / RATE
    for frequency, reason in ((60.0, "no-cut"), (200.0, "")):
        shake = np.where((time > 0.5) & (time < 1.5), 5.0 * np.sin(2 * np.pi * frequency * time), 0.0)
        assert parts_of(recording(2.0) + shake).reason == reason


@pytest.mark.parametrize(("peak", "reason"), [(9.0, ""), (16.0, "knock")])
def test_a_piece_with_four_times_the_peak_of_those_around_is_a_knock(peak: float, reason: str) -> None:
    """Peaks of the tones in a cut are 3, so that 12 is four times as much."""
    time = np.arange(round(2.0 * RATE)) / RATE
    cut = np.where((time > 0.5) & (time < 1.5), 3.0 * np.sin(2 * np.pi * 1000 * time), 0.0)
    signal = cut + np.random.default_rng(1).normal(scale=0.01, size=time.size)
    signal[round(1.0 * RATE)] = peak
    assert parts_of(signal).reason == reason


def test_a_cut_of_one_loud_tone_in_air_that_rushes_louder_than_it_is_found_by_its_power() -> None:
    """Simulate a microphone: broadband loudness would take air for the cut."""
    random, time = np.random.default_rng(0), np.arange(round(5 * RATE)) / RATE
    inside = (time >= 1.0) & (time < 4.0)
    signal = random.normal(size=time.size) * np.where(inside, 0.3, 1.0) + inside * 12 * np.sin(2 * np.pi * 900 * time)
    parts = parts_of(signal)
    assert parts.reason == ""
    assert (parts.begin, parts.end) == pytest.approx((1.0, 4.0), abs=PIECE)
