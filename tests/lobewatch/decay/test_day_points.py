"""Points of many tap tests a day: as if each test were asked for one by one, only faster."""

from __future__ import annotations

import time
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from statistics import median

import numpy as np
import pytest

from lobewatch.decay.change_point import calls_for_another
from lobewatch.decay.day_points import DAY, DIVISIONS, DIVISIONS_KEPT, PercentSeries, Span, divide_into_points

START = datetime(2024, 1, 15, 9, tzinfo=UTC)


def one_by_one(series: PercentSeries, most: int) -> tuple[Span, ...]:
    """Each test asks whether the points before it have called for it."""
    found: list[list[int]] = []
    for tap, when in enumerate(series.times):
        if found and when - series.times[found[-1][0]] < DAY and not called(series, found[-most:]):
            found[-1].append(tap)
        else:
            found.append([tap])
    return tuple((taps[0], taps[-1] + 1) for taps in found)


def called(series: PercentSeries, points: list[list[int]]) -> bool:
    y = [median(series.percents[tap] for tap in taps) for taps in points]
    warm = [[series.temperatures[tap] for tap in taps if np.isfinite(series.temperatures[tap])] for taps in points]
    return calls_for_another(np.array(y), np.array([sum(one) / len(one) if one else np.nan for one in warm]))


def many(seed: int, count: int, hours: float, *, warm: bool = False) -> PercentSeries:
    """Steps and slopes down and up again, so that some tests call for another; gaps that differ."""
    random = np.random.default_rng(seed)
    at = np.cumsum(random.exponential(hours, count))
    steps = np.zeros(count)
    steps[random.integers(0, count, count // 15)] = random.normal(0, 1.0, count // 15)
    percents = np.cumsum(steps) - random.uniform(0, 0.03) * np.arange(count) + 0.1 * random.standard_normal(count)
    temperatures = random.uniform(15, 45, count) if warm else np.full(count, np.nan)
    temperatures[::5] = np.nan
    times = tuple(START + timedelta(hours=hour) for hour in at.tolist())
    return PercentSeries(times, tuple(percents.tolist()), tuple(temperatures.tolist()))


@pytest.mark.parametrize("hours", [4.0, 8.0])
@pytest.mark.parametrize("seed", range(2))
def test_points_are_those_of_asking_one_by_one(seed: int, hours: float) -> None:
    series = many(seed, 250, hours)
    for most in (1000, 30):
        found = divide_into_points(series, most)
        assert found == one_by_one(series, most)
        days = [series.times[second[0]] - series.times[first[0]] for first, second in pairwise(found)]
        assert min(days) < DAY  # some were asked for, or this tests nothing


def test_points_of_a_series_that_goes_on_are_those_of_the_whole() -> None:
    series = many(11, 160, 8.0, warm=True)
    other = series._replace(percents=(*series.percents[:90], *(one - 2.0 for one in series.percents[90:])))
    for count in (1, 2, 60, 61, 62, 100, 101, 160):
        for one in (series, other):  # alike up to the 90th test
            begun = PercentSeries(one.times[:count], one.percents[:count], one.temperatures[:count])
            assert divide_into_points(begun, 1000) == one_by_one(begun, 1000)
    times = tuple(time + timedelta(hours=30 * (n > 80)) for n, time in enumerate(series.times))
    later = series._replace(times=times)
    assert divide_into_points(later, 1000) == one_by_one(later, 1000)


def test_of_many_series_the_newest_are_kept_and_all_are_divided_alike() -> None:
    several = [many(seed, 20, 8.0) for seed in range(DIVISIONS_KEPT + 2)]
    points = [divide_into_points(series, 1000) for series in several]
    assert [series for series, _ in DIVISIONS.values()] == several[2:]
    assert [divide_into_points(series, 1000) for series in several] == points


def test_points_are_those_of_asking_one_by_one_with_the_temperature() -> None:
    series = many(7, 120, 12.0, warm=True)
    assert divide_into_points(series, 40) == one_by_one(series, 40)


def test_a_series_without_scatter_and_one_of_a_single_test() -> None:
    times = tuple(START + timedelta(hours=8 * i) for i in range(60))
    steady = PercentSeries(times, (0.0,) * 60, (np.nan,) * 60)
    assert divide_into_points(steady, 1000) == one_by_one(steady, 1000)
    assert divide_into_points(PercentSeries(times[:1], (0.0,), (np.nan,)), 1000) == ((0, 1),)


def test_thousands_of_tests_cost_little() -> None:
    series = many(3, 3000, 16.0)
    begin = time.process_time()
    divide_into_points(series, 1000)
    assert time.process_time() - begin < 3.0  # one by one: a millisecond each and more
