"""Peaks are found however many lines are between them and a higher one."""

import numpy as np
import pytest

from modal import Mode, synthesize_frf
from modal.bands.find_resonances import find_resonances

LINES = np.arange(1.0, 12001.0)


@pytest.mark.parametrize("distance", [20.0, 100.0, 900.0, 8000.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_peak_is_found_at_any_distance_from_a_higher_one(distance: float, sign: float) -> None:
    places = [6000.0 - sign * distance / 2, 6000.0 + sign * distance / 2]
    modes = [Mode(place, 2.0 / place, stiffness) for place, stiffness in zip(places, (1e7, 3e7), strict=True)]
    found = find_resonances(synthesize_frf(modes, LINES))
    assert [peak.frequency for peak in found] == pytest.approx(sorted(places), abs=1.0)
    assert [peak.half_width for peak in found] == pytest.approx([2.0, 2.0], rel=0.2)


def test_the_highest_peak_needs_no_higher_one() -> None:
    (peak,) = find_resonances(synthesize_frf([Mode(6000.0, 0.01, 1e7)], LINES))
    assert peak.height == pytest.approx(np.pi * 6000.0 / (0.01 * 1e7), rel=1e-3)
