"""Stepped shafts with cones against their differential equations, and tools with cones coupled to them.

Reference: the equations of E. C. Pestel and F. A. Leckie, Matrix Methods in Elastomechanics, 1963, integrated by the
method of Dormand and Prince of order 8.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from dsm import (
    Bearing,
    Segment,
    Spindle,
    Theory,
    change_tool,
    couple_tool,
    natural_frequencies,
    receptance,
    spindle_side,
)
from dsm.spindle.segment import ring_area, ring_second_moment


def mismatch(spindle: Spindle, frequency: float) -> float:
    """Return the determinant of moment and force at the free far end; 0 at a natural frequency (Hz)."""
    state, start = np.eye(4)[:, :2], 0.0
    size = np.array([1.0, 1 / spindle.length, 1e6 * spindle.length, 1e6])[:, np.newaxis]
    state = state * size
    for segment in spindle.segments:
        end = start + segment.length
        places = sorted(bearing.position for bearing in spindle.bearings if start <= bearing.position < end)
        for near, far in zip([start, *places], [*places, end], strict=True):
            state = _along(spindle, segment, near - start, far - start, frequency, size) @ state
            for bearing in spindle.bearings:
                if bearing.position == far and far < end:
                    state[3] += bearing.stiffness * state[0]
        start = end
    return float(np.linalg.det((state / size)[2:]))


def _along(
    spindle: Spindle, segment: Segment, near: float, far: float, frequency: float, size: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Transfer matrix of the state (u, t, M, Q)."""
    w2 = (2 * math.pi * frequency) ** 2
    material = segment.material or spindle.material

    def slope(z: float, flat: NDArray[np.float64]) -> NDArray[np.float64]:
        outer, bore = segment.diameters_at(z / segment.length)
        area, second = ring_area(outer, bore), ring_second_moment(outer, bore)
        u, t, moment, force = flat.reshape(4, 4) * size
        shear, turning = 0 * force, 0 * t
        if spindle.theory == "timoshenko":
            shear = force / (material.shear_coefficient(bore / outer) * material.shear_modulus * area)
            turning = material.density * second * w2 * t
        bent = moment / (material.youngs_modulus * second)
        rows = np.array([t + shear, bent, -force - turning, -material.density * area * w2 * u])
        return np.asarray((rows / size).ravel())

    if far == near:
        return np.eye(4)
    end = solve_ivp(slope, (near, far), np.eye(4).ravel(), method="DOP853", rtol=1e-11, atol=1e-14).y[:, -1]
    return np.asarray(size * end.reshape(4, 4) / size.T)


def stepped_shaft(draw: np.random.Generator) -> Spindle:
    """Return a random shaft on two bearings: three to six segments, every second a cone, some hollow or short."""
    segments, outer = [], float(draw.uniform(0.03, 0.09))
    for number in range(int(draw.integers(3, 7))):
        length, next_outer = float(draw.uniform(0.01, 0.12)), float(draw.uniform(0.03, 0.09))
        bore = float(draw.choice([0.0, 0.2, 0.6])) * outer
        if number % 2:
            end_bore = float(draw.uniform(0.0, 0.8)) * next_outer
            cone = Segment(length, outer, bore, end_outer_diameter=next_outer, end_bore_diameter=end_bore)
            segments.append(cone)
        else:
            segments.append(Segment(length, outer, bore))
        outer = next_outer
    length = sum(segment.length for segment in segments)
    bearings = [Bearing(share * length, float(10 ** draw.uniform(7, 9))) for share in (0.37, 0.83)]
    theory: Theory = "timoshenko" if draw.random() < 0.5 else "euler-bernoulli"
    return Spindle(segments, bearings, theory=theory)


def wrong_modes(number: int, within: float) -> int:
    """Return how many of six modes of so many shafts are not within a relative error."""
    draw, wrong = np.random.default_rng(17), 0
    for _ in range(number):
        shaft = stepped_shaft(draw)
        frequency = natural_frequencies(shaft, 6)
        below, above = ([mismatch(shaft, float(f) * (1 + side * within)) for f in frequency] for side in (-1, 1))
        wrong += int(np.sum(np.sign(below) == np.sign(above)))
    return wrong


def test_six_modes_of_stepped_shafts_with_cones() -> None:
    assert wrong_modes(2, 1e-7) == 0


@pytest.mark.long
def test_six_modes_of_five_hundred_stepped_shafts_with_cones() -> None:
    assert wrong_modes(500, 1e-7) == 0


def test_a_coupled_tool_with_cones_is_that_of_the_whole_shaft() -> None:
    f = np.linspace(20.0, 6000.0, 200)
    draw = np.random.default_rng(3)
    for _ in range(10):
        shaft = stepped_shaft(draw)
        cone = Segment(0.05, 0.02, end_outer_diameter=0.05, end_bore_diameter=0.01)
        tool = Spindle([Segment(0.03, 0.012), cone], [], theory=shaft.theory)
        cut = 0.6 * shaft.segments[0].length
        whole = receptance(change_tool(shaft, cut, tool), f, loss_factor=0.02)
        found = couple_tool(spindle_side(shaft, f, cut, 0.02), tool)
        assert np.max(np.abs(found - whole)) < 1e-8 * np.max(np.abs(whole))
