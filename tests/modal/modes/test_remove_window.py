"""Damping that an exponential window adds."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition import Frf
from modal import Mode, fit_modes, remove_window, synthesize_frf, widen_for_window

pytestmark = pytest.mark.quick

MODE = Mode(1722.0, 0.03, 3.5e7)
LINES = np.arange(1000.0, 2600.0, 2.0)


def windowed(mode: Mode, tau: float) -> Frf:
    """Return the transform of the impulse response 1/(m w_d) exp(-zeta w t) sin(w_d t), times exp(-t/tau)."""
    w = 2 * np.pi * mode.frequency
    w_d, mass = w * np.sqrt(1 - mode.damping_ratio**2), mode.stiffness / w**2
    s = 2j * np.pi * LINES + mode.damping_ratio * w + 1 / tau
    return Frf(LINES, 1 / (mass * (s**2 + w_d**2)))


def test_an_endless_window_changes_nothing() -> None:
    assert windowed(MODE, 1e12).receptance == pytest.approx(synthesize_frf([MODE], LINES).receptance, rel=1e-9)


@pytest.mark.parametrize("tau", [0.02, 0.1, 1.0])
def test_the_mode_without_the_window_is_the_true_one(tau: float) -> None:
    (fitted,) = fit_modes(windowed(MODE, tau))
    assert fitted.damping_ratio - 0.03 == pytest.approx(1 / (2 * np.pi * 1722 * tau), rel=0.01)
    mode = remove_window(fitted, tau)
    assert mode.frequency == pytest.approx(1722.0, rel=1e-9)
    assert mode.damping_ratio == pytest.approx(0.03, rel=1e-7)
    assert mode.stiffness == pytest.approx(3.5e7, rel=1e-7)
    assert mode.method.endswith(f"without the window of {tau:g} s")


def test_standard_errors_are_carried_over() -> None:
    tau = 0.004
    root = np.array([[0.2, 0.0, 0.0], [5e-5, 1e-4, 0.0], [3e4, -9e4, 1e4]])
    base = Mode(1722.0, 0.03, 3.5e7, root @ root.T, jackknife=4 * root @ root.T, n_hits=10)
    found = remove_window(base, tau)
    step = np.diag([1e-3, 1e-8, 10.0])
    slope = []
    for i in range(3):
        values = np.array([1722.0, 0.03, 3.5e7]) + step[i]
        moved = remove_window(Mode(*(float(v) for v in values)), tau)  # type: ignore[arg-type]
        change = np.array([moved.frequency, moved.damping_ratio, moved.stiffness]) - [
            found.frequency,
            found.damping_ratio,
            found.stiffness,
        ]
        slope.append(change / step[i, i])
    expected = np.array(slope).T @ root @ root.T @ np.array(slope)
    assert found.covariance is not None
    assert found.covariance == pytest.approx(expected, rel=1e-3)
    assert found.jackknife == pytest.approx(4 * found.covariance)


@pytest.mark.parametrize("tau", [0.0, -1.0, np.nan, np.inf])
def test_a_time_constant_that_is_none(tau: float) -> None:
    with pytest.raises(ValueError, match="time_constant"):
        remove_window(MODE, tau)


def test_a_mode_cannot_decay_slower_than_its_window() -> None:
    with pytest.raises(ValueError, match=r"Hz .*333/s"):
        remove_window(MODE, 0.003)


@pytest.mark.parametrize("delay", [0.0, 0.01])
def test_what_the_window_lost_before_the_hit_is_taken_off_the_stiffness(delay: float) -> None:
    tau, base = 0.05, Mode(1722.0, 0.03, 3.5e7, np.diag([0.2, 1e-4, 1e5]) ** 2)
    late, at_once = remove_window(base, tau, delay), remove_window(base, tau)
    assert late.stiffness == pytest.approx(at_once.stiffness * np.exp(-delay / tau))
    assert late.standard_error[2] == pytest.approx(at_once.standard_error[2] * np.exp(-delay / tau))
    assert late.standard_error[:2] == pytest.approx(at_once.standard_error[:2])


def test_phase_stays_and_its_correlations_are_carried_over() -> None:
    root = np.array([[0.2, 0.0, 0.0], [5e-5, 1e-4, 0.0], [3e4, -9e4, 1e4]])
    correlation = np.array([0.5, -0.3, 0.1])
    base = Mode(1722.0, 0.03, 3.5e7, root @ root.T, phase_deg=20.0, phase_deg_std=1.0, phase_correlation=correlation)
    found = remove_window(base, 1e9)
    assert found.phase_deg == 20.0
    assert found.phase_correlation == pytest.approx(correlation)


@pytest.mark.parametrize("delay", [-0.01, np.nan, np.inf])
def test_a_window_cannot_begin_after_the_hit(delay: float) -> None:
    with pytest.raises(ValueError, match="delay"):
        remove_window(MODE, 0.1, delay)


def test_noise_under_a_window_widens_the_errors_as_its_lines_are_alike() -> None:
    base = Mode(1722.0, 0.03, 3.5e7, np.diag([0.2, 1e-4, 1e5]) ** 2, degrees_of_freedom=100, phase_deg_std=0.3)
    none, short = widen_for_window(base, 1e6, 0.25), widen_for_window(base, 0.01, 0.25)
    assert none.standard_error == pytest.approx(base.standard_error, rel=1e-6)
    assert short.standard_error == pytest.approx(5 * base.standard_error, rel=1e-6)
    assert short.phase_deg_std == pytest.approx(5 * 0.3, rel=1e-6)
    assert short.degrees_of_freedom == pytest.approx(4)
