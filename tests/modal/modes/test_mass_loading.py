"""The mass of the sensor: taken off an FRF, and what it does to modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition import Frf, Hit, estimate_frf, remove_sensor_mass
from modal import Mode, fit_modes, mass_loading, synthesize_frf, with_mass_uncertainty
from tests.modal.test_hit_scatter import tap

F = np.arange(10.0, 4000.0, 2.0)
TEN_GRAMS = 0.010
ALONE = Mode(1500.0, 0.03, 3e7)
TWO = [ALONE, Mode(2600.0, 0.03, 6e7)]


def loaded(modes: list[Mode], mass: float) -> Frf:
    """Return the FRF measured by an accelerometer of this mass (kg): K - w^2 (M + mass) of the structure."""
    free = synthesize_frf(modes, F).receptance
    return Frf(F, 1 / (1 / free - mass * (2 * np.pi * F) ** 2), measured_as="accelerance")


def test_a_mass_on_a_spring_lowers_f_as_the_closed_form_says_and_is_taken_off() -> None:
    modal_mass = ALONE.stiffness / (2 * np.pi * ALONE.frequency) ** 2
    (mode,) = fit_modes(loaded([ALONE], TEN_GRAMS))
    assert mode.frequency == pytest.approx(1500 * np.sqrt(modal_mass / (modal_mass + TEN_GRAMS)), rel=1e-9)
    assert mode.frequency / 1500 - 1 == pytest.approx(-0.0145, abs=0.0005)
    assert mode.stiffness == pytest.approx(3e7, rel=1e-9)
    (free,) = fit_modes(remove_sensor_mass(loaded([ALONE], TEN_GRAMS), TEN_GRAMS))
    assert (free.frequency, free.damping_ratio, free.stiffness) == pytest.approx((1500, 0.03, 3e7), rel=1e-9)


def test_two_modes_come_back_where_they_are() -> None:
    with_mass = fit_modes(loaded(TWO, TEN_GRAMS))
    assert with_mass[0].frequency == pytest.approx(1500 * (1 - 0.015), rel=1e-3)
    assert abs(with_mass[0].stiffness / 3e7 - 1) > 0.04
    without = fit_modes(remove_sensor_mass(loaded(TWO, TEN_GRAMS), TEN_GRAMS))
    for mode, true in zip(without, TWO, strict=True):
        assert (mode.frequency, mode.damping_ratio, mode.stiffness) == pytest.approx(
            (true.frequency, true.damping_ratio, true.stiffness), rel=1e-6
        )


@pytest.mark.parametrize("mass", [0.001, -0.001])
def test_first_order_change_is_that_of_modes_fitted_with_a_small_mass(mass: float) -> None:
    bare, moved = fit_modes(synthesize_frf(TWO, F)), fit_modes(loaded(TWO, mass))
    for before, after in zip(bare, moved, strict=True):
        change = mass_loading(before, synthesize_frf(TWO, F), mass)
        assert after.frequency / before.frequency - 1 == pytest.approx(change.frequency, rel=0.02)
        assert after.stiffness / before.stiffness - 1 == pytest.approx(change.stiffness, rel=0.12)
        assert after.damping_ratio / before.damping_ratio - 1 == pytest.approx(change.frequency, rel=0.05)


def test_what_is_not_known_of_the_mass_is_in_the_errors() -> None:
    frf = remove_sensor_mass(loaded(TWO, TEN_GRAMS), TEN_GRAMS)
    sure = replace(fit_modes(frf)[0], covariance=np.diag([0.01, 1e-12, 1e6]))
    doubtful = with_mass_uncertainty(sure, frf, 0.001)
    off = mass_loading(sure, frf, 0.001)
    assert doubtful.standard_error[0] == pytest.approx(np.hypot(0.1, off.frequency * 1500), rel=1e-3)
    assert doubtful.standard_error[2] == pytest.approx(np.hypot(1e3, off.stiffness * 3e7), rel=1e-3)
    assert with_mass_uncertainty(replace(sure, covariance=None), frf, 0.001).covariance is None


def test_nothing_is_taken_off_where_nothing_rides() -> None:
    frf = synthesize_frf(TWO, F)
    assert remove_sensor_mass(frf, 0.0) is frf
    assert remove_sensor_mass(frf, TEN_GRAMS).in_band((100.0, 200.0)).mass_removed == TEN_GRAMS


def test_the_hits_scatter_without_the_mass_as_refitted_frfs_do() -> None:
    hits = tap(1)

    def bare(some: list[Hit]) -> Frf:
        return remove_sensor_mass(estimate_frf(some), TEN_GRAMS)

    mode = fit_modes(bare(hits), hits=hits)[0]
    without = [fit_modes(bare(hits[:i] + hits[i + 1 :]))[0] for i in range(10)]
    spread = np.array([[one.damping_ratio, one.stiffness] for one in without])
    refitted = np.sqrt(0.9 * np.sum((spread - spread.mean(axis=0)) ** 2, axis=0))
    assert mode.standard_error[1:] == pytest.approx(refitted, rel=0.15)


def test_noise_of_the_hammer_reaches_the_modes_without_the_mass() -> None:
    tests = [tap(seed, 2, hammer_noise=0.5) for seed in range(30)]
    modes = [fit_modes(remove_sensor_mass(estimate_frf(hits), 3 * TEN_GRAMS), hits=hits)[0] for hits in tests]
    scatter = np.std([[mode.damping_ratio, mode.stiffness] for mode in modes], axis=0)
    by_fit = np.sqrt(np.mean([mode.fit_error[1:] ** 2 for mode in modes], axis=0))
    assert by_fit == pytest.approx(scatter, rel=0.35)
