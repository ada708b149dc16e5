"""Predicted chatter of a cut, against its limit and the chatter frequency there."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from lobes import Cut, stability_boundary
from lobewatch.cuts.learning.cut_likelihood import predict_chatter
from lobewatch.machine import CutTable
from lobewatch.machine.settings.requested_cut import CutSetting
from lobewatch.tool.assembly import Assembly
from modal import Mode

pytestmark = pytest.mark.quick

SLOT = Cut(teeth=3, immersion=0.4, direction="down", tangential=1.4e9, radial=5e8)
X, Y = [Mode(1400.0, 0.03, 2.5e7)], [Mode(1713.0, 0.03, 6e7)]
TAPPED = Assembly("A", datetime(2026, 1, 1, tzinfo=UTC), "t1", X, Y, ("x", "y"), None, {}, False, ())
TABLE = CutTable(3, 4.0, 10.0, "down", tangential_n_per_mm2=1400.0, radial_n_per_mm2=500.0)
ANGLES = {"x": 0.0, "y": np.pi / 2}


def setting(feed: str, depth: float) -> CutSetting:
    return CutSetting(TABLE, "", None, "A", SLOT, feed, 11000.0, depth)


def limit(feed: str, speed: float) -> tuple[float, float]:
    """Limit (m) and chatter frequency there (Hz)."""
    boundary = stability_boundary(X, Y, replace(SLOT, feed_angle=ANGLES[feed]), [speed], 0.05)
    return float(boundary.depth[0]), float(boundary.chatter_frequency[0])


@pytest.mark.parametrize("feed", ["x", "y"])
@pytest.mark.parametrize("speed", [9000.0, 11000.0])
def test_a_cut_is_stable_below_its_limit_and_sounds_there_as_the_limit_does(feed: str, speed: float) -> None:
    depth, chatter = limit(feed, speed)
    below, above = (predict_chatter(setting(feed, share * depth), TAPPED, speed) for share in (0.99, 1.01))
    assert (below.stable, above.stable) == (True, False)
    assert below.frequency == pytest.approx(chatter, rel=5e-3)
    assert above.frequency == pytest.approx(chatter, rel=5e-3)


def test_a_cut_that_may_be_fed_either_way_sounds_as_in_the_worse() -> None:
    limits = {feed: limit(feed, 11000.0)[0] for feed in ANGLES}
    worse, better = sorted(limits, key=lambda feed: limits[feed])
    between = np.sqrt(limits[worse] * limits[better])
    sounds = {feed: predict_chatter(setting(feed, between), TAPPED, 11000.0) for feed in ("x", "y", "both")}
    assert (sounds[worse].stable, sounds[better].stable) == (False, True)
    assert sounds["both"] == sounds[worse]
