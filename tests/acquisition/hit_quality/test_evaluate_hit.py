"""The reasons of a verdict: what was found with its figures, the cure, and the limits on either side."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from acquisition import (
    Channel,
    DataError,
    Frf,
    HammeredStructure,
    Hit,
    HitFlags,
    HitVerdict,
    SimulatedSource,
    Trigger,
    average_good_hits,
    capture_hits,
    check_hit,
    compute_cross_spectra,
    estimate_frf,
    evaluate_hit,
)
from acquisition.hit_quality.double_hit import find_force_hole
from acquisition.hits.force_window import window_force

RATE = 25600.0
NOTHING = 1e-32
"""Share of the largest power below which a line has none but for rounding."""
TIME = np.arange(6400) / RATE - 0.02


def hit(*blows: tuple[float, float, float], noise: float = 0.05) -> Hit:
    """Blows of peak (N), start (s) and foot width (s) on a resonant structure."""
    random = np.random.default_rng(3).normal(size=(2, TIME.size))
    force = noise * random[0]
    for peak, start, width in blows:
        inside = (start <= TIME) & (start + width >= TIME)
        force += np.where(inside, peak * np.sin(np.pi * (TIME - start) / width) ** 4, 0.0)
    ringing = np.exp(-300 * TIME) * np.sin(2 * np.pi * 1722 * TIME) * (TIME > 0) * 1000
    return Hit(force, ringing + 0.1 * random[1], RATE, 512)


def coded(one: Hit, force_range: float, response_range: float = 2000.0) -> Hit:
    channels = (Channel("force", 1e-3, 1e-3 * force_range), Channel("acceleration", 1e-3, 1e-3 * response_range))
    codes = [c.encode(s) for c, s in zip(channels, (one.force, one.acceleration), strict=True)]
    return Hit.from_codes(np.stack(codes), channels, RATE, 512)


@pytest.fixture
def hits(tapper: Callable[..., HammeredStructure], channels: tuple[Channel, Channel]) -> list[Hit]:
    return list(capture_hits(SimulatedSource(tapper(), channels, RATE, 80_000), Trigger(20.0, 6400, 512)))


def test_a_good_hit_has_no_reason() -> None:
    assert evaluate_hit(hit((200, 0, 0.6e-3))) == HitVerdict(HitFlags.OK, ())
    assert evaluate_hit(hit((200, 0, 0.6e-3))).text == ""


@pytest.mark.parametrize(("start", "when"), [(12e-3, "12 ms after"), (-8e-3, "8 ms before")])
@pytest.mark.parametrize(("peak", "flags"), [(36, HitFlags.OK), (190, HitFlags.DOUBLE_HIT)])
def test_a_second_touch_is_reported_with_its_time_and_size(
    start: float, when: str, peak: float, flags: HitFlags
) -> None:
    verdict = evaluate_hit(hit((200, 0, 0.6e-3), (peak, start, 0.6e-3)))
    assert verdict.flags == flags
    (told,) = verdict.reasons or verdict.notes
    found = re.fullmatch(rf".*\b{when} .*\((\d+) % .*", told)
    assert found is not None
    assert int(found[1]) == pytest.approx(peak / 2, rel=0.06)


def test_a_touch_below_2_5_percent_is_not_named() -> None:
    assert evaluate_hit(hit((200, 0, 0.6e-3), (4, 12e-3, 0.6e-3))).notes == ()


def test_a_hole_counts_up_to_the_end_of_the_required_band() -> None:
    """Two equal touches cancel at 1 / (2 T): at 250 Hz for 2 ms."""
    double = hit((200, 0, 0.6e-3), (200, 2e-3, 0.6e-3))
    told = re.search(r"at (\d+) Hz", evaluate_hit(double).text)
    assert told is not None
    assert int(told[1]) == pytest.approx(250, rel=0.01)
    assert evaluate_hit(double, band=(20.0, 220.0)).flags == HitFlags.OK
    assert evaluate_hit(double, band=(20.0, 260.0)).flags == HitFlags.DOUBLE_HIT


@pytest.mark.parametrize("delay", [2e-3, 20e-3, 150e-3])
def test_touches_of_nearly_one_size_cancel_first_at_half_a_turn(delay: float) -> None:
    """The least power over the largest is ((1 - r) / (1 + r))^2 of two touches of sizes 1 and r."""
    for ratio, is_deep in ((0.85, True), (0.5, False)):
        double = hit((200, 0, 0.6e-3), (200 * ratio, delay, 0.6e-3), noise=0.01)
        hole = find_force_hole(window_force(double), RATE, 2000.0)
        assert hole == (pytest.approx(1 / (2 * delay), rel=0.05) if is_deep else None)


@pytest.mark.parametrize("delay", [20e-3, 150e-3])
def test_holes_of_touches_far_apart_begin_where_the_pulse_is_low_enough(delay: float) -> None:
    """Two touches of sizes 1 and 0.7: the spectrum P of the pulse is (1.7 / 0.3) / 10 of its largest value there."""
    pulse = np.sin(np.pi * np.arange(0, 0.6e-3, 1e-6) / 0.6e-3) ** 4
    size = np.abs(np.fft.rfft(pulse, 1_000_000)) / np.sum(pulse)  # one line per Hz
    begin = int(np.argmax(size < 0.17 / 0.3))
    hole = find_force_hole(window_force(hit((200, 0, 0.6e-3), (140, delay, 0.6e-3), noise=0.01)), RATE, 1e4)
    assert hole == pytest.approx(begin, abs=1 / delay + 0.02 * begin)


def test_two_peaks_in_one_pulse_leave_a_hole() -> None:
    """At 3 % of the peak between them they are one pulse: 1 / (2 T) = 1000 Hz."""
    verdict = evaluate_hit(hit((200, 0, 0.6e-3), (200, 0.5e-3, 0.6e-3)))
    assert verdict.flags == HitFlags.DOUBLE_HIT
    assert verdict.notes == ()


def test_one_flat_or_narrow_pulse_has_no_hole() -> None:
    """The first lobe of a rectangle, behind its zero at 1 / T, is 13 dB below the largest power."""
    one = hit((200, 0, 0.6e-3))
    for samples in (1, 2, 20, 60):
        force = 0.05 * np.random.default_rng(samples).normal(size=TIME.size)
        force[512 : 512 + samples] = 200.0
        assert HitFlags.DOUBLE_HIT not in check_hit(replace(one, force=force))


def test_a_touch_whose_response_is_cut_off_is_a_double_hit() -> None:
    decay, end = 60.0, TIME[-1]
    for start, share, flags in ((0.12, 0.3, HitFlags.OK), (0.2, 0.3, HitFlags.DOUBLE_HIT), (0.2, 0.02, HitFlags.OK)):
        one = hit((200, 0, 0.6e-3), (200 * share, start, 0.6e-3))
        response = np.zeros(TIME.size)
        for at, size in ((0.0, 1000.0), (start, 1000.0 * share)):
            t = np.maximum(TIME - at, 0)
            response += size * np.exp(-decay * t) * np.sin(2 * np.pi * 400 * t)
        expected = share * np.exp(-decay * (end - start)) > 0.02
        assert bool(flags) == expected
        assert evaluate_hit(replace(one, acceleration=response)).flags & HitFlags.DOUBLE_HIT == flags


def test_a_record_that_begins_inside_the_pulse_has_no_hit() -> None:
    whole = hit((200, 0, 0.6e-3))
    for first, flags in ((514, HitFlags.OK), (520, HitFlags.NO_HIT)):
        cut = Hit(whole.force[first:], whole.acceleration[first:], RATE)
        assert check_hit(cut) == flags


def test_a_touch_before_the_hit_does_not_count_as_noise() -> None:
    assert evaluate_hit(hit((200, 0, 0.6e-3), (60, -12e-3, 0.6e-3))).flags == HitFlags.OK


@pytest.mark.parametrize("width", [1e-3, 2e-3, 4e-3])
@pytest.mark.parametrize("noise", [0.05, 5.0])
def test_one_soft_pulse_is_one(width: float, noise: float) -> None:
    assert evaluate_hit(hit((200, 0, width), noise=noise)).flags == HitFlags.OK


def test_drift_and_hum_are_no_touch_and_hide_none() -> None:
    for second in (0.0, 40.0):
        one = hit((200, 0, 0.6e-3), (second, 15e-3, 0.6e-3))
        wandering = 5 * np.sin(2 * np.pi * 50 * TIME + 1) + 80 * TIME
        verdict = evaluate_hit(replace(one, force=one.force + wandering))
        assert verdict.flags == HitFlags.OK
        assert bool(verdict.notes) == bool(second)


def test_noise_alone_is_no_touch_however_long_the_record() -> None:
    random = np.random.default_rng(5)
    for _ in range(20):
        force = 5 * random.normal(size=65536)
        force[2000:2020] += 200 * np.sin(np.pi * np.arange(20) / 20) ** 2
        verdict = evaluate_hit(Hit(force, random.normal(size=65536), RATE, 1990))
        assert HitFlags.DOUBLE_HIT not in verdict.flags
        assert verdict.notes == ()


def test_strength_is_evaluated_against_the_range() -> None:
    assert evaluate_hit(coded(hit((200, 0, 0.6e-3)), 230)).flags == HitFlags.OK
    hard = evaluate_hit(coded(hit((200, 0, 0.6e-3)), 205))
    assert hard.flags == HitFlags.TOO_HARD
    assert "97% of the range of 205 N" in hard.text
    assert HitFlags.TOO_HARD.cure in hard.text
    soft = evaluate_hit(coded(hit((200, 0, 0.6e-3)), 12_000))
    assert soft.flags == HitFlags.TOO_SOFT
    assert all(figure in soft.text for figure in ("198.1 N", "2%", "12000 N"))
    noisy = evaluate_hit(hit((60, 0, 0.6e-3), noise=5.0))
    assert noisy.flags == HitFlags.TOO_SOFT
    assert "20 times the noise" in noisy.text


@pytest.mark.parametrize(("bits", "range_over_peak"), [(12, 10), (14, 5)])
def test_300_hits_of_few_codes_are_good_though_their_force_has_no_power_at_some_lines(
    tapper: Callable[..., HammeredStructure], bits: int, range_over_peak: float
) -> None:
    force = Channel("force", 2.25e-3, 2.25e-3 * 200 * range_over_peak, bits)
    pair = (force, Channel("acceleration", 1.02e-3, 5.0, bits))
    tapping = tapper(force_range=(200.0, 200.0), force_noise=0.0)
    few_codes = list(capture_hits(SimulatedSource(tapping, pair, RATE, 3_500_000), Trigger(20.0, 6400, 512)))[:300]
    powers = [compute_cross_spectra([one])[0] for one in few_codes]
    assert sum(power.min() < NOTHING * power.max() for power in powers) > 50
    mean = estimate_frf(few_codes[:3])
    flags = [evaluate_hit(one, mean, (500.0, 2000.0)).flags for one in few_codes]
    assert flags == [HitFlags.OK] * 300


def test_a_force_that_begins_20_db_below_its_largest_value_reaches_no_line(hits: list[Hit]) -> None:
    """The second derivative of a bell, as behind a high pass: its spectrum is f^2 at low frequencies."""
    x = (TIME - 0.4e-3) / 0.2e-3
    swinging = replace(hit((200, 0, 0.6e-3)), force=200 * (1 - x**2) * np.exp(-(x**2) / 2))
    assert check_hit(swinging) == HitFlags.OK
    for verdict in (evaluate_hit(swinging, estimate_frf(hits[:3])), evaluate_hit(swinging, band=(500.0, 2000.0))):
        assert verdict.flags == HitFlags.TOO_SOFT
        assert "20 dB" in verdict.text
        assert " 4 Hz" in verdict.text


def test_clipped_is_not_too_hard_as_well() -> None:
    assert evaluate_hit(coded(hit((200, 0, 0.6e-3)), 120)).flags == HitFlags.OVERLOAD_FORCE


def test_overload_is_certain_by_codes_and_inferred_by_shape() -> None:
    loud = hit((200, 0, 2e-3))
    certain = evaluate_hit(coded(loud, 120))
    assert "inferred" not in certain.text
    assert "120 N" in certain.text
    noise = 0.1 * np.random.default_rng(7).normal(size=TIME.size)
    saturated = evaluate_hit(replace(loud, force=np.minimum(loud.force, 120) + noise))
    assert saturated.flags == HitFlags.OVERLOAD_FORCE
    assert "inferred" in saturated.text
    with pytest.raises(DataError, match=r"1 \(overload \(force\)\): .* N .*inferred"):
        average_good_hits([replace(loud, force=np.minimum(loud.force, 120))])


@pytest.mark.parametrize("rest", [0.0, 9.81])
def test_hits_without_any_response_are_not_averaged(rest: float) -> None:
    one = hit((200, 0, 0.6e-3))
    still = replace(one, acceleration=np.full(TIME.size, rest))
    with pytest.raises(DataError, match="constant"):
        average_good_hits([still, still])
    assert average_good_hits([one, still])[0] is not None


def test_lost_scans_are_counted_in_the_reason() -> None:
    verdict = evaluate_hit(replace(hit((200, 0, 0.6e-3)), lost_scans=7))
    assert verdict.text.startswith("7 samples ")


def test_a_band_that_the_force_does_not_reach_is_narrow() -> None:
    """sin^4 of foot width T has |F(f)| ~ 1/(x (1 - x^2) (4 - x^2)) sin(pi x), x = f T: a tenth of F(0) at x = 2.01."""
    one = hit((200, 0, 2e-3), noise=0.001)
    reach = 2.01 / 2e-3
    x = np.array([2.01])
    assert 4 * np.sin(np.pi * x) / (np.pi * x * (1 - x**2) * (4 - x**2)) == pytest.approx(0.163, abs=0.01)
    assert evaluate_hit(one).flags == HitFlags.OK
    assert evaluate_hit(one, band=(100, reach)).flags == HitFlags.OK
    narrow = evaluate_hit(one, band=(100, 1.3 * reach))
    assert narrow.flags == HitFlags.NARROW_BAND
    assert "(-20 dB)" in narrow.text
    assert "1306.5 Hz" in narrow.text


@pytest.mark.parametrize("gain", [-1.0, 0.6, 1.6])
def test_another_spot_or_side_is_inconsistent_with_the_mean(hits: list[Hit], gain: float) -> None:
    mean = estimate_frf(hits[:3])
    assert evaluate_hit(hits[3], mean).flags == HitFlags.OK
    other = replace(hits[3], acceleration=gain * hits[3].acceleration, codes=None, channels=None)
    assert check_hit(other) == HitFlags.OK
    verdict = evaluate_hit(other, mean)
    assert verdict.flags == HitFlags.INCONSISTENT
    assert "mean of 3 hits (limit 30%)" in verdict.text


def test_a_hand_that_is_ten_percent_off_is_consistent(hits: list[Hit]) -> None:
    mean = estimate_frf(hits[:3])
    other = replace(hits[3], acceleration=1.1 * hits[3].acceleration, codes=None, channels=None)
    assert evaluate_hit(other, mean).flags == HitFlags.OK


def test_two_hits_are_no_mean_to_compare_with(hits: list[Hit]) -> None:
    other = replace(hits[3], acceleration=-hits[3].acceleration, codes=None, channels=None)
    assert evaluate_hit(other, estimate_frf(hits[:2])).flags == HitFlags.OK


def test_a_hit_with_another_fault_is_not_called_inconsistent_too(hits: list[Hit]) -> None:
    other = replace(hits[3], acceleration=-hits[3].acceleration, lost_scans=1, codes=None, channels=None)
    assert evaluate_hit(other, estimate_frf(hits[:3])).flags == HitFlags.LOST_SCANS


def test_a_mean_of_another_set_up_is_rejected(hits: list[Hit]) -> None:
    mean = estimate_frf(hits[:3])
    shorter = Frf(mean.frequency[:-1], mean.receptance[:-1], np.ones(mean.frequency.size - 1), 3)
    with pytest.raises(ValueError, match=r"has \d+ lines .*mean \d+ "):
        evaluate_hit(hits[3], shorter)


def test_new_words_are_read_back() -> None:
    flags = HitFlags.TOO_HARD | HitFlags.NARROW_BAND | HitFlags.INCONSISTENT
    assert flags.words == "too hard, narrow band, inconsistent"
    assert HitFlags.from_words(flags.words) == flags


@pytest.mark.parametrize("noise", [0.0, 0.1, 30.0])
def test_a_hit_without_response_is_rejected(noise: float) -> None:
    one = hit((200, 0, 0.6e-3))
    silent = replace(one, acceleration=2.5 + noise * np.random.default_rng(5).normal(size=TIME.size))
    assert HitFlags.NO_RESPONSE in evaluate_hit(silent).flags


@pytest.mark.parametrize("share", [0.005, 0.02, 1.0])
def test_a_weak_response_above_its_noise_is_one(share: float) -> None:
    one = hit((200, 0, 0.6e-3))
    noise = 0.5 * np.random.default_rng(5).normal(size=TIME.size)
    assert HitFlags.NO_RESPONSE not in evaluate_hit(replace(one, acceleration=share * one.acceleration + noise)).flags


def test_noise_without_a_pre_trigger_cannot_be_told_from_a_response() -> None:
    one = hit((200, 0, 0.6e-3))
    noise = np.random.default_rng(5).normal(size=TIME.size - 512)
    assert HitFlags.NO_RESPONSE not in check_hit(replace(one, force=one.force[512:], acceleration=noise, pre_trigger=0))
