"""Expected gain of a test cut, against gains counted by hand over a few spindles."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lobes import zero_order_lobes
from lobewatch.cuts.chatter_detection.spectrum import fold_frequency
from lobewatch.cuts.learning.cut_likelihood import CutEvidence
from lobewatch.cuts.learning.suggestion import CutGrid, LimitCharts, floor_depth
from tests.lobewatch.cuts.learning.conftest import SLOT, Mill

pytestmark = pytest.mark.quick

Floats = NDArray[np.float64]
SPEEDS = np.array([6000.0, 9000.0, 9100.0, 12000.0, 15000.0])


def charts(limits_mm: Floats, frequencies: Floats | None = None) -> LimitCharts:
    """Limits of some spindles (r, s) as a chart; typical natural frequency 1000 Hz."""
    limits = np.asarray(limits_mm) / 1e3
    speeds = SPEEDS[: limits.shape[1]]
    grid = CutGrid(SLOT, (0.0,), speeds, np.full(speeds.shape, 0.02), np.ones(speeds.shape))
    order = np.argsort(-limits, axis=0, kind="stable")
    floored = np.vectorize(floor_depth)(np.take_along_axis(limits, order, axis=0))
    heard = np.zeros(limits.shape) if frequencies is None else frequencies
    return LimitCharts(grid, limits, heard, order, 1000.0, speeds * floored)


def counted_gains(chart: LimitCharts, weights: Floats, best: float | Floats) -> list[float]:
    """Gains by going through all depths at which a spindle has its limit; best: of all spindles, or of each."""
    gains = []
    for row, speed in enumerate(chart.grid.speeds):
        gains.append(0.0)
        for limit in chart.limits[:, row]:
            stable = weights * (chart.limits[:, row] >= limit)
            if np.sum(stable) > 0.5:
                more = np.maximum(speed * floor_depth(limit) - best, 0.0)
                gains[-1] = max(gains[-1], float(np.sum(stable * more)))
    return gains


@pytest.mark.parametrize("best", [0.0, 14.0, 40.0])
def test_the_gain_at_a_speed_is_that_of_the_best_depth_more_likely_stable_than_not(best: float) -> None:
    random = np.random.default_rng(3)
    chart = charts(random.uniform(0.5, 4.0, (41, 5)))
    for weights in (np.full(41, 1 / 41), random.dirichlet(np.full(41, 0.3))):
        assert chart.expected_gains(weights, best) == pytest.approx(counted_gains(chart, weights, best))


def test_the_best_so_far_may_differ_from_spindle_to_spindle() -> None:
    random = np.random.default_rng(4)
    chart, best = charts(random.uniform(0.5, 4.0, (41, 5))), random.choice([0.0, 9.0, 14.0], 41)
    for weights in (np.full(41, 1 / 41), random.dirichlet(np.full(41, 0.3))):
        assert chart.expected_gains(weights, best) == pytest.approx(counted_gains(chart, weights, best))


def test_the_best_so_far_is_that_of_cuts_whose_word_a_spindle_does_not_contradict() -> None:
    chart = charts(np.array([[1.0, 2.0], [2.0, 2.0], [2.15, 2.0]]))
    deep = CutEvidence(SLOT, 6010.0, 2.3e-3, "stable")
    shallow = replace(deep, depth=1.2e-3, speed_rpm=9000.0)
    assert chart.is_label_wrong(deep).tolist() == [True, True, False]  # 2.3 mm is 7 % beyond 2.15
    assert chart.true_best_rates([deep, shallow]) == pytest.approx([10.8, 10.8, 6010.0 * 2.3e-3])
    chatter = replace(deep, verdict="chatter", depth=1.9e-3)
    assert chart.is_label_wrong(chatter).tolist() == [False, False, True]
    assert chart.true_best_rates([chatter]).tolist() == [0.0, 0.0, 0.0]


def test_the_last_cut_is_worth_its_gain_times_its_chance() -> None:
    chart = charts(np.array([[1.0], [2.0], [3.0], [4.0]]))
    assert chart.expected_worth(0, 2e-3, 9.0, 1) == pytest.approx(0.75 * (12.0 - 9.0))
    assert chart.expected_worth(0, 2e-3, 13.0, 1) == 0.0
    assert chart.expected_worth(0, 3e-3, 0.0, 1) == 0.0
    assert chart.expected_worth(0, 3e-3, 0.0, 2) == 0.0


def test_before_another_cut_it_is_worth_what_the_next_one_gains_besides() -> None:
    """Stable leaves the spindles of 2 to 4 mm, chatter those of 1 and 1.5 mm, of which both have one frequency."""
    chart = charts(np.array([[1.0], [1.5], [2.0], [2.0], [3.0], [4.0]]), np.full((6, 1), 80.0))
    stable = chart.expected_worth(0, 2e-3, 3.0, 2)
    after_stable = 4 / 6 * max(4 / 4 * (12 - 12), 2 / 4 * 0)
    after_chatter = 2 / 6 * max(2 / 2 * (6 - 3), 0)
    assert stable == pytest.approx(4 / 6 * (12 - 3) + after_stable + after_chatter)
    deeper = charts(np.array([[1.0], [2.0], [3.0], [3.0], [4.0]]), np.full((5, 1), 80.0))
    after_stable = 4 / 5 * 3 / 4 * (18 - 12)
    assert deeper.expected_worth(0, 2e-3, 3.0, 2) == pytest.approx(4 / 5 * (12 - 3) + after_stable + 1 / 5 * (6 - 3))
    shallow = deeper.expected_worth(0, 2e-3, 13.0, 2)
    assert shallow == pytest.approx(4 / 5 * 3 / 4 * (18 - 13))


def test_chatter_teaches_by_its_frequency_within_1_5_percent_of_a_natural_one() -> None:
    """Four spindles chatter, two at 80 Hz, two at 80 + off Hz; the second pair allows more depth at another speed."""
    limits = np.vstack([np.tile([9.0, 1.0], (6, 1)), np.tile([1.0, 4.0], (2, 1)), np.tile([1.0, 8.0], (2, 1))])
    for off in (0.0, 15.0, 200.0):
        heard = np.zeros(limits.shape)
        heard[6:8, 0], heard[8:, 0] = 80.0, 80.0 + off
        near = math.exp(-((off / 15.0) ** 2) / 2)
        shares = 1 / (1 + near), near / (1 + near)
        deep = shares[1] if shares[1] > 0.5 else 0.0
        low = max(9000 * 4e-3, deep * 9000 * 8e-3)
        high = max(9000 * 4e-3, shares[0] * 9000 * 8e-3 if shares[0] > 0.5 else 0.0)
        after_chatter = 4 / 10 * (low + high) / 2
        after_stable = 0.0
        worth = charts(limits, heard).expected_worth(0, 9e-3, 0.0, 2)
        assert worth == pytest.approx(6 / 10 * 6000 * 9e-3 + after_stable + after_chatter), off


def test_candidates_are_the_best_speeds_apart_by_2_percent_and_depths_likely_stable() -> None:
    limits = np.tile(np.linspace(1.0, 3.0, 201)[:, np.newaxis], (1, 5)) * [1.0, 1.0, 1.1, 1.0, 1.0]
    candidates = list(charts(limits).candidates(0.0))
    places = list(dict.fromkeys(place for place, _ in candidates))
    assert places == [4, 3, 2, 0]
    depths = [depth for place, depth in candidates if place == 4]
    assert depths == pytest.approx([1.2e-3, 1.4e-3, 1.6e-3, 1.8e-3, 1.95e-3])
    assert list(charts(np.full((3, 5), 0.04)).candidates(0.0)) == []


def test_no_more_than_eight_speeds_are_inspected() -> None:
    mill = Mill()
    places = {place for place, _ in LimitCharts.of(mill.prior.draw(50), mill.grid).candidates(0.0)}
    assert len(places) == 8
    speeds = np.sort(mill.grid.speeds[list(places)])
    assert np.min(np.diff(np.log(speeds))) > 0.02


def test_a_chart_is_that_of_zero_order_corrected_and_as_deep_as_is_allowed(mill: Mill) -> None:
    draws = mill.prior.samples[:3]
    draws.normal[:] = 0.0
    draws.normal[1, :2] = 1.5
    speeds = np.array([6000.0, 8000.0, 12000.0, 16000.0])
    deepest, trust = np.array([0.02, 0.02, 0.02, 0.0013]), np.array([1.0, 0.7, 1.3, 1.0])
    grid = CutGrid(mill.cut, (0.0, np.pi / 2), speeds, deepest, trust)
    chart = LimitCharts.of(draws, grid)
    ratios = draws.ratios()
    for number in range(3):
        x, y = (
            replace(
                mode.scaled(ratios[f"frequency_{side}"][number], 1.0, ""),
                damping_ratio=1.1 * mode.damping_ratio,
                stiffness=mode.stiffness,
            )
            for side, mode in (("x", mill.x), ("y", mill.y))
        )
        radial = 1.1 * ratios["ratio"][number] * mill.cut.radial
        pushed = replace(mill.cut, tangential=1.1 * mill.cut.tangential, radial=radial)
        lobes = [zero_order_lobes([x], [y], replace(pushed, feed_angle=angle), speeds) for angle in grid.feed_angles]
        limit = np.minimum(np.min([part.depth for part in lobes], axis=0) * trust, deepest)
        assert chart.limits[number] == pytest.approx(limit, rel=0.01)
        worst = np.argmin([part.depth for part in lobes], axis=0)
        chatter = np.array([part.chatter_frequency for part in lobes])[worst, np.arange(4)]
        folded = fold_frequency(chatter, 4 * speeds / 60)
        assert chart.frequencies[number, :3] == pytest.approx(folded[:3], abs=5.0)
    assert np.all(np.diff(np.take_along_axis(chart.limits, chart.depth_order, axis=0), axis=0) <= 0)
    depths = np.sort([[floor_depth(limit) for limit in row] for row in chart.limits], axis=0)[::-1]
    assert chart.removal_rates == pytest.approx(speeds * depths)
    middle = np.mean([ratios["frequency_x"] * mill.x.frequency, ratios["frequency_y"] * mill.y.frequency])
    assert chart.typical_frequency == pytest.approx(middle)
