"""A channel delay rotates all modal constants consistently; complex modes do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition import Frf, from_accelerance
from modal import Mode, common_delay, fit_modes, synthesize_frf

LINES = np.arange(5.0, 4000.0, 5.0)
REAL = [Mode(700.0, 0.02, 6e7), Mode(1500.0, 0.03, 3e7), Mode(2600.0, 0.02, 9e7)]


def measured(modes: list[Mode], skew: float, seed: int = 0) -> Frf:
    """Return the response sampled later than the force (s), with noise of 0.2 % of the largest accelerance."""
    exact = synthesize_frf(modes, LINES).accelerance * np.exp(2j * np.pi * LINES * skew)
    noise = np.random.default_rng(seed).normal(size=(2, LINES.size)) * 0.002 * np.max(np.abs(exact))
    return from_accelerance(LINES, exact + noise[0] + 1j * noise[1])


@pytest.mark.parametrize("skew", [-30e-6, -8e-6, 12e-6, 30e-6])
def test_a_delay_is_found_with_its_sign_and_no_mode_is_called_complex(skew: float) -> None:
    found = fit_modes(measured(REAL, skew))
    delay = common_delay(found)
    assert delay is not None
    assert delay.skew == pytest.approx(skew, abs=max(3 * delay.skew_std, 1e-6))
    assert delay.phase_deg(1000.0) == pytest.approx(0.36e6 * delay.skew)
    assert not any(remark.code == "complex-mode" for mode in found for remark in mode.remarks)


def test_real_modes_have_no_delay() -> None:
    for seed in range(3):
        assert common_delay(fit_modes(measured(REAL, 0.0, seed))) is None


def test_complex_modes_are_no_delay_and_say_so() -> None:
    complex_ones = [replace(mode, phase_deg=phase) for mode, phase in zip(REAL, (26.0, -8.0, 30.0), strict=True)]
    found = fit_modes(measured(complex_ones, 0.0))
    assert common_delay(found) is None
    said = [mode.frequency for mode in found if any(remark.code == "complex-mode" for remark in mode.remarks)]
    assert said == pytest.approx([700.0, 2600.0], rel=1e-3)


def test_a_complex_mode_is_seen_through_a_delay() -> None:
    turned = [*REAL[:2], Mode(2000.0, 0.02, 8e7), replace(REAL[2], phase_deg=1.0), Mode(3300.0, 0.015, 8e7)]
    delay = common_delay(fit_modes(measured(turned, 20e-6)))
    assert delay is not None
    assert delay.skew == pytest.approx(20e-6, abs=1e-6)


def test_two_modes_show_no_delay() -> None:
    assert common_delay([Mode(700.0, 0.02, 6e7, phase_deg=10.0), Mode(1400.0, 0.02, 6e7, phase_deg=20.0)]) is None
    assert common_delay([]) is None
