"""Remark on averaged hits that touch twice."""

from __future__ import annotations

import re

import numpy as np
import pytest

from acquisition import Hit
from lobewatch.measurement.touch_remarks import touch_remarks

TIME = np.arange(-500, 6000) / 25600.0


def hit(share: float) -> Hit:
    """200 N, and a touch of this share 5 ms later."""
    pulses = [(0.0, 200.0), (5e-3, 200.0 * share)]
    starts = ((peak, (TIME - start) / 0.7e-3) for start, peak in pulses)
    force = sum((np.where((u > 0) & (u < 1), peak * np.sin(np.pi * u) ** 2, 0.0) for peak, u in starts), 0 * TIME)
    return Hit(force, np.gradient(force), 25600.0, 500)


def test_hits_that_touch_twice_are_counted() -> None:
    (remark,) = touch_remarks([hit(0.0), hit(0.1), hit(0.02), hit(0.3)])
    assert remark.code == "touched-twice"
    assert "2 of 4" in remark.text
    (share,) = re.findall(r"(\d+)%", remark.text)
    assert int(share) == pytest.approx(30, abs=1)


def test_without_touches_or_force_there_is_no_remark() -> None:
    one = hit(0.0)
    assert touch_remarks([one, hit(0.01)]) == []
    assert touch_remarks([Hit(np.empty(0), one.acceleration, 25600.0, 500)]) == []
