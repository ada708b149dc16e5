"""Finite elements of the validation against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dsm import Bearing, Segment, Spindle
from lobewatch.paper.finite_elements import ElementKind, first_frequency

LENGTH, DIAMETER, BORE = 0.8, 0.06, 0.02


def beam(stiffness: float = math.inf, diameter: float = DIAMETER) -> Spindle:
    """Return a uniform ring on two bearings at its ends, of two segments."""
    segment = Segment(LENGTH / 2, diameter, diameter * BORE / DIAMETER)
    return Spindle([segment, segment], [Bearing(0.0, stiffness), Bearing(LENGTH, stiffness)])


def section(spindle: Spindle) -> tuple[float, float, float, float]:
    """EI, kappa G A, mass per length and rho I; Cowper's kappa of a ring of 1/3 by hand: 9.62963/13.48642."""
    segment, steel = spindle.segments[0], spindle.material
    shear = 0.714024 * steel.shear_modulus * segment.area
    mass, rotary = steel.density * segment.area, steel.density * segment.second_moment
    return steel.youngs_modulus * segment.second_moment, shear, mass, rotary


def pinned_with_shear(spindle: Spindle) -> float:
    """First frequency (Hz) of a pinned Timoshenko beam: the smaller root of a quadratic in w^2 (Timoshenko, 1921)."""
    rigidity, shear, mass, rotary = section(spindle)
    wave = (math.pi / LENGTH) ** 2
    a, b, c = rotary * mass / shear, -(mass + rotary * wave + mass * rigidity * wave / shear), rigidity * wave**2
    return math.sqrt((-b - math.sqrt(b * b - 4 * a * c)) / (2 * a)) / (2 * math.pi)


def test_pinned_without_shear() -> None:
    rigidity, _, mass, _ = section(beam())
    exact = math.pi**2 * math.sqrt(rigidity / mass) / LENGTH**2 / (2 * math.pi)
    assert first_frequency(beam(), 40, "euler-bernoulli", "rigid") == pytest.approx(exact, rel=1e-7)


@pytest.mark.parametrize(("stiffness", "root"), [(1.0, 1.4025302030354), (100.0, 8.2756945554786)])
def test_free_on_two_springs(stiffness: float, root: float) -> None:
    rigidity, _, mass, _ = section(beam())
    spindle = beam(stiffness * rigidity / LENGTH**3)
    exact = root * math.sqrt(rigidity / mass) / LENGTH**2 / (2 * math.pi)
    assert first_frequency(spindle, 40, "euler-bernoulli") == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize(("kind", "rel"), [("timoshenko", 2e-5), ("linear", 4e-4)])
def test_pinned_with_shear(kind: ElementKind, rel: float) -> None:
    spindle = beam(diameter=0.2)
    exact = pinned_with_shear(spindle)
    assert first_frequency(spindle, 80, kind, "rigid") == pytest.approx(exact, rel=rel)
    assert exact < 0.95 * first_frequency(spindle, 80, "euler-bernoulli", "rigid")


@pytest.mark.parametrize(("kind", "order"), [("euler-bernoulli", 4), ("timoshenko", 2), ("linear", 2)])
def test_errors_fall_with_the_order_of_the_element(kind: ElementKind, order: int) -> None:
    coarse, middle, fine = (first_frequency(beam(), n, kind, "rigid") for n in (8, 16, 32))
    assert math.log2((coarse - middle) / (middle - fine)) == pytest.approx(order, abs=0.25)


def test_straight_lines_do_not_lock_in_a_slender_beam() -> None:
    slender = beam(diameter=0.004)
    exact = pinned_with_shear(slender)
    assert first_frequency(slender, 40, "linear", "rigid") == pytest.approx(exact, rel=2e-3)


def test_less_than_an_element_a_segment_is_rejected() -> None:
    with pytest.raises(ValueError, match=r"elements=1 .* 2 segments"):
        first_frequency(beam(), 1, "linear")


def test_elements_go_where_they_are_longest() -> None:
    """Segments of 3:1 with four elements are four of one length: the uniform mesh."""
    uneven = Spindle([Segment(0.6, DIAMETER), Segment(0.2, DIAMETER)], [Bearing(0.0, 1e8), Bearing(LENGTH, 1e8)])
    even = Spindle([Segment(0.2, DIAMETER)] * 4, uneven.bearings)
    both = [first_frequency(spindle, 4, "timoshenko") for spindle in (uneven, even)]
    assert both[0] == pytest.approx(both[1], rel=1e-9)
    assert np.isfinite(both[0])


def test_clamped_in_its_bearings() -> None:
    rigidity, _, mass, _ = section(beam())
    exact = 22.373285448061 * math.sqrt(rigidity / mass) / LENGTH**2 / (2 * math.pi)
    assert first_frequency(beam(), 40, "euler-bernoulli", "clamped") == pytest.approx(exact, rel=1e-5)
