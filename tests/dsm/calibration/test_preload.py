"""What a calibrated bearing stiffness says of the preload, and where it says nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dsm import Bearing, Segment, Spindle, calibrate, natural_frequencies

SPINDLE = Spindle([Segment(0.1, 0.05), Segment(0.3, 0.07, 0.02)], [Bearing(0.12, 2e8), Bearing(0.35, 2e8)])


def scaled(factor: float) -> Spindle:
    return replace(SPINDLE, bearings=[replace(b, stiffness=factor * b.stiffness) for b in SPINDLE.bearings])


def first(spindle: Spindle) -> float:
    return float(natural_frequencies(spindle, 1)[0])


@pytest.mark.parametrize(("factor", "low", "high"), [(0.58, 0.195, 0.336), (1.2, 1.44, 1.728)])
def test_preload_left_is_the_range_of_the_square_and_the_cube(factor: float, low: float, high: float) -> None:
    found = calibrate(SPINDLE, first(scaled(factor)))
    assert found.preload_left == pytest.approx((low, high), abs=1e-3)
    assert "preload left" in str(found)


def test_rollers_say_nothing_of_it() -> None:
    rollers = replace(SPINDLE, bearings=[replace(b, rolling_elements="rollers") for b in SPINDLE.bearings])
    found = calibrate(rollers, first(scaled(0.58)))
    assert found.preload_left is None
    assert "preload" not in str(found)
    with pytest.raises(ValueError, match="bearing 1: rolling_elements='needles' is none of balls, rollers"):
        replace(SPINDLE, bearings=[replace(b, rolling_elements="needles") for b in SPINDLE.bearings])  # type: ignore[arg-type]


def test_near_the_limit_of_rigid_bearings_the_stiffness_is_open() -> None:
    rigid = float(natural_frequencies(SPINDLE, 1, rigid_bearings=True)[0])
    assert [remark.code for remark in calibrate(SPINDLE, 0.999 * rigid).remarks] == ["bearings-not-felt"]
    assert calibrate(SPINDLE, first(SPINDLE)).remarks == ()
