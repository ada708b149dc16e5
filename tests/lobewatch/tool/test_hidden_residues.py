"""Limits of the residues of modes in the FRF of the other direction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition import Frf
from lobewatch.tool.hidden_residues import find_hidden_residues
from modal import Mode, synthesize_frf

pytestmark = pytest.mark.quick

LINES = np.arange(200.0, 4000.0, 2.0)
X, Y = Mode(1500.0, 0.03, 20e6), Mode(1650.0, 0.028, 22e6)


def frf(*modes: Mode, noise: float = 0.0, seed: int = 0) -> Frf:
    """FRF of modes with white noise, over the peak of Y."""
    random, receptance = np.random.default_rng(seed), synthesize_frf(modes, LINES).receptance
    white = random.normal(size=LINES.size) + 1j * random.normal(size=LINES.size)
    return Frf(LINES, receptance + noise * Y.peak / np.sqrt(2) * white)


def test_a_mode_that_is_not_in_the_other_frf_has_hardly_any_residue() -> None:
    assert find_hidden_residues([X], [Y], frf(Y)) * X.stiffness == pytest.approx([0.0], abs=1e-9)


@pytest.mark.parametrize("share", [0.003, 0.03, 0.3])
def test_a_hidden_mode_has_its_residue(share: float) -> None:
    """Without reclamping: a shift of 0.3 % changes little where the mode stands alone."""
    (found,) = find_hidden_residues([X], [Y], frf(Y, replace(X, stiffness=X.stiffness / share)))
    assert share <= found * X.stiffness < 1.5 * share


def test_modes_at_one_frequency_cannot_be_told_apart() -> None:
    near = replace(X, frequency=1501.0)
    assert find_hidden_residues([X], [near], frf(near, noise=0.001))[0] * X.stiffness > 0.5


def test_nothing_is_said_outside_the_lines_or_with_few_of_them() -> None:
    few = Frf(np.array([1400.0, 1450.0, 1500.0, 1550.0, 1600.0]), np.zeros(5, complex))
    beyond = replace(X, frequency=5000.0)
    assert find_hidden_residues([beyond], [Y], frf(Y)).tolist() == [np.inf]
    assert find_hidden_residues([X], [Y], few).tolist() == [np.inf]


def test_the_limit_covers_hidden_residues_under_noise() -> None:
    random, covered = np.random.default_rng(5), 0
    for seed in range(60):
        hidden = replace(X, frequency=Y.frequency * random.uniform(0.88, 1.12))
        share = 10 ** random.uniform(-4, -1.5)
        measured = frf(Y, replace(hidden, stiffness=hidden.stiffness / share), noise=0.002, seed=seed)
        covered += find_hidden_residues([hidden], [Y], measured)[0] * hidden.stiffness >= share
    assert covered >= 57


def test_noise_of_accelerometers_counts_where_it_is_flat() -> None:
    """Noise of accelerance: the receptance of low lines says little, and takes nothing from the others."""
    random = np.random.default_rng(1)
    white = random.normal(size=LINES.size) + 1j * random.normal(size=LINES.size)
    noisy = frf(Y).receptance + 3e-3 * Y.peak * (Y.frequency / LINES) ** 2 * white
    limits = [
        find_hidden_residues([X], [Y], Frf(LINES, noisy, measured_as=kind))[0] for kind in ("accelerance", "receptance")
    ]
    assert limits[0] < limits[1]
