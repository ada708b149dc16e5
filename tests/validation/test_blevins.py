"""Uniform beams with EI = m = L = 1 against closed forms.

Classical ends: R. D. Blevins, Formulas for Natural Frequency and Mode Shape, table 8-1 (roots of the frequency
equations to more digits). Receptance: R. E. D. Bishop and D. C. Johnson, The Mechanics of Vibration, table 7.1(c).
End springs: roots of the closed-form frequency equation in 40-digit arithmetic.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from dsm import Bearing, Segment, Spindle, modal_stiffness, modes_at, natural_frequencies, receptance, static_stiffness
from dsm.matrix.assemble import HeldDof
from dsm.modes.find_modes import find_modes

SECTION = Segment(1.0, 1.0)
PINNED: list[HeldDof] = [(0.0, 0)]
CLAMPED: list[HeldDof] = [(0.0, 0), (0.0, 1)]
FAR_PINNED: list[HeldDof] = [(1.0, 0)]
FAR_CLAMPED: list[HeldDof] = [(1.0, 0), (1.0, 1)]
FIXED_ROOTS = [22.373285448061, 61.67282286792, 120.90339172712, 199.8594481272]


def unit_beam(*bearings: Bearing, pieces: int = 1) -> Spindle:
    segments = [Segment(1 / pieces, 1.0)] * pieces
    return Spindle(segments, bearings, youngs_modulus=1 / SECTION.second_moment, density=1 / SECTION.area)


@pytest.mark.parametrize("pieces", [1, 7])
@pytest.mark.parametrize(
    ("held", "expected"),
    [
        (CLAMPED, [3.5160152685002, 22.034491564667, 61.697214413549, 120.90191605231]),
        (CLAMPED + FAR_CLAMPED, FIXED_ROOTS),
        (PINNED + FAR_PINNED, [(n * math.pi) ** 2 for n in (1, 2, 3, 4, 5, 6)]),
        (CLAMPED + FAR_PINNED, [15.41820571698, 49.9648620318, 104.24769645886]),
        ([], [0.0, 0.0, *FIXED_ROOTS]),
        ([(0.0, 1), (1.0, 1)], [0.0, math.pi**2, 4 * math.pi**2]),
    ],
    ids=["clamped-free", "clamped-clamped", "pinned-pinned", "clamped-pinned", "free-free", "guided-guided"],
)
def test_classical_ends(held: list[HeldDof], expected: list[float], pieces: int) -> None:
    modes = find_modes(unit_beam(pieces=pieces), len(expected), held=held)
    assert 2 * math.pi * modes.frequency == pytest.approx(expected, rel=2e-11, abs=0)


@pytest.mark.parametrize(
    ("stiffness", "expected"),
    [
        (1.0, [1.4025302030354, 2.4465747957936, 22.551935726108]),
        (10.0, [4.1304113880024, 7.6541259454437, 24.14132978485]),
        (100.0, [8.2756945554786, 21.750886758279, 36.919855723939]),
        (1000.0, [9.678715907395, 36.446130195892, 73.369408409326]),
    ],
)
def test_two_end_springs(stiffness: float, expected: list[float]) -> None:
    beam = unit_beam(Bearing(0.0, stiffness), Bearing(1.0, stiffness))
    assert 2 * math.pi * natural_frequencies(beam, 3) == pytest.approx(expected, rel=2e-11)


def test_rigid_bearings_at_the_ends_are_pins() -> None:
    beam = unit_beam(Bearing(0.0, 3.0), Bearing(1.0, 5.0))
    expected = [(n * math.pi) ** 2 for n in (1, 2, 3)]
    assert 2 * math.pi * natural_frequencies(beam, 3, rigid_bearings=True) == pytest.approx(expected, rel=1e-11)


def test_sixty_modes_of_a_free_beam_none_missed() -> None:
    roots = [(n + 0.5) * math.pi for n in range(5, 59)]
    frequency = natural_frequencies(unit_beam(), 60)
    assert 2 * math.pi * frequency[6:] == pytest.approx(np.array(roots) ** 2, rel=1e-8)


@pytest.mark.parametrize("stiffness", [1e-3, 1e-5])
def test_soft_springs_give_the_rigid_body_modes(stiffness: float) -> None:
    beam = unit_beam(Bearing(0.0, stiffness), Bearing(1.0, stiffness))
    expected = [math.sqrt(2 * stiffness), math.sqrt(6 * stiffness)]
    assert 2 * math.pi * natural_frequencies(beam, 4)[:2] == pytest.approx(expected, rel=2e-5)


@pytest.mark.parametrize("stiffness", [1e-12, 1e-30])
def test_springs_of_no_account_leave_the_beam_free(stiffness: float) -> None:
    beam = unit_beam(Bearing(0.0, stiffness), Bearing(1.0, stiffness))
    w = 2 * math.pi * natural_frequencies(beam, 3)
    assert w == pytest.approx([0.0, 0.0, FIXED_ROOTS[0]], rel=1e-10, abs=1e-5)


def test_tip_receptance_of_a_free_beam() -> None:
    w = np.linspace(0.5, 400.0, 777)
    x = np.sqrt(w)
    numerator = np.cos(x) * np.sinh(x) - np.sin(x) * np.cosh(x)
    expected = -numerator / (x**3 * (np.cos(x) * np.cosh(x) - 1))
    found = receptance(unit_beam(), w / (2 * math.pi))
    assert found.real == pytest.approx(expected, rel=1e-8)
    assert not np.any(found.imag)


def test_static_tip_stiffness_of_an_overhanging_beam() -> None:
    overhang, span, near, far = 0.3, 0.45, 40.0, 90.0
    beam = unit_beam(Bearing(overhang, near), Bearing(overhang + span, far))
    lever = overhang / span
    deflection = overhang**2 * (overhang + span) / 3 + (1 + lever) ** 2 / near + lever**2 / far
    assert static_stiffness(beam) == pytest.approx(1 / deflection, rel=1e-12)
    assert receptance(beam, [0.0])[0] == pytest.approx(deflection, rel=1e-12)


def test_modal_stiffness_of_a_pinned_beam_on_near_rigid_springs() -> None:
    beam = unit_beam(Bearing(0.0, 1e9), Bearing(1.0, 1e9))
    assert modal_stiffness(beam, 1, 0.5) == pytest.approx(math.pi**4 / 2, rel=1e-6)
    assert modal_stiffness(beam, 3, 0.5) == pytest.approx(81 * math.pi**4 / 2, rel=1e-5)
    assert modal_stiffness(beam, 2, 0.25) == pytest.approx(16 * math.pi**4 / 2, rel=1e-5)
    assert modal_stiffness(beam, 2, 0.5) > 1e15


def test_modal_flexibilities_add_up_to_the_static_one() -> None:
    beam = unit_beam(Bearing(0.2, 50.0), Bearing(0.8, 70.0))
    _, stiffness = modes_at(beam, 40)
    assert np.sum(1 / stiffness) == pytest.approx(1 / static_stiffness(beam), rel=1e-5)


def test_loss_factor_is_twice_the_damping_ratio_of_every_mode() -> None:
    beam = unit_beam(Bearing(0.2, 50.0), Bearing(0.8, 70.0))
    natural, stiffness = modes_at(beam, 20)
    frequency = np.linspace(0.01, natural[4], 300)
    ratio = frequency[:, np.newaxis] / natural
    beyond = (1 / static_stiffness(beam) - np.sum(1 / stiffness)) / (1 + 0.04j)
    expected = np.sum(1 / (stiffness * (1 - ratio**2 + 0.04j)), axis=1) + beyond
    found = receptance(beam, frequency, loss_factor=0.04)
    assert np.abs(found - expected) == pytest.approx(0, abs=1e-6 * float(np.max(np.abs(expected))))
