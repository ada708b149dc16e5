"""Hum of the mains is no ringing."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition import Hit, HitFlags, Structure, check_hit
from acquisition.hit_quality.evaluate_hit import evaluate_hit

RATE, RECORD, WIDTH = 25600.0, 6400, 6e-4


def hit(structure: Structure, before: int, hum: float = 0.0, mains: float = 50.0, seed: int = 0) -> Hit:
    """One hit after so many samples, hum of this amplitude (m/s^2) and a third of it at three times its frequency."""
    random = np.random.default_rng(seed)
    time = np.arange(RECORD) / RATE
    after = time - before / RATE
    response = np.zeros(RECORD)
    response[after >= 0] = structure.response(after[after >= 0], WIDTH)
    force = np.where((after >= 0) & (after <= WIDTH), np.sin(np.pi * after / WIDTH) ** 4, 0.0)
    phase = random.uniform(0, 2 * np.pi)
    tone = np.sin(2 * np.pi * mains * time + phase) + 0.3 * np.sin(6 * np.pi * mains * time + 2 * phase)
    noise = random.normal(size=(2, RECORD))
    return Hit(250 * force + 0.1 * noise[0], 250 * response + hum * tone + noise[1], RATE, before)


DAMPED = Structure(np.array([1713.0]), np.array([0.03]), np.array([3.5e7]))


@pytest.mark.parametrize("mains", [50.0, 60.0])
@pytest.mark.parametrize("before", [64, 128, 256])
def test_hits_in_hum_are_good_however_little_stands_before_them(before: int, mains: float) -> None:
    verdicts = [check_hit(hit(DAMPED, before, 100.0, mains, seed)) for seed in range(20)]
    assert verdicts == [HitFlags.OK] * 20


@pytest.mark.parametrize("frequency", [50.0, 100.2, 151.0, 180.0, 240.0, 300.0])
@pytest.mark.parametrize("before", [16, 64, 512])
def test_what_rings_next_to_the_mains_is_rejected(frequency: float, before: int) -> None:
    structure = Structure(np.array([frequency]), np.array([3e-4]), np.array([1e5]))
    assert check_hit(hit(structure, before)) & HitFlags.NOT_DECAYED
    assert check_hit(hit(structure, before, 0.2)) & HitFlags.NOT_DECAYED


def test_hum_that_cannot_be_proved_is_named() -> None:
    verdict = evaluate_hit(hit(DAMPED, 0, 20.0))
    assert verdict.flags == HitFlags.NOT_DECAYED
    assert "mains hum" in verdict.text
    rings = Structure(np.array([437.0]), np.array([3e-4]), np.array([3e7]))
    assert "hum" not in evaluate_hit(hit(rings, 0)).text
