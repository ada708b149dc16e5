"""The next test cut: one that can be set, more likely stable than not, and worth it; none where nothing is gained."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lobes import Cut, stability_boundary, zero_order
from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.grid import floor_depth, zero_order_trust
from lobewatch.cuts.learning.likelihood import predict_cut
from lobewatch.cuts.learning.suggest import suggest
from tests.lobewatch.cuts.learning.conftest import Mill


def test_a_suggested_cut_can_be_set_and_is_more_likely_stable_than_not(mill: Mill) -> None:
    learnt, grid = mill.prior, mill.grid
    for left in (5, 1):
        found = suggest(learnt, grid, (), left)
        assert found is not None
        assert found.speed_rpm % 10 == 0
        assert found.speed_rpm in grid.speeds
        assert found.depth * 1e3 / 0.05 == pytest.approx(round(found.depth * 1e3 / 0.05))
        assert found.depth <= 0.012
        assert found.chance < 0.5
        chance = predict_cut(grid.evidence(found.speed_rpm, found.depth), learnt.draws).chance
        assert found.chance == pytest.approx(np.mean(chance), abs=0.07)
        assert found.settles in learnt.intervals


def test_cuts_lead_to_more_chips_and_end_where_nothing_is_to_be_gained(mill: Mill) -> None:
    mill.force = 0.9
    learnt, grid, cuts = mill.prior, mill.grid, list[CutEvidence]()
    for left in (4, 3, 2, 1):
        found = suggest(learnt, grid, cuts, left)
        if found is None:
            break
        cuts.append(mill.hear(found.speed_rpm, found.depth))
        learnt = learnt.learn_from(cuts[-1])
    best = max(cut.speed_rpm * cut.depth for cut in cuts if not cut.chatters)
    x, y = (mode.scaled(0.985, 1.0, "") for mode in (mill.x, mill.y))
    truly = replace(mill.cut, tangential=0.9 * mill.cut.tangential, radial=0.9 * mill.cut.radial)
    limits = np.minimum(zero_order([x], [y], truly, grid.speeds).depth, grid.deepest)
    assert best > 0.85 * max(speed * floor_depth(limit) for speed, limit in zip(grid.speeds, limits, strict=True))
    ceiling = CutEvidence(mill.cut, 20000, 0.012, "stable")
    assert suggest(learnt, grid, [*cuts, ceiling], 1) is None


def test_depths_are_rounded_inwards_and_the_flutes_are_respected(mill: Mill) -> None:
    assert [floor_depth(depth / 1e3) * 1e3 for depth in (1.0, 1.049, 0.04)] == pytest.approx([1.0, 1.0, 0.0])
    shallow = replace(mill.grid, deepest=np.full(mill.grid.speeds.shape, 0.00052))
    found = suggest(mill.prior, shallow, (), 1)
    assert found is not None
    assert found.depth == pytest.approx(0.0005)


def test_zero_order_is_corrected_where_it_is_not_exact(mill: Mill) -> None:
    speeds = np.array([5000.0, 9000.0, 15000.0, 18000.0])
    assert np.all(zero_order_trust([mill.x], [mill.y], mill.cut, (0.0,), speeds, 0.02) == 1)
    slender = Cut(2, 0.1, "down", 1.4e9, 5e8)
    share = zero_order_trust([mill.x], [mill.y], slender, (0.0,), speeds, 0.02)
    true = stability_boundary([mill.x], [mill.y], slender, speeds, 0.02).depth
    mean = zero_order([mill.x], [mill.y], slender, speeds).depth
    assert share == pytest.approx(np.minimum(true, 0.02) / np.minimum(mean, 0.02))
    assert np.max(np.abs(share - 1)) > 0.1
