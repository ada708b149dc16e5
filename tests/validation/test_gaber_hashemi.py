"""A stand-in for the OKADA VM500 spindle of Gaber & Hashemi, whose geometry is not public.

26 segments fitted to the numbers of O. Gaber and S. M. Hashemi, Effects of Machine Tool Spindle Decay on the
Stability Lobe Diagram, Shock and Vibration, 2015: the paper's value stands beside ours in each comment.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from dsm import (
    Bearing,
    Segment,
    Spindle,
    UnreachableFrequencyError,
    calibrate,
    modal_stiffness,
    natural_frequencies,
    static_stiffness,
    stiffness_curve,
)

BEARING_NODES = (8, 10, 12, 16, 17, 18, 21, 22, 23, 24)
GEOMETRY = Path(__file__).parents[1] / "data" / "okada_vm500_surrogate.csv"


def surrogate(stiffness: float) -> Spindle:
    with GEOMETRY.open(newline="") as file:
        rows = list(csv.DictReader(file))
    names = ("length_mm", "outer_diameter_mm", "bore_diameter_mm")
    segments = [Segment(*(float(row[name]) / 1e3 for name in names)) for row in rows]
    nodes = np.cumsum([0.0, *(segment.length for segment in segments)])
    return Spindle(segments, [Bearing(float(nodes[i]), stiffness) for i in BEARING_NODES])


@pytest.mark.parametrize(("stiffness", "frequency"), [(1.28e9, 1713.0), (7.72e8, 1582.1)])  # paper: 1722, 1550
def test_first_frequency(stiffness: float, frequency: float) -> None:
    assert natural_frequencies(surrogate(stiffness), 1)[0] == pytest.approx(frequency, abs=0.06)


def test_first_frequency_with_rigid_bearings() -> None:
    assert natural_frequencies(surrogate(1e9), 1, rigid_bearings=True)[0] == pytest.approx(2301.1, abs=0.06)  # 2303


@pytest.mark.parametrize(("frequency", "stiffness"), [(1722.0, 1.327e9), (1550.0, 6.86e8)])  # paper: 1.28e9, 7.72e8
def test_calibrated_stiffness(frequency: float, stiffness: float) -> None:
    found = calibrate(surrogate(1e9), frequency)
    assert found.bearing_stiffness == pytest.approx(stiffness, rel=1e-3)
    assert found.residual == pytest.approx(0, abs=1e-7)
    assert found.bearing_stiffness_std is None


def test_tip_stiffness_before_and_after_ten_percent_decay() -> None:
    new = calibrate(surrogate(1.28e9), 1722.0).spindle
    worn = calibrate(new, 1550.0)
    assert worn.static_stiffness_before == pytest.approx(2.937e7, rel=2e-4)
    assert worn.static_stiffness_after == pytest.approx(2.739e7, rel=2e-4)
    assert worn.modal_stiffness_before == pytest.approx(3.531e7, rel=2e-4)  # paper, measured: 3.2289e7
    assert worn.modal_stiffness_after == pytest.approx(3.480e7, rel=2e-4)
    assert worn.factor == pytest.approx(6.86e8 / 1.327e9, rel=1e-3)
    assert static_stiffness(worn.spindle) == worn.static_stiffness_after
    assert modal_stiffness(worn.spindle) == pytest.approx(worn.modal_stiffness_after, rel=1e-9)


def test_calibration_is_right_even_where_the_start_is_far_off() -> None:
    near, far = (calibrate(surrogate(stiffness), 1722.0).bearing_stiffness for stiffness in (1e9, 1e3))
    assert far == pytest.approx(near, rel=1e-10)


@pytest.mark.parametrize("mode", [1, 2, 3, 4, 5, 6])
def test_calibration_inverts_natural_frequencies(mode: int) -> None:
    frequency = natural_frequencies(surrogate(1.28e9), mode)[-1]
    assert calibrate(surrogate(5e8), frequency, mode=mode).bearing_stiffness == pytest.approx(1.28e9, rel=1e-9)


def test_frequency_above_the_rigid_limit_is_rejected_with_the_range() -> None:
    with pytest.raises(UnreachableFrequencyError, match=r"mode 1 at 2400 Hz.* 0\.0 Hz .* 2301\.1 Hz") as error:
        calibrate(surrogate(1.28e9), 2400.0)
    assert error.value.reachable == pytest.approx((0.0, 2301.09), abs=0.01)


def test_frequency_below_the_free_limit_is_rejected_with_the_range() -> None:
    with pytest.raises(UnreachableFrequencyError, match=r"mode 4 at 500 Hz.* 2316\.5 Hz"):
        calibrate(surrogate(1.28e9), 500.0, mode=4)


def test_stiffness_curve_agrees_with_calibration_and_ends_at_the_limit() -> None:
    curve = stiffness_curve(surrogate(1e8), [1000.0, 1550.0, 1722.0, 2300.0, 2302.0])
    assert np.all(np.diff(curve[:4]) > 0)
    assert np.isnan(curve[4])
    assert curve[1:3] == pytest.approx([6.86e8, 1.327e9], rel=1e-3)
