"""Modes of free decays, with no force measured: against closed forms, and against the same hits with their force."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Structure
from lobewatch.tap.emulated_spindle import EMULATED_SAMPLE_RATE
from modal import Mode, fit_decays, follow_mode, predominant_mode, select_credible_modes
from tests.modal.test_hit_scatter import PRE_TRIGGER, TRUTH, first_mode, tap

RATE, SIZE = 6400.0, 1024
TIME = np.arange(SIZE) / RATE
AFTER = PRE_TRIGGER + round(1.5e-3 * EMULATED_SAMPLE_RATE)
"""First sample at which no force is left."""


def decay(*modes: tuple[float, float, float, float]) -> NDArray[np.float64]:
    """Sum of damped oscillations: frequency (Hz), damping ratio, amplitude (m/s^2) and phase (rad) of each."""
    w = [2 * np.pi * f for f, *_ in modes]
    waves = [
        size * np.exp(-zeta * at * TIME) * np.cos(at * np.sqrt(1 - zeta**2) * TIME + phase)
        for at, (_, zeta, size, phase) in zip(w, modes, strict=True)
    ]
    return np.asarray(np.sum(waves, axis=0))


def noisy_decays(seed: int, count: int = 3) -> NDArray[np.float64]:
    """Return decays of a strong and a weaker mode, each with its own sizes and phases, with noise of 1 %."""
    random = np.random.default_rng(seed)
    records = [
        decay((900.0, 0.03, random.uniform(60, 140), random.uniform(0, 6)), (1100.0, 0.02, 30.0, random.uniform(0, 6)))
        for _ in range(count)
    ]
    return np.array(records) + random.normal(size=(count, SIZE))


def near(modes: list[Mode], frequency: float) -> Mode:
    return min(modes, key=lambda mode: abs(mode.frequency - frequency))


def test_decays_without_noise_give_their_modes() -> None:
    pair = [decay((900.0, 0.03, 5.0, 0.3), (1300.0, 0.01, 2.0, 1.0)), decay((900.0, 0.03, 2.0, 2.0))]
    modes = fit_decays(pair, RATE)
    assert [mode.frequency for mode in modes] == pytest.approx([900.0, 1300.0], rel=1e-5)
    assert [mode.damping_ratio for mode in modes] == pytest.approx([0.03, 0.01], rel=1e-3)


def test_decays_tell_no_stiffness_and_no_sign_of_it() -> None:
    (mode, _) = fit_decays(noisy_decays(1), RATE)
    assert np.isnan(mode.stiffness)
    assert not mode.has_stiffness
    assert mode.is_driving_point
    assert np.isnan(mode.standard_error[2])
    assert np.all(mode.standard_error[:2] > 0)
    assert not {remark.code for remark in mode.remarks} & {"not-driving-point", "complex-mode", "near-node"}


def test_the_loudest_mode_is_the_predominant_one() -> None:
    modes = fit_decays(noisy_decays(2), RATE)
    assert [mode.relative_peak == 1.0 for mode in modes] == [True, False]
    assert predominant_mode(modes) is modes[0]
    assert select_credible_modes(modes).modes == tuple(modes)


def test_size_offset_and_order_of_the_decays_do_not_matter() -> None:
    records = noisy_decays(3)
    plain, other = fit_decays(records, RATE), fit_decays(7.5 * records[::-1] + 9.81, RATE)
    for mode, same in zip(plain, other, strict=True):
        assert same.frequency == pytest.approx(mode.frequency, rel=1e-6)
        assert same.damping_ratio == pytest.approx(mode.damping_ratio, rel=1e-4)
        assert same.standard_error[:2] == pytest.approx(mode.standard_error[:2], rel=1e-2)


def test_modes_are_those_of_the_same_hits_with_their_force() -> None:
    hits = tap(4, hits=5)
    with_force = first_mode(hits)
    mode = near(fit_decays([hit.acceleration[AFTER:] for hit in hits], EMULATED_SAMPLE_RATE), TRUTH[0])
    low, high = mode.interval()[0]
    assert low < TRUTH[0] < high
    assert mode.frequency == pytest.approx(with_force.frequency, rel=1e-4)
    assert mode.damping_ratio == pytest.approx(with_force.damping_ratio, rel=1e-2)
    assert follow_mode(with_force, [mode]).mode is mode
    assert follow_mode(mode, [with_force]).mode is with_force


@pytest.mark.parametrize("width", [1e-3, 3e-3])
def test_force_that_still_acts_at_the_first_sample_moves_no_pole(width: float) -> None:
    structure = Structure(np.array([400.0]), np.array([0.03]), np.array([2e7]))
    whole = structure.response(np.arange(8192) / RATE, width)[None]
    for begin in (0, 4, 24):
        (mode, *_) = fit_decays(whole[:, begin : begin + 4096], RATE)
        assert mode.frequency == pytest.approx(400.0, rel=2e-4)
        assert mode.damping_ratio == pytest.approx(0.03, rel=5e-3)


def test_95_percent_intervals_hold_the_truth() -> None:
    held = []
    for seed in range(200):
        mode = near(fit_decays(noisy_decays(seed), RATE, (300.0, 2000.0)), 900.0)
        held.append([low < true < high for (low, high), true in zip(mode.interval(), (900.0, 0.03), strict=False)])
    print(f"200 x 3 decays: f, zeta {np.mean(held, axis=0)}")  # noqa: T201
    assert np.all(np.mean(held, axis=0) >= 0.90)
    assert np.all(np.mean(held, axis=0) <= 0.99)


@pytest.mark.long
@pytest.mark.timeout(1200)
@pytest.mark.parametrize(("hits", "tests"), [(1, 500), (3, 500), (10, 500)])
def test_95_percent_intervals_of_tap_tests_without_force_hold_the_truth(hits: int, tests: int) -> None:
    held = []
    for seed in range(tests):
        decays = [hit.acceleration[AFTER:] for hit in tap(seed, hits)]
        mode = near(fit_decays(decays, EMULATED_SAMPLE_RATE), TRUTH[0])
        held.append([low < true < high for (low, high), true in zip(mode.interval(), TRUTH[:2], strict=False)])
    print(f"{hits} decays: f, zeta {np.mean(held, axis=0)}")  # noqa: T201
    assert np.all(np.mean(held, axis=0) >= 0.91)


@pytest.mark.parametrize(
    ("decays", "why"),
    [
        (np.zeros((2, 64)), "constant"),
        (np.full((1, 64), np.nan), "not finite"),
        (np.ones((1, 8)), "32 samples"),
        (np.ones((2, 3, 64)), "shape"),
    ],
)
def test_what_is_no_decay_is_rejected(decays: NDArray[np.float64], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        fit_decays(decays, RATE)


def test_a_relative_peak_belongs_to_a_mode_without_stiffness() -> None:
    for stiffness, peak in ((np.nan, None), (1e7, 0.5), (np.nan, 0.0)):
        with pytest.raises(ValueError, match="stiffness"):
            Mode(900.0, 0.03, stiffness, relative_peak=peak)
