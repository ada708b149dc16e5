"""Invalid input of the spindle model, and its error messages."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Callable
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from dsm import (
    Bearing,
    Joint,
    LumpedMass,
    Material,
    Segment,
    Spindle,
    Theory,
    calibrate,
    critical_speed,
    modal_stiffness,
    natural_frequencies,
    receptance,
    static_stiffness,
    stiffness_curve,
)

PARTS = [Segment(0.2, 0.05), Segment(0.3, 0.08, 0.02)]
BEARINGS = [Bearing(0.1, 1e8), Bearing(0.4, 2e8)]
SPINDLE = Spindle(PARTS, BEARINGS)


@pytest.mark.parametrize(
    ("segment", "message"),
    [
        (Segment(0.0, 0.05), r"segment 3: length=0\.0 .* > 0 \(m\)"),
        (Segment(0.0, 0.05, end_outer_diameter=0.06), r"segment 3: length=0\.0 .* > 0 \(m\)"),
        (Segment(math.nan, 0.05), "segment 3: length=nan"),
        (Segment(0.1, -0.05), r"segment 3: outer_diameter=-0\.05"),
        (Segment(0.1, math.inf), "segment 3: outer_diameter=inf"),
        (Segment(0.1, 0.05, 0.05), r"segment 3: bore_diameter=0\.05 m is not .* outer_diameter=0\.05"),
        (Segment(0.1, 0.05, -0.01), r"segment 3: bore_diameter=-0\.01"),
        (Segment(0.1, 0.05, math.nan), "segment 3: bore_diameter=nan"),
        (Segment(0.0, 0.05, end_outer_diameter=0.04), r"segment 3: length=0\.0 .* > 0 \(m\)"),
        (Segment(0.1, 0.05, end_outer_diameter=0.0), r"segment 3: end_outer_diameter=0\.0 .* > 0"),
        (Segment(0.1, 0.05, end_outer_diameter=math.nan), "segment 3: end_outer_diameter=nan"),
        (
            Segment(0.1, 0.05, 0.03, end_outer_diameter=0.02),
            r"segment 3: end_bore_diameter=0\.03 .*_outer_diameter=0\.02",
        ),
        (
            Segment(0.1, 0.05, end_bore_diameter=0.05),
            r"segment 3: end_bore_diameter=0\.05 m .* end_outer_diameter=0\.05",
        ),
        (Segment(0.1, 0.05, end_bore_diameter=-0.01), r"segment 3: end_bore_diameter=-0\.01"),
        (Segment(0.1, 0.05, mass_diameter=0.0), r"segment 3: mass_diameter=0\.0"),
        (Segment(0.1, 0.05, 0.03, mass_diameter=0.02), r"segment 3: bore_diameter=0\.03 .* mass_diameter=0\.02"),
        (
            Segment(0.1, 0.05, mass_diameter=0.06, end_outer_diameter=0.04),
            "segment 3: mass_diameter=0.06 m .*cone",
        ),
    ],
)
def test_segments_are_rejected_by_number(segment: Segment, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Spindle([*PARTS, segment], BEARINGS)


@pytest.mark.parametrize(
    ("bearing", "message"),
    [
        (Bearing(0.6, 1e8), r"bearing 3: position=0\.6 m .*0 to 0\.5 m"),
        (Bearing(-0.1, 1e8), r"bearing 3: position=-0\.1 m"),
        (Bearing(math.nan, 1e8), "bearing 3: position=nan"),
        (Bearing(0.4, 1e8), r"bearing 3: position=0\.4 m .*bearing 2"),
        (Bearing(0.4 + 1e-13, 1e8), r"bearing 3: position=0\.4.* m .*bearing 2"),
        (Bearing(0.2, 0.0), r"bearing 3: stiffness=0\.0 .* \(N/m\)"),
        (Bearing(0.2, math.nan), "bearing 3: stiffness=nan"),
        (Bearing(0.2, 1e8, damping=-1.0), r"bearing 3: damping=-1\.0 .* \(N s/m\)"),
        (Bearing(0.2, 1e8, rotational_stiffness=math.inf), r"bearing 3: rotational_stiffness=inf .* \(N m/rad\)"),
        (Bearing(0.2, 1e8, housing_stiffness=0.0), r"bearing 3: housing_stiffness=0\.0 .* \(N/m\)"),
    ],
)
def test_bearings_are_rejected_by_number(bearing: Bearing, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Spindle(PARTS, [*BEARINGS, bearing])


@pytest.mark.parametrize(
    ("mass", "message"),
    [
        (LumpedMass(0.6, 1.0), r"mass 2: position=0\.6 m .*0 to 0\.5 m"),
        (LumpedMass(0.25, 1.0), r"mass 2: position=0\.25 m .*mass 1"),
        (LumpedMass(0.3, -1.0), r"mass 2: mass=-1\.0 .* >= 0 \(kg\)"),
        (LumpedMass(0.3, math.nan), "mass 2: mass=nan"),
        (LumpedMass(0.3, math.inf), "mass 2: mass=inf"),
        (LumpedMass(0.3, 1.0, -1e-3), r"mass 2: diametral_inertia=-0\.001"),
        (LumpedMass(0.3, 1.0, 1e-3, 3e-3), r"mass 2: polar_inertia=0\.003 kg m\^2 .*diametral_inertia=0\.001"),
    ],
)
def test_masses_are_rejected_by_number(mass: LumpedMass, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Spindle(PARTS, BEARINGS, masses=[LumpedMass(0.25, 1.0), mass])


@pytest.mark.parametrize(
    ("joint", "message"),
    [
        (Joint(0.0, 1e9, 1e6), r"joint 1: position=0\.0 m .*end"),
        (Joint(0.5, 1e9, 1e6), r"joint 1: position=0\.5 m .*end"),
        (Joint(0.6, 1e9, 1e6), r"joint 1: position=0\.6 m .*0 to 0\.5 m"),
        (Joint(0.4, 1e9, 1e6), r"joint 1: position=0\.4 m .*bearing 2"),
        (Joint(0.25, 1e9, 1e6), r"joint 1: position=0\.25 m .*mass 1"),
        (Joint(0.3, 0.0, 1e6), r"joint 1: stiffness=0\.0 .* > 0 \(N/m\)"),
        (Joint(0.3, math.inf, 1e6), "joint 1: stiffness=inf"),
        (Joint(0.3, 1e9, math.nan), r"joint 1: rotational_stiffness=nan .* \(N m/rad\)"),
    ],
)
def test_joints_are_rejected_by_number(joint: Joint, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Spindle(PARTS, BEARINGS, masses=[LumpedMass(0.25, 1.0)], joints=[joint])


@pytest.mark.parametrize(
    ("constants", "message"),
    [
        ((210e9, 7850.0, 60e9), r"shear_modulus=6e\+10 Pa .*0\.75.* 0 and 0\.5.*axial_poisson_ratio"),
        ((210e9, 7850.0, 110e9), r"shear_modulus=1\.1e\+11 Pa .*-0\.0455.* 0 and 0\.5.*theory"),
        ((120e9, 1550.0, 5e9), r"Poisson's ratio 11.*axial_poisson_ratio"),
        ((120e9, 1550.0, 5e9, -0.1), r"axial_poisson_ratio=-0\.1 .* 0 and 0\.5"),
        ((120e9, 1550.0, 5e9, 0.6), r"axial_poisson_ratio=0\.6 .* 0 and 0\.5"),
        ((120e9, 1550.0, 5e9, math.nan), "axial_poisson_ratio=nan"),
        ((0.0, 7850.0, 80e9), "youngs_modulus=0.0"),
        ((210e9, math.nan, 80e9), "density=nan"),
        ((210e9, 7850.0, math.inf), "shear_modulus=inf"),
    ],
)
def test_impossible_materials_are_rejected(constants: tuple[float, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Material(*constants)


def test_a_spindle_of_an_impossible_shear_modulus_is_rejected() -> None:
    with pytest.raises(ValueError, match=r"shear_modulus=-1\.0"):
        Spindle(PARTS, BEARINGS, shear_modulus=-1.0)
    with pytest.raises(ValueError, match=r"Poisson.* 0\.75"):
        Spindle(PARTS, BEARINGS, shear_modulus=60e9)


def test_too_many_segments_are_rejected() -> None:
    with pytest.raises(ValueError, match=r"501 segments.*1 to 500"):
        Spindle([Segment(0.001, 0.05)] * 501, BEARINGS)


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("slenderness", [0.01, 0.05, 1.0, 1e3, 1e5])
def test_slender_and_stubby_shafts_get_right_modes(slenderness: float, theory: Theory) -> None:
    """Rigid on much softer springs: bounce, and pitch about the middle."""
    length = 0.05 * slenderness
    shaft = Segment(length, 0.05)
    bending, shear = 210e9 * shaft.second_moment / length**3, 0.1 * 210e9 * shaft.area / length
    soft = 1e-4 * (min(bending, shear) if theory == "timoshenko" else bending)
    spindle = Spindle([shaft], [Bearing(0.0, soft), Bearing(length, soft)], theory=theory)
    gyration = math.sqrt((0.05**2 / 16 if theory == "timoshenko" else 0.0) + length**2 / 12)
    bounce, pitch = math.sqrt(2 * soft / spindle.mass), length / gyration * math.sqrt(soft / 2 / spindle.mass)
    found = 2 * math.pi * natural_frequencies(spindle, 2)
    assert found == pytest.approx(sorted([bounce, pitch]), rel=1e-3)


def test_a_spindle_needs_segments_and_a_material() -> None:
    with pytest.raises(ValueError, match=r"0 segments.*1 to 500"):
        Spindle([], BEARINGS)
    with pytest.raises(ValueError, match=r"youngs_modulus=-1\.0 .* \(Pa\)"):
        Spindle(PARTS, BEARINGS, youngs_modulus=-1.0)
    with pytest.raises(ValueError, match="density=nan"):
        Spindle(PARTS, BEARINGS, density=math.nan)


def test_an_unknown_theory_is_rejected_by_name() -> None:
    with pytest.raises(ValueError, match=r"theory='rayleigh' .*euler-bernoulli"):
        Spindle(PARTS, BEARINGS, theory="rayleigh")  # type: ignore[arg-type]


def test_a_spindle_is_plain_frozen_data() -> None:
    again = Spindle(list(PARTS), list(BEARINGS))
    assert again == SPINDLE
    assert hash(again) == hash(SPINDLE)
    with pytest.raises(FrozenInstanceError):
        SPINDLE.density = 1.0  # type: ignore[misc]


@pytest.mark.parametrize(
    "ask",
    [
        static_stiffness,
        critical_speed,
        lambda s: calibrate(s, 100.0),
        lambda s: receptance(s, [0.0, 1.0]),
        lambda s: stiffness_curve(s, [1.0]),
    ],
)
def test_a_shaft_that_can_move_freely_is_rejected(ask: Callable[[Spindle], object]) -> None:
    with pytest.raises(ValueError, match=r"1 bearing\(s\).*two"):
        ask(Spindle(PARTS, BEARINGS[:1]))


def test_one_bearing_is_enough_for_natural_frequencies_and_receptance() -> None:
    hinged = Spindle(PARTS, BEARINGS[:1])
    assert natural_frequencies(hinged, 2)[0] == pytest.approx(0.0, abs=1e-2)
    assert natural_frequencies(hinged, 2)[1] > 100
    assert np.all(np.isfinite(receptance(hinged, [10.0, 100.0])))


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda: natural_frequencies(SPINDLE, 0), "0 modes"),
        (lambda: modal_stiffness(SPINDLE, 0), "mode=0"),
        (lambda: modal_stiffness(SPINDLE, 1, 0.7), r"position=0\.7 m .*0 to 0\.5 m"),
        (lambda: static_stiffness(SPINDLE, math.nan), "position=nan"),
        (lambda: receptance(SPINDLE, [10.0, -1.0]), r"frequency=-1\.0 Hz"),
        (lambda: receptance(SPINDLE, [math.nan]), "frequency=nan"),
        (lambda: receptance(SPINDLE, [[1.0, 2.0]]), r"shape \(1, 2\)"),
        (lambda: receptance(SPINDLE, [1.0], loss_factor=-0.1), r"loss_factor=-0\.1"),
        (lambda: receptance(SPINDLE, [1.0], loss_factor=math.nan), "loss_factor=nan"),
        (lambda: calibrate(SPINDLE, 0.0), r"frequency=0\.0 Hz"),
        (lambda: calibrate(SPINDLE, math.nan), "frequency=nan"),
        (lambda: calibrate(SPINDLE, 500.0, -1.0), r"frequency_std=-1\.0"),
        (lambda: calibrate(SPINDLE, 500.0, mode=0), "mode=0"),
        (lambda: stiffness_curve(SPINDLE, [0.0]), "frequency=0 Hz"),
    ],
)
def test_bad_arguments_are_rejected(ask: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ask()


@pytest.mark.quick
def test_a_bearing_at_a_rounded_segment_end_makes_no_node_of_its_own() -> None:
    thirds = [Segment(0.1, 0.05)] * 3
    exact = Spindle(thirds, [Bearing(0.0, 1e8), Bearing(0.1 + 0.1 + 0.1, 1e8)])
    rounded = Spindle(thirds, [Bearing(0.0, 1e8), Bearing(0.3, 1e8)])
    assert natural_frequencies(rounded, 3) == pytest.approx(natural_frequencies(exact, 3), rel=1e-12)


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("apart", [1e-9, 8e-9, 1e-7])
def test_bearings_nanometres_apart_are_one_of_both_stiffnesses(apart: float, theory: Theory) -> None:
    close = Spindle(PARTS, [Bearing(0.2, 1e8), Bearing(0.2 + apart, 2e8), Bearing(0.4, 1e8)], theory=theory)
    one = Spindle(PARTS, [Bearing(0.2, 3e8), Bearing(0.4, 1e8)], theory=theory)
    assert natural_frequencies(close, 4) == pytest.approx(natural_frequencies(one, 4), rel=20 * apart)
    assert static_stiffness(close) == pytest.approx(static_stiffness(one), rel=20 * apart)


def test_no_frequencies_give_no_receptance() -> None:
    assert receptance(SPINDLE, []).shape == (0,)


@pytest.mark.parametrize(
    "ask", [lambda: natural_frequencies(SPINDLE, 400), lambda: calibrate(SPINDLE, 500.0, mode=200)]
)
def test_hundreds_of_modes_are_rejected(ask: Callable[[], object]) -> None:
    with pytest.raises(ValueError, match=r"1.* 100"):
        ask()


def test_a_receptance_of_many_lines_takes_little_memory() -> None:
    frequency = np.linspace(1.0, 4000.0, 50_000)
    receptance(SPINDLE, frequency[:10])
    tracemalloc.start()
    receptance(SPINDLE, frequency, loss_factor=0.03)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20e6
