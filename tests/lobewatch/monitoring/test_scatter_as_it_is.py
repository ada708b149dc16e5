"""The watch over scatter that is not normal, over operators, over both directions, and over a young series."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from lobewatch.monitoring.change_detection import detect_changes, monitor_drops
from lobewatch.monitoring.series_points import (
    Readings,
    ScatterPrior,
    SeriesScatterPrior,
    estimate_scatter,
    pool_scatter,
    winsorize,
)

Floats = NDArray[np.float64]
Random = np.random.Generator
POINTS = 128
NEVER = 999


def normal(random: Random) -> Readings:
    return Readings(0.3 * random.normal(size=POINTS))


def heavy_tailed(random: Random) -> Readings:
    return Readings(0.3 * random.standard_t(3, POINTS))


def badly_clamped(random: Random) -> Readings:
    is_bad = random.random(POINTS) < 0.02
    return Readings(0.3 * random.normal(size=POINTS) - is_bad * random.uniform(1, 3, POINTS))


def of_operators(random: Random, share: float = 0.1) -> Readings:
    """Three operators who differ by one scatter; another one takes over after ten points on average."""
    apart, who = random.normal(size=3), [int(random.integers(3))]
    for _ in range(POINTS - 1):
        who.append(int(random.integers(3)) if random.random() < share else who[-1])
    return Readings(0.3 * (random.normal(size=POINTS) + apart[who]), operators=tuple(f"operator {i}" for i in who))


def of_one_of_two(random: Random) -> Readings:
    x, y = 0.3 * random.normal(size=(2, POINTS))
    return Readings(x, other_direction=y)


POPULATIONS: list[tuple[Callable[[Random], Readings], tuple[float, float, float]]] = [
    (normal, (3.5, 7, 13)),
    (heavy_tailed, (5, 10.5, 20)),
    (badly_clamped, (8, 20, 35)),
    (of_operators, (5, 12, 20)),
    (of_one_of_two, (3.5, 7.5, 13.5)),
]


def false_alarms(draw: Callable[[Random], Readings], series: int) -> list[float]:
    """Share (%) of healthy series with an alarm in 24, 60 and 120 points after the first 8."""
    random = np.random.default_rng(17)
    raised = [detect_changes(draw(random)).drops for _ in range(series)]
    first = np.array([falls[0].triggered_at if falls else NEVER for falls in raised])
    return [100 * float(np.mean(first < 8 + n)) for n in (24, 60, 120)]


@pytest.mark.long
@pytest.mark.parametrize(("draw", "most"), POPULATIONS)
def test_false_alarms_of_4000_series_of_each_sort(
    draw: Callable[[Random], Readings], most: tuple[float, float, float]
) -> None:
    rates = false_alarms(draw, 4000)
    print(f"{draw.__name__}: {rates}")  # noqa: T201
    assert np.all(np.array(rates) <= most), rates


@pytest.mark.parametrize(("draw", "most"), POPULATIONS[1:])
def test_false_alarms_of_some_series(draw: Callable[[Random], Readings], most: tuple[float, float, float]) -> None:
    rates = false_alarms(draw, 200)
    assert rates[2] <= 1.35 * most[2], rates


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(0, 40))
@settings(max_examples=50, deadline=None)
def test_what_a_point_becomes_follows_from_those_until_the_one_after_it(seed: int, n: int) -> None:
    y = np.random.default_rng(seed).standard_t(2, size=60)
    np.testing.assert_array_equal(winsorize(y[: n + 1])[:n], winsorize(y)[:n])
    assert winsorize(y[: n + 1])[n] == y[n]


def test_a_point_that_stands_alone_is_drawn_in_and_a_step_is_not() -> None:
    y = np.array([0.1, -0.1, 0.05, -0.05, 0.1, 0.0, -0.1, 0.05, -3.0, 0.1, 0.0, -0.05])
    calm = winsorize(y)
    assert np.flatnonzero(calm != y).tolist() == [8]
    assert -1.0 < calm[8] < -0.2
    stepped = np.concatenate([y[:8], y[:8] - 3.0])
    np.testing.assert_array_equal(winsorize(stepped), stepped)


def test_one_bad_clamping_asks_for_another_and_hardly_ever_raises_an_alarm() -> None:
    asked = raised = 0
    for seed in range(200):
        y = 0.3 * np.random.default_rng(seed).normal(size=26)
        y[20] -= 3.0
        asked += detect_changes(Readings(y[:21])).needs_repeat
        raised += any(20 <= fall.triggered_at <= 22 for fall in detect_changes(Readings(y)).drops)
    assert asked >= 196
    assert raised <= 8


def test_another_operator_is_no_fall_and_a_fall_next_to_the_operators_is_found() -> None:
    random = np.random.default_rng(3)
    who = tuple("AABB" * 9)
    apart = np.where(np.array(who) == "B", -0.5, 0.0)
    y = 0.1 * random.normal(size=36) + apart
    late = Readings(y[: 2 * 9], operators=("A",) * 9 + ("B",) * 9)
    swapped = late.y - apart[:18] + np.where(np.arange(18) < 9, 0.0, -0.3)
    assert detect_changes(Readings(swapped)).drops
    assert not detect_changes(Readings(swapped, operators=late.operators)).drops
    assert not detect_changes(Readings(y, operators=who)).drops
    fallen = y - np.where(np.arange(36) < 24, 0.0, 0.5)
    assert 24 <= detect_changes(Readings(fallen, operators=who)).drops[0].triggered_at <= 29


def test_one_operator_changes_nothing() -> None:
    y = np.random.default_rng(5).normal(size=40) - 0.1 * np.arange(40)
    named = monitor_drops(Readings(y, operators=("Kim",) * 40))
    np.testing.assert_allclose(named.scores, monitor_drops(Readings(y)).scores, rtol=1e-8)


def delays(size: float, kind: str, before: int, series: int, *, pair: bool = True) -> Floats:
    """Points from a fall of both directions to the first alarm; inf without one."""
    random = np.random.default_rng(2)
    late = []
    steps = np.arange(1.0, 61.0)
    fall = size * (np.ones(60) if kind == "step" else steps)
    for _ in range(series):
        x, y = 0.3 * random.normal(size=(2, before + 60))
        x[before:] -= fall
        y[before:] -= fall
        sides = (Readings(x, other_direction=y), Readings(y, other_direction=x)) if pair else (Readings(x),)
        raised = [
            seen.triggered_at for side in sides for seen in detect_changes(side).drops if seen.triggered_at >= before
        ]
        late.append(min(raised, default=np.inf) + 1 - before)
    return np.array(late)


@pytest.mark.parametrize("series", [80, pytest.param(1500, marks=pytest.mark.long)])
def test_what_both_directions_did_is_found_sooner(series: int) -> None:
    step, slope = delays(0.5, "step", 24, series), delays(0.02, "slope", 24, series)
    alone = delays(0.5, "step", 24, series, pair=False), delays(0.02, "slope", 24, series, pair=False)
    print(f"step {np.quantile(step, [0.5, 0.9])}, slope {np.mean(slope <= 24)}")  # noqa: T201
    assert np.median(step) <= 4
    assert np.quantile(step, 0.9) <= 7
    assert np.median(alone[0]) >= 5
    assert np.mean(slope <= 24) >= 0.92
    assert np.mean(alone[1] <= 24) <= 0.85


def test_what_one_direction_did_alone_is_no_fall_of_the_other() -> None:
    random = np.random.default_rng(8)
    of_y = []
    for _ in range(60):
        x, y = 0.3 * random.normal(size=(2, 48))
        x[24:] -= 1.5
        assert detect_changes(Readings(x, other_direction=y)).drops
        of_y.append(bool(detect_changes(Readings(y, other_direction=x)).drops))
    assert np.mean(of_y) <= 0.15


def test_points_without_the_other_direction_count_alone() -> None:
    y = np.random.default_rng(9).normal(size=30)
    without = np.full(30, np.nan)
    np.testing.assert_array_equal(
        monitor_drops(Readings(y, other_direction=without)).scores, monitor_drops(Readings(y)).scores
    )
    some = np.where(np.arange(30) % 3 == 0, y, np.nan)
    assert np.isfinite(monitor_drops(Readings(y, other_direction=some)).scores[8:]).all()


KNOWN = SeriesScatterPrior(ScatterPrior(0.3, 12.0), ScatterPrior(0.3 / np.sqrt(2), 12.0))


@pytest.mark.parametrize("series", [80, pytest.param(1500, marks=pytest.mark.long)])
def test_a_step_after_three_points_is_found_with_the_scatter_of_other_machines(series: int) -> None:
    random = np.random.default_rng(4)
    late = []
    for _ in range(series):
        x, y = 0.3 * random.normal(size=(2, 43))
        x[3:] -= 1.0
        y[3:] -= 1.0
        sides = Readings(x, other_direction=y, scatter_prior=KNOWN), Readings(y, other_direction=x, scatter_prior=KNOWN)
        raised = [seen.triggered_at for side in sides for seen in detect_changes(side).drops]
        late.append(min(raised, default=np.inf) - 2)
    print(f"after three points: {np.quantile(late, [0.5, 0.9])}")  # noqa: T201
    assert np.median(late) <= 3
    assert np.quantile(late, 0.9) <= 7


@pytest.mark.long
def test_false_alarms_with_a_known_scatter_that_scatters_itself() -> None:
    random = np.random.default_rng(6)
    first = []
    for _ in range(4000):
        others = 0.3 * np.exp(0.3 * random.normal(size=21))
        known = pool_scatter([estimate_scatter(one * random.normal(size=24)) for one in others[1:]])
        falls = detect_changes(
            Readings(others[0] * random.normal(size=POINTS), scatter_prior=SeriesScatterPrior(known))
        ).drops
        first.append(falls[0].triggered_at if falls else NEVER)
    rates = [100 * float(np.mean(np.array(first) < n)) for n in (8, 32, 68, 128)]
    print(f"known scatter: {rates}")  # noqa: T201
    assert np.all(np.array(rates) <= (0.5, 3.5, 7, 13)), rates


def test_the_scatter_of_others_is_theirs_and_worth_less_the_more_they_differ() -> None:
    random = np.random.default_rng(7)
    worth = []
    for apart in (0.0, 0.3, 0.8):
        own = 0.2 * np.exp(apart * random.normal(size=200))
        pooled = pool_scatter([estimate_scatter(one * random.normal(size=40)) for one in own])
        assert pooled.percent == pytest.approx(0.2, rel=0.15 + apart / 2)
        worth.append(pooled.freedom)
    assert worth[0] > 15 > worth[1] > 4 > worth[2] > 0.5


def test_few_series_and_short_ones_tell_nothing() -> None:
    assert estimate_scatter(np.zeros(7)).freedom == 0
    assert pool_scatter([ScatterPrior(0.2, 6.0)] * 3).freedom == 0
    assert pool_scatter([ScatterPrior(0.0, 6.0)] * 9).freedom == 0
    assert pool_scatter([ScatterPrior(0.2, 6.0)] * 4).percent == pytest.approx(0.2, rel=0.1)
