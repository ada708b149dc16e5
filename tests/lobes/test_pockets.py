"""From lobes to advice: programs, aged modes, pockets, drive limits, coefficients.

T. L. Schmitz, K. S. Smith, Machining Dynamics, 2nd ed., Springer 2019, Ex. 4.3 (slot in aluminium).
O. Gaber, S. M. Hashemi, Shock and Vibration 2015: 1722 -> 1550 Hz, K x 0.9.
Y. Altintas, Manufacturing Automation, 2nd ed., Cambridge 2012, ch. 2 (mean torque).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lobes import (
    Cut,
    CuttingCoefficients,
    Program,
    StabilityLobes,
    age_mode,
    all_cutting_coefficients,
    average_angle_lobes,
    find_pockets,
    match_pockets,
    max_depth_for_drive,
    mean_torque,
    program_limit,
    rank_pockets,
    spectral_radius,
    tangential_and_radial,
)
from modal import Mode

SLOT = Cut(4, 1.0, "up", *tangential_and_radial(750e6, math.radians(68)))
SPINDLE = Mode(1722.0, 0.029136, 3.2289e7)
MODE = Mode(1200.0, 0.03, 2e7)


def test_the_paper_s_spindle_in_an_aluminium_slot() -> None:
    """The lowest limit falls by 10 %, but at 5200 rpm, inside the 8.7 mm pocket at 5262 rpm, from 7.97 to 3.48 mm."""
    old = age_mode(SPINDLE, 0.9, "paper")
    around = np.linspace(5000, 5500, 5001)
    new_lobes, old_lobes = (average_angle_lobes([mode], None, SLOT, around) for mode in (SPINDLE, old))
    deepest = find_pockets(new_lobes, 1.0)[0]
    assert deepest.speed_rpm == pytest.approx(5262, abs=1)
    assert deepest.depth * 1e3 == pytest.approx(8.7, abs=0.05)
    assert new_lobes.depth_at(5200) * 1e3 == pytest.approx(7.97, abs=0.005)
    assert old_lobes.depth_at(5200) * 1e3 == pytest.approx(3.48, abs=0.005)
    charts = [
        average_angle_lobes([m], None, SLOT, np.linspace(3000, 20000, 20001)).minimum.depth for m in (SPINDLE, old)
    ]
    assert charts[1] / charts[0] == pytest.approx(0.9, abs=1e-4)


def test_rules_for_k() -> None:
    covariance = np.diag([1.0, 1e-8, 1e10])
    base = replace(SPINDLE, covariance=covariance, method="tap")
    paper = age_mode(base, 0.9, "paper")
    assert paper.frequency == pytest.approx(1549.8)
    assert paper.damping_ratio == 0.029136
    assert paper.stiffness == pytest.approx(0.9 * 3.2289e7)
    np.testing.assert_allclose(paper.standard_error, [0.9, 1e-4, 0.9e5])
    assert age_mode(base, 0.9, "model", 0.985).stiffness == pytest.approx(0.985 * 3.2289e7)
    assert age_mode(base, 0.9, "measured", 1.02).stiffness == pytest.approx(1.02 * 3.2289e7)
    constant = age_mode(base, 0.9, "model")
    assert constant.stiffness == 3.2289e7
    assert constant.method == "tap, aged, K constant, no model"
    assert paper.method == "tap, aged, K by rule paper"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.9, "guess", None), "rule='guess'"),
        ((0.0, "paper", None), "ratio=0.0"),
        ((0.9, "measured", None), 'rule="measured" .*stiffness_ratio'),
        ((0.9, "paper", 0.9), 'rule="paper" .*stiffness_ratio=0.9'),
        ((0.9, "model", -1.0), "stiffness_ratio=-1.0"),
        ((math.nan, "model", None), "ratio=nan"),
    ],
)
def test_bad_aging_is_rejected(arguments: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        age_mode(SPINDLE, *arguments)


def test_an_island_above_the_limit_is_no_place_to_work() -> None:
    """a/D 0.1 at 18 000 rpm: stable below 0.816 mm, and again between 3.118 and 3.831 mm."""
    benchmark = [Mode(922.0, 0.011, 0.03993 * (2 * math.pi * 922) ** 2)]
    program = Program(Cut(2, 0.1, "down", 6e8, 2e8), 18000.0, 3.5e-3)
    assert spectral_radius(benchmark, None, program.cut, 18000.0, 3.5e-3)[0, 0] < 1
    found = program_limit(program, benchmark, None)
    assert not found.stable
    assert found.limit * 1e3 == pytest.approx(0.816, rel=0.01)


@pytest.mark.parametrize(("speed", "depth"), [(0.0, 1e-3), (math.nan, 1e-3), (1e4, 0.0), (1e4, math.inf)])
def test_bad_programs_are_rejected(speed: float, depth: float) -> None:
    with pytest.raises(ValueError, match=r"speed_rpm=|depth="):
        Program(SLOT, speed, depth)


def chart(depth: list[float], speed: NDArray[np.float64] | None = None) -> StabilityLobes:
    values = np.array(depth)
    speeds = np.arange(1.0, values.size + 1) * 1000 if speed is None else speed
    return StabilityLobes(
        speeds, values, np.full(values.shape, 800.0), np.full(values.shape, "hopf"), values[:, None], "zero order"
    )


def test_pockets_are_the_tops_of_the_diagram() -> None:
    found = find_pockets(chart([4.0, 1.0, 3.0, 1.0, math.inf, math.inf, math.inf, 2.0]), 5.0)
    assert [pocket[:2] for pocket in found] == [(1000.0, 4.0), (3000.0, 3.0), (6000.0, 5.0)]
    assert [pocket[:2] for pocket in rank_pockets(found, 2)] == [(6000.0, 5.0), (1000.0, 4.0)]
    assert [pocket[:2] for pocket in rank_pockets(found, 2, by="removal")] == [(6000.0, 5.0), (3000.0, 3.0)]
    with pytest.raises(ValueError, match="by='speed'"):
        rank_pockets(found, by="speed")
    with pytest.raises(ValueError, match="deepest"):
        find_pockets(chart([1.0, 2.0]), 0.0)


def test_the_drive_cuts_pockets_off() -> None:
    lobes = chart([1.0, 8.0, 1.0, 1.0, 9.0, 1.0])
    assert find_pockets(lobes, np.array([9.0, 9, 9, 2, 2, 2]))[1][:2] == (5000.0, 2.0)


def test_a_pocket_reaches_as_far_as_four_fifths_of_its_depth() -> None:
    found = find_pockets(chart([4.0, 1.0, 3.0, 1.0, math.inf, math.inf, 5.0, 2.0, 9.0]), 5.0)
    ends = [(pocket.from_rpm, pocket.to_rpm) for pocket in found]
    np.testing.assert_allclose(
        ends, [(1000, 1000 + 800 / 3), (2700, 3300), (4750, 7000 + 1000 / 3), (8000 + 2000 / 3, 9000)]
    )


def test_pockets_move_with_the_frequency() -> None:
    speeds = np.linspace(6000, 30000, 2401)
    then, now = (average_angle_lobes([age_mode(MODE, ratio, "paper")], None, SLOT, speeds) for ratio in (1.0, 0.95))
    shifts = match_pockets(then, now, 50e-3)
    assert len(shifts) >= 2
    inside = [shift for shift in shifts if 7000 < shift.before.speed_rpm < 28000]
    for shift in inside:
        assert shift.speed_change == pytest.approx(-0.05, abs=2e-3)
        assert shift.depth_change == pytest.approx(-0.05, abs=0.03)


def test_mean_torque_of_a_slot() -> None:
    """N D / (4 pi) b (2 Kt f + pi Kte)."""
    torque = mean_torque(SLOT, [1e-3, 2e-3], diameter=0.02, feed_per_tooth=1e-4, edge=2e4)
    one = 4 * 0.02 / (4 * math.pi) * 1e-3 * (2 * SLOT.tangential * 1e-4 + math.pi * 2e4)
    assert torque == pytest.approx([one, 2 * one])


def test_power_is_the_tangential_force_times_the_removal_rate() -> None:
    """Kt a_e b f N n: the chip volume of a half-immersed cut times Kt."""
    half = replace(SLOT, immersion=0.5)
    power = 2 * math.pi * 200 * mean_torque(half, 3e-3, 0.02, 1e-4)
    assert power == pytest.approx(half.tangential * 0.01 * 3e-3 * 1e-4 * 4 * 200)


def test_depth_for_power_and_torque() -> None:
    depth = max_depth_for_drive(SLOT, [3000.0, 12000.0], 0.02, 1e-4, power=2000.0, torque=4.0)
    at_torque = 4.0 / mean_torque(SLOT, 1.0, 0.02, 1e-4)
    at_power = 2000 / (2 * math.pi * 200) / mean_torque(SLOT, 1.0, 0.02, 1e-4)
    assert depth == pytest.approx([at_torque, at_power])


@pytest.mark.parametrize("change", [{"diameter": 0.0}, {"feed_per_tooth": -1.0}, {"edge": math.nan}, {"power": 0.0}])
def test_bad_drive_limits_are_rejected(change: dict[str, float]) -> None:
    good = {"diameter": 0.02, "feed_per_tooth": 1e-4}
    with pytest.raises(ValueError, match=next(iter(change))):
        max_depth_for_drive(SLOT, 3000.0, **{**good, **change})


def test_published_coefficients_in_si_with_source_and_edge() -> None:
    known = {one.material: one for one in all_cutting_coefficients()[:10]}
    assert len(known) == 10
    first = known["Al 7075-T6 (carbide; dry; ref. 190)"]
    assert first.alloy == "Al 7075"
    assert (first.tangential, first.radial) == pytest.approx((767.01e6, 168.8e6))
    assert (first.tangential_edge, first.radial_edge) == (27700.0, 26600.0)
    assert all(
        "10.1186" in one.source or "p." in one.source or "Ex." in one.source or "Stepan" in one.source
        for one in known.values()
    )
    assert math.isnan(known["Al (textbook; Altintas)"].tangential_edge)


def test_specific_force_and_angle_there_and_back() -> None:
    assert SLOT.specific_force == pytest.approx(750e6)
    assert math.degrees(SLOT.force_angle) == pytest.approx(68)
    assert tangential_and_radial(750e6, math.radians(68)) == pytest.approx((695.4e6, 281.0e6), abs=0.05e6)
    assert tangential_and_radial(1e9, math.pi / 2) == pytest.approx((1e9, 0.0), abs=1e-3)


@pytest.mark.parametrize(("force", "angle"), [(0.0, 1.0), (math.nan, 1.0), (1e9, 0.0), (1e9, 2.0), (1e9, math.nan)])
def test_bad_specific_forces_are_rejected(force: float, angle: float) -> None:
    with pytest.raises(ValueError, match=r"specific_force=|force_angle="):
        tangential_and_radial(force, angle)


@pytest.mark.parametrize(("tangential", "radial"), [(0.0, 1.0), (1e9, -1.0), (math.inf, 1.0), (1e9, math.nan)])
def test_bad_coefficients_are_rejected(tangential: float, radial: float) -> None:
    with pytest.raises(ValueError, match=r"tangential=|radial="):
        CuttingCoefficients("unobtainium", tangential, radial)
