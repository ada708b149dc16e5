"""A response that does not answer the hit: hum, drift, noise and a saturated amplifier."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Channel, Hit, HitFlags, Structure, check_hit

pytestmark = pytest.mark.quick
RATE, RECORD, BEFORE, WIDTH = 25600.0, 6400, 512, 6e-4
TIME = np.arange(RECORD) / RATE
AFTER = TIME - BEFORE / RATE
PULSE = np.where((AFTER >= 0) & (AFTER <= WIDTH), np.sin(np.pi * AFTER / WIDTH) ** 4, 0.0)
CHANNELS = Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0)
Signal = NDArray[np.float64]


def hit(response: Signal, random: np.random.Generator) -> Hit:
    signals = 250 * PULSE + 0.1 * random.normal(size=RECORD), response
    codes = [channel.encode(values) for channel, values in zip(CHANNELS, signals, strict=True)]
    return Hit.from_codes(codes, CHANNELS, RATE, BEFORE)


def hum(random: np.random.Generator, mains: float, amplitude: float) -> Signal:
    phases = random.uniform(0, 2 * np.pi, 3)
    waves = [np.sin(2 * np.pi * k * mains * TIME + phase) / k for k, phase in zip((1, 3, 5), phases, strict=True)]
    return np.asarray(amplitude * sum(waves) + 0.5 * random.normal(size=RECORD))


@pytest.mark.parametrize("mains", [50.0, 49.9, 60.0])
@pytest.mark.parametrize("amplitude", [5.0, 100.0])
def test_hum_alone_is_no_response(mains: float, amplitude: float) -> None:
    random = np.random.default_rng(1)
    verdicts = [check_hit(hit(hum(random, mains, amplitude), random)) for _ in range(20)]
    assert verdicts == [HitFlags.NO_RESPONSE] * 20


def test_the_drift_of_an_open_input_is_no_response() -> None:
    random = np.random.default_rng(2)
    verdicts = [check_hit(hit(0.3 * np.cumsum(random.normal(size=RECORD)), random)) for _ in range(20)]
    assert verdicts == [HitFlags.NO_RESPONSE] * 20


def test_an_amplifier_at_its_limit_is_no_overload_by_the_hit() -> None:
    random = np.random.default_rng(3)
    response = np.full(RECORD, 6000.0)
    response[4000:] = 4000.0
    assert check_hit(hit(response, random)) == HitFlags.NO_RESPONSE


@pytest.mark.parametrize(("frequency", "damping_ratio"), [(1713.0, 0.03), (300.0, 0.05), (60.0, 0.1)])
@pytest.mark.parametrize("disturbance", ["noise", "hum"])
def test_a_weak_answer_in_noise_or_hum_is_one(frequency: float, damping_ratio: float, disturbance: str) -> None:
    structure = Structure(np.array([frequency]), np.array([damping_ratio]), np.array([3e7]))
    answer = np.zeros(RECORD)
    answer[AFTER >= 0] = structure.response(AFTER[AFTER >= 0], WIDTH)
    answer *= 60 / np.max(np.abs(answer[AFTER > WIDTH]))
    for seed in range(20):
        random = np.random.default_rng(seed)
        rest = random.normal(size=RECORD) if disturbance == "noise" else hum(random, 50.0, 3.0)
        assert not check_hit(hit(answer + rest, random)) & HitFlags.NO_RESPONSE
