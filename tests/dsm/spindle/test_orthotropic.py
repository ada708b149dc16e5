"""Orthotropic bars, such as carbon fibre: shear coefficient, deflection and frequencies in closed form."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsm import MATERIALS, Bearing, Material, Segment, Spindle, natural_frequencies, static_stiffness

CARBON = Material(120e9, 1550.0, 5e9, 0.3)
RIGID = 1e16
"""Stiffness of a clamp in N/m and N m/rad, far above that of the bar."""


def shear_flexibility(material: Material, m: float) -> float:
    """1/kappa of a ring by nu G/E only, as its shear stresses (Saint-Venant); m: bore over outer diameter."""
    contraction, ring = material.poisson_ratio * material.shear_modulus / material.youngs_modulus, (1 + m**2) ** 2
    return ((7 - 2 * contraction) * ring + (20 - 16 * contraction) * m**2) / (6 * ring)


@pytest.mark.parametrize("m", [0.0, 0.3, 0.95])
@pytest.mark.parametrize("material", [CARBON, replace(CARBON, axial_poisson_ratio=0.0), MATERIALS["steel"]])
def test_shear_coefficient_depends_on_nu_g_over_e(material: Material, m: float) -> None:
    assert 1 / material.shear_coefficient(m) == pytest.approx(shear_flexibility(material, m), rel=1e-12)


def test_shear_coefficients_in_print() -> None:
    """6E/(7E - 2 nu G) of a full circle (Dharmarajan & McCutchen 1973), 1/2 of a thin tube without contraction."""
    assert CARBON.shear_coefficient(0.0) == pytest.approx(6 * 120 / (7 * 120 - 2 * 0.3 * 5), rel=1e-12)
    assert replace(CARBON, axial_poisson_ratio=0.0).shear_coefficient(1.0) == pytest.approx(0.5, rel=1e-12)


@given(nu=st.floats(0.0, 0.5), youngs_modulus=st.floats(1e10, 1e12), m=st.floats(0.0, 0.99))
def test_isotropic_bar_by_its_own_poisson_ratio(nu: float, youngs_modulus: float, m: float) -> None:
    plain = Material(youngs_modulus, 7850.0, youngs_modulus / (2 * (1 + nu)))
    named = replace(plain, axial_poisson_ratio=nu)
    assert named.shear_coefficient(m) == pytest.approx(plain.shear_coefficient(m), rel=1e-9)


def cantilever(material: Material, length: float) -> Spindle:
    clamp = Bearing(length, RIGID, rotational_stiffness=RIGID)
    return Spindle([Segment(length, 0.04, 0.02, material=material)], [clamp], theory="timoshenko")


def test_deflection_of_a_carbon_bar() -> None:
    """L^3/(3 E I) + L/(kappa G A): here the shear term is the larger one."""
    length, segment = 0.12, Segment(0.12, 0.04, 0.02)
    bending = length**3 / (3 * 120e9 * segment.second_moment)
    shear = length * shear_flexibility(CARBON, 0.5) / (5e9 * segment.area)
    assert shear > bending
    assert 1 / static_stiffness(cantilever(CARBON, length)) == pytest.approx(bending + shear, rel=1e-5)


def test_slender_carbon_bar_bends_as_if_without_shear() -> None:
    """First frequency 1.8751^2 sqrt(EI/(rho A))/(2 pi L^2)."""
    length, segment = 6.0, Segment(6.0, 0.04, 0.02)
    root = math.sqrt(120e9 * segment.second_moment / (1550.0 * segment.area))
    expected = 1.8751040687**2 * root / (2 * math.pi * length**2)
    assert natural_frequencies(cantilever(CARBON, length), 1)[0] == pytest.approx(expected, rel=1e-3)


def test_constants_of_the_spindle_and_of_its_segments_are_the_same_bar() -> None:
    whole, constants = cantilever(CARBON, 0.2), vars(CARBON)
    common = replace(whole, segments=[replace(whole.segments[0], material=None)], **constants)
    assert natural_frequencies(common, 3) == pytest.approx(natural_frequencies(whole, 3), rel=1e-12)
    assert replace(common, shear_modulus=None).material.shear_modulus == pytest.approx(120e9 / 2.6)
