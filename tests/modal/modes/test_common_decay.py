"""Modes with a common decay rate, as under an exponential window."""

from __future__ import annotations

import numpy as np
import pytest

from modal import Mode, common_decay_rate

pytestmark = pytest.mark.quick

FREQUENCIES = (120.0, 310.0, 590.0, 970.0, 1500.0)


def under(time_constant: float, damping_ratio: float, scatter: float = 0.0, seed: int = 0) -> list[Mode]:
    """Modes of about this damping ratio under a window (s)."""
    random = np.random.default_rng(seed)
    ratios = damping_ratio * np.exp(scatter * random.normal(size=len(FREQUENCIES)))
    return [
        Mode(f, zeta + 1 / (2 * np.pi * f * time_constant), 1e7) for f, zeta in zip(FREQUENCIES, ratios, strict=True)
    ]


def test_a_window_shorter_than_all_decays_is_seen_with_its_time_constant() -> None:
    rate = common_decay_rate(under(0.05, 0.0005))
    assert rate is not None
    assert 1 / rate == pytest.approx(0.05, rel=0.2)


def test_equal_damping_ratios_are_no_window() -> None:
    without = [common_decay_rate(under(np.inf, 0.003, 0.5, seed)) for seed in range(300)]
    assert without.count(None) >= 297


def test_few_modes_or_a_narrow_band_tell_nothing() -> None:
    assert common_decay_rate(under(0.05, 0.0005)[:3]) is None
    close = [Mode(f, 1 / (2 * np.pi * f * 0.05), 1e7) for f in (1000.0, 1100.0, 1200.0, 1300.0)]
    assert common_decay_rate(close) is None
