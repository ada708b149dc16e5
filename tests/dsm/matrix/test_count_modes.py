"""Count of modes below a frequency, compared with the natural frequencies, and condensation to one node."""

from __future__ import annotations

import numpy as np
import pytest

from dsm import Bearing, Segment, Spindle, natural_frequencies, receptance, static_stiffness
from dsm.matrix.assemble import assemble
from dsm.matrix.dynamic_stiffness import count_modes_below

pytestmark = pytest.mark.quick

SPINDLE = Spindle([Segment(0.1, 0.03), Segment(0.4, 0.06)], [Bearing(0.15, 2.5e8), Bearing(0.4, 2.5e8)])


def test_the_count_rises_by_one_at_each_natural_frequency() -> None:
    frequency = natural_frequencies(SPINDLE, 5)
    model = assemble(SPINDLE, 2 * float(frequency[-1]))
    between = np.sqrt(frequency[:-1] * frequency[1:])
    assert count_modes_below(model, model.to_eigenvalue(between)).tolist() == [1, 2, 3, 4]


def test_the_condensed_shaft_has_the_static_stiffness_at_0_hz() -> None:
    compliance = receptance(SPINDLE, 0.0)
    assert 1 / compliance[0].real == pytest.approx(static_stiffness(SPINDLE), rel=1e-9)
