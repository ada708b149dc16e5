"""Intervals of the bearing stiffness near the frequency that rigid bearings give."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from dsm import (
    Bearing,
    Calibration,
    Segment,
    Spindle,
    UnreachableFrequencyError,
    calibrate,
    natural_frequencies,
    stiffness_curve,
)


def random_shaft(draw: np.random.Generator) -> Spindle:
    """Four alike bearings, anywhere."""
    segments = [Segment(*draw.uniform([0.03, 0.04], [0.12, 0.1]).tolist()) for _ in range(int(draw.integers(3, 7)))]
    places = np.sort(draw.uniform(0.15, 0.95, 4)) * sum(segment.length for segment in segments)
    return Spindle(segments, [Bearing(place, 1e8) for place in places.tolist()])


class Outcome(NamedTuple):
    """Results of many simulated shafts."""

    inside: list[bool]
    """True for each interval that contains the truth."""
    unremarked: list[bool]
    """True for each such interval without a remark."""
    refused: int
    """Frequencies measured above the limit."""


def study(number: int, share: float, noise: float) -> Outcome:
    """Frequencies of this share of that with rigid bearings, measured with so much noise."""
    draw, outcome = np.random.default_rng(1), Outcome([], [], 0)
    for _ in range(number):
        shaft = random_shaft(draw)
        frequency = share * float(natural_frequencies(shaft, 1, rigid_bearings=True)[0])
        truth = calibrate(shaft, frequency).bearing_stiffness
        measured = frequency * (1 + noise * float(draw.normal()))
        try:
            found = calibrate(shaft, measured, noise * measured)
        except UnreachableFrequencyError:
            outcome = outcome._replace(refused=outcome.refused + 1)
            continue
        assert found.bearing_stiffness_interval is not None
        low, high = found.bearing_stiffness_interval
        outcome.inside.append(low <= truth <= high)
        outcome.unremarked.extend([] if found.remarks else [low <= truth <= high])
    return outcome


def test_intervals_near_the_rigid_limit_hold_the_truth() -> None:
    found = study(100, 0.995, 3e-3)
    assert np.mean(found.inside) >= 0.93
    assert found.refused < 10


@pytest.mark.long
@pytest.mark.parametrize("share", [0.98, 0.99, 0.995])
@pytest.mark.parametrize("noise", [1e-3, 2e-3, 3e-3])
def test_intervals_near_the_rigid_limit_hold_the_truth_with_and_without_a_remark(share: float, noise: float) -> None:
    """A miss without a remark is rare among all measurements.

    Among those without a remark alone it is not: near the limit only frequencies measured too low have none.
    """
    found = study(400, share, noise)
    assert np.mean(found.inside) >= 0.93
    assert np.count_nonzero(~np.array(found.unremarked)) <= 0.07 * len(found.inside)
    assert len(found.inside) + found.refused == 400


def found_at(share: float, noise: float) -> Calibration:
    shaft = random_shaft(np.random.default_rng(3))
    frequency = share * float(natural_frequencies(shaft, 1, rigid_bearings=True)[0])
    return calibrate(shaft, frequency, noise * frequency)


def test_the_interval_is_that_of_the_frequency_end_by_end() -> None:
    found = found_at(0.9, 3e-3)
    ends = found.frequency + 1.96 * 3e-3 * found.frequency * np.array([-1, 1])
    assert found.bearing_stiffness_interval == pytest.approx(stiffness_curve(found.given, ends).tolist(), rel=1e-6)
    low, high = (end / 1e6 for end in found.bearing_stiffness_interval or ())
    assert f"{low:.5g} N/um to {high:.5g} N/um" in str(found)
    assert not found.remarks


def test_an_interval_without_an_upper_end_is_open() -> None:
    """The mode feels 3.2 % of these bearings, and its frequency may be that of rigid ones all the same."""
    found = found_at(0.985, 1e-2)
    assert found.energy_share > 0.02
    assert found.bearing_stiffness_interval is not None
    low, high = found.bearing_stiffness_interval
    assert 0 < low < found.bearing_stiffness < high == math.inf
    assert [remark.code for remark in found.remarks] == ["bearings-not-felt"]
    assert "rigid" in str(found.remarks[0])
    assert f"{low / 1e6:.5g} N/um to rigid" in str(found)
    assert found.remaining_preload is None


def test_an_interval_reaches_down_to_no_bearings() -> None:
    """A third bearing of a shaft on two: without it the mode is 2 % lower."""
    held = Spindle([Segment(0.4, 0.05)], [Bearing(0.1, 2e8, group=""), Bearing(0.35, 2e8, group="")])
    soft = replace(held, bearings=[*held.bearings, Bearing(0.02, 3e5)])
    frequency = float(natural_frequencies(soft, 1)[0])
    found = calibrate(soft, frequency, 0.05 * frequency)
    assert found.bearing_stiffness_interval is not None
    assert found.bearing_stiffness_interval[0] == 0.0


def test_without_the_error_of_the_frequency_there_is_no_interval() -> None:
    shaft = random_shaft(np.random.default_rng(3))
    found = calibrate(shaft, 0.9 * float(natural_frequencies(shaft, 1, rigid_bearings=True)[0]))
    assert found.bearing_stiffness_interval is None
    assert "interval" not in str(found)
