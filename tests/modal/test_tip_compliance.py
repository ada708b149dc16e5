"""Shares of the parts in the compliance at the tip: closed forms, and the tip motion with a softer part."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from dsm import Spindle, mode_shapes, receptance, static_stiffness
from modal import compliance_shares
from tests.modal.simulated_parts import PARTS, SPINDLE, draw, place_points, soften, true_motion, true_shares

STEP = 1e-3
"""Relative step of the flexibility of a part."""


def test_deformation_of_each_part_is_its_share() -> None:
    z = [0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.25, 0.5]
    parts = ["tool", "tool", "holder", "holder", "spindle", "spindle", "column", "column"]
    # Lines through the points at z = 0: holder 0.7, spindle 0.4, column -0.1; the tip moves by 1.
    motion = [1.0, 0.8, 0.7 - 0.3, 0.7 - 0.45, 0.4 - 0.4, 0.4 - 0.6, -0.1 + 0.05, -0.1 + 0.1]
    shares = compliance_shares(z, parts, motion, np.zeros((8, 8)))
    assert [row.parts for row in shares] == [("tool",), ("holder",), ("spindle",), ("column",)]
    assert [row.share for row in shares] == pytest.approx([0.3, 0.3, 0.5, -0.1])


def test_positions_may_begin_anywhere() -> None:
    z = np.array([0.0, 0.1, 0.2, 0.3, 0.4])
    parts, motion = ["tool", "holder", "holder", "spindle", "spindle"], [1.0, 0.6, 0.5, 0.2, 0.15]
    first, moved = (compliance_shares(z + by, parts, motion, np.zeros((5, 5))) for by in (0.0, 0.7))
    assert [row.share for row in moved] == pytest.approx([row.share for row in first])


def test_a_part_with_one_point_counts_to_the_part_in_front() -> None:
    parts = ["tool", "holder", "spindle", "spindle", "column"]
    shares = compliance_shares([0.0, 0.1, 0.2, 0.3, 0.4], parts, [1.0, 0.7, 0.3, 0.2, 0.1], np.zeros((5, 5)))
    assert [row.parts for row in shares] == [("tool", "holder"), ("spindle", "column")]
    assert [row.share for row in shares] == pytest.approx([0.5, 0.5])


@given(st.permutations(range(6)), st.lists(st.floats(-2, 2), min_size=5, max_size=5))
def test_shares_add_up_to_one_in_any_order_of_points(order: list[int], others: list[float]) -> None:
    z = np.array([0.0, 0.1, 0.15, 0.2, 0.25, 0.4])
    parts = np.array(["tool", "holder", "holder", "spindle", "spindle", "spindle"])
    motion = np.array([1.0, *others])
    shares = compliance_shares(z[order], [str(name) for name in parts[order]], motion[order], 1e-4 * np.eye(6))
    assert sum(row.share for row in shares) == pytest.approx(1.0)


def test_a_straight_part_uses_all_points_and_a_bent_one_its_front() -> None:
    z, parts = [0.0, 0.2, 0.25, 0.3, 0.35], ["tool", "spindle", "spindle", "spindle", "spindle"]
    error = 1e-4 * np.eye(5)
    straight = compliance_shares(z, parts, [1.0, 0.4, 0.35, 0.3, 0.25], error)[1]
    bent = compliance_shares(z, parts, [1.0, 0.4, 0.35, 0.36, 0.5], error)[1]
    front = compliance_shares(z[:3], parts[:3], [1.0, 0.4, 0.35], error[:3, :3])[1]
    assert straight.share == pytest.approx(0.6)
    assert (bent.share, bent.standard_error) == pytest.approx((front.share, front.standard_error))
    assert straight.standard_error < 0.8 * front.standard_error


def test_error_of_a_share_is_that_of_many_noisy_shapes() -> None:
    z, parts = [0.0, 0.1, 0.15, 0.2, 0.3], ["tool", "holder", "holder", "spindle", "spindle"]
    exact, error = np.array([1.0, 0.6, 0.4, 0.2, -0.1]), np.array([0.02, 0.05, 0.05, 0.1, 0.2])
    rng, rows = np.random.default_rng(1), []
    for _ in range(400):
        noisy = exact * (1 + error * rng.normal(size=5))
        rows.append([row.share for row in compliance_shares(z, parts, noisy / noisy[0], np.diag(error**2))])
    stated = [row.standard_error for row in compliance_shares(z, parts, exact, np.diag(error**2))]
    assert np.std(rows, axis=0) == pytest.approx(stated, rel=0.15)


def test_two_points_of_a_part_at_one_place_have_no_slope() -> None:
    with pytest.raises(ValueError, match=r"0\.1 m"):
        compliance_shares([0.0, 0.1, 0.1], ["tool", "spindle", "spindle"], [1.0, 0.5, 0.4], np.zeros((3, 3)))


def test_shares_of_all_modes_are_what_softer_parts_do_to_the_static_compliance() -> None:
    modes, shares = true_shares(SPINDLE, 24)
    compliance = 1 / modes.stiffness_at(0.0)
    by_part = compliance @ shares
    softer, stiffer = (
        np.array([1 / static_stiffness(soften(name, sign * STEP)) for name in PARTS]) for sign in (1, -1)
    )
    assert by_part == pytest.approx((softer - stiffer) / (2 * STEP), abs=0.01 * np.sum(by_part))


def test_share_of_one_mode_is_what_a_softer_part_does_under_the_same_inertia_forces() -> None:
    modes, shares = true_shares(SPINDLE, 4)
    z, mass = gauss_masses()
    shapes = mode_shapes(SPINDLE, 4, z).deflection / modes.at(np.zeros(1)).deflection
    forces = (2 * np.pi * modes.frequency[:, np.newaxis]) ** 2 * mass * shapes
    for i, name in enumerate(PARTS):
        softer, stiffer = (forces @ deflection_per_force(soften(name, sign * STEP), z) for sign in (1, -1))
        assert (softer + stiffer) / 2 == pytest.approx(np.ones(4), abs=0.01)  # forces of the mode itself
        assert (softer - stiffer) / (2 * STEP) == pytest.approx(shares[:, i], abs=0.01)


def gauss_masses() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return places on the shaft (m), and the mass that each stands for (kg)."""
    node, weight = np.polynomial.legendre.leggauss(5)
    ends = np.cumsum([0.0, *(segment.length for segment in SPINDLE.segments)])
    half = np.diff(ends)[:, np.newaxis] / 2
    area = np.array([[np.pi / 4 * segment.outer_diameter**2] for segment in SPINDLE.segments])
    places = ends[:-1, np.newaxis] + half * (1 + node)
    return places.ravel(), (SPINDLE.density * area * half * weight).ravel()


def deflection_per_force(spindle: Spindle, z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the static deflection of the tip per force at each place (m/N)."""
    return np.array([receptance(spindle, [0.0], at, 0.0, 0.0)[0].real for at in z])


@pytest.mark.parametrize("spindles", [5, pytest.param(100, marks=pytest.mark.long)])
def test_shares_of_measured_points_are_near_the_true_ones(spindles: int) -> None:
    """Modes with at least 30 % of the highest compliance 1/K, of the lowest six, with errors of 0.3 % at each point."""
    rng, errors, within = np.random.default_rng(11), [], []
    for spindle in (draw(rng) for _ in range(spindles)):
        (modes, shares), points = true_shares(spindle, 6), place_points(spindle)
        peaks, parts = 1 / modes.stiffness_at(0.0), [point.part for point in points]
        for r in np.flatnonzero(peaks > 0.3 * peaks.max()):
            noisy = true_motion(modes, points, int(r)) * (1 + 0.003 * rng.normal(size=len(points)))
            positions = [point.position for point in points]
            rows = compliance_shares(positions, parts, noisy / noisy[0], 0.003**2 * np.eye(len(points)))
            error = np.array([row.share for row in rows]) - shares[r]
            errors.append(np.max(np.abs(error)))
            within += [abs(e) < 2 * row.standard_error for e, row in zip(error, rows, strict=True)]
    assert np.mean(np.array(errors) < 0.1) >= 0.98
    assert np.mean(within) >= 0.93
