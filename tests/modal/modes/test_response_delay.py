"""A delay of the response is found by the phases from mode to mode and over each peak."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition import Frf, remove_frf_delay
from modal import Mode, Trust, assess_trust, find_delay, fit_modes, synthesize_frf

SPINDLE = (Mode(700.0, 0.03, 4e7), Mode(1240.0, 0.02, 3e7), Mode(2300.0, 0.015, 9e7))
LINES = np.arange(50.0, 3500.0, 2.0)


def measured(modes: tuple[Mode, ...], delay: float = 0.0, turn: complex = 1.0) -> Frf:
    random = np.random.default_rng(2).normal(size=(2, LINES.size))
    values = synthesize_frf(list(modes), LINES).receptance * (1 + 0.01 * (random[0] + 1j * random[1]))
    return Frf(LINES, turn * values * np.exp(-2j * np.pi * LINES * delay))


def found(frf: Frf) -> float | None:
    return find_delay(frf, [mode for mode in fit_modes(frf) if assess_trust(mode) is not Trust.REJECTED])


@pytest.mark.parametrize("delay", [1e-3, -5e-4, 3e-4, 1.2e-4])
@pytest.mark.parametrize("opposed", [(), (1,)])
def test_a_delay_is_found_at_driving_and_transfer_points(delay: float, opposed: tuple[int, ...]) -> None:
    modes = tuple(replace(m, stiffness=-m.stiffness) if i in opposed else m for i, m in enumerate(SPINDLE))
    frf = measured(modes, delay)
    value = found(frf)
    assert value == pytest.approx(delay, abs=1e-5)
    restored = fit_modes(remove_frf_delay(frf, value or 0.0))
    assert [mode.is_driving_point for mode in restored] == [mode.is_driving_point for mode in modes]


@pytest.mark.parametrize("opposed", [(), (1,), (0, 1, 2)])
def test_modes_of_either_sign_without_a_delay_have_none(opposed: tuple[int, ...]) -> None:
    modes = tuple(replace(m, stiffness=-m.stiffness) if i in opposed else m for i, m in enumerate(SPINDLE))
    assert found(measured(modes)) is None


def test_complex_modes_without_a_common_delay_have_none() -> None:
    phases = (25.0, -30.0, 20.0)
    modes = tuple(replace(m, phase_deg=phase) for m, phase in zip(SPINDLE, phases, strict=True))
    assert found(measured(modes)) is None


def test_another_quantity_is_no_delay() -> None:
    assert found(measured(SPINDLE, turn=1j)) is None


def test_a_small_delay_that_leaves_all_signs_is_not_removed() -> None:
    assert found(measured(SPINDLE, 4e-5)) is None  # 33 degrees at 2300 Hz


def test_one_mode_tells_no_delay() -> None:
    assert find_delay(measured(SPINDLE[:1], 1e-3), [SPINDLE[0]]) is None
