"""What raises an alarm, what closes it, and what begins the watch anew."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.decay.change_point import watch
from lobewatch.decay.detection import CALM, detect
from lobewatch.decay.readings import Readings

Floats = NDArray[np.float64]


def steady(seed: int, count: int, scatter: float = 0.3) -> Floats:
    return np.random.default_rng(seed).normal(0, scatter, count)


def test_a_fall_stays_open_as_long_as_it_is_there() -> None:
    for seed in range(20):
        y = steady(seed, 60, 0.1)
        y[20:] -= 0.15 * np.minimum(np.arange(40), 12)
        fall = detect(Readings(y)).open_falls[0]
        assert 20 < fall.raised < 28
        assert 1.0 < fall.fall.size < 3.0


def test_two_bad_clampings_and_then_fourteen_good_ones_close_their_alarm() -> None:
    for seed in range(20):
        y = steady(seed, 36)
        y[20:22] -= 3.0
        while_low, after = detect(Readings(y[:22])), detect(Readings(y))
        assert [fall.raised for fall in while_low.open_falls] == [21]
        assert after.open_falls == ()
        assert after.falls[0].raised == 21
        closed = after.falls[0].closed
        assert closed is not None
        assert closed >= 21 + CALM
        assert detect(Readings(y[:closed])).open_falls != ()
        assert not after.asks_again


@pytest.mark.parametrize(("rise", "fall"), [(1.5, 1.0), (3.0, 2.8)])
def test_a_rise_that_nobody_reported_does_not_hide_the_fall_after_it(rise: float, fall: float) -> None:
    late = []
    for seed in range(100):
        y = steady(seed, 60)
        y[24:] += rise
        y[48:] -= fall
        seen = detect(Readings(y))
        assert seen.rise is not None
        late.append(min((one.raised for one in seen.open_falls if one.raised >= 48), default=60) - 48)
    assert np.mean(np.array(late) < 12) >= 0.95


def test_a_rise_by_half_of_a_fall_closes_no_alarm() -> None:
    for seed in range(20):
        y = steady(seed, 60)
        y[20:] -= 6.0
        y[40:] += 3.0
        assert detect(Readings(y)).open_falls[0].raised < 24


def test_scores_are_those_of_the_watch_of_the_time() -> None:
    y = steady(5, 60)
    y[24:] += 3.0
    seen = detect(Readings(y))
    begin = 26  # the second point that was sure of the rise is number 25
    np.testing.assert_array_equal(seen.scores[:begin], watch(Readings(y)).scores[:begin])
    np.testing.assert_array_equal(seen.scores[begin:], watch(Readings(y[begin - 1 :])).scores[1:])


@pytest.mark.parametrize("count", [0, 1, 8, 9])
def test_a_short_series_sees_nothing(count: int) -> None:
    seen = detect(Readings(np.zeros(count)))
    assert (seen.falls, seen.rise, seen.asks_again) == ((), None, False)
    assert seen.scores.shape == (count,)


HEALTHY = {24: 3.5, 60: 7.0, 120: 13.0}
CLAMPED = {24: 8.0, 60: 25.0, 120: 50.0}


@pytest.mark.long
@pytest.mark.parametrize(("share", "most"), [(0.0, HEALTHY), (0.02, CLAMPED)])
def test_false_alarms_of_4000_healthy_series(share: float, most: dict[int, float]) -> None:
    random = np.random.default_rng(1)
    y = random.normal(size=(4000, 128)) - 5 * (random.random((4000, 128)) < share)
    first = np.array([falls[0].raised if (falls := detect(Readings(one)).falls) else 128 for one in y])
    for points, percent in most.items():
        assert 100 * np.mean(first < 8 + points) <= percent
