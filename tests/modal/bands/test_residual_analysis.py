"""Errors where the fit leaves more than noise: structure that the model lacks."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Frf, from_accelerance
from modal import Mode, Trust, assess_trust, extract_modes, fit_modes, synthesize_frf
from modal.bands.residual_analysis import systematic_error

MODE = Mode(1722.0, 0.03, 3.5e7)


def noisy(modes: list[Mode], level: float, seed: int, step: float = 5.0) -> Frf:
    lines = np.arange(step, 4000.0, step)
    exact = synthesize_frf(modes, lines).accelerance
    noise = np.random.default_rng(seed).normal(size=(2, lines.size)) / np.sqrt(2) * level * np.max(np.abs(exact))
    return from_accelerance(lines, exact + noise[0] + 1j * noise[1])


def values(mode: Mode) -> NDArray[np.float64]:
    return np.array([mode.frequency, mode.damping_ratio, mode.stiffness])


def test_white_noise_changes_nothing() -> None:
    for seed in range(10):
        state = extract_modes([noisy([MODE], 2e-3, seed)])
        (band,) = state.bands
        beyond = systematic_error(band)
        assert beyond.factor == 1.0
        assert beyond.degrees_of_freedom == band.fit.degrees_of_freedom
        assert not np.any(beyond.covariance)


def test_what_the_model_lacks_widens_the_errors_until_they_hold_the_truth() -> None:
    frf = noisy([MODE], 1e-4, 0)
    rippled = Frf(frf.frequency, frf.receptance * (1 + 0.03 * np.sin(frf.frequency / 30)), measured_as="accelerance")
    (band, *_) = extract_modes([rippled]).bands
    beyond = systematic_error(band)
    assert beyond.factor > 3
    assert beyond.degrees_of_freedom < band.fit.degrees_of_freedom / 3
    mode = min(fit_modes(rippled), key=lambda mode: abs(mode.frequency - 1722))
    reach = mode.quantile() * mode.standard_error
    assert np.all(np.abs(values(mode) - values(MODE)) < reach)
    i = int(np.argmin(np.abs(band.fit.frequency - 1722)))
    assert reach[0] > 5 * band.fit.standard_error[0, i]


def test_parts_of_the_lines_that_cut_the_peak_of_a_mode_say_nothing_of_it() -> None:
    true = [Mode(800.0 + 100.0 * i, 0.02, 3.5e7) for i in range(4)]
    frf = noisy(true, 1e-4, 0)
    rippled = Frf(frf.frequency, frf.receptance * (1 + 0.02 * np.sin(frf.frequency / 30)), measured_as="accelerance")
    modes = fit_modes(rippled, band=(500.0, 1500.0))
    assert [round(mode.frequency, -2) for mode in modes] == [800.0, 900.0, 1000.0, 1100.0]
    shares = [mode.standard_error[2] / mode.stiffness for mode in modes]
    assert max(shares) < 1.5 * min(shares)
    for mode, exact in zip(modes, true, strict=True):
        assert np.all(np.abs(values(mode) - values(exact)) < mode.quantile() * mode.standard_error)


def test_an_frf_without_noise_is_not_taken_for_coloured() -> None:
    (band,) = extract_modes([synthesize_frf([MODE], np.arange(5.0, 4000.0, 5.0))]).bands
    assert systematic_error(band).factor == 1.0


def dense(seed: int) -> tuple[list[Mode], Frf]:
    """28 modes from 250 to 4000 Hz, on average a half-power width apart."""
    random = np.random.default_rng(seed)
    columns = np.sort(random.uniform(250, 4000, 28)), random.uniform(0.01, 0.04, 28), 10 ** random.uniform(7.3, 8.8, 28)
    modes = [Mode(float(f), float(zeta), float(k)) for f, zeta, k in zip(*columns, strict=True)]
    return modes, noisy(modes, 1e-4, seed, step=2.0)


def stands_alone(mode: Mode, modes: list[Mode]) -> bool:
    """Return whether its half-power band is apart from those of all others."""
    reach = [mode.damping_ratio * mode.frequency + other.damping_ratio * other.frequency for other in modes]
    distance = [abs(other.frequency - mode.frequency) for other in modes]
    return sum(apart < near for apart, near in zip(distance, reach, strict=True)) == 1


@pytest.mark.long
@pytest.mark.timeout(900)
def test_95_percent_intervals_hold_the_truth_among_modes_that_are_not_fitted() -> None:
    """Only separate modes count, as a mode fitted in place of two has no true value."""
    held: dict[Trust, list[NDArray[np.bool_]]] = {trust: [] for trust in Trust}
    for seed in range(40):
        modes, frf = dense(seed)
        for mode in fit_modes(frf):
            true = min(modes, key=lambda other: abs(other.frequency - mode.frequency))
            if stands_alone(true, modes):
                limits = mode.interval()
                held[assess_trust(mode)].append((limits[:, 0] < values(true)) & (values(true) < limits[:, 1]))
    shares = {trust: np.mean(each, axis=0) for trust, each in held.items()}
    print({str(trust): (len(held[trust]), share) for trust, share in shares.items()})  # noqa: T201
    assert np.all(shares[Trust.TRUSTED] > 0.75)
    assert np.all(shares[Trust.DOUBTFUL] > 0.8)
    assert np.all(shares[Trust.REJECTED] > 0.9)
