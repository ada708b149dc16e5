"""Noise that grows with the FRF: weights from the fit residual."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Frf, from_accelerance
from modal import Mode, Trust, assess_trust, fit_common_modes, fit_modes, synthesize_frf

LINES = np.arange(200.0, 4000.0, 4.0)
STRUCTURES = {
    "alone": [Mode(1500.0, 0.03, 3e7)],
    "beside another": [Mode(1500.0, 0.03, 3e7), Mode(1900.0, 0.02, 6e7)],
    "sharp": [Mode(1500.0, 0.005, 3e8), Mode(2100.0, 0.01, 1e8)],
}
LEVEL = 0.03
"""rms of the noise over the FRF, line by line."""
FRFS, LEAST = 400, {0.0: 0.92, 0.001: 0.9}
"""FRFs, and the share of the intervals that hold the truth, at least, by the white floor under the noise."""
FEW_FRFS, LEAST_OF_FEW = 100, 0.87
"""Number of FRFs, and smallest share of intervals with the truth; its standard error is 0.022."""


def measured(truth: list[Mode], seed: int, floor: float = 0.0) -> Frf:
    """floor: rms of white noise over the largest accelerance."""
    exact = synthesize_frf(truth, LINES).accelerance
    random = np.random.default_rng(seed)
    noise, white = random.normal(size=(2, 2, LINES.size)) / np.sqrt(2)
    off = LEVEL * np.abs(exact) * (noise[0] + 1j * noise[1]) + floor * np.max(np.abs(exact)) * (
        white[0] + 1j * white[1]
    )
    return from_accelerance(LINES, exact + off)


def are_held(mode: Mode, truth: Mode) -> NDArray[np.bool_]:
    """Return whether the 95 % intervals of f, zeta and K contain the truth."""
    value = np.array([truth.frequency, truth.damping_ratio, truth.stiffness])
    low, high = mode.interval(0.95).T
    return np.asarray((low < value) & (value < high))


def held(truth: list[Mode], frfs: int, floor: float) -> NDArray[np.float64]:
    found = [fit_modes(measured(truth, seed, floor)) for seed in range(frfs)]
    assert all(len(modes) == len(truth) for modes in found)
    assert np.mean([assess_trust(modes[0]) is Trust.TRUSTED for modes in found]) > 0.95
    share = np.mean([are_held(modes[0], truth[0]) for modes in found], axis=0)
    print(f"{len(truth)} modes, floor {floor}: f, zeta, K {share}")  # noqa: T201
    return np.asarray(share)


@pytest.mark.parametrize("name", STRUCTURES)
def test_intervals_hold_the_truth_where_noise_grows_with_the_frf(name: str) -> None:
    assert np.all(held(STRUCTURES[name], FEW_FRFS, 0.0) >= LEAST_OF_FEW)


@pytest.mark.long
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("floor", LEAST)
@pytest.mark.parametrize("name", STRUCTURES)
def test_95_percent_intervals_hold_the_truth_where_noise_grows_with_the_frf(name: str, floor: float) -> None:
    assert np.all(held(STRUCTURES[name], FRFS, floor) >= LEAST[floor])


def test_an_frf_with_far_more_noise_than_the_others_does_not_spoil_them() -> None:
    truth = STRUCTURES["alone"]
    exact = synthesize_frf(truth, LINES).accelerance
    for seed in range(5):
        noise = np.random.default_rng(seed).normal(size=(2, 2, LINES.size)) * np.max(np.abs(exact))
        still, loud = (
            exact + level * (part[0] + 1j * part[1]) for level, part in zip((1e-4, 1e-2), noise, strict=True)
        )
        (alone,) = fit_modes(from_accelerance(LINES, still))
        (mode,) = fit_common_modes([from_accelerance(LINES, still), from_accelerance(LINES, loud)])
        assert mode.standard_error == pytest.approx(alone.standard_error, rel=0.3)
        assert np.all(np.abs(mode.frequency - truth[0].frequency) < 4.5 * mode.standard_error[0])
