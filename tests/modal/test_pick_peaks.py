"""Peak picking against its own closed form.

S. Gaber and S. M. Hashemi (2015), the paper's eqs. (28), (29) and its synthetic mode: 1722 Hz, zeta 0.029136,
K 3.2289e7 N/m. For one mode G = 1/K/(1 - r^2 + 2i zeta r) the extremes of Re G are at r^2 = 1 -+ 2 zeta, and that
of Im G is at r^2 = (1 - 2 zeta^2 + sqrt((1 - 2 zeta^2)^2 + 3))/3.
"""

from __future__ import annotations

import numpy as np
import pytest

from acquisition import Frf
from modal import Mode, fit_modes, pick_peaks, synthesize_frf

pytestmark = pytest.mark.quick

PAPER = Mode(1722.0, 0.029136, 3.2289e7)


def picked_exactly(mode: Mode) -> tuple[float, float, float]:
    """Return the result of eqs. (28) and (29) for a single mode with infinitely fine resolution."""
    z = mode.damping_ratio
    q = (1 - 2 * z**2 + np.sqrt((1 - 2 * z**2) ** 2 + 3)) / 3
    frequency = mode.frequency * np.sqrt(q)
    damping = mode.frequency * (np.sqrt(1 + 2 * z) - np.sqrt(1 - 2 * z)) / (2 * frequency)
    imaginary = -2 * z * np.sqrt(q) / ((1 - q) ** 2 + 4 * z**2 * q) / mode.stiffness
    return frequency, damping, -1 / (2 * damping * imaginary)


@pytest.mark.parametrize("stiffness", [3.2289e7, -3.2289e7])
@pytest.mark.parametrize("damping", [0.002, 0.029136, 0.1])
def test_peak_picking_has_its_closed_form_bias(damping: float, stiffness: float) -> None:
    mode = Mode(1722.0, damping, stiffness)
    lines = 1722.0 * (1 + damping * np.arange(-4.0, 6.0, 0.002))
    (found,) = pick_peaks(synthesize_frf([mode], lines))
    frequency, zeta, k = picked_exactly(mode)
    assert found.frequency == pytest.approx(frequency, rel=1e-7)
    assert found.damping_ratio == pytest.approx(zeta, rel=3e-6)
    assert found.stiffness == pytest.approx(k, rel=3e-6)
    assert found.is_driving_point == (stiffness > 0)


def test_bias_of_the_paper_mode_is_zeta_squared() -> None:
    (found,) = pick_peaks(synthesize_frf([PAPER], np.arange(800.0, 3000.0, 0.05)))
    square = PAPER.damping_ratio**2
    assert found.frequency / PAPER.frequency - 1 == pytest.approx(-square / 2, rel=0.01)
    assert found.damping_ratio / PAPER.damping_ratio - 1 == pytest.approx(square, rel=0.03)
    assert found.stiffness / PAPER.stiffness - 1 == pytest.approx(-1.25 * square, rel=0.03)


def test_extremes_are_found_between_lines() -> None:
    frequency, zeta, k = picked_exactly(PAPER)
    for shift in (0.0, 1.3, 2.5, 3.7):
        (found,) = pick_peaks(synthesize_frf([PAPER], np.arange(800.0, 3000.0, 5.0) + shift))
        assert found.frequency == pytest.approx(frequency, abs=0.02)
        assert found.damping_ratio == pytest.approx(zeta, rel=5e-3)
        assert found.stiffness == pytest.approx(k, rel=5e-3)


def test_least_squares_has_no_such_bias() -> None:
    (found,) = fit_modes(synthesize_frf([PAPER], np.arange(800.0, 3000.0, 5.0)))
    assert found.frequency == pytest.approx(PAPER.frequency, rel=1e-12)
    assert found.damping_ratio == pytest.approx(PAPER.damping_ratio, rel=1e-10)
    assert found.stiffness == pytest.approx(PAPER.stiffness, rel=1e-10)


def test_every_mode_of_several_is_picked() -> None:
    modes = [Mode(900.0, 0.01, 4e7), Mode(1722.0, 0.01, -3.5e7), Mode(2900.0, 0.01, 3e7)]
    found = pick_peaks(synthesize_frf(modes, np.arange(5.0, 5000.0, 1.0)))
    assert [m.frequency for m in found] == pytest.approx([m.frequency for m in modes], rel=1e-3)
    assert [m.stiffness for m in found] == pytest.approx([m.stiffness for m in modes], rel=0.1)
    assert all(m.covariance is None and m.method == "peak picking" for m in found)


def test_peak_that_is_cut_off_is_not_picked() -> None:
    frf: Frf = synthesize_frf([PAPER], np.arange(1690.0, 3000.0, 5.0))
    assert pick_peaks(frf) == []
