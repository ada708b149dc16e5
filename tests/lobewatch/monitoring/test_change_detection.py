"""Alarms by change detection: triggered, closed, restarted."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.monitoring.change_detection import N_CLOSING_POINTS, detect_changes, monitor_drops
from lobewatch.monitoring.series_points import Readings

Floats = NDArray[np.float64]


def steady(seed: int, count: int, scatter: float = 0.3) -> Floats:
    return np.random.default_rng(seed).normal(0, scatter, count)


@pytest.mark.quick
def test_a_fall_stays_open_as_long_as_it_is_there() -> None:
    for seed in range(20):
        y = steady(seed, 60, 0.1)
        y[20:] -= 0.15 * np.minimum(np.arange(40), 12)
        fall = detect_changes(Readings(y)).open_drops[0]
        assert 20 < fall.triggered_at < 28
        assert 1.0 < fall.change.size < 3.0


@pytest.mark.quick
def test_two_bad_clampings_and_then_fourteen_good_ones_close_their_alarm() -> None:
    for seed in range(20):
        y = steady(seed, 36)
        y[20:22] -= 3.0
        while_low, after = detect_changes(Readings(y[:22])), detect_changes(Readings(y))
        assert [fall.triggered_at for fall in while_low.open_drops] == [21]
        assert after.open_drops == ()
        assert after.drops[0].triggered_at == 21
        closed = after.drops[0].closed_at
        assert closed is not None
        assert closed >= 21 + N_CLOSING_POINTS
        assert detect_changes(Readings(y[:closed])).open_drops != ()
        assert not after.needs_repeat


@pytest.mark.quick
@pytest.mark.parametrize(("rise", "fall"), [(1.5, 1.0), (3.0, 2.8)])
def test_a_rise_that_nobody_reported_does_not_hide_the_fall_after_it(rise: float, fall: float) -> None:
    late = []
    for seed in range(100):
        y = steady(seed, 60)
        y[24:] += rise
        y[48:] -= fall
        seen = detect_changes(Readings(y))
        assert seen.rise is not None
        late.append(min((one.triggered_at for one in seen.open_drops if one.triggered_at >= 48), default=60) - 48)
    assert np.mean(np.array(late) < 12) >= 0.95


@pytest.mark.quick
def test_a_rise_by_half_of_a_fall_closes_no_alarm() -> None:
    for seed in range(20):
        y = steady(seed, 60)
        y[20:] -= 6.0
        y[40:] += 3.0
        assert detect_changes(Readings(y)).open_drops[0].triggered_at < 24


@pytest.mark.quick
def test_scores_are_those_of_the_watch_of_the_time() -> None:
    y = steady(5, 60)
    y[24:] += 3.0
    seen = detect_changes(Readings(y))
    begin = 26  # the second point that was sure of the rise is number 25
    np.testing.assert_array_equal(seen.scores[:begin], monitor_drops(Readings(y)).scores[:begin])
    np.testing.assert_array_equal(seen.scores[begin:], monitor_drops(Readings(y[begin - 1 :])).scores[1:])


@pytest.mark.quick
@pytest.mark.parametrize("count", [0, 1, 8, 9])
def test_a_short_series_sees_nothing(count: int) -> None:
    seen = detect_changes(Readings(np.zeros(count)))
    assert (seen.drops, seen.rise, seen.needs_repeat) == ((), None, False)
    assert seen.scores.shape == (count,)


HEALTHY = {24: 3.5, 60: 7.0, 120: 13.0}
CLAMPED = {24: 8.0, 60: 25.0, 120: 50.0}


@pytest.mark.long
@pytest.mark.parametrize(("share", "most"), [(0.0, HEALTHY), (0.02, CLAMPED)])
def test_false_alarms_of_4000_healthy_series(share: float, most: dict[int, float]) -> None:
    random = np.random.default_rng(1)
    y = random.normal(size=(4000, 128)) - 5 * (random.random((4000, 128)) < share)
    first = np.array([falls[0].triggered_at if (falls := detect_changes(Readings(one)).drops) else 128 for one in y])
    for points, percent in most.items():
        assert 100 * np.mean(first < 8 + points) <= percent
