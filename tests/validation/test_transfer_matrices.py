"""Spindles with parts close together against 50-digit transfer matrices: frequencies, static stiffness, receptance.

Source: E. C. Pestel and F. A. Leckie, Matrix Methods in Elastomechanics, 1963; the state is (u, t, Q, M) with
EI t' = M, kappa G A (u' - t) = Q, Q' = -m w^2 u, M' = -Q - rho I w^2 t. Nothing of it is shared with the model.
"""

from __future__ import annotations

import math
from typing import Any

import mpmath
import numpy as np
import pytest
from mpmath import mpf

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

DIGITS = 50


def determinant(spindle: Spindle, frequency: float) -> mpf:
    """0 at a natural frequency (Hz) of the shaft with free ends."""
    with mpmath.workdps(DIGITS):
        end, _ = _along(spindle, frequency, math.inf)
        return end[2, 0] * end[3, 1] - end[2, 1] * end[3, 0]


def exact_receptance(spindle: Spindle, frequency: float, position: float) -> mpf:
    """Driving-point receptance (m/N) at a frequency (Hz) and a place (m), undamped."""
    with mpmath.workdps(DIGITS):
        end, before = _along(spindle, frequency, position)
        beyond = end * before**-1
        ends = mpmath.matrix([[end[2, 0], end[2, 1]], [end[3, 0], end[3, 1]]])
        tip = mpmath.lu_solve(ends, mpmath.matrix([beyond[2, 2], beyond[3, 2]]))
        return before[0, 0] * tip[0] + before[0, 1] * tip[1]


def _along(spindle: Spindle, frequency: float, position: float) -> tuple[mpmath.matrix, mpmath.matrix]:
    """Transfer matrices from the tip to the far end, and to a place."""
    w2 = (2 * mpmath.pi * mpf(frequency)) ** 2
    ends = [mpf(0)]
    for segment in spindle.segments:
        ends.append(ends[-1] + mpf(segment.length))
    places = {
        *ends,
        *(mpf(part.position) for part in spindle.bearings),
        *(mpf(mass.position) for mass in spindle.masses),
    }
    places |= {mpf(joint.position) for joint in spindle.joints} | ({mpf(position)} - {mpf("inf")})
    stops = sorted(places)
    total = before = mpmath.eye(4)
    for place, following in zip(stops, [*stops[1:], None], strict=True):
        total = _parts(spindle, place, w2) * total
        before = total if place == position else before
        if following is not None:
            index = max(i for i, end in enumerate(ends[:-1]) if end <= place)
            total = _uniform(spindle, spindle.segments[index], following - place, w2) * total
    return total, before


def _parts(spindle: Spindle, place: mpf, w2: mpf) -> mpmath.matrix:
    """Return the transfer matrix of bearings, masses and joints at one place, where at most one is."""
    matrix = mpmath.eye(4)
    for bearing in spindle.bearings:
        if bearing.position == place:
            matrix[2, 0] += 1 / (1 / mpf(bearing.stiffness) + 1 / mpf(bearing.housing_stiffness))
            matrix[3, 1] += mpf(bearing.rotational_stiffness)
    for mass in spindle.masses:
        if mass.position == place:
            matrix[2, 0] -= mpf(mass.mass) * w2
            matrix[3, 1] -= mpf(mass.diametral_inertia) * w2
    for joint in spindle.joints:
        if joint.position == place:
            matrix[0, 2], matrix[1, 3] = 1 / mpf(joint.stiffness), 1 / mpf(joint.rotational_stiffness)
    return matrix


def _uniform(spindle: Spindle, segment: Segment, length: mpf, w2: mpf) -> mpmath.matrix:
    """exp(A L) as a power series, rows and columns scaled to one size."""
    material = segment.material or spindle.material
    outer, bore = mpf(segment.outer_diameter), mpf(segment.bore_diameter)
    area, second = mpmath.pi * (outer**2 - bore**2) / 4, mpmath.pi * (outer**4 - bore**4) / 64
    rigidity, density = mpf(material.youngs_modulus) * second, mpf(material.density)
    soft, turning = mpf(0), mpf(0)
    if spindle.theory == "timoshenko":
        nu, ring = mpf(material.youngs_modulus) / (2 * mpf(material.shear_modulus)) - 1, (1 + (bore / outer) ** 2) ** 2
        kappa = 6 * (1 + nu) * ring / ((7 + 6 * nu) * ring + (20 + 12 * nu) * (bore / outer) ** 2)
        soft, turning = 1 / (kappa * mpf(material.shear_modulus) * area), density * second * w2
    rows = [[0, 1, soft, 0], [0, 0, 0, 1 / rigidity], [-density * area * w2, 0, 0, 0], [0, -turning, -1, 0]]
    size = [mpf(1), 1 / length, rigidity / length**3, rigidity / length**2]
    slope = mpmath.matrix(4, 4)
    for i in range(4):
        for j in range(4):
            slope[i, j] = rows[i][j] * length * size[j] / size[i]
    found = term = mpmath.eye(4)
    for order in range(1, 300):
        term = term * slope / order
        found = found + term
        if max(abs(value) for value in term) < mpf(10) ** (-DIGITS - 2):
            break
    for i in range(4):
        for j in range(4):
            found[i, j] *= size[i] / size[j]
    return found


SEGMENTS = [Segment(0.12, 0.04), Segment(0.2, 0.07, 0.02), Segment(0.15, 0.06, 0.02)]
F = 500.0


def spindle(offset: float, theory: Theory, **parts: Any) -> Spindle:
    """Bearings close to the ends of segments, a mass close to the tip."""
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
def test_parts_next_to_the_end_of_a_segment(offset_mm: float, theory: Theory) -> None:
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


@pytest.mark.parametrize("apart_um", [2.0, 2.06, 2.1])
def test_rocking_on_two_bearings_two_micrometres_apart(apart_um: float) -> None:
    """Some 0.02 Hz; the matrix near such a mode is singular to working precision."""
    segments = [
        Segment(0.047, 0.052),
        Segment(0.047, 0.047, 0.033),
        Segment(0.0094, 0.129, 0.039),
        Segment(0.0071, 0.106),
    ]
    bearings = [Bearing(0.1048, 4.75e7, housing_stiffness=3.6e8), Bearing(0.1048 + apart_um / 1e6, 8.6e7)]
    shaft = Spindle(segments, bearings, theory="timoshenko")
    rocking = float(natural_frequencies(shaft, 1)[0])
    assert determinant(shaft, rocking * (1 - 3e-7)) * determinant(shaft, rocking * (1 + 3e-7)) < 0


def test_modes_of_a_stiff_shaft_on_soft_bearings() -> None:
    """The stiffness of the shaft is 1e8 times that of the bearings: links throughout."""
    assert_exact(Spindle([Segment(0.03, 0.06), Segment(0.03, 0.1)], [Bearing(0.01, 1e5), Bearing(0.05, 3e4)]))


def test_calibration_next_to_the_end_of_a_segment_inverts_the_frequency() -> None:
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


MODES = 6
CLOSEST = 2e-9
"""Least distance between two parts over the length of the shaft."""


def random_spindle(draw: np.random.Generator) -> Spindle:
    """Two to eight segments, two to six bearings, up to two masses and two joints; half of them close to others."""
    segments = [
        Segment(float(10 ** draw.uniform(-2.5, -0.8)), outer, float(draw.choice([0.0, 0.3, 0.7])) * outer)
        for outer in 10 ** draw.uniform(-1.6, -0.8, int(draw.integers(2, 9)))
    ]
    ends = np.cumsum([0.0, *(segment.length for segment in segments)])
    taken = ends.tolist()

    def place() -> float:
        while True:
            z = float(draw.uniform(0.0, ends[-1]))
            if draw.random() < 0.5:
                z = float(draw.choice(taken)) + float(draw.choice([-1, 1]) * 10 ** draw.uniform(-8.5, -3))
            if 0 <= z <= ends[-1] and np.min(np.abs(np.array(taken) - z)) > CLOSEST * ends[-1]:
                taken.append(z)
                return z

    bearings = [
        Bearing(
            place(),
            float(10 ** draw.uniform(6, 10)),
            housing_stiffness=float(draw.choice([np.inf, 10 ** draw.uniform(7, 10)])),
            rotational_stiffness=float(draw.choice([0.0, 10 ** draw.uniform(2, 6)])),
        )
        for _ in range(int(draw.integers(2, 7)))
    ]
    masses = [LumpedMass(place(), *(10 ** draw.uniform([-2, -6], [1, -2])).tolist()) for _ in range(draw.integers(3))]
    joints = [Joint(place(), *(10 ** draw.uniform([7, 4], [10, 7])).tolist()) for _ in range(draw.integers(3))]
    theory: Theory = "timoshenko" if draw.random() < 0.5 else "euler-bernoulli"
    return Spindle(segments, bearings, theory=theory, masses=masses, joints=joints)


def refused_and_missed(number: int, checked: int, seed: int) -> tuple[int, int]:
    """Return how many of `number` spindles are rejected, and how many of the first `checked` have wrong modes.

    The determinant changes its sign at each mode and nowhere else: signs half-way between modes alternate.
    """
    draw, refused, missed = np.random.default_rng(seed), 0, 0
    for index in range(number):
        spindle = random_spindle(draw)
        try:
            frequency = natural_frequencies(spindle, MODES)
            static_stiffness(spindle)
        except ArithmeticError:
            refused += 1
            continue
        if index < checked:
            between = np.sqrt(np.append(frequency[0] / 4, frequency[:-1]) * frequency)
            signs = [float(np.sign(float(determinant(spindle, float(f))))) for f in between]
            missed += bool(np.any(np.diff(signs) == 0))
    return refused, missed


def test_twenty_random_spindles() -> None:
    assert refused_and_missed(20, 2, 7) == (0, 0)


@pytest.mark.long
def test_fifteen_hundred_random_spindles() -> None:
    assert refused_and_missed(1500, 100, 8) == (0, 0)
