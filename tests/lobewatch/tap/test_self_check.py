"""Self-check before the first hit: passed and failed checks, with numbers."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Channel, Hit
from lobewatch.tap.device_connection import estimate_resting_rms
from lobewatch.tap.self_check import find_quiet_part, run_self_check

pytestmark = pytest.mark.quick

RATE = 25600.0
Pair = tuple[Channel, Channel]
Signal = NDArray[np.float64] | float
TIME = np.arange(round(RATE)) / RATE


def wave(frequency: float, rms: float) -> NDArray[np.float64]:
    return np.asarray(np.sqrt(2) * rms * np.sin(2 * np.pi * frequency * TIME + 0.3))


def record(channels: Pair, force: Signal = 0.0, response: Signal = 0.0, lost: int = 0) -> Hit:
    random = np.random.default_rng(1)
    noise = random.normal(scale=0.2, size=TIME.size), random.normal(scale=2.0, size=TIME.size)
    codes = [channel.encode(n + extra) for channel, n, extra in zip(channels, noise, (force, response), strict=True)]
    return Hit.from_codes(codes, channels, RATE, lost_scans=lost)


def failed(hit: Hit, level: float | None = 20.0, free: int = 10**10) -> dict[str, str]:
    return {check.name: check.text for check in run_self_check(hit, level, free) if not check.passed}


def test_a_quiet_machine_passes(channels: Pair) -> None:
    checks = run_self_check(record(channels), 20.0, 78 * 10**9)
    assert all(check.passed for check in checks)
    texts = {check.name: check.text for check in checks}
    facts = {"force noise": ("0.2 N", "20 N"), "response noise": ("2 m/s^2",), "disk": ("78.0 GB",)}
    assert all(fact in texts[name] for name, named in facts.items() for fact in named)
    checks = run_self_check(record(channels), None, 10**10)
    (force,) = (check for check in checks if check.name == "force noise")
    assert (force.passed, "0.2 N" in force.text) == (True, True)


@pytest.mark.parametrize(("mains", "harmonic"), [(50.0, 1), (60.0, 1), (50.0, 3)])
def test_hum_is_named_with_its_frequency(channels: Pair, mains: float, harmonic: int) -> None:
    said = failed(record(channels, force=wave(mains * harmonic, 1.0)))
    assert set(said) == {"hum"}
    assert all(fact in said["hum"] for fact in ("1 N", f"{mains:g} Hz", "force"))


def test_a_turning_spindle_is_found_in_the_response(channels: Pair) -> None:
    said = failed(record(channels, response=wave(217.0, 8.0)))
    assert set(said) == {"spindle"}
    assert all(fact in said["spindle"] for fact in ("8 m/s^2", "217 Hz", "13020 rpm"))


def test_broadband_noise_is_neither_hum_nor_a_spindle(channels: Pair) -> None:
    random = np.random.default_rng(2).normal(scale=200.0, size=TIME.size)
    assert set(failed(record(channels, response=random))) == {"response noise"}


def test_noise_near_the_trigger_level(channels: Pair) -> None:
    said = failed(record(channels), level=1.0)
    assert all(fact in said["force noise"] for fact in ("0.2 N", "1 N", "trigger_n", "2.4"))


@pytest.mark.parametrize(("level", "words"), [(0.0, "constant"), (1e9, "range")])
def test_a_dead_sensor(channels: Pair, level: float, words: str) -> None:
    codes = record(channels).codes
    assert codes is not None
    codes = codes.copy()
    codes[1] = channels[1].encode(np.full(TIME.size, level))
    assert words in failed(Hit.from_codes(codes, channels, RATE))["acceleration sensor"]


def test_lost_scans_and_a_full_disk(channels: Pair) -> None:
    said = failed(record(channels, lost=512), free=10**8)
    assert set(said) == {"samples", "disk"}
    assert said["samples"].startswith("512 ")


def test_the_longest_stretch_without_hits_is_inspected(channels: Pair) -> None:
    force, response = np.zeros(TIME.size), np.zeros(TIME.size)
    for at in (0.2, 0.75):
        start = round(at * RATE)
        force[start : start + 20] = 200.0
        ringing = np.arange(TIME.size - start) / RATE
        response[start:] += 500 * np.exp(-ringing / 0.02) * np.sin(2 * np.pi * 900 * ringing)
    quiet = find_quiet_part(record(channels, force, response))
    assert 0.3 < quiet.force.size / RATE < 0.5
    assert np.max(quiet.force) < 2
    assert np.std(quiet.acceleration) == pytest.approx(2.0, rel=0.2)
    assert not failed(quiet)


def test_the_resting_level_is_that_of_short_stretches(channels: Pair) -> None:
    assert estimate_resting_rms(record(channels), 512) == pytest.approx(2.0, rel=0.03)
    assert estimate_resting_rms(record(channels, response=100.0), 512) == pytest.approx(2.0, rel=0.03)


def test_a_record_without_codes_is_rejected() -> None:
    with pytest.raises(ValueError, match="codes"):
        run_self_check(Hit(np.zeros(100), np.zeros(100), 100.0), 1.0, 10**10)
