"""Error of a frequency of a tapped tool: that of the fit, and the scatter of mounting as a standard deviation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.special import ndtri

from lobewatch.logbook.tool_modes import find_tapped_tools
from modal import Mode

Shop = Any
"""Machine of tests/lobewatch/conftest.py."""
LONG = "long end mill"


@pytest.mark.quick
def test_scatter_is_the_half_width_of_95_percent_as_a_standard_deviation(shop: Shop) -> None:
    shop.put("[doubt]\nfrequency_percent = 0.98\n")
    shop.tap(0, 1713.0)
    shop.tap(1, 1500.0, tool=LONG)
    for tapped in find_tapped_tools(shop.logbook, ["reference", LONG], "x"):
        assert tapped.scatter == pytest.approx(0.0098 / ndtri(0.975), rel=1e-3)
        own = 3.0
        mode = Mode(1000.0, 0.03, 3e7, covariance=np.diag([own**2, 1e-8, 1e8]))
        assert tapped.frequency_std(mode) == pytest.approx(math.hypot(own, 1000 * 0.0098 / 1.96), rel=1e-3)
