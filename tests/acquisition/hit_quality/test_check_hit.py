"""Verdicts on hits whose faults are known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Channel, DataError, HammeredStructure, Hit, HitFlags, average_good_hits, check_hit, read_hits
from acquisition.hit_fault import HIT_FAULTS

RATE = 25600.0
TIME = np.arange(6400) / RATE - 0.02


def hit(force: NDArray[np.float64], response: NDArray[np.float64] | None = None, **more: object) -> Hit:
    ringing = np.exp(-300 * TIME) * np.sin(2 * np.pi * 1722 * TIME) * (TIME > 0) * 1000
    noise = np.random.default_rng(0).normal(size=(2, TIME.size))
    return Hit(
        force + 0.05 * noise[0],
        (ringing if response is None else response) + 0.1 * noise[1],
        RATE,
        512,
        **more,  # type: ignore[arg-type]
    )


def pulse(peak: float, start: float = 0.0, width: float = 0.6e-3) -> NDArray[np.float64]:
    inside = (start <= TIME) & (start + width >= TIME)
    return np.where(inside, peak * np.sin(np.pi * (TIME - start) / width) ** 2, 0.0)


@pytest.mark.quick
@pytest.mark.parametrize("width", [0.3e-3, 0.6e-3, 1e-3, 4e-3])
def test_single_hits_hard_or_soft_tipped_are_good(width: float) -> None:
    assert check_hit(hit(pulse(200, width=width))) == HitFlags.OK


@pytest.mark.parametrize(("gap", "share"), [(1.2e-3, 1.0), (3e-3, 0.9), (12e-3, 1.1), (60e-3, 0.9)])
def test_equal_contacts_are_a_double_hit(gap: float, share: float) -> None:
    assert check_hit(hit(pulse(200) + pulse(200 * share, gap))) == HitFlags.DOUBLE_HIT


@pytest.mark.parametrize("share", [0.02, 0.05, 0.18, 0.4])
@pytest.mark.parametrize("gap", [1.2e-3, 3e-3, 12e-3])
def test_a_lower_contact_that_leaves_force_at_all_lines_is_let_pass(gap: float, share: float) -> None:
    assert check_hit(hit(pulse(200) + pulse(200 * share, gap))) == HitFlags.OK


def test_small_hit_in_noise_is_too_soft_and_silence_is_no_hit() -> None:
    assert HitFlags.TOO_SOFT in check_hit(hit(pulse(0.6)))
    assert check_hit(hit(pulse(0.0))) & (HitFlags.NO_HIT | HitFlags.TOO_SOFT)


def test_a_response_that_is_cut_off_is_not_decayed() -> None:
    slow = np.exp(-2 * TIME) * np.sin(2 * np.pi * 400 * TIME) * (TIME > 0) * 100
    assert check_hit(hit(pulse(200), slow)) == HitFlags.NOT_DECAYED


def test_lost_scans_are_reported() -> None:
    assert check_hit(hit(pulse(200), lost_scans=3)) == HitFlags.LOST_SCANS


def test_swapped_cables_are_reported() -> None:
    right = hit(pulse(200))
    assert check_hit(Hit(right.acceleration, right.force, RATE, 512)) == HitFlags.SWAPPED_CHANNELS


@pytest.mark.parametrize("delay", [0, 60, 400])
def test_swapped_cables_are_named_though_the_hammer_rings_or_hits_twice(delay: int) -> None:
    right = hit(pulse(200))
    ringing = 30 * np.exp(-800 * TIME) * np.sin(2 * np.pi * 4000 * TIME) * (TIME > 0)
    force, response = (
        signal + 0.9 * np.roll(signal, delay) * bool(delay) for signal in (right.force + ringing, right.acceleration)
    )
    assert HitFlags.SWAPPED_CHANNELS in check_hit(Hit(response, force, RATE, 512))
    assert HitFlags.SWAPPED_CHANNELS not in check_hit(Hit(force, response, RATE, 512))


def test_a_missing_response_to_a_long_pulse_is_a_soft_tip() -> None:
    noise = np.random.default_rng(1).normal(size=(2, TIME.size))
    long, short = (200 * np.where((TIME >= 0) & (w >= TIME), np.sin(np.pi * TIME / w) ** 2, 0.0) for w in (6e-3, 1e-3))
    flags = [check_hit(Hit(force + 0.1 * noise[0], noise[1], RATE, 512)) for force in (long, short)]
    assert flags == [HitFlags.NARROW_BAND, HitFlags.NO_RESPONSE]


@pytest.mark.parametrize("sign", [1, -1])
def test_rails_of_the_converter_make_an_overload(channels: tuple[Channel, Channel], sign: int) -> None:
    force, response = channels
    good = hit(pulse(200))
    codes = np.stack([force.encode(good.force), response.encode(sign * 20 * good.acceleration)])
    assert check_hit(Hit.from_codes(codes, channels, RATE, 512)) == HitFlags.OVERLOAD_RESPONSE
    codes = np.stack([force.encode(sign * 20 * good.force), response.encode(good.acceleration)])
    assert HitFlags.OVERLOAD_FORCE in check_hit(Hit.from_codes(codes, channels, RATE, 512))


def test_clipping_with_noise_on_top_is_found_by_the_codes(channels: tuple[Channel, Channel]) -> None:
    force, response = channels
    good = hit(pulse(200))
    loud = 20 * good.acceleration + np.random.default_rng(1).normal(size=TIME.size)
    codes = np.stack([force.encode(good.force), response.encode(loud)])
    assert check_hit(Hit.from_codes(codes, channels, RATE, 512)) == HitFlags.OVERLOAD_RESPONSE


@pytest.mark.parametrize("bits", [12, 13, 14, 16])
def test_rails_of_a_converter_of_fewer_bits_are_those_of_its_codes(
    channels: tuple[Channel, Channel], bits: int
) -> None:
    """50 responses cut off at 98 % of their peak, and the same on twice the range: words whose lower bits are 0."""
    random = np.random.default_rng(bits)
    force, caught = pulse(200), 0
    for _ in range(50):
        slow = np.sin(2 * np.pi * random.uniform(200, 500) * TIME) * np.exp(-60 * TIME) * (TIME > 0) * 100
        good = hit(force, slow)
        top = float(np.abs(good.acceleration).max())
        for scale in (0.98, 2.0):
            pair = channels[0], replace(channels[1], full_scale=scale * top * abs(channels[1].sensitivity))
            coarse = [replace(channel, adc_bits=bits) for channel in pair]
            signals = zip(coarse, (good.force, good.acceleration), strict=True)
            codes = np.stack([channel.encode(signal) << 16 - bits for channel, signal in signals])
            flags = check_hit(Hit.from_codes(codes, pair, RATE, 512))
            assert flags in (HitFlags.OK, HitFlags.OVERLOAD_RESPONSE)
            assert scale < 1 or not flags
            caught += bool(flags)
    assert caught >= 49


def test_two_samples_at_a_rail_are_no_overload(channels: tuple[Channel, Channel]) -> None:
    good = hit(pulse(200))
    codes = np.stack([c.encode(s) for c, s in zip(channels, (good.force, good.acceleration), strict=True)])
    codes[1, 600:602] = 32767
    assert check_hit(Hit.from_codes(codes, channels, RATE, 512)) == HitFlags.OK


def test_faults_of_the_tapper_are_found(
    tapper: Callable[..., HammeredStructure], channels: tuple[Channel, Channel]
) -> None:
    for fault, expected in (("double_hits", HitFlags.DOUBLE_HIT), ("overloads", HitFlags.OVERLOAD_FORCE)):
        signal = tapper(interval_range=(0.1, 0.1001), **{fault: 1.0})(0, 9000)
        codes = np.stack([c.encode(s) for c, s in zip(channels, signal, strict=True)])
        verdict = check_hit(Hit.from_codes(codes[:, 2048 : 2048 + 2400], channels, RATE, 512))
        assert expected in verdict


def test_real_clean_hit_is_good_and_real_clipped_hit_is_rejected(beam: Path, clipped_beam: Path) -> None:
    assert check_hit(read_hits(beam)[0]) == HitFlags.OK
    (clipped,) = read_hits(clipped_beam)
    assert check_hit(clipped) == HitFlags.OVERLOAD_RESPONSE
    with pytest.raises(DataError, match=r"overload \(response\).*inferred"):
        average_good_hits([clipped])


def test_flags_print_as_words_with_the_cure() -> None:
    both = HitFlags.DOUBLE_HIT | HitFlags.OVERLOAD_FORCE
    assert both.words == "double hit, overload (force)"
    assert HIT_FAULTS[HitFlags.DOUBLE_HIT].remedy in str(both)
    assert HitFlags.from_words(both.words) == both
    assert not HitFlags.from_words(HitFlags.OK.words)
    with pytest.raises(ValueError, match=r"'bad luck' .*double hit"):
        HitFlags.from_words("bad luck")


@pytest.mark.parametrize(
    ("broken", "flaw"), [(np.nan, "not finite"), (np.inf, "not finite"), (-1e60, r"larger than 1e\+50")]
)
def test_a_record_with_nan_or_inf_or_what_no_sensor_measures_is_rejected(broken: float, flaw: str) -> None:
    force = pulse(200)
    force[700] = broken
    with pytest.raises(ValueError, match=rf"force .*{flaw} .*1 of 6400 samples.* 700"):
        Hit(force, force, RATE)


def test_records_of_different_length_and_wrong_rates_are_rejected() -> None:
    with pytest.raises(ValueError, match=r"force \(\d+,\) .*acceleration \(\d+,\)"):
        Hit(np.zeros(100), np.zeros(99), RATE)
    with pytest.raises(ValueError, match="sample_rate=0"):
        Hit(np.zeros(100), np.zeros(100), 0.0)
