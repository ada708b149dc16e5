"""Errors of H1 by noise of the hammer: closed form of an impulse, and 2000 simulated averages."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Hit, estimate_frf, propagate_force_noise

RATE, SIZE, PRE_TRIGGER = 10_000.0, 2000, 100
LINES = np.array([50.0, 300.0, 500.0, 550.0, 900.0])
"""On the lines of the record (5 Hz apart)."""
BASELINE = 80
"""Samples, four fifths of those before the trigger."""


def impulse(peak: float, noise: float) -> Hit:
    """One sample of force, on a baseline that swings by noise: rms noise and mean 0, exactly."""
    force = noise * np.tile([1.0, -1.0], SIZE // 2)
    force[BASELINE:] = 0.0
    force[PRE_TRIGGER] = peak
    return Hit(force, force, RATE, PRE_TRIGGER)


def covariance(columns: list[NDArray[np.complex128]]) -> NDArray[np.complex128]:
    return np.asarray(sum(part @ part.conj().T for part in columns))


def impulse_variance() -> NDArray[np.float64]:
    """Return the variance of H1 / H for one hit: an impulse of 1 N with noise of 1 N rms, at the lines.

    The window has 18 samples of weight 1, and 7 on either side of weights cos^2(pi k / 16): squares add up to 23. The
    error of the mean of the baseline is the same at all of them, so that their spectrum counts.
    """
    taper = np.cos(np.pi * np.arange(1, 8) / 16) ** 2
    window = np.concatenate([taper[::-1], np.ones(18), taper])
    spectrum = np.exp(-2j * np.pi * np.outer(LINES, np.arange(32)) / RATE) @ window
    return np.asarray(23 + np.abs(spectrum) ** 2 / BASELINE)


def test_impulse() -> None:
    found = covariance(list(propagate_force_noise([impulse(100.0, 2.0)], LINES)))
    assert np.diag(found) == pytest.approx(impulse_variance() * (2.0 / 100.0) ** 2)


def test_hits_count_by_their_own_noise_and_force() -> None:
    hits = [impulse(100.0, 2.0), impulse(300.0, 1.0)]
    expected = impulse_variance() * (2.0**2 * 100.0**2 + 1.0**2 * 300.0**2) / (100.0**2 + 300.0**2) ** 2
    assert np.diag(covariance(list(propagate_force_noise(hits, LINES)))) == pytest.approx(expected)


def test_sign_and_time_of_a_sample() -> None:
    """Force that is too high by d at the impulse itself makes H1 too low by d / peak, at all lines alike."""
    (columns,) = propagate_force_noise([impulse(100.0, 2.0)], LINES)
    at_pulse = columns[:, np.argmin(np.ptp(np.angle(-columns), axis=0))]
    assert at_pulse == pytest.approx(np.full(LINES.size, -0.02))


def test_covariance_is_that_of_simulated_averages() -> None:
    """Both of the complex error and its square: real and imaginary parts are not alike. rms of 100 baselines."""
    random = np.random.default_rng(5)
    time = np.arange(SIZE) - PRE_TRIGGER
    clean = [
        np.where((time >= 0) & (time < n), peak * np.sin(np.pi * time / n), 0.0) for n, peak in ((9, 80.0), (12, 50.0))
    ]
    response = np.exp(-0.02 * np.clip(time, 0, None)) * np.sin(0.3 * time) * (time > 0)

    def average() -> list[Hit]:
        noises = random.normal(scale=[[0.4], [0.7]], size=(2, SIZE))
        pairs = zip(clean, noises, strict=True)
        return [Hit(f + n, np.convolve(f, response[PRE_TRIGGER:])[:SIZE], RATE, PRE_TRIGGER) for f, n in pairs]

    at = np.round(LINES / 5.0).astype(int) - 1
    frfs = np.array([estimate_frf(average()).receptance[at] for _ in range(2000)])
    error = frfs / frfs.mean(axis=0) - 1
    made = [np.concatenate(list(propagate_force_noise(average(), LINES)), axis=1) for _ in range(100)]
    columns = np.concatenate(made, axis=1) / np.sqrt(100)
    size = np.real(np.diag(columns @ columns.conj().T))
    scale = np.sqrt(np.outer(size, size))
    for found, expected in (
        (error.T @ error.conj() / 2000, columns @ columns.conj().T),
        (error.T @ error / 2000, columns @ columns.T),
    ):
        assert np.max(np.abs(found - expected) / scale) < 0.15


def test_hit_without_pulse_is_rejected() -> None:
    with pytest.raises(ValueError, match="pulse"):
        list(propagate_force_noise([Hit(np.zeros(SIZE), np.zeros(SIZE), RATE)], LINES))
