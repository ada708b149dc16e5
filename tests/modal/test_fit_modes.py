"""Modes by least squares: synthetic FRFs of known modes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Frf, from_accelerance
from acquisition.frf import FrfQuantity
from modal import Mode, fit_modes, predominant_mode, synthesize_frf

SPINDLE = [Mode(900.0, 0.03, 4e7), Mode(1722.0, 0.03, 3.5e7), Mode(2900.0, 0.03, 3e7)]
STATIC_RESIDUAL = 1 / 3e8
LINES = np.arange(5.0, 6000.0, 5.0)


def accelerance(modes: list[Mode], frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the accelerance of these modes and a static residual flexibility."""
    flexibility = synthesize_frf(modes, frequency).receptance + STATIC_RESIDUAL
    return np.asarray(-((2 * np.pi * frequency) ** 2) * flexibility)


def noisy(modes: list[Mode], level: float, hits: int, seed: int, frequency: NDArray[np.float64] = LINES) -> Frf:
    """Mean of hits, each with noise of level times the largest accelerance, and its coherence from three hits on."""
    random = np.random.default_rng(seed)
    exact = accelerance(modes, frequency)
    noise = random.normal(size=(2, hits, frequency.size)) / np.sqrt(2) * level * np.max(np.abs(exact))
    each = exact + noise[0] + 1j * noise[1]
    mean = each.mean(axis=0)
    coherence = np.abs(mean) ** 2 / np.mean(np.abs(each) ** 2, axis=0)
    return from_accelerance(frequency, mean, coherence, hits)


def values(mode: Mode) -> NDArray[np.float64]:
    return np.array([mode.frequency, mode.damping_ratio, mode.stiffness])


def errors(found: list[Mode], true: list[Mode]) -> NDArray[np.float64]:
    """Relative errors, shape (n modes, 3)."""
    assert len(found) == len(true)
    return np.array([values(a) / values(b) - 1 for a, b in zip(found, true, strict=True)])


def significant_digits(error: NDArray[np.float64]) -> float:
    return float(-np.log10(np.max(np.abs(error)) + 1e-16))


@pytest.mark.parametrize("damping", [0.0005, 0.003, 0.01, 0.03, 0.1])
@pytest.mark.parametrize("n_lines", [200, 5000, 50000])
def test_one_mode_without_noise(n_lines: int, damping: float) -> None:
    mode = Mode(1722.0, damping, 3.5e7)
    frequency = np.linspace(0.0, 5000.0, n_lines + 1)
    error = errors(fit_modes(synthesize_frf([mode], frequency)), [mode])
    assert significant_digits(error[:, 0]) > 12
    assert significant_digits(error[:, 1:]) > 10


def test_many_modes_without_noise() -> None:
    modes = [
        Mode(310.0, 0.02, 6e7),
        Mode(700.0, 0.005, 2e8),
        Mode(1200.0, 0.01, -8e7),
        Mode(1722.0, 0.03, 3.5e7),
        Mode(2900.0, 0.002, 9e8),
        Mode(4100.0, 0.015, -2e8),
    ]
    frf = from_accelerance(LINES, accelerance(modes, LINES))
    error = errors(fit_modes(frf), modes)
    assert significant_digits(error[:, 0]) > 8
    assert significant_digits(error[:, 1:]) > 6


@pytest.mark.parametrize("ratio", [1.1, 1.2, 1.3, 1.5])
def test_close_modes_are_distinguished(ratio: float) -> None:
    modes = [Mode(1722.0, 0.03, 3.5e7), Mode(1722.0 * ratio, 0.03, 5e7)]
    error = errors(fit_modes(from_accelerance(LINES, accelerance(modes, LINES))), modes)
    assert significant_digits(error[:, 0]) > 7
    assert significant_digits(error[:, 1:]) > 5


def test_spindle_without_noise_is_not_biased_by_neighbours() -> None:
    error = errors(fit_modes(from_accelerance(LINES, accelerance(SPINDLE, LINES))), SPINDLE)
    assert significant_digits(error[:, 0]) > 8
    assert significant_digits(error[:, 1:]) > 6


def test_modes_outside_the_band_bias_the_stiffness_by_less_than_a_thousandth() -> None:
    hidden = [Mode(320.0, 0.05, 8e7), *SPINDLE, Mode(4600.0, 0.03, 3e7)]
    found = fit_modes(from_accelerance(LINES, accelerance(hidden, LINES)), (500.0, 3800.0))
    error = errors(found, SPINDLE)[1]
    assert np.all(np.abs(error) < [2e-5, 1e-3, 1e-3])


def test_spindle_with_noise() -> None:
    for seed in range(10):
        error = errors(fit_modes(noisy(SPINDLE, 0.005, 10, seed)), SPINDLE)[1]
        assert np.all(np.abs(error) < [2e-4, 1e-2, 5e-3])


def test_sign_of_a_small_loss_of_stiffness_is_found() -> None:
    aged = [SPINDLE[0], Mode(1722.0, 0.03, 3.5e7 * (1 - 0.014)), SPINDLE[2]]
    for seed in range(10):
        before = fit_modes(noisy(SPINDLE, 0.005, 10, seed))[1]
        after = fit_modes(noisy(aged, 0.005, 10, seed + 100))[1]
        assert after.stiffness / before.stiffness - 1 == pytest.approx(-0.014, abs=0.008)


@pytest.mark.parametrize("damping", [0.002, 0.01, 0.03, 0.1])
@pytest.mark.parametrize("n_lines", [300, 3000, 30000])
def test_one_mode_and_nothing_else_is_found_in_noise(n_lines: int, damping: float) -> None:
    frequency = np.linspace(5.0, 5000.0, n_lines)
    mode = Mode(1722.0, damping, 3.5e7)
    for seed in range(3):
        (found,) = fit_modes(noisy([mode], 0.01, 1, seed, frequency))
        assert np.all(np.abs(values(found) - values(mode)) < 5 * found.standard_error)


@pytest.mark.parametrize("damping", [0.03, 0.1])
def test_wide_mode_is_found_in_noise_as_high_as_a_fifth_of_it(damping: float) -> None:
    frequency = np.linspace(0.1, 5000.0, 50000)
    for seed in range(4):
        (found,) = fit_modes(noisy([Mode(1722.0, damping, 3.5e7)], 0.2, 1, seed, frequency))
        assert found.frequency == pytest.approx(1722.0, rel=5e-3)


def test_mode_narrower_than_a_line_in_noise_is_not_taken_for_a_conjugate() -> None:
    frequency = np.linspace(25.0, 5000.0, 200)
    for seed in range(200):
        found = fit_modes(noisy([Mode(1722.0, 0.0005, 3.5e7)], 0.05, 1, seed, frequency))
        assert len(found) <= 1


@pytest.mark.parametrize("hits", [1, 10])
def test_noise_alone_has_no_modes(hits: int) -> None:
    random = np.random.default_rng(1)
    each = random.normal(size=(hits, 20000)) + 1j * random.normal(size=(hits, 20000))
    coherence = np.abs(each.mean(axis=0)) ** 2 / np.mean(np.abs(each) ** 2, axis=0)
    assert fit_modes(from_accelerance(np.arange(1.0, 20001.0), each.mean(axis=0), coherence, hits)) == []


def test_one_disturbed_line_is_no_mode() -> None:
    frf = noisy([Mode(1722.0, 0.03, 3.5e7)], 0.001, 1, 0)
    frf.receptance[200] *= 10
    (found,) = fit_modes(frf)
    assert found.frequency == pytest.approx(1722.0, rel=1e-3)


def test_double_integration_drift_is_no_mode() -> None:
    lines = np.arange(1.0, 4000.0)
    drift = np.random.default_rng(0).normal(size=(2, lines.size)) * 30 * np.exp(-lines / 10)
    (found,) = fit_modes(
        from_accelerance(lines, accelerance([Mode(1722.0, 0.03, 3.5e7)], lines) + drift[0] + 1j * drift[1])
    )
    assert found.frequency == pytest.approx(1722.0, rel=1e-6)


def test_lines_of_low_coherence_count_less() -> None:
    exact = accelerance(SPINDLE, LINES)
    random = np.random.default_rng(3)
    level = np.where(np.abs(LINES - 1850.0) < 60.0, 0.1, 0.002) * np.max(np.abs(exact))
    noise = random.normal(size=(2, 10, LINES.size)) * level
    each = exact + noise[0] + 1j * noise[1]
    mean = each.mean(axis=0)
    coherence = np.abs(mean) ** 2 / np.mean(np.abs(each) ** 2, axis=0)
    weighted, equal = (
        min(fit_modes(frf), key=lambda mode: abs(mode.frequency - 1722.0))
        for frf in (from_accelerance(LINES, mean, coherence, 10), from_accelerance(LINES, mean))
    )
    assert weighted.standard_error[2] < equal.standard_error[2] / 3
    assert weighted.stiffness == pytest.approx(3.5e7, abs=3 * weighted.standard_error[2])


@pytest.mark.parametrize(("measured_as", "power"), [("receptance", 0), ("mobility", 1), ("accelerance", 2)])
def test_without_coherence_the_noise_is_equal_in_what_was_measured(measured_as: FrfQuantity, power: int) -> None:
    noise = np.random.default_rng(0).normal(size=(2, LINES.size)) * 1e-3
    exact = synthesize_frf([Mode(1722.0, 0.1, 3.5e7)], LINES).receptance * LINES**power
    receptance = (exact + (noise[0] + 1j * noise[1]) * np.max(np.abs(exact))) / LINES**power
    signal = np.abs(receptance) * LINES**power / np.max(np.abs(exact))
    coherence = 1 / (1 + 10 * 2e-6 / signal**2)
    (assumed,) = fit_modes(Frf(LINES, receptance, measured_as=measured_as))
    (known,) = fit_modes(Frf(LINES, receptance, coherence, 10, measured_as))
    assert values(assumed) == pytest.approx(values(known), rel=1e-9)
    assert assumed.standard_error == pytest.approx(known.standard_error, rel=1e-9)


def test_peak_of_low_coherence_is_no_mode() -> None:
    coherence = np.where(np.abs(LINES - 2900.0) < 300.0, 0.2, 0.999)
    found = fit_modes(from_accelerance(LINES, accelerance(SPINDLE, LINES), coherence, 10))
    assert [round(mode.frequency) for mode in found] == [900, 1722]


def test_standard_error_grows_with_the_noise_and_falls_with_the_hits() -> None:
    one, ten, loud = (
        fit_modes(noisy(SPINDLE, *case, 0))[1].standard_error for case in ((0.002, 3), (0.002, 30), (0.02, 3))
    )
    assert ten == pytest.approx(one / np.sqrt(10), rel=0.3)
    assert loud == pytest.approx(one * 10, rel=0.3)


def test_standard_errors_are_the_scatter() -> None:
    fits = [fit_modes(noisy(SPINDLE, 0.005, 10, seed))[1] for seed in range(60)]
    scatter = np.std([values(fit) for fit in fits], axis=0)
    assert np.mean([fit.standard_error for fit in fits], axis=0) == pytest.approx(scatter, rel=0.3)
    covariance = np.mean([fit.covariance for fit in fits if fit.covariance is not None], axis=0)
    correlation = covariance[1, 2] / np.sqrt(covariance[1, 1] * covariance[2, 2])
    assert correlation == pytest.approx(np.corrcoef([values(fit) for fit in fits], rowvar=False)[1, 2], abs=0.1)


@pytest.mark.long
@pytest.mark.parametrize("hits", [1, 3, 10])
@pytest.mark.parametrize("modes", [SPINDLE, [Mode(1722.0, 0.03, 3.5e7), Mode(1894.0, 0.03, 5e7)]])
def test_intervals_of_95_percent_cover_their_truth(modes: list[Mode], hits: int) -> None:
    fits = [fit_modes(noisy(modes, 0.005, hits, seed)) for seed in range(300)]
    error = [[(values(a) - values(b)) / a.standard_error for a, b in zip(fit, modes, strict=True)] for fit in fits]
    covered = np.mean(np.abs(error) < 1.96, axis=0)
    assert np.all((covered > 0.90) & (covered < 0.99))


def test_band_and_usable_band_choose_the_lines() -> None:
    frf = from_accelerance(LINES, accelerance(SPINDLE, LINES), usable_band=(5.0, 2300.0))
    assert [round(m.frequency) for m in fit_modes(frf)] == [900, 1722]
    assert [round(m.frequency) for m in fit_modes(frf, (1300.0, 4000.0))] == [1722]
    with pytest.raises(ValueError, match=r"2500.*4000 Hz"):
        fit_modes(frf, (2500.0, 4000.0))


def test_method_names_band_and_company() -> None:
    close = [Mode(1722.0, 0.03, 3.5e7), Mode(1950.0, 0.03, 5e7)]
    found = fit_modes(from_accelerance(LINES, accelerance(close, LINES)))
    assert all(mode.method.startswith("least squares") and "2 modes together" in mode.method for mode in found)


def test_predominant_is_the_largest_peak_of_a_driving_point() -> None:
    soft, damped, opposite = Mode(900.0, 0.03, 3e7), Mode(1722.0, 0.01, 6e7), Mode(2900.0, 0.001, -1e7)
    assert predominant_mode([soft, damped, opposite]) is damped
    assert predominant_mode([soft, damped, opposite], (500.0, 1000.0)) is soft
    assert predominant_mode([soft, damped, opposite], (2000.0, 3000.0)) is None
    assert predominant_mode([]) is None
    with pytest.raises(ValueError, match=r"1000\.\.500 Hz"):
        predominant_mode([soft], (1000.0, 500.0))
