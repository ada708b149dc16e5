"""FRFs of the same weights share the columns of their fit: the results are those of separate columns."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from modal import Mode
from modal.fitting.band_fit import BandFit, FixedPoleFit
from modal.fitting.fit_band import ProjectedBand, fit_band, fit_real_constants, refit_nearby
from modal.poles import fit_lscf_poles

LINES = np.arange(400.0, 600.0)
SHAPES = np.array([[1.0, 1.0], [-0.6, 1.4], [0.3, -0.8]])
STARTS = np.array([[470.0, 530.0], [0.02, 0.02]])


def receptances(phase: float) -> NDArray[np.complex128]:
    """Three FRFs of two modes with noise of 1 % of the largest, the second mode of the last one with a phase (rad)."""
    modes = [Mode(470.0, 0.02, 2e7).receptance(LINES), Mode(530.0, 0.015, 3e7).receptance(LINES)]
    shapes = SHAPES.astype(complex)
    shapes[2, 1] *= np.exp(1j * phase)
    exact = shapes @ np.array(modes)
    noise = np.random.default_rng(1).normal(size=(2, *exact.shape))
    return np.asarray(exact + 0.01 * np.max(np.abs(exact)) * (noise[0] + 1j * noise[1]))


def weights() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Equal weights of three FRFs, and the same but for rounding."""
    equal = np.tile(LINES**2, (3, 1))
    other = equal.copy()
    other[1, 7] *= 1 + 1e-12
    return equal, other


def fitted(weight: NDArray[np.float64], phase: float = 0.0) -> BandFit:
    fit = fit_band(LINES, receptances(phase), weight, STARTS, 4)
    assert fit is not None
    return fit


def test_a_fit_with_shared_columns_is_that_with_separate_ones() -> None:
    shared, separate = map(fitted, weights())
    assert shared.degrees_of_freedom == separate.degrees_of_freedom
    assert np.allclose(shared.poles, separate.poles, rtol=1e-8)
    assert np.allclose(shared.constant, separate.constant, rtol=1e-7)
    assert np.allclose(shared.covariance, separate.covariance, rtol=1e-6, atol=1e-9 * np.max(shared.covariance))
    for i in range(3):
        own, other = shared.influence_of(i), separate.influence_of(i)
        assert np.allclose(own, other, atol=1e-7 * np.max(np.abs(own), axis=1, keepdims=True))


def test_trial_fits_and_poles_are_those_with_separate_columns() -> None:
    values = receptances(0.0)
    changed, poles = [], []
    for weight in weights():
        trial = refit_nearby(fitted(weight), LINES[20:], values[:, 20:], weight[:, 20:], 5)
        assert trial is not None
        changed.append(np.concatenate([part.ravel() for part in trial]))
        chart = fit_lscf_poles(LINES, values, weight, 3)
        poles.append(np.column_stack([chart.frequency, chart.damping_ratio, chart.flexibility]))
    assert np.allclose(changed[0], changed[1], rtol=1e-7)
    assert np.allclose(poles[0], poles[1], rtol=1e-6)


def test_real_constants_are_fitted_unless_a_phase_is_seen() -> None:
    weight = weights()[0]
    plain, turned = fitted(weight), fitted(weight, 0.7)
    assert not np.any(fit_real_constants(plain, LINES, receptances(0.0), weight, 4).constant.imag)
    assert fit_real_constants(turned, LINES, receptances(0.7), weight, 4) is turned


def test_a_fit_of_real_constants_ends_as_soon_as_it_cannot_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    weight, evaluate, evaluated = weights()[0], ProjectedBand.at, list[float]()

    def count(band: ProjectedBand, poles: NDArray[np.float64], is_complex: bool) -> FixedPoleFit:
        state = evaluate(band, poles, is_complex)
        evaluated.append(state.cost)
        return state

    turned = fitted(weight, 1.2)
    monkeypatch.setattr(ProjectedBand, "at", count)
    assert fit_real_constants(turned, LINES, receptances(1.2), weight, 4) is turned
    assert len(evaluated) <= 2
