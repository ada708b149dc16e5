"""The Timoshenko theory against closed forms, 40-digit arithmetic and independent finite elements.

Closed form: T. C. Huang, The effect of rotatory inertia and of shear deformation ..., J. Appl. Mech. 28 (1961).
Finite element: J. S. Przemieniecki, Theory of Matrix Structural Analysis, 1968, with gyroscopic terms of H. D. Nelson,
A finite rotating shaft element using Timoshenko beam theory, J. Mech. Design 102 (1980).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.linalg import eigh

from dsm import MATERIALS, Bearing, LumpedMass, Material, Segment, Spindle, natural_frequencies, receptance
from dsm.matrix.assemble import assemble
from dsm.modes.find_modes import find_modes
from dsm.spindle.segment import ring_area, ring_second_moment

STEEL = MATERIALS["steel"]


def beam(length: float, outer: float = 0.05, bore: float = 0.0) -> Spindle:
    return Spindle([Segment(length, outer, bore)], [], theory="timoshenko")


def constants(segment: Segment) -> tuple[float, float, float, float]:
    """EI, m, rho I and kappa G A of a steel segment."""
    area, inertia = segment.area, segment.second_moment
    kappa = STEEL.shear_coefficient(segment.bore_diameter / segment.outer_diameter)
    return (
        STEEL.youngs_modulus * inertia,
        STEEL.density * area,
        STEEL.density * inertia,
        kappa * STEEL.shear_modulus * area,
    )


def simply_supported(length: float, segment: Segment, wave: int, spin: float) -> list[float]:
    """Roots w > 0 (rad/s) of one number of half waves, bending and shear branch.

    With u = U sin(az), t = T cos(az): (S a^2 - m w^2)(EI a^2 + S - r(w)) = (S a)^2, r = rho I (w^2 - 2 W w).
    """
    rigidity, mass, rotary, shear = constants(segment)
    a = wave * math.pi / length
    translation = Polynomial([shear * a**2, 0, -mass])
    rotation = Polynomial([rigidity * a**2 + shear, 2 * spin * rotary, -rotary])
    roots = (translation * rotation - (shear * a) ** 2).roots().real
    return sorted(float(root) for root in roots if root > 0)


@pytest.mark.parametrize("spin", [0.0, 2000.0, -2000.0])
@pytest.mark.parametrize(("length", "bore"), [(2.5, 0.0), (0.5, 0.03), (0.1, 0.0), (0.03, 0.02)])
def test_simply_supported_beam(length: float, bore: float, spin: float) -> None:
    spindle = beam(length, bore=bore)
    waves = [simply_supported(length, spindle.segments[0], wave, spin) for wave in range(1, 9)]
    # No half wave: the section turns everywhere alike, and shear brings it back.
    waves.append(simply_supported(length, spindle.segments[0], 0, spin)[-1:])
    expected = sorted(root for roots in waves for root in roots)[:5]
    held = [(0.0, 0), (length, 0)]
    found = find_modes(spindle, 5, held=held, spin=spin or None).frequency
    assert 2 * math.pi * found == pytest.approx(expected, rel=1e-9)


def test_a_slender_shaft_shows_neither_shear_nor_rotary_inertia() -> None:
    plain = Spindle([Segment(200.0, 0.05)], [Bearing(0.0, 1e5), Bearing(150.0, 1e5)])
    lower = natural_frequencies(replace(plain, theory="timoshenko"), 4) / natural_frequencies(plain, 4)
    assert lower == pytest.approx(1, abs=2e-6)
    assert np.all(lower < 1)


def exact_element(segment: Segment, w: float, spin: float) -> NDArray[np.float64]:
    """Element matrix from exp(A L), 60 digits, of the state (u, t, M, Q) with EI t' = M, S (u' - t) = Q."""
    with mpmath.workdps(60):
        rigidity, mass, rotary, shear = (mpmath.mpf(value) for value in constants(segment))
        turning = rotary * mpmath.mpf(w) * (mpmath.mpf(w) - 2 * mpmath.mpf(spin))
        rows = [
            [0, 1, 0, 1 / shear],
            [0, 0, 1 / rigidity, 0],
            [0, -turning, 0, -1],
            [-mass * mpmath.mpf(w) ** 2, 0, 0, 0],
        ]
        transfer = mpmath.expm(mpmath.matrix(rows) * mpmath.mpf(segment.length), method="taylor")
        a, b, c, d = (transfer[i : i + 2, j : j + 2] for i in (0, 2) for j in (0, 2))
        swap = mpmath.matrix([[0, 1], [1, 0]])
        across = b**-1
        blocks = [[swap * across * a, -swap * across], [swap * (c - d * across * a), swap * d * across]]
        return np.block([[np.array(block.tolist(), dtype=float) for block in row] for row in blocks])


@pytest.mark.parametrize("sense", [0.0, 1.0, -1.0])
@pytest.mark.parametrize("slenderness", [0.05, 0.5, 3.0, 20.0, 500.0])
def test_element_matches_the_matrix_exponential(slenderness: float, sense: float) -> None:
    segment = Segment(0.05 * slenderness, 0.05, 0.02)
    rigidity, mass, rotary, shear = constants(segment)
    clamped = [22.4 / segment.length**2 * math.sqrt(rigidity / mass)]
    clamped += [math.pi / segment.length * math.sqrt(ratio) for ratio in (shear / mass, rigidity / rotary)]
    w = 0.13 / math.sqrt(sum(1 / limit**2 for limit in clamped))
    spin = sense * w / 3
    model = assemble(Spindle([segment], [], theory="timoshenko"), w / (2 * math.pi), spin=spin if sense else None)
    assert model.position.size == 2
    found = model.dense(np.array([w if sense else w * w]))[0]
    exact = exact_element(segment, w, spin)
    size = np.sqrt(np.abs(np.diagonal(exact)))
    assert np.abs(found - exact) / np.outer(size, size) == pytest.approx(0, abs=2e-13)


@pytest.mark.parametrize("spin", [None, 3000.0, -3000.0])
def test_a_segment_cut_in_pieces_changes_nothing(spin: float | None) -> None:
    whole = stepped_shaft()
    parts = [replace(s, length=s.length / 7) for s in whole.segments for _ in range(7)]
    cut = find_modes(replace(whole, segments=parts), 5, spin=spin).frequency
    assert cut == pytest.approx(find_modes(whole, 5, spin=spin).frequency, rel=1e-10)


def test_response_between_two_points_is_the_same_both_ways() -> None:
    frequency = [0.0, 500.0, 1500.0, 4000.0]
    there = receptance(stepped_shaft(), frequency, 0.05, 0.03, force_position=0.43)
    back = receptance(stepped_shaft(), frequency, 0.43, 0.03, force_position=0.05)
    assert there == pytest.approx(back, rel=1e-9)


def stepped_shaft() -> Spindle:
    """Hollow, stepped, on springs, with a disk."""
    segments = [
        Segment(0.12, 0.05),
        Segment(0.2, 0.09, 0.04),
        Segment(0.15, 0.07, 0.05, material=MATERIALS["titanium"]),
    ]
    bearings = [Bearing(0.12, 2e8, rotational_stiffness=1e5), Bearing(0.32, 3e8)]
    return Spindle(segments, bearings, theory="timoshenko", masses=[LumpedMass(0.47, 3.0, 0.01, 0.018)])


def finite_elements(spindle: Spindle, parts: int, spin: float, count: int) -> NDArray[np.float64]:
    """Forward whirl (Hz) from two-node elements of cubic deflection and quadratic rotation, free of locking."""
    ends = np.cumsum([0.0, *(segment.length for segment in spindle.segments)])
    nodes = np.concatenate([[0.0], *(np.linspace(a, b, parts + 1)[1:] for a, b in itertools.pairwise(ends))])
    stiffness, mass, gyroscopic = np.zeros((3, 2 * nodes.size, 2 * nodes.size))
    for index, length in enumerate(np.diff(nodes)):
        segment = spindle.segments[index // parts]
        k, m, polar = two_node_element(segment, segment.material or STEEL, float(length))
        where = slice(2 * index, 2 * index + 4)
        stiffness[where, where] += k
        mass[where, where] += m
        gyroscopic[where, where] += polar
    for bearing in spindle.bearings:
        dof = 2 * int(np.argmin(np.abs(nodes - bearing.position)))
        stiffness[dof, dof] += bearing.stiffness
        stiffness[dof + 1, dof + 1] += bearing.rotational_stiffness
    for body in spindle.masses:
        dof = 2 * int(np.argmin(np.abs(nodes - body.position)))
        mass[dof, dof] += body.mass
        mass[dof + 1, dof + 1] += body.diametral_inertia
        gyroscopic[dof + 1, dof + 1] += body.polar_inertia
    zero = np.zeros_like(mass)
    # (K + w W G - w^2 M) x = 0 with y = w x: 1/w is an eigenvalue of a symmetric pencil.
    right = np.block([[-spin * gyroscopic, mass], [mass, zero]])
    inverse = eigh(right, np.block([[stiffness, zero], [zero, mass]]), eigvals_only=True)
    return np.asarray(1 / inverse[::-1][:count] / (2 * math.pi))


def two_node_element(
    segment: Segment, material: Material, length: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Stiffness, mass and gyroscopic matrix; the shapes follow from static equilibrium, Phi = 12 EI/(S L^2)."""
    area = ring_area(segment.outer_diameter, segment.bore_diameter)
    inertia = ring_second_moment(segment.outer_diameter, segment.bore_diameter)
    kappa = material.shear_coefficient(segment.bore_diameter / segment.outer_diameter)
    rigidity = material.youngs_modulus * inertia
    phi = 12 * rigidity / (kappa * material.shear_modulus * area * length**2)
    place, weight = np.polynomial.legendre.leggauss(4)
    s, weight = (1 + place) / 2, weight / 2 * length
    u = np.array(
        [
            1 - 3 * s**2 + 2 * s**3 + phi * (1 - s),
            length * (s - 2 * s**2 + s**3 + phi / 2 * (s - s**2)),
            3 * s**2 - 2 * s**3 + phi * s,
            length * (-(s**2) + s**3 + phi / 2 * (s**2 - s)),
        ]
    ) / (1 + phi)
    t = np.array(
        [
            6 * (s**2 - s) / length,
            1 - 4 * s + 3 * s**2 + phi * (1 - s),
            6 * (s - s**2) / length,
            3 * s**2 - 2 * s + phi * s,
        ]
    ) / (1 + phi)
    turning = material.density * inertia * (t * weight) @ t.T
    mass = material.density * area * (u * weight) @ u.T + turning
    h, b, c, d = 12.0, 6 * length, (4 + phi) * length**2, (2 - phi) * length**2
    stiffness = np.array([[h, b, -h, b], [b, c, -b, d], [-h, -b, h, -b], [b, d, -b, c]])
    return stiffness * rigidity / ((1 + phi) * length**3), mass, 2 * turning


@pytest.mark.parametrize("spin", [0.0, 3000.0, -3000.0])
def test_finite_elements_converge_to_it(spin: float) -> None:
    exact = find_modes(stepped_shaft(), 5, spin=spin).frequency
    coarse, fine = (finite_elements(stepped_shaft(), parts, spin, 5) / exact - 1 for parts in (8, 16))
    assert coarse / fine == pytest.approx(4.0, rel=0.02)
    assert (4 * fine - coarse) / 3 == pytest.approx(0, abs=2e-6)
