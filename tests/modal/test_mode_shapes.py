"""Complex mode shapes: normalisation, phases, repeated points, MAC, and the agreement of FRFs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from acquisition import Frf
from modal import (
    Mode,
    ModeShape,
    average_points,
    compare_frfs,
    extract_modes,
    fit_mode_shapes,
    mac,
    mac_matrix,
    synthesize_frf,
)

LINES = np.arange(5.0, 2000.0, 5.0)
COMPLEX = st.complex_numbers(min_magnitude=0.1, max_magnitude=3, allow_nan=False)


def shape_of(motion: list[complex], error: float = 0.01) -> ModeShape:
    return ModeShape(Mode(500.0, 0.02, 2e7), np.array(motion, dtype=complex), error**2 * np.eye(len(motion)))


def test_shapes_of_two_masses_have_unit_modal_mass() -> None:
    """Two masses m on a chain of three springs k: K = k [[2, -1], [-1, 2]], w^2 = k/m and 3 k/m, phi = (1, +-1)."""
    mass, stiffness, zeta = 2.0, 2e7, 0.02
    modes = [(np.sqrt(k * stiffness / mass) / (2 * np.pi), np.array([1.0, sign])) for k, sign in ((1, 1), (3, -1))]
    frfs = [
        synthesize_frf(
            [Mode(f, zeta, (2 * np.pi * f) ** 2 / (shape[0] * shape[point] / (2 * mass))) for f, shape in modes],
            LINES,
        )
        for point in range(2)
    ]
    found = fit_mode_shapes(frfs)
    assert [shape.mode.frequency for shape in found] == pytest.approx([f for f, _ in modes], rel=1e-6)
    normalized = np.array([shape.mass_normalized for shape in found])
    assert mass * normalized @ normalized.T == pytest.approx(np.eye(2), abs=1e-6)
    assert mac_matrix([*normalized], [*normalized]) == pytest.approx(np.eye(2), abs=1e-6)


def test_phases_of_the_points_are_fitted() -> None:
    motion = np.array([1.0, 0.6 * np.exp(0.5j), -0.4 * np.exp(-0.3j)])
    modes = [
        Mode(
            500.0,
            0.02,
            2e7 / abs(ratio) * np.sign(ratio.real),
            phase_deg=np.degrees(np.angle(ratio * np.sign(ratio.real))),
        )
        for ratio in motion
    ]
    (shape,) = fit_mode_shapes([synthesize_frf([mode], LINES) for mode in modes])
    assert shape.motion == pytest.approx(motion, abs=1e-6)


def test_errors_of_the_motions_are_those_of_many_noisy_measurements() -> None:
    motion, rng = [1.0, 0.5, -0.3], np.random.default_rng(2)
    exact = [synthesize_frf([Mode(500.0, 0.02, 2e7 / ratio)], LINES[:300]).receptance for ratio in motion]
    found = []
    for _ in range(40):
        noise = 2e-9 * (rng.normal(size=(3, 300)) + 1j * rng.normal(size=(3, 300)))
        found += fit_mode_shapes([Frf(LINES[:300], row + part) for row, part in zip(exact, noise, strict=True)])
    scatter = np.std([shape.motion.real for shape in found], axis=0)
    stated = np.mean([shape.motion_error for shape in found], axis=0)
    assert len(found) == 40
    assert stated[0] == 0
    assert stated[1:] == pytest.approx(scatter[1:], rel=0.3)


def test_covariance_of_the_sizes_has_their_errors() -> None:
    rng = np.random.default_rng(3)
    exact = [synthesize_frf([Mode(500.0, 0.02, 2e7 / ratio), Mode(540.0, 0.03, 3e7)], LINES) for ratio in (1.0, -0.4)]
    noise = 1e-8 * (rng.normal(size=(2, LINES.size)) + 1j * rng.normal(size=(2, LINES.size)))
    state = extract_modes([Frf(LINES, frf.receptance + part) for frf, part in zip(exact, noise, strict=True)])
    (band,) = state.bands
    for i in range(2):
        covariance = band.fit.size_covariance(i)
        assert np.sqrt(np.diag(covariance)) == pytest.approx(band.fit.size_error[:, i], rel=1e-9)
        assert covariance[0, 1] > 0.1 * np.sqrt(covariance[0, 0] * covariance[1, 1])  # by the common damping ratio


@given(st.lists(COMPLEX, min_size=3, max_size=6), COMPLEX)
def test_collinearity_does_not_depend_on_the_scale(motion: list[complex], factor: complex) -> None:
    assume(abs(np.sum(np.square(motion))) > 1e-3)
    first, scaled = shape_of(motion), shape_of([factor * value for value in motion])
    assert 0 <= first.phase_collinearity <= 1 + 1e-12
    assert scaled.phase_collinearity == pytest.approx(first.phase_collinearity)
    assert scaled.mean_phase_deviation_deg == pytest.approx(first.mean_phase_deviation_deg, abs=1e-6)


def test_collinearity_of_standing_and_travelling_waves() -> None:
    standing, travelling = shape_of([1.0, -0.5, 0.2]), shape_of([1.0, 1j])
    assert (standing.phase_collinearity, standing.mean_phase_deviation_deg) == pytest.approx((1.0, 0.0))
    assert travelling.phase_collinearity == pytest.approx(0.0)
    pair = shape_of([1.0, np.exp(0.4j)])  # both 0.2 rad from the line in their middle
    assert pair.mean_phase_deviation_deg == pytest.approx(np.degrees(0.2))
    assert pair.phase_collinearity == pytest.approx(np.cos(0.4) ** 2)


def test_repeated_points_are_averaged_and_normalised_to_the_tip() -> None:
    shape = average_points(shape_of([1.0, 1.1, 0.42, 0.63]), [[0, 1], [2], [3]])
    assert shape.motion == pytest.approx(np.array([1.0, 0.4, 0.6]))
    errors = np.sqrt(np.diag(shape.size_covariance))
    assert errors[1] == pytest.approx(0.01)
    assert errors[0] == pytest.approx(np.hypot(0.05, 0.01 * np.hypot(1, 1.1) / 2) / 1.05)
    assert shape.motion_error[1] == pytest.approx(0.4 * np.hypot(*errors[:2]))


@pytest.mark.parametrize("ratio", [1.2, 1.2 * np.exp(0.2j), -3.0])
def test_the_tip_measured_twice_has_the_mean_modal_constant(ratio: complex) -> None:
    single, factor = shape_of([1.0, ratio, 0.5]), (1 + ratio) / 2
    tap = replace(single.mode, covariance=np.diag([0.1, 1e-4, 2e5]) ** 2)
    found = average_points(replace(single, mode=tap), [[0, 1], [2]])
    assert found.mode.constant == pytest.approx(factor * tap.constant)
    at_tip, before = found.mass_normalized, single.mass_normalized
    assert at_tip[0] * at_tip == pytest.approx(before[0] * np.array([before[0] * factor, before[2]]))
    scatter = abs(1 - ratio) / 2 / abs(factor)
    relative = found.mode.standard_error / [1, 1, found.mode.stiffness * np.sign(factor.real)]
    assert relative == pytest.approx([0.1, 1e-4, np.hypot(0.01, scatter)])


def test_the_same_frf_agrees_whatever_its_size_and_sign() -> None:
    frf = synthesize_frf([Mode(500.0, 0.02, 2e7), Mode(1500.0, 0.02, 3e7)], LINES)
    other = synthesize_frf([Mode(650.0, 0.02, 2e7)], LINES)
    assert compare_frfs(frf, replace(frf, receptance=-0.8 * frf.receptance)) == pytest.approx((1.0, -0.8))
    assert compare_frfs(frf, other).frac < 0.1
    assert compare_frfs(frf, other, (5.0, 100.0)).frac > 0.9


def test_mac_matrix_is_the_mac_of_each_pair() -> None:
    first, second = [[1.0, 0.5, 0.2], [1.0, -0.5, 0.1]], [[1.0, 0.4, 0.3]]
    assert mac_matrix(first, second).tolist() == [[mac(first[0], second[0])], [mac(first[1], second[0])]]
