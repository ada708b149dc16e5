"""Implausible sensitivities, dates and stiffnesses."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, date, datetime
from importlib import resources

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition import (
    Channel,
    Circumstances,
    TapTest,
    calibration_remark,
    channel_remarks,
    stiffness_remark,
    unit_mistake_remark,
)
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.measurement import measure
from modal import Mode, synthesize_frf

pytestmark = pytest.mark.quick

HAMMER = Channel("force", 2.25e-3, 5.0, calibration_date="2026-01-15")
TODAY = date(2026, 11, 1)


@pytest.mark.parametrize(
    ("quantity", "sensitivity"),
    [("force", 0.23e-3), ("force", -11.2e-3), ("force", 22.5e-3), ("acceleration", 1.02e-3), ("acceleration", 0.102)],
)
def test_real_sensors_are_believed(quantity: str, sensitivity: float) -> None:
    assert channel_remarks(Channel(quantity, sensitivity, 5.0)) == ()  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("channel", "code", "words", "cure"),
    [
        (Channel("acceleration", 100.0, 5.0), "sensitivity", "100 V per m/s^2", "mV"),
        (Channel("force", 2.25, 5.0), "sensitivity", "2.25 V per N", "mV"),
        (Channel("force", 2.25e-6, 5.0), "sensitivity", "2.25e-06 V per N", "1000 twice"),
        (
            Channel("acceleration", 1e9, 5.0),
            "sensitivity",
            "1e+09 V per m/s^2",
            "",
        ),
        (Channel("force", 2.25e-3, 5000.0), "input-range", "±5000 V", "mV"),
    ],
)
def test_a_sensitivity_or_range_that_no_device_has_is_not_believed(
    channel: Channel, code: str, words: str, cure: str
) -> None:
    (doubt,) = channel_remarks(channel)
    assert (doubt.code, doubt.about, bool(doubt.cure)) == (f"{code}-not-believed", channel.quantity, bool(cure))
    assert words in doubt.text
    assert cure in doubt.cure


@given(st.floats(0.11, 24), st.sampled_from([1, -1]))
def test_a_believed_hammer_entered_in_millivolts_is_caught(millivolts: float, sign: int) -> None:
    assert channel_remarks(Channel("force", sign * millivolts * 1e-3, 5.0)) == ()
    assert len(channel_remarks(Channel("force", sign * millivolts, 5.0))) == 1


@pytest.mark.parametrize(
    ("factor", "word"),
    [
        (9.80665, "V/g by 9.80665"),
        (1 / 9.80665, "V per m/s^2"),
        (4.44822, "V/N"),
        (1 / 4.44822, "V/lbf by 4.44822"),
        (1e3, "force 1000 times too large or acceleration too small"),
        (1e-3, "force 1000 times too small or acceleration too large"),
    ],
)
@given(st.floats(0.9, 1.1))
def test_a_ratio_near_a_unit_mistake_names_it(factor: float, word: str, off: float) -> None:
    found = unit_mistake_remark(factor * off)
    assert found is not None
    assert found.code == "unit-mistake"
    assert word in found.cure


@given(st.floats(0.3, 3.5))
def test_a_ratio_far_from_all_names_none(ratio: float) -> None:
    assert unit_mistake_remark(ratio) is None


@pytest.mark.parametrize("stiffness", [1e5, 3.5e7, -3.5e7, 1e10])
def test_stiffnesses_of_machine_tools_are_believed(stiffness: float) -> None:
    assert stiffness_remark(stiffness) is None


@pytest.mark.parametrize("stiffness", [3.5e4, 3.5e10, -9e4])
def test_other_stiffnesses_are_not(stiffness: float) -> None:
    shown = f"{stiffness:.0f} N/m" if stiffness < 1e5 else f"{stiffness / 1e6:.0f} N/um"
    found = stiffness_remark(stiffness)
    assert found is not None
    assert f"K = {shown} is outside 0.1 to 10000 N/um" in found.text


@pytest.mark.parametrize(("stiffness", "noted"), [(3.5e7, False), (3.5e4, True)])
def test_a_measurement_whose_stiffness_is_not_believed_says_so(stiffness: float, noted: bool) -> None:
    machine = parse_machine_file(resources.files("sim_data").joinpath("new_machine.toml").read_text("utf-8"))
    frf = synthesize_frf([Mode(1500.0, 0.03, stiffness)], np.arange(4.0, 4000.0, 4.0))
    measurement = measure(TapTest("t", Circumstances("mill", datetime(2026, 1, 15, tzinfo=UTC)), frf), machine)
    assert ("stiffness-not-believed" in [remark.code for remark in measurement.remarks]) is noted


@pytest.mark.parametrize(
    ("calibrated", "today", "months", "code", "words"),
    [
        ("2026-01-15", TODAY, 12.0, "", ""),
        ("2026-01-15", TODAY, 6.0, "calibration-old", "2026-01-15, 10 months ago (calibration interval 6 months)"),
        ("2026-01-15", date(2027, 1, 15), 12.0, "", ""),
        ("2026-01-15", date(2027, 1, 16), 12.0, "calibration-old", "12 months ago (calibration interval 12 months)"),
        ("", TODAY, 12.0, "calibration-unknown", ""),
        ("2026-01-15", date(2026, 1, 15), 12.0, "", ""),
        ("2026-01-15", date(2026, 1, 14), 12.0, "calibration-in-future", "2026-01-14"),
        ("15.1.26", TODAY, 12.0, "calibration-no-date", "'15.1.26'"),
    ],
)
def test_the_date_of_calibration(calibrated: str, today: date, months: float, code: str, words: str) -> None:
    found = calibration_remark(replace(HAMMER, calibration_date=calibrated), today, months)
    assert (found.code if found else "") == code
    assert words in str(found or "")
    assert found is None or found.about == "force"


@pytest.mark.parametrize("direction", ["z", "X", "xy"])
def test_a_channel_of_no_direction_of_the_tool_tip_is_rejected(direction: str) -> None:
    with pytest.raises(ValueError, match=f"direction='{direction}'"):
        replace(HAMMER, direction=direction)  # type: ignore[arg-type]
    assert [replace(HAMMER, direction=one).direction for one in ("", "x", "y")] == ["", "x", "y"]
