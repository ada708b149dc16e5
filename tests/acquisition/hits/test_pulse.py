"""Location of the hammer pulse, for pulses with known samples."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition import Hit
from acquisition.hits.pulse import find_pulse

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("half", [3, 500, 1023, 1024, 5000])
def test_a_triangle_reaches_to_5_percent_of_its_peak(half: int) -> None:
    force = np.full(16_384, 2.0)
    top = 8000
    force[top - half : top + half + 1] += 100 * (1 - np.abs(np.arange(-half, half + 1)) / half)
    pulse = find_pulse(Hit(force, np.zeros_like(force), 1000.0, pre_trigger=2000))
    assert pulse is not None
    inside = np.flatnonzero(force - 2.0 > 5.0)
    assert (pulse.peak_index, pulse.start, pulse.end) == (top, inside[0], inside[-1] + 1)
    assert (pulse.offset, pulse.peak, pulse.baseline_rms) == (2.0, 100.0, 0.0)
    assert pulse.force == pytest.approx(force - 2.0)


@pytest.mark.parametrize(("backwards", "start", "end"), [(False, 2000, 4096), (True, 0, 2096)])
def test_a_pulse_cut_off_by_its_record_ends_with_it(backwards: bool, start: int, end: int) -> None:
    force = np.zeros(4096)
    force[2000:] = np.linspace(20.0, 100.0, 2096)
    pulse = find_pulse(Hit(force[:: -1 if backwards else 1], np.zeros(4096), 1000.0, 0 if backwards else 1000))
    assert pulse is not None
    assert (pulse.start, pulse.end) == (start, end)
