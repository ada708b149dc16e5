"""Points of a series, its falls, where it started."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from lobewatch.monitoring.alarm_estimate import SeriesChange
from lobewatch.monitoring.trend import TapValue, Trend, fit_trend

START = datetime(2024, 1, 15, 9, tzinfo=UTC)
FALLING = np.fromstring(
    "0 .12 -.09 .05 -.14 .08 .02 -.06 .11 -.03 .04 -.10 -.31 -.55 -.62 -.93 -1.02 -1.31 -1.38 -1.62", sep=" "
)


def tapped(days: float, percent: float) -> TapValue:
    return TapValue(START + timedelta(days=days), 1700.0 * float(np.exp(percent / 100)), 0.01)


def judged(series: list[TapValue]) -> Trend:
    return fit_trend(series, series[-1].time)


def open_fall(trend: Trend) -> SeriesChange:
    assert trend.open_drop is not None
    return trend.open_drop.change


def monthly(percents: np.ndarray[tuple[int], np.dtype[np.float64]]) -> list[TapValue]:
    return [tapped(30.0 * i, percent) for i, percent in enumerate(percents)]


def test_tests_of_a_day_are_one_point_the_mean_of_two_the_median_of_three() -> None:
    series = [tapped(0, 0.0), tapped(30, 0.1), tapped(30.5, 0.3), tapped(60, 0.1), tapped(60.1, 0.2), tapped(60.9, 9.0)]
    found = judged(series).points
    assert [point.taps for point in found] == [(0,), (1, 2), (3, 4, 5)]
    assert [point.percent for point in found] == pytest.approx([0.0, 0.2, 0.2])
    assert found[1].error == pytest.approx(0.01 / np.sqrt(2))


def test_a_test_confirms_another_of_the_same_day_where_the_tool_was_reclamped() -> None:
    asked = monthly(FALLING[:14])
    again = asked[-1]._replace(time=asked[-1].time + timedelta(hours=1))
    same_clamping, reclamped = judged([*asked, again]), judged([*asked, again._replace(reclamped=True)])
    assert (len(same_clamping.points), same_clamping.open_drop) == (14, None)
    assert same_clamping.detection.needs_repeat
    assert len(reclamped.points) == 15
    assert reclamped.open_drop is not None
    assert reclamped.open_drop.triggered_at == 14


def test_tests_of_two_clampings_on_one_day_are_two_points() -> None:
    first = [tapped(0, 0.0), tapped(0.1, 0.2)]
    second = [one._replace(reclamped=clamped) for one, clamped in ((tapped(0.2, 1.0), True), (tapped(0.3, 1.2), False))]
    assert [point.taps for point in judged([*first, *second]).points] == [(0, 1), (2, 3)]


def test_the_alarm_is_dated_and_its_size_grows_with_the_fall() -> None:
    first, later = judged(monthly(FALLING[:15])), judged(monthly(FALLING))
    assert first.drop_since == later.drop_since == START + timedelta(days=300)
    assert open_fall(first).size < open_fall(later).size == pytest.approx(1.62, abs=0.1)


def test_a_low_first_test_hides_no_fall() -> None:
    assert judged(monthly(np.array([-3.0, 0.0, 0.1]))).start == pytest.approx(3.1)
    many = np.append(-3.0, np.tile([0.05, -0.05], 12))
    assert judged(monthly(many)).start == pytest.approx(3.0, abs=0.35)


def test_a_spindle_that_falls_from_the_beginning_started_where_its_line_does() -> None:
    found = judged(monthly(-0.4 * np.arange(24.0) + np.tile([0.05, -0.05], 12)))
    assert found.start == pytest.approx(-0.05, abs=0.05)
    assert found.spread == pytest.approx(0.05, abs=0.01)


def test_a_rise_is_distinguished() -> None:
    found = judged(monthly(-FALLING))
    assert found.open_drop is None
    assert found.detection.rise is not None
    assert found.detection.rise.size == pytest.approx(1.62, abs=0.1)


@pytest.mark.parametrize("n", [1, 2, 7])
def test_a_short_series_predicts_nothing(n: int) -> None:
    found = judged(monthly(FALLING[:n]))
    assert found.forecast is None
    assert found.spread == 0.0
    assert found.start == pytest.approx(max(FALLING[:n][:3]))


def test_a_machine_that_was_not_tapped_for_long_is_not_predicted() -> None:
    series = monthly(FALLING)
    late = fit_trend(series, series[-1].time + timedelta(days=3 * 30 * 19))
    assert late.is_stale
    assert late.start == pytest.approx(judged(series).start)
    assert not judged(series).is_stale


def test_ten_taps_of_an_hour_tapped_years_ago_are_taken_as_they_are() -> None:
    found = fit_trend([tapped(i / 240, 0.1 * (-1) ** i) for i in range(10)], START + timedelta(days=9000))
    assert len(found.points) == 1
    days_apart = [tapped(i * 1.01, 0.1 * (-1) ** i) for i in range(10)]
    assert fit_trend(days_apart, START + timedelta(days=9000)).is_stale


def test_of_a_very_long_series_the_newest_thousand_points_are_evaluated() -> None:
    steps = np.repeat([0.0, -1.0, -1.0], [12, 600, 600]) + np.tile([0.05, -0.05], 606)
    found = judged(monthly(steps))
    assert len(found.points) == 1000
    assert found.open_drop is None


def test_a_gap_of_years_divides_nothing_and_the_fall_across_it_is_found() -> None:
    noise = np.random.default_rng(3).normal(0, 0.1, 24)
    series = [tapped(30.0 * i + 3000 * (i >= 12), noise[i] - 1.5 * (i >= 12)) for i in range(24)]
    found = judged(series)
    assert len(found.points) == 24
    assert open_fall(found).kind == "step"
    assert open_fall(found).size == pytest.approx(1.5, abs=0.2)
    assert found.drop_since is not None
    assert found.drop_since - found.points[11].time > timedelta(days=3000)
    assert found.forecast is not None
    assert np.isfinite(found.forecast.mean_line).all()


@pytest.mark.parametrize("at", [0, 10, 19])
def test_one_outlier_raises_no_alarm_wherever_it_is(at: int) -> None:
    percents = np.random.default_rng(0).normal(0, 0.1, 20)
    percents[at] = -3.0
    found = judged(monthly(percents))
    assert found.open_drop is None
    assert found.detection.needs_repeat == (at == 19)


def test_the_temperature_of_some_tests_is_enough_and_of_a_few_counts_for_nothing() -> None:
    random = np.random.default_rng(0)
    warmth = 20 + 8 * np.sin(np.arange(40) / 3)
    percents = -0.02 * (warmth - 20) + random.normal(0, 0.02, 40)

    def spread(known: int) -> float:
        told = np.where(np.arange(40) % 4 < known, warmth, np.nan)
        return judged([one._replace(temperature=t) for one, t in zip(monthly(percents), told, strict=True)]).spread

    assert spread(0) == spread(1)  # ten are too few
    assert spread(4) < 0.03 < spread(3) < spread(0)
