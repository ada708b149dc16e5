"""Passes in a recording that a shop fills with sound: times that are known, other combs, and no false passes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.cuts.chatter_detection.cut_detection import CutParts, trim_overload
from lobewatch.cuts.chatter_detection.cut_evaluation import CutRecording, evaluate_recording
from lobewatch.cuts.chatter_detection.pass_detection import find_cuts_in_shop, find_passes

pytestmark = pytest.mark.quick

Floats = NDArray[np.float64]
RATE, TEETH, TURN, LENGTH = 12800.0, 5, 75.4, 12.0
"""Sample rate (Hz), teeth, true spindle frequency (Hz; set: 75) and length of a recording (s)."""
PASSES = ((2.0, 4.0), (4.6, 6.6), (7.2, 9.2))
TIME = np.arange(round(LENGTH * RATE)) / RATE


def comb(frequency: float, count: int = 10) -> Floats:
    """Harmonics of a frequency with amplitudes that fall slowly, rms about 1."""
    return np.asarray(sum(np.cos(2 * np.pi * k * frequency * TIME + k * k) / np.sqrt(k) for k in range(1, count + 1)))


def between(*times: tuple[float, float]) -> Floats:
    """One between times (s), else zero."""
    return np.asarray(np.sum([(begin <= TIME) & (end > TIME) for begin, end in times], axis=0), dtype=np.float64)


@pytest.fixture(scope="module")
def shop() -> Floats:
    """Noise as loud as a pass, a compressor throughout, and a neighbour's machine that comes and goes."""
    random = np.random.default_rng(5)
    neighbour = between((0.5, 3.0), (5.5, 6.9), (8.5, 11.0)) * comb(433.0)
    return np.asarray(random.normal(size=TIME.size) + 0.3 * comb(26.3) + 0.3 * neighbour)


def cutting(signal: Floats, teeth: int = TEETH) -> Floats:
    return np.asarray(signal + 0.7 * between(*PASSES) * (comb(teeth * TURN) + 0.05 * comb(TURN, 30)))


def test_passes_are_found_by_their_times_in_a_shop_as_loud_as_they_are(shop: Floats) -> None:
    passes = find_passes(cutting(shop), RATE, TEETH, 75.0)
    assert np.array([(parts.begin, parts.end) for parts in passes]) == pytest.approx(np.array(PASSES), abs=0.13)
    for parts in passes:
        air = parts.air.start / RATE, parts.air.stop / RATE
        assert all(air[1] <= begin or air[0] >= end for begin, end in PASSES)
        assert air[1] - air[0] > 0.15


@pytest.mark.parametrize("scale", [1e-3, 40.0])
def test_the_times_do_not_depend_on_the_unit(shop: Floats, scale: float) -> None:
    one, other = (find_passes(signal, RATE, TEETH, 75.0) for signal in (cutting(shop), scale * cutting(shop)))
    assert one == other


def test_other_machines_are_no_passes(shop: Floats) -> None:
    assert find_passes(shop, RATE, TEETH, 75.0) == []
    assert find_passes(cutting(shop), RATE, TEETH, 81.0) == []


def test_each_pass_in_a_shop_is_stable(shop: Floats) -> None:
    heard = evaluate_recording(CutRecording(cutting(shop), RATE, TEETH, 0.3, 60 * 75.0))
    assert [sound.verdict for sound in heard] == ["stable"] * 3
    assert [sound.speed_rpm for sound in heard] == pytest.approx([60 * TURN] * 3, rel=5e-4)


def test_chatter_in_one_pass_of_a_shop_is_heard(shop: Floats) -> None:
    f_c = 1710.0
    lines = sum(2.0 * 0.4 ** abs(k) * np.cos(2 * np.pi * (f_c + k * TEETH * TURN) * TIME) for k in range(-2, 3))
    heard = evaluate_recording(CutRecording(cutting(shop) + between(PASSES[1]) * lines, RATE, TEETH, 0.3, 60 * 75.0))
    assert [sound.verdict for sound in heard] == ["stable", "chatter", "stable"]
    assert heard[1].chatter is not None
    assert heard[1].chatter.frequency == pytest.approx(f_c, abs=0.5)


def test_a_cut_that_loudness_finds_keeps_its_times() -> None:
    random = np.random.default_rng(3)
    signal = 0.05 * random.normal(size=TIME.size) + between((3.0, 5.0)) * comb(TEETH * TURN)
    (parts,) = find_cuts_in_shop(signal, RATE, TEETH, 75.0)
    assert (parts.begin, parts.end) == pytest.approx((3.0, 5.0), abs=0.03)
    assert parts.shop == ()


@pytest.mark.parametrize(
    ("places", "cut"),
    [((), (0, 20_000)), ((2000,), (2641, 20_000)), ((1000, 15_000), (1641, 14_360)), ((6000, 6500), (7141, 20_000))],
)
def test_the_samples_near_an_overload_are_left_out(places: tuple[int, ...], cut: tuple[int, int]) -> None:
    clipped = np.zeros(30_000, dtype=np.bool_)
    clipped[[5000 + place for place in places]] = True
    parts = trim_overload(CutParts("", slice(0, 4000), slice(5000, 25_000)), clipped, RATE)
    assert (parts.cut.start - 5000, parts.cut.stop - 5000) == cut


def test_a_cut_that_is_overloaded_again_and_again_is_kept_whole() -> None:
    clipped = np.arange(30_000) % 2000 == 0
    parts = CutParts("", slice(0, 4000), slice(5000, 25_000))
    assert trim_overload(parts, clipped, RATE) == parts


def test_a_speed_far_from_the_set_one_is_named_in_a_shop_as_notes_of_music_fit_one(shop: Floats) -> None:
    heard = evaluate_recording(CutRecording(cutting(shop), RATE, TEETH, 0.3, 60 * TURN / 1.03))
    assert {sound.reason for sound in heard} == {"speed-not-found"}
    assert [sound.distant_rpm for sound in heard] == pytest.approx([60 * TURN] * 3, rel=5e-4)
