"""A mode beyond the first or last line is in the errors of the modes inside."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition import Frf, from_accelerance
from modal import Mode, extract_modes, fit_modes, synthesize_frf
from modal.bands.edge_tails import edge_covariance, edge_tails

LAST = 2000.0
LINES = np.arange(400.0, LAST + 1, 2.0)
BEYOND = Mode(1.06 * LAST, 0.02, 3e7)
INSIDE = Mode(1500.0, 0.02, 3e7)


def measured(modes: list[Mode], seed: int = 0, noise: float = 5e-4) -> Frf:
    exact = synthesize_frf(modes, LINES).accelerance
    random = np.random.default_rng(seed).normal(size=(2, LINES.size))
    return from_accelerance(LINES, exact + noise * np.max(np.abs(exact)) * (random[0] + 1j * random[1]))


@pytest.mark.parametrize("inside", [INSIDE, Mode(1700.0, 0.02, 3e7)])
def test_intervals_next_to_a_mode_beyond_the_last_line_hold_the_truth(inside: Mode) -> None:
    modes = [Mode(900.0, 0.03, 2e7), inside, BEYOND]
    covered = []
    for seed in range(40):
        mode = min(fit_modes(measured(modes, seed)), key=lambda mode: abs(mode.frequency - inside.frequency))
        (low, *_), (high, *_) = mode.interval().T
        covered.append((low <= inside.frequency <= high, abs(mode.phase_deg) <= 2 * mode.phase_deg_std))
    assert np.mean(covered, axis=0) == pytest.approx(np.ones(2), abs=0.15)  # 0.6 and 0.4 without the tail


@pytest.mark.parametrize("lower", [False, True])
def test_the_tail_of_an_exact_frf_is_that_of_the_mode_beyond(lower: bool) -> None:
    """Mirrored over ratio 1, the mode is below the first line."""
    beyond = Mode(380.0, 0.02, 3e7) if lower else BEYOND
    inside = Mode(700.0, 0.02, 3e7) if lower else INSIDE
    state = extract_modes([measured([inside, beyond], noise=0.0)])
    tails = edge_tails(state)
    expected = beyond.receptance(LINES)
    near = slice(0, 20) if lower else slice(-20, None)
    best = min(np.max(np.abs(tail[0] - expected)[near] / np.abs(expected)[near]) for tail in tails)
    assert best < 0.6


def test_without_a_mode_beyond_no_error_is_added() -> None:
    added = []
    for seed in range(10):
        state = extract_modes([measured([Mode(900.0, 0.03, 2e7), INSIDE], seed)])
        added += [np.max(np.diag(edge_covariance(state, b)) / np.diag(b.fit.covariance)) for b in state.bands]
    assert np.max(added) < 0.05
