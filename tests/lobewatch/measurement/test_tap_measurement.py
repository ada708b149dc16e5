"""Rejected modes: neither followed nor calibrated nor used for lobes."""

from __future__ import annotations

from datetime import UTC, datetime
from importlib import resources

import numpy as np
import pytest

from acquisition import Circumstances, Frf, TapTest
from lobewatch.machine import Machine
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.measurement import Measurement, measure
from modal import Mode, synthesize_frf

pytestmark = pytest.mark.quick

LINES = np.arange(0.5, 4000.0, 0.5)
TRUE = Mode(1713.0, 0.03, 3.5e7)


@pytest.fixture
def machine() -> Machine:
    """Return the example without a band, so that any mode may be followed."""
    text = resources.files("sim_data").joinpath("surrogate_machine.toml").read_text("utf-8")
    return parse_machine_file(text.replace("band_hz", "# band_hz"))


def measured(machine: Machine, *modes: Mode, last: Mode | None = None) -> Measurement:
    about = Circumstances("m", datetime(2026, 1, 15, tzinfo=UTC), "reference")
    return measure(TapTest("t", about, Frf(LINES, synthesize_frf(modes, LINES).receptance)), machine, last)


def codes(measurement: Measurement) -> list[str]:
    return [remark.code for remark in measurement.remarks]


def test_the_pole_of_a_drift_is_named_and_the_mode_is_followed(machine: Machine) -> None:
    """The pole that a file of a shop gave: 1.09 Hz, zeta 74 %, K 19.7 N/m, bearings of 129 N/m."""
    measurement = measured(machine, Mode(1.09, 0.74, 19.7), TRUE)
    assert min(mode.frequency for mode in measurement.modes) < 2
    assert measurement.followed is not None
    assert measurement.followed.frequency == pytest.approx(1713.0, rel=1e-4)
    assert [mode.frequency for mode in measurement.at_tip] == pytest.approx([1713.0], rel=1e-4)
    assert measurement.calibration is not None
    assert codes(measurement) == ["mode-not-believed"]
    assert measurement.remarks[0].about == "1.09 Hz"


def test_a_drift_alone_leaves_nothing_to_follow(machine: Machine) -> None:
    measurement = measured(machine, Mode(1.09, 0.74, 19.7))
    assert (measurement.followed, measurement.calibration, measurement.at_tip) == (None, None, [])
    assert "mode-not-believed" in codes(measurement)


@pytest.mark.parametrize(("share", "is_believed"), [(0.52, True), (0.48, False), (1.9, True), (2.1, False)])
def test_a_stiffness_far_from_the_series_calibrates_nothing(machine: Machine, share: float, is_believed: bool) -> None:
    measurement = measured(machine, Mode(1713.0, 0.03, share * TRUE.stiffness), last=TRUE)
    assert measurement.followed is not None
    assert (measurement.calibration is not None) is is_believed
    assert ("calibration-not-believed" in codes(measurement)) is not is_believed


def test_a_bearing_stiffness_of_no_bearing_is_unknown(machine: Machine) -> None:
    """Just below the frequency that rigid bearings give, 2301.1 Hz."""
    measurement = measured(machine, Mode(2301.0, 0.03, 3.5e7))
    assert measurement.calibration is None
    (remark,) = [remark for remark in measurement.remarks if remark.code == "calibration-not-believed"]
    assert "0.1 to 100000 N/um" in remark.text


def test_a_small_mode_against_the_hammer_is_left_out_and_reported(machine: Machine) -> None:
    """13 Hz with K < 0, its peak 8 % of that of a perfect mode, once took all lobes of the direction away."""
    large, zeta = 1 / (2 * TRUE.stiffness * TRUE.damping_ratio), 0.05
    measurement = measured(machine, Mode(60.0, zeta, -1 / (2 * zeta * 0.08 * large)), TRUE)
    assert [mode.frequency for mode in measurement.at_tip] == pytest.approx([1713.0], rel=1e-3)
    (said,) = [remark for remark in measurement.remarks if remark.code == "small-against"]
    assert (said.about, " 8 % " in said.text) == ("60 Hz", True)


def test_a_large_mode_against_the_hammer_leaves_no_modes_at_the_tip(machine: Machine) -> None:
    large, zeta = 1 / (2 * TRUE.stiffness * TRUE.damping_ratio), 0.05
    measurement = measured(machine, Mode(60.0, zeta, -1 / (2 * zeta * 0.12 * large)), TRUE)
    assert not measurement.at_tip
    assert codes(measurement)[-1] == "no-lobes-driving-point"
