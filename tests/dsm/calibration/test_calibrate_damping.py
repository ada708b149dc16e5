"""Damped modes, and bearing dampers from a measured damping ratio."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import eigh, eigvals

from dsm import Bearing, Joint, LumpedMass, Segment, Spindle, natural_frequencies, receptance
from dsm.calibration.calibrate_damping import UnreachableDampingError, calibrate_damping
from dsm.modes.damped_modes import damped_modes

MASS, STIFFNESS = 20.0, 1e7
W0 = math.sqrt(2 * STIFFNESS / MASS)


def two_bodies(damping: float, housing: float = math.inf) -> Spindle:
    """Half of the mass on each of two springs with dampers, and a shaft without mass: mode 2 moves both alike."""
    bearings = [Bearing(z, STIFFNESS, damping=damping, housing_stiffness=housing) for z in (0.0, 0.2)]
    bodies = [LumpedMass(z, MASS / 2, diametral_inertia=0.5) for z in (0.0, 0.2)]
    return Spindle([Segment(0.2, 0.1)], bearings, density=1e-4, masses=bodies)


def stepped(dampers: tuple[float, float, float], theta: float = 0.0) -> Spindle:
    bearings = [
        Bearing(0.15, 2e8, damping=dampers[0], group="front"),
        Bearing(0.25, 1e8, damping=dampers[1], group="front", rotational_stiffness=theta),
        Bearing(0.5, 5e7, damping=dampers[2], group="rear"),
    ]
    return Spindle([Segment(0.2, 0.04), Segment(0.35, 0.07, 0.03)], bearings)


def finite_elements(spindle: Spindle) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Stiffness and mass matrix of Hermite elements of 10 mm, without bearings."""
    h, node = 0.01, 0
    size = 2 * (round(spindle.length / h) + 1)
    stiffness, mass = np.zeros((2, size, size))
    for segment in spindle.segments:
        ei, m = spindle.youngs_modulus * segment.second_moment, spindle.density * segment.area
        k = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2]])
        k = np.vstack([k, -k[0], [6 * h, 2 * h**2, -6 * h, 4 * h**2]])
        c = [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2]]
        c += [[54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]]
        for _ in range(round(segment.length / h)):
            part = slice(2 * node, 2 * node + 4)
            stiffness[part, part] += k * ei / h**3
            mass[part, part] += np.array(c) * m * h / 420
            node += 1
    return stiffness, mass


def quadratic_modes(spindle: Spindle, loss_factor: float) -> NDArray[np.complex128]:
    """Return the s with Im s > 0 of (s^2 M + s C + (1 + i eta) K) x = 0.

    In undamped modes, M = 1 and K = L^2, with p = L x, v = s x: (p, v)/s = A (p, v), which limits rounding.
    """
    stiffness, mass = finite_elements(spindle)
    damping = np.zeros_like(mass)
    for bearing in spindle.bearings:
        dof = 2 * round(bearing.position / 0.01)
        stiffness[dof, dof] += bearing.stiffness
        stiffness[dof + 1, dof + 1] += bearing.rotational_stiffness
        damping[dof, dof] += bearing.damping
    inverse, vectors = eigh(mass, stiffness)  # x^T K x = 1: columns are those of unit mass over L
    inertia, loss = np.diag(np.sqrt(inverse)), 1 + 1j * loss_factor
    a = np.block([[-(vectors.T @ damping @ vectors) / loss, -inertia / loss], [inertia, np.zeros_like(inertia)]])
    s = 1 / eigvals(a)
    return np.asarray(s[s.imag > 1e-3 * np.abs(s)])


@pytest.mark.parametrize("zeta", [1e-6, 0.01, 0.3, 0.9, 0.999])
def test_mass_on_springs_and_dampers(zeta: float) -> None:
    """|s| = sqrt(2k/m) and zeta = 2c/(2 m w0), whatever zeta is."""
    found = damped_modes(two_bodies(zeta * W0 * MASS), 2)
    assert found.frequency[1] == pytest.approx(W0 / (2 * math.pi), rel=1e-7)
    assert found.damping_ratio[1] == pytest.approx(zeta, rel=1e-7)


@pytest.mark.parametrize("damping", [3e2, 3e3, 1e5])
def test_damper_and_spring_before_a_compliant_housing(damping: float) -> None:
    """Solve m s^2 + 2 (k + c s) h/(k + c s + h) = 0, which is a cubic."""
    h = 4e7
    roots = np.roots([MASS * damping, MASS * (STIFFNESS + h), 2 * damping * h, 2 * STIFFNESS * h])
    s = roots[np.argmax(roots.imag)]
    found = damped_modes(two_bodies(damping, h), 2)
    assert found.frequency[1] == pytest.approx(abs(s) / (2 * math.pi), rel=1e-7)
    assert found.damping_ratio[1] == pytest.approx(-s.real / abs(s), rel=1e-6)


@pytest.mark.parametrize("eta", [0.0, 1e-4, 0.03, 0.5])
def test_a_loss_factor_alone(eta: float) -> None:
    """w^2 = (1 + i eta) w0^2: |w| = w0 (1 + eta^2)^(1/4) and zeta = sin(atan(eta)/2) of every mode."""
    spindle = replace(stepped((0, 0, 0), 1e5), theory="timoshenko", joints=[Joint(0.1, 1e8, 1e5)])
    found = damped_modes(spindle, 4, eta)
    assert found.frequency == pytest.approx(natural_frequencies(spindle, 4) * (1 + eta**2) ** 0.25, rel=1e-9)
    assert found.damping_ratio == pytest.approx(math.sin(math.atan(eta) / 2), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("eta", [0.0, 0.02])
@pytest.mark.parametrize("scale", [0.1, 1.0, 2.0])
def test_an_independent_quadratic_eigenproblem(scale: float, eta: float) -> None:
    """Finite elements of 10 mm, (0.19)^4/720 = 2e-6 off in mode 4, on a shaft whose dampers are uneven."""
    spindle = stepped((2e4 * scale, 0.0, 3e3 * scale), 1e5)
    found = damped_modes(spindle, 4, eta)
    zeta = found.damping_ratio
    ours = 2 * np.pi * found.frequency * (1j * np.sqrt(1 - zeta**2) - zeta)
    s = quadratic_modes(spindle, eta)
    nearest = np.argmin(np.abs(s - ours[:, np.newaxis]), axis=1)
    assert np.unique(nearest).size == 4
    assert np.abs(s[nearest] / ours - 1) == pytest.approx(0, abs=5e-6)
    if scale < 2:
        assert sorted(nearest) == sorted(np.argsort(np.abs(s))[:4])


def test_the_peak_of_the_receptance_is_as_wide_as_the_mode_says() -> None:
    spindle = stepped((2e2, 1e2, 5e1))
    mode = damped_modes(spindle, 1, 0.004)
    near = mode.frequency[0] * (1 + mode.damping_ratio[0] * np.linspace(-2, 2, 4001))
    power = np.abs(receptance(spindle, near, loss_factor=0.004)) ** 2
    half = near[power > np.max(power) / 2]
    assert (half[-1] - half[0]) / mode.frequency[0] / 2 == pytest.approx(mode.damping_ratio[0], rel=2e-2)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(0, 300), min_size=3, max_size=3), st.floats(0, 0.005))
def test_light_damping_is_that_of_first_order(dampers: list[float], eta: float) -> None:
    """Compare with zeta = eta/2 + sum of c phi^2/(2 w); d w^2/d k = phi^2 by differences."""
    a, b, c = dampers
    spindle = stepped((a, b, c))
    w = 2 * np.pi * natural_frequencies(spindle, 3)
    expected = np.full(3, eta / 2)
    for index, bearing in enumerate(spindle.bearings):
        low, high = (
            2
            * np.pi
            * natural_frequencies(
                replace(
                    spindle,
                    bearings=[
                        replace(x, stiffness=x.stiffness * (f if i == index else 1))
                        for i, x in enumerate(spindle.bearings)
                    ],
                ),
                3,
            )
            for f in (0.999, 1.001)
        )
        expected += bearing.damping * (high**2 - low**2) / (0.002 * bearing.stiffness) / (2 * w)
    assert damped_modes(spindle, 3, eta).damping_ratio == pytest.approx(expected, rel=1e-3, abs=1e-7)


def test_a_mode_that_stops_oscillating_is_no_mode() -> None:
    with pytest.raises(ArithmeticError, match=r"mode 2 .* damping ratio of (0\.9|1)"):
        damped_modes(two_bodies(1.1 * W0 * MASS), 2)


@pytest.mark.parametrize("damping", [1e6, 1e7, 1e9])
def test_a_damper_that_holds_its_bearing_gives_no_mode_that_only_creeps(damping: float) -> None:
    """A stiff damper leaves a motion that dies out at k/c without a swing; it is none of the modes."""
    shaft = Spindle([Segment(0.3, 0.05)], [Bearing(0.05, 1e8, damping=damping), Bearing(0.25, 2e8)])
    try:
        found = damped_modes(shaft, 4)
    except ArithmeticError:
        return
    assert np.all(found.damping_ratio < 0.9999)
    assert np.all(np.diff(found.frequency) > 1e-6 * found.frequency[1:])


@pytest.mark.parametrize("eta", [-0.1, math.nan, math.inf])
def test_bad_loss_factors_are_rejected(eta: float) -> None:
    with pytest.raises(ValueError, match="loss_factor="):
        damped_modes(stepped((0, 0, 0)), 1, eta)


def test_free_shafts_and_no_modes_are_rejected() -> None:
    with pytest.raises(ValueError, match="0 bearing"):
        damped_modes(replace(stepped((0, 0, 0)), bearings=[]), 1)
    with pytest.raises(ValueError, match="0 modes"):
        damped_modes(stepped((0, 0, 0)), 0)


@pytest.mark.parametrize("zeta", [0.001, 0.2, 0.95])
def test_dampers_under_a_mass(zeta: float) -> None:
    found = calibrate_damping(two_bodies(0.0), zeta, 0.01 * zeta, mode=2)
    assert found.bearing_damping == pytest.approx(zeta * W0 * MASS, rel=1e-7)
    assert found.bearing_damping_std == pytest.approx(0.01 * zeta * W0 * MASS, rel=1e-6)
    assert found.sensitivity == pytest.approx(zeta, rel=1e-6)
    assert found.frequency == pytest.approx(W0 / (2 * math.pi), rel=1e-7)
    assert found.other_damping_ratio == pytest.approx(0, abs=1e-12)


@settings(max_examples=25, deadline=None)
@given(st.floats(2, 4.3), st.integers(1, 3), st.sampled_from([0.0, 0.01]))
def test_calibration_inverts_damped_modes(power: float, mode: int, eta: float) -> None:
    damping = 10**power
    truth = stepped((2 * damping, damping, 200.0))
    zeta = float(damped_modes(truth, mode, eta).damping_ratio[-1])
    try:
        found = calibrate_damping(stepped((0.0, 0.0, 200.0)), zeta, mode=mode, group="front", loss_factor=eta)
    except UnreachableDampingError as error:
        assert error.limit == pytest.approx(zeta, rel=1e-6)  # noqa: PT017
        return
    zeta_again = float(damped_modes(found.spindle, mode, eta).damping_ratio[-1])
    assert zeta_again == pytest.approx(zeta, rel=1e-9)
    assert found.spindle.bearings[0].damping == pytest.approx(2 * found.spindle.bearings[1].damping, rel=1e-12)
    assert found.spindle.bearings[2].damping == 200.0
    assert found.bearing_damping <= 1.5 * damping * (1 + 1e-6)


def test_given_dampers_keep_their_ratio_and_the_error_is_the_slope() -> None:
    spindle = stepped((30.0, 10.0, 20.0))
    found = calibrate_damping(spindle, 0.01, 1e-4, loss_factor=0.004)
    assert [b.damping / found.bearing_damping for b in found.spindle.bearings] == pytest.approx([1.5, 0.5, 1.0])
    low, high = (calibrate_damping(spindle, 0.01 + d, loss_factor=0.004).bearing_damping for d in (-1e-4, 1e-4))
    assert found.bearing_damping_std == pytest.approx((high - low) / 2, rel=1e-3)
    assert found.other_damping_ratio == pytest.approx(math.sin(math.atan(0.004) / 2), rel=1e-9)
    assert found.bearing_damping_std == pytest.approx(1e-4 * found.bearing_damping / found.sensitivity, rel=1e-9)


def test_report() -> None:
    text = str(calibrate_damping(stepped((0, 0, 0)), 0.01, 5e-4, loss_factor=0.004))
    assert "bearing damping  " in text
    assert " N s/m (" in text
    assert "from mode 1      damping ratio 0.01000 ± 0.00050 of critical (5 %), " in text
    assert "loss factor 0.004" in text


@pytest.mark.parametrize(("group", "mode"), [("front", 1), ("front", 2)])
def test_more_than_a_damper_can_give_is_rejected_with_the_most_it_can(group: str, mode: int) -> None:
    spindle = stepped((0, 0, 0))
    with pytest.raises(UnreachableDampingError, match=rf"damping_ratio=0\.9 of mode {mode} .*loss_factor") as error:
        calibrate_damping(spindle, 0.9, mode=mode, group=group)
    most = error.value.limit
    dampers = np.geomspace(9e4, 1.5e5, 50)
    scan = [damped_modes(stepped((2 * c, c, 0)), mode).damping_ratio[-1] for c in dampers.tolist()]
    assert 0 < np.argmax(scan) < 49
    assert most == pytest.approx(max(scan), rel=5e-3)
    assert most >= max(scan)
    nearly = calibrate_damping(spindle, 0.999 * most, mode=mode, group=group)
    assert nearly.bearing_damping < 1.5 * dampers[int(np.argmax(scan)) + 1]


def test_of_several_humps_the_first_that_is_high_enough_is_taken() -> None:
    """Dampers of the front bearings give mode 2 up to 0.0563, less, and then up to 0.1229."""
    low, high = (calibrate_damping(stepped((0, 0, 0)), zeta, mode=2, group="front") for zeta in (0.055, 0.06))
    assert damped_modes(low.spindle, 2).damping_ratio[1] == pytest.approx(0.055, rel=1e-9)
    assert damped_modes(high.spindle, 2).damping_ratio[1] == pytest.approx(0.06, rel=1e-9)
    assert high.bearing_damping > 2 * low.bearing_damping


def test_a_bearing_in_a_node_of_the_mode_cannot_damp_it() -> None:
    """A symmetric shaft whose mode 2 has its node at the middle bearing."""
    bearings = [Bearing(z, 1e8, group=g) for z, g in ((0.1, "ends"), (0.25, "middle"), (0.4, "ends"))]
    spindle = Spindle([Segment(0.5, 0.05)], bearings)
    with pytest.raises(UnreachableDampingError, match=r"damping_ratio=0\.01 of mode 2 .*loss_factor"):
        calibrate_damping(spindle, 0.01, mode=2, group="middle")


def test_other_damping_above_the_measured_one_is_rejected() -> None:
    with pytest.raises(UnreachableDampingError, match=r"damping_ratio=0\.004 of mode 1 .* 0\.00499") as error:
        calibrate_damping(stepped((0, 0, 0)), 0.004, loss_factor=0.01)
    assert error.value.limit == pytest.approx(0.005, rel=1e-3)


@pytest.mark.parametrize(
    ("dampers", "arguments", "message"),
    [
        ((0, 0, 0), {"damping_ratio": 0.0}, r"damping_ratio=0\.0 .*0 and 1"),
        ((0, 0, 0), {"damping_ratio": math.nan}, "damping_ratio=nan"),
        ((0, 0, 0), {"damping_ratio": 1.0}, r"damping_ratio=1\.0"),
        ((0, 0, 0), {"damping_ratio": 0.1, "damping_ratio_std": -1.0}, r"damping_ratio_std=-1\.0"),
        ((0, 0, 0), {"damping_ratio": 0.1, "mode": 0}, "mode=0 .*1"),
        ((0, 0, 0), {"damping_ratio": 0.1, "group": "tool"}, "group 'tool' .* 'front', 'rear'"),
        ((0, 0, 0), {"damping_ratio": 0.1, "loss_factor": -1.0}, r"loss_factor=-1\.0"),
        ((1, 0, 1), {"damping_ratio": 0.1}, "2 of 3 bearings .*damping"),
    ],
)
def test_bad_input_of_the_calibration_is_rejected(
    dampers: tuple[float, float, float], arguments: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        calibrate_damping(stepped(dampers), **arguments)
