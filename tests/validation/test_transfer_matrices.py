"""Spindles with parts close together against 50-digit transfer matrices: frequencies, static stiffness, receptance.

Source: E. C. Pestel and F. A. Leckie, Matrix Methods in Elastomechanics, 1963; the state is (u, t, Q, M) with
EI t' = M, kappa G A (u' - t) = Q, Q' = -m w^2 u, M' = -Q - rho I w^2 t. Nothing of it is shared with the model.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from transfer_matrices import determinant, exact_receptance

from dsm import (
    Bearing,
    Joint,
    LumpedMass,
    Segment,
    Spindle,
    Theory,
    calibrate,
    mode_shapes,
    natural_frequencies,
    receptance,
    static_stiffness,
)
from dsm.modes.find_modes import find_modes

SEGMENTS = [Segment(0.12, 0.04), Segment(0.2, 0.07, 0.02), Segment(0.15, 0.06, 0.02)]
F = 500.0


def spindle(offset: float, theory: Theory, **parts: Any) -> Spindle:
    """Bearings beside the ends of segments, a mass beside the tip."""
    bearings = [
        Bearing(0.12 + offset, 2e8, housing_stiffness=1e9),
        Bearing(0.32 - offset, 1e8, rotational_stiffness=1e4),
        Bearing(0.47 - offset, 5e7),
    ]
    return Spindle(SEGMENTS, bearings, theory=theory, masses=[LumpedMass(offset, 0.1, 1e-5, 1e-5)], **parts)


def assert_exact(shaft: Spindle) -> None:
    """Each frequency within 1e-9, static stiffness and receptance within 1e-10."""
    for frequency in natural_frequencies(shaft, 3):
        below, above = (determinant(shaft, float(frequency) * (1 + side * 1e-9)) for side in (-1, 1))
        assert below * above < 0
    assert static_stiffness(shaft) * float(exact_receptance(shaft, 0.0, 0.0)) == pytest.approx(1, rel=1e-10)
    found = receptance(shaft, [F])[0]
    assert found == pytest.approx(float(exact_receptance(shaft, F, 0.0)), rel=1e-10)


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("offset_mm", [1e-6, 0.002, 0.01, 0.13, 0.5])
def test_parts_beside_the_end_of_a_segment(offset_mm: float, theory: Theory) -> None:
    assert_exact(spindle(offset_mm / 1e3, theory))


def test_joints_bearings_and_a_mass_within_a_tenth_of_a_millimetre() -> None:
    shaft = spindle(1e-5, "euler-bernoulli", joints=[Joint(0.12 + 1.7e-5, 3e9, 1e6), Joint(2e-6, 1e12, 1e8)])
    assert_exact(Spindle(shaft.segments, [*shaft.bearings, Bearing(0.12 + 2e-5, 1e8)], joints=shaft.joints))


def test_parts_of_a_micrometre_leave_the_rest_of_the_shaft_as_it_is() -> None:
    """A joint 10 um from a step, and thin discs at the ends of a wire."""
    stubby = Spindle([Segment(0.04, 0.0625), Segment(0.05, 0.0625)], [Bearing(0.02, 1e8), Bearing(0.07, 1e8)])
    assert_exact(Spindle(stubby.segments, stubby.bearings, joints=[Joint(0.04 - 10e-6, 1e8, 1e4)]))
    discs = Spindle([Segment(1e-7, 0.2), Segment(0.5, 0.001), Segment(1e-7, 0.2)], [])
    for frequency in natural_frequencies(discs, 4)[2:]:
        assert determinant(discs, frequency * (1 - 1e-9)) * determinant(discs, frequency * (1 + 1e-9)) < 0


@pytest.mark.parametrize("stiffness", [1e-3, 1e3, 1e6])
def test_static_stiffness_on_soft_bearings(stiffness: float) -> None:
    soft = Spindle(SEGMENTS, [Bearing(0.05, stiffness), Bearing(0.4, 2 * stiffness)])
    assert static_stiffness(soft) * float(exact_receptance(soft, 0.0, 0.0)) == pytest.approx(1, rel=1e-12)


def test_bounce_of_a_disc_half_a_micrometre_thick() -> None:
    flat = Spindle([Segment(5e-7, 0.05)], [Bearing(0.0, 1e9), Bearing(5e-7, 1e9)], theory="timoshenko")
    found = natural_frequencies(flat, 2)
    for frequency in found:
        assert determinant(flat, frequency * (1 - 1e-7)) * determinant(flat, frequency * (1 + 1e-7)) < 0


def test_modes_of_a_stiff_shaft_on_soft_bearings() -> None:
    """The stiffness of the shaft is 1e8 times that of the bearings: links throughout."""
    assert_exact(Spindle([Segment(0.03, 0.06), Segment(0.03, 0.1)], [Bearing(0.01, 1e5), Bearing(0.05, 3e4)]))


def test_calibration_beside_the_end_of_a_segment_inverts_the_frequency() -> None:
    shaft = spindle(1e-5, "euler-bernoulli")
    found = calibrate(shaft, float(natural_frequencies(shaft, 2)[1]), mode=2)
    assert found.factor == pytest.approx(1, rel=1e-8)
    assert found.modal_stiffness_after == pytest.approx(found.modal_stiffness_before, rel=1e-6)
    assert found.modal_stiffness_before > 1e6


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
def test_shapes_between_nodes_are_those_of_nodes_there(theory: Theory) -> None:
    shaft, places = spindle(1e-5, theory), 0.12 + np.array([-2e-5, -1e-9, 3e-6, 2e-5, 3e-3])
    between, nodes = mode_shapes(shaft, 3, places), find_modes(shaft, 3, places=places.tolist()).at(places)
    sign = np.sign(between.deflection[:, :1] * nodes.deflection[:, :1])
    assert between.deflection == pytest.approx(sign * nodes.deflection, abs=1e-7)
    assert between.slope == pytest.approx(sign * nodes.slope, abs=1e-6)
