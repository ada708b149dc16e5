"""Drop of a series: its interval contains reclamping and the start, its value neither operators nor temperature."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.stats import norm
from scipy.stats import t as students

from lobewatch.monitoring.drop_text import describe_drop, format_below_start, format_change
from lobewatch.monitoring.machine_status import scatter_remarks
from lobewatch.monitoring.scatter_check import check_scatter
from lobewatch.monitoring.series_drop import HIGHEST_SQUARE, ScatterPosterior, SeriesDrop
from lobewatch.monitoring.series_points import NO_SCATTER_PRIOR, NO_SERIES_PRIOR, ScatterPrior, SeriesScatterPrior
from lobewatch.monitoring.trend import TapValue, Trend, fit_trend

Floats = NDArray[np.float64]
START = datetime(2024, 1, 15, 9, tzinfo=UTC)


def fitted(
    percents: Floats,
    operators: str = "",
    temperatures: Floats | None = None,
    known: SeriesScatterPrior = NO_SERIES_PRIOR,
) -> Trend:
    warmth = np.full(percents.size, np.nan) if temperatures is None else temperatures
    taps = [
        TapValue(START + timedelta(days=30 * i), 1700.0 * float(np.exp(percent / 100)), 0.002, warm, operator=who)
        for i, (percent, warm, who) in enumerate(
            zip(percents.tolist(), warmth.tolist(), operators or [""] * percents.size, strict=True)
        )
    ]
    return fit_trend(taps, taps[-1].time, known=known)


def newest_drop(trend: Trend) -> SeriesDrop:
    point, model = trend.points[-1], trend.drop_model
    value = model.percent_below_start(point.percent, point.temperature, point.operator)
    return model.drop_at(value, point.temperature, point.operator, point.error)


@pytest.mark.parametrize("freedom", [4.0, 8.0, 30.0])
def test_a_measured_scatter_gives_the_interval_of_student(freedom: float) -> None:
    found = ScatterPosterior.measured(freedom * 0.2**2, freedom, NO_SCATTER_PRIOR)
    assert found.half_width(1.5) == pytest.approx(0.2 * np.sqrt(1.5) * students.ppf(0.975, freedom), rel=0.01)
    assert found.tail(0.5, 1.0, 0.0) == pytest.approx(students.sf(2.5, freedom), rel=0.05)
    prior = ScatterPosterior.measured(0.0, 0.0, ScatterPrior(0.2, freedom))
    assert prior.half_width(1.5) == pytest.approx(found.half_width(1.5))


def test_an_unknown_scatter_is_that_of_the_usual_range() -> None:
    found = ScatterPosterior.between(0.05, 0.6, 0.0, 0.0)
    assert found.percent == pytest.approx(np.sqrt((0.6**2 - 0.05**2) / (2 * np.log(12))), rel=0.02)
    assert 1.96 * found.percent < found.half_width(1.0) < 1.96 * 0.6


@pytest.mark.parametrize("n", [1, 2, 3])
def test_the_mean_square_of_the_highest_of_some_normal_numbers(n: int) -> None:
    square, _ = quad(lambda x: x**2 * n * norm.pdf(x) * norm.cdf(x) ** (n - 1), -8, 8)
    assert HIGHEST_SQUARE[n - 1] == pytest.approx(square)


def test_two_tests_say_little_and_other_series_say_more() -> None:
    alone = newest_drop(fitted(np.array([0.0, -0.2])))
    told = newest_drop(fitted(np.array([0.0, -0.2]), known=SeriesScatterPrior(ScatterPrior(0.1, 30.0))))
    assert alone.value == pytest.approx(told.value) == pytest.approx(-100 * np.expm1(-0.002))
    assert told.half_width == pytest.approx(0.1 * np.sqrt(2) * students.ppf(0.975, 30), rel=0.1)
    assert alone.half_width > 2 * told.half_width
    assert not alone.is_proven


def test_a_large_drop_of_two_tests_is_proven_and_a_small_one_is_not() -> None:
    assert newest_drop(fitted(np.array([0.0, -6.0]))).is_proven
    assert not newest_drop(fitted(np.array([0.0, -1.0]))).is_proven


def test_the_interval_contains_the_uncertainty_of_the_start() -> None:
    trend = fitted(np.tile([0.1, -0.1], 10))
    alone = trend.drop_model.scatter.half_width(1.0)
    assert 1.01 * alone < newest_drop(trend).half_width < 1.3 * alone


def test_an_operator_with_other_taps_is_no_drop() -> None:
    who = "AB" * 12
    noise = np.random.default_rng(0).normal(0, 0.05, 24)
    percents = noise - np.where([one == "B" for one in who], 0.2, 0.0)
    declared, silent = newest_drop(fitted(percents, who)), newest_drop(fitted(percents))
    assert abs(declared.value) < declared.half_width < 0.2
    assert silent.value - declared.value == pytest.approx(0.1, abs=0.05)


def test_warmth_is_no_drop() -> None:
    warmth = 20 + 8 * np.sin(np.arange(24) / 2)
    noise = np.random.default_rng(0).normal(0, 0.02, 24)
    hot, plain = fitted(noise - 0.02 * (warmth - warmth.mean()), temperatures=warmth), fitted(noise)
    assert newest_drop(hot).value == pytest.approx(newest_drop(plain).value, abs=0.03)


def test_the_unit_of_the_values_does_not_count() -> None:
    percents = np.random.default_rng(1).normal(0, 0.1, 9)
    assert newest_drop(fitted(percents + 40)) == pytest.approx(newest_drop(fitted(percents)), rel=1e-6)


def covered(n: int, scatter: float, series: int, drop: float = 0.0, operators: int = 1) -> tuple[float, float]:
    """Return shares of the series whose interval contains the true drop, and whose change is called proven.

    drop: at once after half of the points (%).
    """
    rng = np.random.default_rng([n, operators, int(1000 * scatter)])
    level, found = -drop * (np.arange(n) >= n - n // 2), []
    for _ in range(series):
        turns = rng.integers(0, operators, n)
        apart = rng.normal(0, scatter * (operators > 1), operators)[turns]
        who = "".join("ABC"[turn] for turn in turns) if operators > 1 else ""
        one = newest_drop(fitted(level + apart + rng.normal(0, scatter, n), who))
        found.append((abs(one.value + 100 * np.expm1(-drop / 100)) <= one.half_width, one.is_proven))
    inside, proven = np.mean(found, axis=0).tolist()
    return inside, proven


@pytest.mark.parametrize("n", [2, 3, 5, 7])
@pytest.mark.parametrize("scatter", [0.05, 0.5])
def test_the_interval_of_a_short_healthy_series_holds(n: int, scatter: float) -> None:
    inside, proven = covered(n, scatter, 150)
    assert inside >= 0.9
    assert proven <= 0.02


@pytest.mark.long
@pytest.mark.parametrize("operators", [1, 3])
@pytest.mark.parametrize("n", [2, 3, 5, 8, 12, 20, 30])
def test_the_interval_holds_at_each_length_and_scatter(n: int, operators: int) -> None:
    healthy = [covered(n, scatter, 150, operators=operators) for scatter in (0.05, 0.15, 0.3, 0.5)]
    worn = [covered(n, scatter, 50, 2.5, operators)[0] for scatter in (0.05, 0.3)]
    inside, proven = np.mean(healthy, axis=0)
    assert inside >= 0.93
    assert proven <= 0.02
    assert np.mean(worn) >= 0.88


def test_a_change_is_claimed_only_if_it_is_proven() -> None:
    assert format_change(0.2345, 0.41) in describe_drop(0.2345, 0.41, is_proven=False)
    assert "since" not in describe_drop(0.2345, 0.41, is_proven=False)
    assert "since" in describe_drop(0.2345, 0.041, is_proven=True)
    assert (format_change(0.2345, 0.41), format_change(-0.2345, 0.041)) == ("-0.23 ± 0.41 %", "+0.234 ± 0.041 %")
    assert format_below_start(10.063, 0.31).startswith("10.06 ± 0.31 %")


def correlated(rng: np.random.Generator, n: int, share: float) -> Floats:
    noise = rng.normal(0, 0.1, n)
    for i in range(1, n):
        noise[i] += share * noise[i - 1]
    return noise


def test_scatter_that_repeats_is_said_with_its_false_alarms() -> None:
    rng = np.random.default_rng(2)
    plain, repeated = fitted(rng.normal(0, 0.1, 60)).scatter_check, fitted(correlated(rng, 60, 0.7)).scatter_check
    assert plain is not None
    assert repeated is not None
    assert (plain.is_independent, plain.false_alarm_share) == (True, 0.024)
    assert repeated.is_correlated
    assert repeated.correlation == pytest.approx(0.7, abs=0.25)
    assert repeated.false_alarm_share is not None
    assert 0.18 < repeated.false_alarm_share <= 0.63


def test_two_operators_whom_nobody_declared_are_two_groups() -> None:
    rng = np.random.default_rng(3)
    found = fitted(rng.normal(0, 0.04, 30) + 0.4 * rng.integers(0, 2, 30)).scatter_check
    assert found is not None
    assert found.group_distance == pytest.approx(0.4, abs=0.05)
    assert (found.is_independent, found.false_alarm_share) == (False, None)


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("bad", [1, 3, 5])
def test_bad_clampings_are_no_group(bad: int, sign: int) -> None:
    rng, places = np.random.default_rng(bad), np.linspace(4, 27, bad).astype(int)
    percents = rng.normal(0, 0.15, 30)
    percents[places] += 2.5 * sign
    found = fitted(percents).scatter_check
    assert found is not None
    assert found.group_distance == 0


def test_less_than_twenty_points_are_not_checked() -> None:
    trend = fitted(np.random.default_rng(4).normal(0, 0.1, 19))
    assert trend.scatter_check is None
    assert check_scatter(trend.drops, None, has_changed=False) is None


def test_two_groups_ask_for_the_operator_only_if_one_is_missing() -> None:
    rng = np.random.default_rng(3)
    percents = rng.normal(0, 0.04, 30) + 0.4 * rng.integers(0, 2, 30)
    declared, missing = (scatter_remarks("x", fitted(percents, operators)) for operators in ("a" * 30, ""))
    remarks = [*declared, *missing]
    assert [remark.code for remark in remarks] == ["scatter-groups"] * 2
    assert remarks[0].text == remarks[1].text
    assert remarks[0].cure != remarks[1].cure
