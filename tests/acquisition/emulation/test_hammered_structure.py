"""Exact response to a pulse against numerical integration, and its limits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lsim

from acquisition import HammeredStructure, Structure


def test_response_equals_numerical_integration() -> None:
    structure = Structure(np.array([900.0, 1722.0]), np.array([0.03, 0.1]), np.array([2e7, 3.2e7]))
    width, time = 0.6e-3, np.arange(0, 0.02, 1 / 2e6)
    force = np.where(time <= width, np.sin(np.pi * time / width) ** 4, 0.0)
    expected = np.zeros(time.size)
    for f, zeta, k in zip(structure.frequency, structure.damping_ratio, structure.stiffness, strict=True):
        w = 2 * np.pi * f
        expected += lsim(([w**2 / k, 0, 0], [1, 2 * zeta * w, w**2]), force, time)[1]
    assert structure.response(time, width) == pytest.approx(expected, abs=1e-5 * np.max(np.abs(expected)))


def test_residual_alone_follows_the_second_derivative_of_the_force() -> None:
    structure = Structure(np.array([1e3]), np.array([0.01]), np.array([1e30]), residual=2e-9)
    width, step = 1e-3, 1e-6
    time = np.arange(2 * step, width - 2 * step, step)
    force = [np.sin(np.pi * (time + shift) / width) ** 4 for shift in (-step, 0.0, step)]
    curvature = (force[0] - 2 * force[1] + force[2]) / step**2
    assert structure.response(time, width) == pytest.approx(2e-9 * curvature, abs=2e-9 * 1e-4 * np.max(curvature))


def test_blocks_of_any_size_give_the_same_signal(tapper: Callable[..., HammeredStructure]) -> None:
    quiet = {"force_noise": 0.0, "response_noise": 0.0}
    whole = tapper(**quiet)(0, 40_000)
    pieces = tapper(**quiet)
    assert np.array_equal(np.concatenate([pieces(i, 100) for i in range(0, 40_000, 100)], axis=1), whole)
