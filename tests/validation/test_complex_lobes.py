"""Lobes of modes with complex constants: against the simulation in time, the FRF that they make, and the mean force."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from milling_simulation import Case, judge
from numpy.typing import ArrayLike
from random_milling import random_case

from acquisition import Frf
from lobes import (
    Cut,
    Program,
    StabilityLobes,
    average_angle_lobes,
    build_milling_system,
    program_limit,
    spectral_radius,
    stability_boundary,
    zero_order_lobes,
)
from modal import Mode, fit_modes, synthesize_frf

Phased = tuple[tuple[float, float, float, float], ...]
Method = Callable[[Frf | Sequence[Mode] | None, Frf | Sequence[Mode] | None, Cut, ArrayLike], StabilityLobes]
Direction = Literal["up", "down"]
TURNED = -40.0, 10.0, 30.0, -20.0
"""Phases of two modes in x, then of two in y (deg)."""
LINES = np.arange(0.0, 8000.0, 0.5)
SPEEDS = np.linspace(3000.0, 16000.0, 200)
TIPS: list[Phased] = [
    ((620.0, 0.031, 9.0e6, 25.0), (1480.0, 0.022, 3.1e7, -15.0)),
    ((840.0, 0.024, 1.4e7, -40.0), (1310.0, 0.030, 2.2e7, 40.0)),
    ((510.0, 0.035, 1.2e7, 12.0), (980.0, 0.020, 1.8e7, -30.0), (1900.0, 0.018, 4.5e7, 20.0)),
    ((700.0, 0.028, 1.0e7, -22.0), (1150.0, 0.026, 2.6e7, 35.0), (2300.0, 0.020, 6.0e7, 0.0)),
    (
        (560.0, 0.030, 1.5e7, 38.0),
        (900.0, 0.022, 2.0e7, -10.0),
        (1420.0, 0.025, 4e7, 18.0),
        (2100.0, 0.016, 7e7, -35.0),
    ),
]
"""Frequency (Hz), damping ratio, stiffness (N/m) and phase (deg) of the modes of five tips."""


def two_and_two(phases: Sequence[float] = TURNED) -> tuple[Phased, Phased]:
    """Modes in x and y with these phases (deg)."""
    real = (603.0, 0.039, 5.59e6), (900.0, 0.03, 1.2e7), (666.0, 0.035, 5.715e6), (1100.0, 0.02, 2e7)
    turned = tuple((*mode, phase) for mode, phase in zip(real, phases, strict=True))
    return turned[:2], turned[2:]


def modes_of(given: Phased) -> list[Mode]:
    return [Mode(f, zeta, k, phase_deg=phase) for f, zeta, k, phase in given]


def cut_of(teeth: int, immersion: float, direction: Direction = "up") -> Cut:
    return Cut(teeth, immersion, direction, 6e8, 2e8)


def limit(given: tuple[Phased, Phased], cut: Cut, speed_rpm: float) -> float:
    """Lowest crossing by semi-discretisation (m)."""
    x, y = map(modes_of, given)
    return float(stability_boundary(x, y, cut, speed_rpm, 0.02).depth[0])


def case_of(given: tuple[Phased, Phased], cut: Cut, speed_rpm: float, depth: float) -> Case:
    return Case(*given, 0.0, cut.teeth, cut.immersion, cut.direction, 6e8, 2e8, 0.0, speed_rpm, depth)


@pytest.mark.parametrize(
    ("phases", "immersion", "direction", "speed_rpm"),
    [
        (TURNED, 1.0, "up", 5000.0),
        (TURNED, 0.1, "up", 9000.0),
        (TURNED, 0.1, "down", 7000.0),
        ((10.0, 30.0, -40.0, 30.0), 0.1, "down", 7000.0),
        ((40.0, 0.0, 40.0, 0.0), 1.0, "up", 5000.0),
        ((-40.0, 0.0, -40.0, 0.0), 1.0, "up", 5000.0),
    ],
    ids=["slot", "low up", "low down", "flip", "all ahead", "all behind"],
)
def test_limits_are_those_of_the_simulation_in_time(
    phases: tuple[float, ...], immersion: float, direction: Direction, speed_rpm: float
) -> None:
    given, cut = two_and_two(phases), cut_of(3, immersion, direction)
    x, y = map(modes_of, given)
    depths = [share * limit(given, cut, speed_rpm) for share in (0.99, 1.01)]
    judged = judge([case_of(given, cut, speed_rpm, depth) for depth in depths])
    exact = np.log(spectral_radius(x, y, cut, speed_rpm, depths)[0])
    assert judged.chatters.tolist() == [False, True]
    assert judged.growth == pytest.approx(exact, rel=0.15)


@pytest.mark.parametrize("count", [2, pytest.param(100, marks=pytest.mark.long)])
def test_random_programs_of_complex_modes_are_evaluated_as_by_the_simulation(count: int) -> None:
    """One to six modes in x and y, phases of -40 to 40 degrees, with and without helix, along x."""
    rng = np.random.default_rng(count)
    cases, growth = list[Case](), list[float]()
    for one in (random_case(rng) for _ in range(count)):
        x, y = (tuple((*mode, rng.uniform(-40.0, 40.0)) for mode in modes) for modes in (one.x, one.y))
        cut = Cut(one.teeth, one.immersion, one.direction, one.tangential, one.radial, one.helix_lag)
        found = program_limit(Program(cut, one.speed_rpm, 5e-3), modes_of(x), modes_of(y)).limit
        depths = [share * min(0.1, found) for share in (0.9, 1.1)]
        growth += np.log(spectral_radius(modes_of(x), modes_of(y), cut, one.speed_rpm, depths)[0]).tolist()
        cases += [replace(one.case(depth, 0.0), x=x, y=y) for depth in depths]
    judged = judge(cases)
    assert not np.any(judged.chatters[::2])
    assert judged.chatters.tolist() == [grown > 0 for grown in growth]
    assert judged.growth == pytest.approx(growth, rel=0.01, abs=2e-3)


def test_the_simulation_tells_the_sign_of_the_phase() -> None:
    ahead, behind = (two_and_two((phase, 0.0, phase, 0.0)) for phase in (40.0, -40.0))
    stiff, soft = (limit(given, cut_of(3, 1.0), 5000.0) for given in (ahead, behind))
    assert stiff / soft == pytest.approx(1.198 / 0.7209, rel=1e-3)
    cases = [case_of(given, cut_of(3, 1.0), 5000.0, (stiff + soft) / 2) for given in (ahead, behind)]
    assert judge(cases).chatters.tolist() == [False, True]


def test_the_error_of_the_simulation_is_of_second_order_for_complex_modes() -> None:
    given = two_and_two((-40.0, -40.0, -40.0, -40.0))
    case = case_of(given, cut_of(3, 0.5), 12000.0, 3e-3)
    coarse, fine, finest = (judge([case], fineness).growth[0] for fineness in (1.0, 2.0, 4.0))
    assert (coarse - finest) / (fine - finest) == pytest.approx(5.0, rel=0.15)


def test_in_a_slot_with_four_teeth_limits_and_frequencies_are_those_of_zero_order() -> None:
    """The force is constant there, so zero order is exact and depends on the receptance only."""
    x, y = map(modes_of, two_and_two())
    speeds = np.linspace(4000.0, 12000.0, 12)
    exact = zero_order_lobes(x, y, cut_of(4, 1.0), speeds)
    found = stability_boundary(x, y, cut_of(4, 1.0), speeds, 0.02)
    assert found.depth == pytest.approx(exact.depth, rel=1e-4)
    assert found.chatter_frequency == pytest.approx(exact.chatter_frequency, rel=1e-4)


def test_the_system_shows_the_receptance_of_its_modes() -> None:
    x, y = map(modes_of, two_and_two())
    at = np.linspace(0.0, 5000.0, 101)
    receptance = build_milling_system(x, y).receptance(at)
    for axis, modes in enumerate((x, y)):
        assert receptance[:, axis, axis] == pytest.approx(sum(mode.receptance(at) for mode in modes), rel=1e-12)
    assert not np.any(receptance[:, 0, 1])


@pytest.mark.parametrize("immersion", [1.0, 0.1])
def test_no_phase_is_the_limit_of_a_small_one(immersion: float) -> None:
    none, tiny = (limit(two_and_two(4 * (phase,)), cut_of(3, immersion), 7000.0) for phase in (0.0, 1e-7))
    assert tiny == pytest.approx(none, rel=1e-7)


def test_damping_beyond_the_critical_is_taken_of_real_modes() -> None:
    real, turned = Mode(500.0, 1.2, 1e7), Mode(500.0, 0.3, 1e7, phase_deg=20.0)
    assert np.all(np.isfinite(spectral_radius([real, turned], None, cut_of(2, 0.5), 6000.0, [1e-3, 1e-2])))


@pytest.mark.parametrize("method", [zero_order_lobes, average_angle_lobes])
@pytest.mark.parametrize("phase", [1.0, -1.0])
def test_limits_from_modes_are_those_from_their_frf(method: Method, phase: float) -> None:
    x, y = map(modes_of, two_and_two([phase * given for given in TURNED]))
    from_modes = method(x, y, cut_of(3, 1.0), SPEEDS).depth
    from_frf = method(synthesize_frf(x, LINES), synthesize_frf(y, LINES), cut_of(3, 1.0), SPEEDS).depth
    assert from_frf == pytest.approx(from_modes, rel=2e-3)


def measured(tip: Phased, noise: float, seed: int) -> Frf:
    """FRF of a tip with noise of this share of its largest accelerance at each line."""
    lines, rng = np.arange(100.0, 4000.0, 1.0), np.random.default_rng(seed)
    true = synthesize_frf(modes_of(tip), lines)
    normal = rng.normal(size=(2, lines.size)) / math.sqrt(2)
    error = noise * np.max(np.abs(true.accelerance)) * (normal[0] + 1j * normal[1])
    return Frf(lines, true.receptance - error / (2 * np.pi * lines) ** 2, measured_as="accelerance")


def far_apart(modes: Sequence[Mode], frf: Frf) -> tuple[float, float]:
    """Return relative differences between limits from modes and from the FRF: of the lowest limit, and over speeds."""
    cut = cut_of(4, 1.0)
    one, other = (zero_order_lobes(tip, tip, cut, SPEEDS) for tip in (modes, frf))
    return abs(one.minimum.depth / other.minimum.depth - 1), float(np.max(np.abs(one.depth / other.depth - 1)))


@pytest.mark.parametrize("seed", range(5))
def test_lobes_of_true_complex_modes_are_those_of_the_frf(seed: int) -> None:
    """Noise of 0.2 % moves single limits of an FRF by several percent, so these are compared without."""
    assert max(far_apart(modes_of(TIPS[seed]), measured(TIPS[seed], 0.0, seed))) < 5e-3
    assert far_apart(modes_of(TIPS[seed]), measured(TIPS[seed], 2e-3, seed))[0] < 0.01


@pytest.mark.long
@pytest.mark.parametrize("noise", [1e-3, 2e-3])
@pytest.mark.parametrize("seed", range(5))
def test_lobes_of_fitted_complex_modes_are_within_1_percent_of_those_of_the_frf(seed: int, noise: float) -> None:
    """The lowest limit of the FRF with its noise; limits over speeds of the FRF without, within ten times the noise."""
    noisy, clean = measured(TIPS[seed], noise, seed), measured(TIPS[seed], 0.0, seed)
    fitted = fit_modes(noisy)
    assert far_apart(fitted, noisy)[0] < 0.01
    assert far_apart(fitted, clean)[0] < 0.005
    assert far_apart(fitted, clean)[1] < 10 * noise
