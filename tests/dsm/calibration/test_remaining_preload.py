"""Preload from a calibrated bearing stiffness, and its limits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dsm import Bearing, Joint, Segment, Spindle, calibrate, natural_frequencies

pytestmark = pytest.mark.quick

SPINDLE = Spindle([Segment(0.1, 0.05), Segment(0.3, 0.07, 0.02)], [Bearing(0.12, 2e8), Bearing(0.35, 2e8)])


def scaled(factor: float) -> Spindle:
    return replace(SPINDLE, bearings=[replace(b, stiffness=factor * b.stiffness) for b in SPINDLE.bearings])


def first(spindle: Spindle) -> float:
    return float(natural_frequencies(spindle, 1)[0])


@pytest.mark.parametrize(("factor", "low", "high"), [(0.58, 0.133, 0.182), (1.2, 1.768, 1.965)])
def test_preload_left_is_the_range_of_the_radial_exponents(factor: float, low: float, high: float) -> None:
    found = calibrate(SPINDLE, first(scaled(factor)))
    assert found.remaining_preload == pytest.approx((low, high), abs=1e-3)
    text = str(found.remaining_preload)
    assert all(fact in text for fact in (f"{100 * low:.0f}", f"{100 * high:.0f} %", "ball", "3.1", "3.7"))


def jones(angle: float, deflection: float) -> tuple[float, float, float]:
    """Logarithms of preload, radial and axial stiffness of Jones's model at rest, each less its own constant.

    angle: of contact without load (degrees). deflection: of a ball, over the distance of the centres of curvature (-).
    """
    cosine = math.cos(math.radians(angle)) / (1 + deflection)
    sine = math.sqrt(1 - cosine**2)
    along, across = 1.5 * deflection**0.5, deflection**1.5 / (1 + deflection)
    stiffness = along * cosine**2 + across * sine**2, along * sine**2 + across * cosine**2
    return math.log(deflection**1.5 * sine), math.log(stiffness[0]), math.log(stiffness[1])


@pytest.mark.parametrize(("angle", "catalogue"), [(15.0, (0.390, 0.515)), (25.0, (0.353, 0.413))])
def test_radial_exponents_follow_from_the_axial_ones_of_catalogues(
    angle: float, catalogue: tuple[float, float]
) -> None:
    """Axial ones of 5 to 95 % of 1022 angular contact bearings."""
    logs = np.array([jones(angle, deflection) for deflection in np.geomspace(1e-3, 0.05, 400)])
    preload, radial, axial = np.diff(logs, axis=0).T
    held = (catalogue[0] < axial / preload) & (axial / preload < catalogue[1])
    exponents = (radial / preload)[held]
    assert np.count_nonzero(held) > 50
    assert 0.28 < np.min(exponents) < np.max(exponents) < 0.33


def test_rollers_say_nothing_of_it() -> None:
    rollers = replace(SPINDLE, bearings=[replace(b, rolling_elements="rollers") for b in SPINDLE.bearings])
    found = calibrate(rollers, first(scaled(0.58)))
    assert found.remaining_preload is None
    assert "preload" not in str(found)
    with pytest.raises(ValueError, match=r"bearing 1: rolling_elements='needles' .* balls, rollers"):
        replace(SPINDLE, bearings=[replace(b, rolling_elements="needles") for b in SPINDLE.bearings])  # type: ignore[arg-type]


def test_near_the_limit_of_rigid_bearings_the_stiffness_is_open_and_nothing_is_reported_of_preload() -> None:
    rigid = float(natural_frequencies(SPINDLE, 1, rigid_bearings=True)[0])
    found = calibrate(SPINDLE, 0.999 * rigid)
    assert [remark.code for remark in found.remarks] == ["bearings-not-felt"]
    assert found.remaining_preload is None
    assert calibrate(SPINDLE, first(SPINDLE)).remarks == ()


def test_a_joint_that_is_calibrated_says_nothing_of_preload() -> None:
    spindle = replace(SPINDLE, joints=[Joint(0.06, 2e8, 2e5, group="holder")])
    worn = replace(spindle, joints=[Joint(0.06, 1e8, 1e5, group="holder")])
    found = calibrate(spindle, first(worn), group="holder")
    assert found.factor == pytest.approx(0.5, rel=1e-6)
    assert found.remaining_preload is None
