"""The alarm rule: two clampings in a row, the first three tests, and what the newest test alone may do."""

from __future__ import annotations

import math
from datetime import timedelta
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.history.history import History, HistoryRow
from lobewatch.measurement.estimate import Estimate
from lobewatch.monitoring import StatusLevel
from lobewatch.monitoring.change_detection import MIN_FIRST_STEP_POINTS, detect_changes, monitor_drops
from lobewatch.monitoring.forecast import fit_past
from lobewatch.monitoring.machine_status import MachineStatus, assess_status
from lobewatch.monitoring.newest_point import measure_newest_distance
from lobewatch.monitoring.series_points import Readings, ScatterPrior, SeriesScatterPrior, guard_first_points
from lobewatch.monitoring.trend import TapValue, Trend, fit_trend
from tests.lobewatch.conftest import START

Floats = NDArray[np.float64]
pytestmark = pytest.mark.quick
WIGGLE = np.array([0.1, -0.2, 0.25, -0.1, 0.05, -0.3, 0.2, 0.0])
"""Scatter of eight points."""


def steady(seed: int, count: int, scatter: float = 0.3) -> Floats:
    return scatter * np.random.default_rng(seed).normal(size=count)


def monthly(y: Floats) -> Trend:
    times = [START + timedelta(days=30 * i) for i in range(y.size)]
    return fit_trend([TapValue(time, 1700 * math.exp(p / 100)) for time, p in zip(times, y, strict=True)], times[-1])


@pytest.fixture(scope="module")
def mill(tmp_path_factory: pytest.TempPathFactory, new_shop: Any) -> Any:
    return new_shop(tmp_path_factory.mktemp("rule") / "m").folder.machine


def status(mill: Any, y: Floats) -> MachineStatus:
    """Return the status after a test in x a month with these frequencies (%)."""
    rows = tuple(
        HistoryRow(f"tap {i}", START + timedelta(days=30 * i), "reference", "x", Estimate(17 * (100 + p), 0.1))
        for i, p in enumerate(y)
    )
    return assess_status(mill, History("", "", rows), rows[-1].time)


def test_one_bad_clamping_asks_for_another_and_two_are_an_alarm(mill: Any) -> None:
    for seed in range(4):
        y = steady(seed, 22)
        y[20:] -= 3.0
        assert status(mill, y[:20]).status is StatusLevel.GOOD
        one, two = status(mill, y[:21]), status(mill, y)
        assert (one.status, one.alarms) == (StatusLevel.WARN, ())
        assert one.reasons[0].code == "decay-doubtful"
        assert two.status is StatusLevel.ALARM
        assert [(alarm.code, alarm.about, alarm.triggered_by) for alarm in two.alarms] == [
            ("decay", "reference, x", "tap 21")
        ]


def test_of_60_healthy_series_with_one_bad_clamping_at_most_three_alarm() -> None:
    raised = 0
    for seed in range(60):
        y = steady(seed, 30)
        y[9 + seed % 20] -= 1 + 2 * (seed % 7) / 6
        raised += bool(detect_changes(Readings(y)).drops)
    assert raised <= 3


def test_an_alarm_keeps_its_first_test_and_closes_with_the_fourth_calm_one() -> None:
    y = np.tile(WIGGLE, 6)
    y[24:28] -= 2.0
    found = detect_changes(Readings(y))
    (drop,) = found.drops
    assert drop.triggered_at == 25
    watched = monitor_drops(Readings(y)).is_sure
    last_sure = int(np.flatnonzero(watched)[-1])
    assert drop.closed_at == last_sure + 4
    assert found.open_drops == ()
    assert [one.triggered_at for one in detect_changes(Readings(y[: last_sure + 4])).open_drops] == [25]


@pytest.mark.parametrize("at", [0, 1, 2])
@pytest.mark.parametrize("error", [3.0, -3.0])
def test_one_of_the_first_three_tests_off_by_3_percent_is_no_alarm(at: int, error: float) -> None:
    raised = 0
    for seed in range(20):
        y = steady(seed, 40, 0.2)
        y[at] += error
        raised += bool(detect_changes(Readings(y)).drops)
    assert raised <= 2


def test_a_guarded_point_takes_the_value_of_the_third_after_it_and_the_first_eight_decide() -> None:
    for at in range(3):
        y = np.tile(WIGGLE, 3)
        y[at] += 3.0
        guarded = guard_first_points(y)
        assert np.flatnonzero(guarded != y).tolist() == [at]
        assert guarded[at] == y[at + 3]
        np.testing.assert_array_equal(guard_first_points(y[:8]), guarded[:8])
        np.testing.assert_array_equal(guard_first_points(y[:7]), y[:7])
    late = WIGGLE + 3.0 * (np.arange(8) == 3)
    np.testing.assert_array_equal(guard_first_points(late), late)


@pytest.mark.parametrize(
    "shift",
    [
        1.9 * (np.arange(8) < 1),  # a small drop after the first test
        3.0 * (np.arange(8) < 2),  # two tests that confirm each other
        np.array([0, 3.0, 2.2, 0, 0, 0, 0, 0]),
        -1.0 * np.arange(8),
    ],
)
def test_what_a_neighbour_confirms_or_is_small_is_not_guarded(shift: Floats) -> None:
    y = 0.1 * WIGGLE + shift
    np.testing.assert_array_equal(guard_first_points(y), y)


@pytest.mark.parametrize("away", [3.0, -3.0])
def test_a_first_test_unlike_the_next_ones_is_said_and_its_drop_is_in_the_interval(mill: Any, away: float) -> None:
    y = np.concatenate([[away], 0.5 * WIGGLE, 0.5 * WIGGLE])
    early, found = status(mill, y[:7]), status(mill, y)
    assert ("first-test-differs" in {remark.code for remark in early.remarks}) is (away > 0)
    assert (found.reasons[0].code, found.status, found.alarms) == ("first-test-differs", StatusLevel.WARN, ())
    assert "exclude_entry" in found.next_step
    assert "tap 0" in found.next_step
    (series,) = found.series
    assert not series.is_change_proven
    low, high = series.drop.interval or (0, 0)
    assert low < 0 < high
    assert low < 100 * away / (100 + away) < high
    plain = status(mill, np.append(y[2:], y[-1:]))
    assert plain.status is StatusLevel.GOOD
    assert plain.series[0].drop.half_width < 0.6
    assert series.drop.std > 1.4


@pytest.mark.parametrize("at", [0, 1])
@pytest.mark.parametrize("count", [4, 7])
def test_a_high_first_test_of_a_short_series_proves_no_drop(mill: Any, at: int, count: int) -> None:
    for seed in range(3):
        y = steady(seed, count, 0.2)
        y[at] += 3.0
        found = status(mill, y)
        (series,) = found.series
        assert not series.is_change_proven
        low, _ = series.drop.interval or (math.nan, math.nan)
        assert low < 0
        assert found.reasons[0].code == "first-test-differs"
        assert f"tap {at} " in found.next_step


def test_a_short_series_that_drops_fast_has_no_first_test_that_differs(mill: Any) -> None:
    found = status(mill, 0.1 * WIGGLE[:6] - 2.5 * np.arange(6))
    assert "first-test-differs" not in {remark.code for remark in found.remarks}
    assert found.series[0].is_change_proven


@pytest.mark.parametrize("error", [-1.0, -3.0, 2.0])
def test_one_newest_test_proves_no_change_and_two_do(mill: Any, error: float) -> None:
    for seed in range(3):
        y = steady(seed, 15, 0.1)
        y[13:] += error
        (alone,), (both,) = status(mill, y[:14]).series, status(mill, y).series
        assert alone.drop.is_proven
        assert not alone.is_change_proven
        assert both.is_change_proven


def test_the_estimate_of_an_alarm_leaves_out_a_newest_test_that_nothing_confirms() -> None:
    y = steady(2, 28, 0.15)
    y[20:] -= 2.0
    before = monthly(y[:-1]).open_drop
    assert before is not None
    for error in (-2.0, 2.0):
        found = monthly(np.append(y[:-1], y[-1] + error)).open_drop
        assert found is not None
        assert found.change == before.change
        twice = monthly(np.append(y[:-1], [y[-1] - 2.0] * 2)).open_drop
        assert twice is not None
        assert twice.change.size > before.change.size + 1.0


@pytest.mark.parametrize("before", [3, 5, 7])
def test_a_step_is_no_run_in(before: int) -> None:
    seen = [monthly(steady(seed, 20, 0.15) - 2.0 * (np.arange(20) >= before)) for seed in range(4)]
    assert all(trend.open_drop for trend in seen)
    assert sum(trend.is_run_in for trend in seen) <= 1


def test_taps_of_one_clamping_share_the_drop_of_their_point(mill: Any) -> None:
    y = np.append(0.5 * WIGGLE, [0.0, -0.2, -0.3, -1.2])
    rows = tuple(
        HistoryRow(
            f"tap {i}", START + timedelta(days=30 * min(i, 9), hours=i), "reference", "x", Estimate(17 * (100 + p), 0.1)
        )
        for i, p in enumerate(y)
    )
    (series,) = assess_status(mill, History("", "", rows), rows[-1].time).series
    history = series.history.frequency
    assert series.trend is not None
    assert len(series.trend.points) == 10
    assert {history.drop_at(row) for row in rows[-3:]} == {series.drop}
    assert series.drop.value == series.trend.drops[-1]
    assert history.percent_below_start(rows[-1]) == series.drop.value
    assert history.drop_at(rows[0]).half_width == 0


def test_a_large_drop_is_proven_though_the_first_test_differs(mill: Any) -> None:
    y = np.concatenate([[3.0], 0.5 * WIGGLE, 0.5 * WIGGLE, [-9.0, -9.0]])
    (series,) = status(mill, y).series
    assert series.drop.is_proven


def test_a_drop_of_1_percent_after_the_first_test_is_found() -> None:
    found, n = 0, MIN_FIRST_STEP_POINTS
    for seed in range(40):
        y = steady(seed, 60)
        y[1:] -= 1.0
        seen = monitor_drops(Readings(y))
        found += bool(seen.first_alarm)
        if seen.first_alarm == n:
            assert seen.change_at(n).point == 1
    assert found >= 30


def test_the_step_after_the_first_test_is_sure_from_its_own_score_on() -> None:
    """At 36 points the mean of 35 is far from one by t of its residuals."""
    n = MIN_FIRST_STEP_POINTS
    rest = np.tile([0.3, -0.3], 18)[1:]
    for away, is_sure in ((0.75, False), (0.9, True)):
        y = np.concatenate([[rest.mean() + away], rest])
        t = away / (np.std(rest) * np.sqrt(35 / 34) * np.sqrt(1 + 1 / 35))
        assert (t > 2.74) == is_sure  # 2.6 is the normal quantile of 2.74 of Student's t with 34 degrees of freedom
        assert monitor_drops(Readings(y)).is_sure[n - 1] == is_sure
        assert not monitor_drops(Readings(y)).is_sure[: n - 1].any()


def test_a_young_series_with_a_known_scatter_is_evaluated_from_the_fifth_point_on() -> None:
    known = SeriesScatterPrior(ScatterPrior(0.2, 12.0), ScatterPrior(0.2, 12.0))
    y = np.array([0.1, -0.1, 0.0, -1.5, -1.6, -1.4])
    scores = monitor_drops(Readings(y, scatter_prior=known)).scores
    assert np.isnan(scores[:4]).all()
    assert np.isfinite(scores[4:]).all()
    assert detect_changes(Readings(y, scatter_prior=known)).drops[0].triggered_at == 5


def test_the_newest_test_alone_moves_no_date_and_the_next_one_does() -> None:
    for seed in range(4):
        y = steady(seed, 14, 0.2)
        y[12:] -= 2.5
        before, alone, confirmed = monthly(y[:12]), monthly(y[:13]), monthly(y)
        level = before.start - 4.0
        assert before.forecast_level(level).probable is None
        assert alone.needs_repeat
        assert alone.forecast_level(level).probable is None
        assert alone.start == before.start
        assert confirmed.past_fit is not None
        assert confirmed.readings.days is not None
        assert np.array_equal(confirmed.past_fit.fitted, fit_past(confirmed.readings.days, confirmed.readings).fitted)
        assert not confirmed.needs_repeat


def test_with_a_newest_test_alone_the_line_ends_at_it_and_keeps_the_earlier_points() -> None:
    y = np.append(np.tile(WIGGLE, 2), 2.5)
    trend = monthly(y)
    earlier = monthly(y[:-1])
    assert trend.past_fit is not None
    assert earlier.past_fit is not None
    assert earlier.forecast is not None
    assert trend.past_fit.fitted.shape == trend.past_fit.dates.shape == (17,)
    np.testing.assert_array_equal(trend.past_fit.fitted[:-1], earlier.past_fit.fitted)
    expected = np.interp(trend.past_fit.dates[-1], earlier.forecast.dates, earlier.forecast.mean_line)
    assert trend.past_fit.fitted[-1] == pytest.approx(expected, abs=0.01)
    assert not trend.needs_repeat  # it is high
    assert trend.is_newest_high
    assert not earlier.is_newest_high
    assert not monthly(np.append(y, 2.5)).is_newest_high
    assert monthly(y[:-1] * 0 - 9 * (np.arange(16) == 15)).past_fit is not None


def test_eight_points_of_which_the_newest_is_alone_have_no_forecast_yet() -> None:
    assert monthly(WIGGLE).past_fit is not None
    trend = monthly(WIGGLE - 2.0 * (np.arange(8) == 7))
    assert trend.past_fit is None
    assert trend.needs_repeat


def test_the_newest_point_of_a_fall_that_goes_on_counts() -> None:
    y = np.tile(WIGGLE, 3) - 0.5 * np.maximum(np.arange(24) - 9, 0)
    trend = monthly(y)
    assert trend.open_drop is not None
    assert trend.past_fit is not None
    assert trend.readings.days is not None
    np.testing.assert_array_equal(trend.past_fit.fitted, fit_past(trend.readings.days, trend.readings).fitted)
    y[-1] -= 4.0
    lone = monthly(y)
    assert lone.past_fit is not None
    assert lone.past_fit.fitted[-1] > y[-1] + 2.0


def test_the_distance_of_the_newest_point_is_in_robust_scatters_from_the_median_of_seven() -> None:
    y = np.array([5.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 4.0])
    scatter = 1.4826 / np.sqrt(2)
    assert measure_newest_distance(y) == pytest.approx(4.0 / scatter)
    assert measure_newest_distance(-y) == pytest.approx(-4.0 / scatter)
    assert measure_newest_distance(np.array([0.0, 1.0, 0.0])) == 0.0
    assert measure_newest_distance(np.array([0.0, 1.0, 0.0, 3.0])) == pytest.approx(3.0 / scatter)
    assert measure_newest_distance(np.append(y[:-1], [4.0, 5.0])) == 0.0
    assert measure_newest_distance(np.append(y[:-1], [3.0, 5.0])) == pytest.approx(4.0 / scatter)
