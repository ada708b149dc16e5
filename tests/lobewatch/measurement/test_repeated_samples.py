"""Remark on a polled sensor that is read faster than it samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition import Hit
from lobewatch.measurement.repeated_samples import MIN_REPEATED_SHARE, repeated_samples_remarks

RATE = 3200.0
COUNT = 4000


def decay(ratio: float, scale: float = 0.01, frequency: float = 180.0, seed: int = 1) -> Hit:
    """Return the decay of a mode (Hz) whose sensor gives `ratio` new values per scan, in steps of `scale` (m/s^2)."""
    newest = np.floor(np.arange(COUNT) * ratio) / ratio / RATE
    time = np.clip(newest - 0.02, 0.0, None)
    values = 80.0 * np.exp(-6.0 * time) * np.sin(2 * np.pi * frequency * time)
    noise = np.random.default_rng(seed).normal(0.0, scale, COUNT)[(newest * RATE).astype(int)]
    return Hit(np.empty(0), scale * np.rint((values + noise) / scale), RATE)


@pytest.mark.parametrize("ratio", [1 / 8, 1 / 3, 0.5, 0.6, 0.8])
def test_the_share_of_repeated_samples_gives_the_true_rate(ratio: float) -> None:
    (remark,) = repeated_samples_remarks([decay(ratio)] * 3)
    assert remark.code == "repeated-samples"
    said = float(remark.text.split("about ")[1].split(" new")[0])
    assert said == pytest.approx(ratio * RATE, rel=0.08)


@given(st.floats(20.0, 1500.0), st.floats(0.001, 5.0), st.integers(0, 99))
def test_a_sensor_read_once_per_value_is_not_named(frequency: float, scale: float, seed: int) -> None:
    assert repeated_samples_remarks([decay(1.0, scale, frequency, seed)] * 2) == []


def test_rest_overload_and_short_records_are_not_named() -> None:
    clipped = Hit(np.empty(0), np.clip(decay(1.0).acceleration, -20.0, 20.0), RATE)
    rest = Hit(np.empty(0), np.random.default_rng(1).integers(0, 2, COUNT).astype(np.float64) * 0.01, RATE)
    constant = Hit(np.empty(0), np.zeros(COUNT), RATE)
    assert repeated_samples_remarks([clipped, rest, constant]) == []
    assert repeated_samples_remarks([]) == []


def test_the_threshold_is_a_share() -> None:
    assert repeated_samples_remarks([decay(1.0 - 1.5 * MIN_REPEATED_SHARE)] * 3)
    assert not repeated_samples_remarks([decay(1.0 - 0.5 * MIN_REPEATED_SHARE)] * 3)
