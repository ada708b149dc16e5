"""Spindle speed from tachometer pulses: exact turns over their time, and signals that are not tachometers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.files.read_cut import compute_speed_from_pulses

RATE = 10e3


def pulses(rpm: float, each: int = 1, seconds: float = 2.0, width: float = 0.1) -> np.ndarray:
    phase = np.arange(round(seconds * RATE)) / RATE * rpm / 60 * each
    return np.where((phase + 0.3) % 1 < width, 5.0, 0.2)


@given(st.floats(600, 24_000), st.sampled_from([1, 2, 6]), st.booleans(), st.integers(0, 100))
def test_the_mean_is_turns_over_time_whatever_noise_and_sign(
    rpm: float, each: int, is_inverse: bool, seed: int
) -> None:
    signal = pulses(rpm, each, width=0.3) + np.random.default_rng(seed).normal(scale=0.1, size=20_000)
    speed = compute_speed_from_pulses(-signal if is_inverse else signal, RATE, each)
    assert np.nanmean(speed) == pytest.approx(rpm, rel=2e-4)
    assert np.isfinite(speed).mean() > 0.85


def test_a_speed_that_ramps_is_followed() -> None:
    time = np.arange(40_000) / RATE
    turns = 50 * time + 5 * time**2  # 3000 to 5400 rpm
    speed = compute_speed_from_pulses(np.where(turns % 1 < 0.1, 1.0, 0.0), RATE)
    inside = np.isfinite(speed)
    assert np.allclose(speed[inside], 60 * (50 + 10 * time[inside]), rtol=0.03)


def test_a_pulse_that_is_missing_leaves_the_speed_unknown_not_halved() -> None:
    signal = pulses(3000.0)
    signal[9900:10_150] = 0.2
    speed = compute_speed_from_pulses(signal, RATE)
    assert np.isnan(speed[10_000])
    assert np.nanmean(speed) == pytest.approx(3000.0, rel=1e-3)


@pytest.mark.parametrize(
    ("signal", "each", "text"),
    [
        (np.full(2000, 4.9), 1, "0 pulses in 0.2 s .*two turns of 1"),
        (pulses(3000.0, seconds=0.05), 1, "2 pulses in 0.05 s"),
        (pulses(3000.0, 10, seconds=0.05), 60, "two turns of 60"),
        (np.random.default_rng(0).normal(size=5000), 1, "pulses are irregular"),
        (pulses(3000.0), 0, "0 pulses per turn"),
    ],
)
def test_what_is_no_tachometer_is_rejected(signal: np.ndarray, each: int, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        compute_speed_from_pulses(signal, RATE, each)


def test_a_pulse_begins_between_samples() -> None:
    turns, rate = 37.3, 2000.0  # 53.6 samples a turn: by whole samples turns differ by 1.9 %
    speed = compute_speed_from_pulses(np.sin(2 * np.pi * turns * np.arange(4000) / rate), rate)
    known = speed[np.isfinite(speed)]
    assert known.size > 3800
    assert np.max(np.abs(known / (60 * turns) - 1)) < 2e-3
