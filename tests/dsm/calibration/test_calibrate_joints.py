"""A named group means the same to calibrate and to fit_stiffness: its bearings and its joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from dsm import (
    Bearing,
    Joint,
    Segment,
    Spindle,
    Theory,
    UnreachableFrequencyError,
    calibrate,
    fit_stiffness,
    natural_frequencies,
    stiffness_curve,
)
from dsm.calibration.stiffness_groups import scale_groups

BEARINGS = [Bearing(0.15, 2e8, group="front", housing_stiffness=4e8), Bearing(0.22, 4e8, group="front")]


def spindle(joints: Sequence[Joint], theory: Theory = "euler-bernoulli") -> Spindle:
    segments = [Segment(0.1, 0.03), Segment(0.4, 0.06, 0.02)]
    return Spindle(segments, [*BEARINGS, Bearing(0.45, 1e8, group="rear")], joints=joints, theory=theory)


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("group", ["holder", "front"])
@pytest.mark.parametrize("mode", [1, 2, 4])
def test_a_group_with_joints_is_solved_as_fit_stiffness_does(group: str, mode: int, theory: Theory) -> None:
    shaft = spindle([Joint(0.08, 1e8, 1e5, group=group), Joint(0.12, 3e8, 2e5)], theory)
    frequency = float(natural_frequencies(scale_groups(shaft, {group: 0.7}), mode)[-1])
    found = calibrate(shaft, frequency, 0.5, mode=mode, group=group)
    fitted = fit_stiffness(shaft, frequency, 0.5, mode=[mode], groups=[group])
    assert found.factor == pytest.approx(0.7, rel=1e-8)
    assert found.spindle.joints[0].rotational_stiffness == pytest.approx(0.7e5, rel=1e-8)
    assert found.spindle.joints[1] == shaft.joints[1]
    assert fitted.factor[0] == pytest.approx(found.factor, rel=1e-8)
    assert fitted.stiffness[0] == pytest.approx(found.bearing_stiffness, rel=1e-8)
    assert fitted.energy_share[0, 0] == pytest.approx(found.energy_share, rel=1e-7)
    assert stiffness_curve(shaft, [frequency], mode, group) == pytest.approx([found.bearing_stiffness], rel=1e-10)


def test_without_a_name_joints_stay_as_given() -> None:
    shaft = spindle([Joint(0.08, 1e8, 1e5, group="holder")])
    softer = scale_groups(shaft, {"front": 0.7, "rear": 0.7})
    found = calibrate(shaft, float(natural_frequencies(softer, 1)[0]))
    assert found.factor == pytest.approx(0.7, rel=1e-9)
    assert found.spindle.joints == shaft.joints


def test_a_frequency_that_no_joint_can_give_is_rejected_with_its_range() -> None:
    shaft = spindle([Joint(0.08, 1e8, 1e5, group="holder")])
    with pytest.raises(UnreachableFrequencyError, match="mode 3 at 9999 Hz") as error:
        calibrate(shaft, 9999.0, mode=3, group="holder")
    rigid = natural_frequencies(replace(shaft, joints=()), 3)[-1]
    assert error.value.reachable[1] == pytest.approx(rigid, rel=1e-9)
