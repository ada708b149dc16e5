"""Points of many tap tests a day: as if each test were asked for one by one, only faster."""

from __future__ import annotations

import time
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from statistics import median

import numpy as np
import pytest

from lobewatch.decay.change_point import calls_for_another
from lobewatch.decay.together import DAY, Series, Span, together

START = datetime(2024, 1, 15, 9, tzinfo=UTC)


def one_by_one(series: Series, most: int) -> list[Span]:
    """Each test asks whether the points before it have called for it."""
    found: list[list[int]] = []
    for tap, when in enumerate(series.times):
        if found and when - series.times[found[-1][0]] < DAY and not called(series, found[-most:]):
            found[-1].append(tap)
        else:
            found.append([tap])
    return [(taps[0], taps[-1] + 1) for taps in found]


def called(series: Series, points: list[list[int]]) -> bool:
    y = [median(series.percents[tap] for tap in taps) for taps in points]
    warm = [[series.temperatures[tap] for tap in taps if np.isfinite(series.temperatures[tap])] for taps in points]
    return calls_for_another(np.array(y), np.array([sum(one) / len(one) if one else np.nan for one in warm]))


def many(seed: int, count: int, hours: float, *, warm: bool = False) -> Series:
    """Steps and slopes down and up again, so that some tests call for another; gaps that differ."""
    random = np.random.default_rng(seed)
    at = np.cumsum(random.exponential(hours, count))
    steps = np.zeros(count)
    steps[random.integers(0, count, count // 15)] = random.normal(0, 1.0, count // 15)
    percents = np.cumsum(steps) - random.uniform(0, 0.03) * np.arange(count) + 0.1 * random.standard_normal(count)
    temperatures = random.uniform(15, 45, count) if warm else np.full(count, np.nan)
    temperatures[::5] = np.nan
    return Series([START + timedelta(hours=one) for one in at.tolist()], percents.tolist(), temperatures.tolist())


@pytest.mark.parametrize("hours", [4.0, 8.0])
@pytest.mark.parametrize("seed", range(2))
def test_points_are_those_of_asking_one_by_one(seed: int, hours: float) -> None:
    series = many(seed, 250, hours)
    for most in (1000, 30):
        found = together(series, most)
        assert found == one_by_one(series, most)
        days = [series.times[second[0]] - series.times[first[0]] for first, second in pairwise(found)]
        assert min(days) < DAY  # some were asked for, or this tests nothing


def test_points_of_a_series_that_goes_on_are_those_of_the_whole() -> None:
    series = many(11, 160, 8.0, warm=True)
    other = series._replace(percents=[*series.percents[:90], *(one - 2.0 for one in series.percents[90:])])
    for count in (1, 2, 60, 61, 62, 100, 101, 160):
        for one in (series, other):  # alike up to the 90th test
            begun = Series(one.times[:count], one.percents[:count], one.temperatures[:count])
            assert together(begun, 1000) == one_by_one(begun, 1000)
    later = series._replace(times=[time + timedelta(hours=30 * (n > 80)) for n, time in enumerate(series.times)])
    assert together(later, 1000) == one_by_one(later, 1000)


def test_what_is_done_with_the_points_does_not_alter_those_of_the_next_who_asks() -> None:
    series = many(13, 40, 8.0)
    found = together(series, 1000)
    expected = [*found]
    found[0] = (0, 0)
    assert together(series, 1000) == expected


def test_points_are_those_of_asking_one_by_one_with_the_temperature() -> None:
    series = many(7, 120, 12.0, warm=True)
    assert together(series, 40) == one_by_one(series, 40)


def test_a_series_without_scatter_and_one_of_a_single_test() -> None:
    times = [START + timedelta(hours=8 * i) for i in range(60)]
    steady = Series(times, [0.0] * 60, [np.nan] * 60)
    assert together(steady, 1000) == one_by_one(steady, 1000)
    assert together(Series(times[:1], [0.0], [np.nan]), 1000) == [(0, 1)]


def test_thousands_of_tests_cost_little() -> None:
    series = many(3, 3000, 16.0)
    begin = time.process_time()
    together(series, 1000)
    assert time.process_time() - begin < 3.0  # one by one: a millisecond each and more
