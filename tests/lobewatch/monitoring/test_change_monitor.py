"""Detection of drops against printed numbers, a public series, plain least squares and simulated series."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import norm
from scipy.stats import t as students

from lobewatch.monitoring.alarm_estimate import SeriesChange
from lobewatch.monitoring.change_detection import (
    MIN_FIRST_STEP_POINTS,
    SURE_CHANGE_SCORE,
    ChangeMonitor,
    detect_changes,
    find_newest_change,
    monitor_drops,
    monitor_drops_and_rises,
)
from lobewatch.monitoring.series_points import Readings, guard_first_points, winsorize

Floats = NDArray[np.float64]

FALLING = np.fromstring(
    "0 .12 -.09 .05 -.14 .08 .02 -.06 .11 -.03 .04 -.10 -.31 -.55 -.62 -.93 -1.02 -1.31 -1.38 -1.62", sep=" "
)
"""Healthy for eleven points, then falling."""
NILE = """
1120 1160 963 1210 1160 1160 813 1230 1370 1140 995 935 1110 994 1020 960 1180 799 958 1140 1100 1210 1150 1250 1260
1220 1030 1100 774 840 874 694 940 833 701 916 692 1020 1050 969 831 726 456 824 702 1120 1100 832 764 821
"""
"""Annual flow at Aswan from 1871 on (1e8 m^3): Cobb (1978), Biometrika 65, 243-251; it fell in 1898, point 28."""


def first_fall(watched: ChangeMonitor) -> SeriesChange:
    assert watched.first_alarm is not None
    return watched.change_at(watched.first_alarm)


@pytest.mark.quick
def test_the_reference_series_is_evaluated_as_printed() -> None:
    found = monitor_drops(Readings(FALLING))
    assert np.all(np.isnan(found.scores[:8]))
    expected = [0.8163, 0.9261, 0.9079, 1.0457, 3.0248, 4.4853, 5.3025, 6.1634, 6.8471, 7.4790, 8.0282, 8.5846]
    np.testing.assert_allclose(found.scores[8:], expected, atol=5.1e-5)
    assert found.first_alarm == 14
    assert (first_fall(found).kind, first_fall(found).point) == ("slope", 10)


@pytest.mark.quick
def test_the_14th_point_of_it_asks_for_another_and_the_15th_alarms() -> None:
    asks = [n for n in range(FALLING.size + 1) if detect_changes(Readings(FALLING[:n])).needs_repeat]
    alarms = [n for n in range(FALLING.size + 1) if monitor_drops(Readings(FALLING[:n])).first_alarm is not None]
    assert asks == [14]
    assert alarms == list(range(15, 21))


@pytest.mark.quick
def test_the_nile_fell_once_in_1898() -> None:
    found = monitor_drops(Readings(np.fromstring(NILE, sep=" ")))
    assert np.flatnonzero(found.scores >= SURE_CHANGE_SCORE)[0] == 30
    assert found.first_alarm == 31
    assert (first_fall(found).kind, first_fall(found).point) == ("step", 28)
    assert first_fall(found).size == pytest.approx(240, abs=30)


@pytest.mark.quick
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(9, MIN_FIRST_STEP_POINTS - 1), drop=st.floats(-1, 1))
def test_the_score_is_that_of_least_squares_written_out(seed: int, n: int, drop: float) -> None:
    y = np.random.default_rng(seed).normal(size=n) + drop * np.arange(n)
    y = winsorize(y)
    assume(np.array_equal(y, winsorize(y)) and np.array_equal(y, guard_first_points(y)))
    changes = [np.arange(n) >= k for k in range(2, n - 1)] + [np.maximum(np.arange(n) - k, 0) for k in range(1, n - 2)]
    steepest = max(falling(y, change.astype(float)) for change in changes)
    assert monitor_drops(Readings(y)).scores[-1] == pytest.approx(
        -norm.ppf(students.sf(steepest, n - 2)), rel=1e-6, abs=1e-6
    )


def falling(y: Floats, change: Floats) -> float:
    columns = np.column_stack([np.ones(y.size), change])
    size, rest, *_ = np.linalg.lstsq(columns, y)
    error = np.sqrt(rest[0] / (y.size - 2) * np.linalg.inv(columns.T @ columns)[1, 1])
    return float(-size[1] / error)


@pytest.mark.quick
def test_a_rise_is_no_fall() -> None:
    assert monitor_drops(Readings(-FALLING)).first_alarm is None


@pytest.mark.quick
@pytest.mark.parametrize("sign", [1, -1])
def test_fall_and_rise_are_mirror_images(sign: int) -> None:
    falls, rises = monitor_drops_and_rises(Readings(sign * FALLING))
    one, other = (falls, rises) if sign > 0 else (rises, falls)
    np.testing.assert_allclose(one.scores, monitor_drops(Readings(FALLING)).scores, rtol=1e-9)
    assert first_fall(one).size == pytest.approx(1.62, abs=0.1)
    assert other.first_alarm is None


@pytest.mark.quick
@pytest.mark.parametrize("sign", [1, -1])
def test_the_newest_change_has_the_sign_of_a_fall_and_wants_two_points(sign: int) -> None:
    assert [n for n in range(21) if find_newest_change(sign * FALLING[:n]) is not None] == list(range(15, 21))
    found = find_newest_change(sign * FALLING)
    assert found is not None
    assert (found.kind, found.point) == ("slope", 10)
    assert sign * found.size == pytest.approx(1.62, abs=0.1)


@pytest.mark.quick
def test_size_and_interval_of_a_known_step() -> None:
    fallen = np.repeat([0.0, -1.0], [20, 10]) + np.tile([0.1, -0.1], 15)
    found = first_fall(monitor_drops(Readings(fallen)))
    assert (found.kind, found.point) == ("step", 20)
    error = np.sqrt(30 * 0.01 / 28 * (1 / 20 + 1 / 10))
    assert found.size == pytest.approx(1.0)
    assert found.half_width == pytest.approx(students.ppf(0.975, 28) * error)


@pytest.mark.quick
@pytest.mark.parametrize("n", [0, 1, 8, 30])
def test_equal_points_are_steady(n: int) -> None:
    found = monitor_drops(Readings(np.full(n, 3.0)))
    assert found.first_alarm is None
    assert found.scores[8:] == pytest.approx(0.0)


@pytest.mark.quick
def test_a_fall_without_any_scatter_alarms() -> None:
    found = monitor_drops(Readings(np.repeat([0.0, -1.0], [12, 3])))
    assert found.first_alarm == 13
    assert first_fall(found).size == pytest.approx(1.0)


@pytest.mark.quick
def test_what_the_temperature_explains_is_no_fall() -> None:
    random = np.random.default_rng(3)
    warmth = np.linspace(18.0, 34.0, 24)
    y = -0.02 * (warmth - 18.0) + random.normal(0, 0.01, 24)
    assert monitor_drops(Readings(y)).first_alarm is not None
    assert monitor_drops(Readings(y, warmth)).first_alarm is None
    assert monitor_drops(Readings(y, np.where(np.arange(24) < 13, np.nan, warmth))).first_alarm is not None, (
        "11 temperatures are too few"
    )


@pytest.mark.quick
def test_a_fall_next_to_the_temperature_is_found() -> None:
    random = np.random.default_rng(4)
    warmth = random.uniform(18.0, 30.0, 30)
    y = -0.02 * warmth - 0.5 * (np.arange(30) >= 18) + random.normal(0, 0.03, 30)
    found = first_fall(monitor_drops(Readings(y, warmth)))
    assert (found.kind, found.point) == ("step", 18)
    assert found.size == pytest.approx(0.5, abs=0.05)


HEALTHY = {24: 3.5, 60: 7.0, 120: 13.0}
CLAMPED = {24: 8.0, 60: 25.0, 120: 50.0}


def false_alarms(series: int, share_clamped: float) -> dict[int, float]:
    random = np.random.default_rng(1)
    y = random.normal(size=(series, 128)) - 5 * (random.random((series, 128)) < share_clamped)
    alarms = [monitor_drops(Readings(one)).first_alarm for one in y]
    return {n: 100 * float(np.mean([at is not None and at < 8 + n for at in alarms])) for n in HEALTHY}


@pytest.mark.long
@pytest.mark.parametrize(("share", "most"), [(0.0, HEALTHY), (0.02, CLAMPED)])
def test_false_alarms_in_4000_series(share: float, most: dict[int, float]) -> None:
    found = false_alarms(4000, share)
    print(f"share clamped badly {share}: {found}")  # noqa: T201
    assert all(found[n] <= most[n] for n in most), found


@pytest.mark.quick
def test_false_alarms_are_rare() -> None:
    found = false_alarms(150, 0.0)
    assert found[24] <= 7.0, found


def shaped(kind: str, size: float, i: Floats) -> Floats:
    return {"step": np.full(i.size, size), "ramp": size * np.minimum(i / 12, 1), "slope": size * i}[kind]


FALLS = [  # kind, size (%), scatter (%), points before; median and 90 % of the points to the alarm
    ("step", 0.5, 0.3, 12, 9, 24),
    ("step", 0.5, 0.3, 36, 7, 13),
    ("step", 0.5, 0.1, 12, 3, 4),
    ("ramp", 2.0, 0.3, 12, 7, 9),
    ("slope", 0.1, 0.3, 12, 10, 12),
    ("slope", 0.1, 0.1, 12, 5, 7),
]


def delays(kind: str, size: float, scatter: float, before: int, series: int) -> tuple[Floats, Floats]:
    """Points from the change to the alarm, inf without one; how much later than true the fall is dated."""
    random = np.random.default_rng(2)
    late, dated = [], []
    for _ in range(series):
        y = random.normal(0, scatter, before + 60)
        y[before:] -= shaped(kind, size, np.arange(1.0, 61.0))
        found = monitor_drops(Readings(y))
        at = np.inf if found.first_alarm is None else found.first_alarm + 1 - before
        if at > 0:
            late.append(at)
            dated.append(first_fall(found).point - before if found.first_alarm is not None else np.nan)
    return np.array(late), np.array(dated)


@pytest.mark.long
@pytest.mark.parametrize(("kind", "size", "scatter", "before", "median", "most"), FALLS)
def test_a_fall_is_found_in_time(kind: str, size: float, scatter: float, before: int, median: int, most: int) -> None:
    late, dated = delays(kind, size, scatter, before, 4000)
    share, dates = np.mean(late <= 24), np.nanquantile(dated, [0.1, 0.9])
    print(f"{kind} {size} %: {np.median(late)}, {np.quantile(late, 0.9)}, {share:.3f}, dated {dates}")  # noqa: T201
    assert np.median(late) <= median
    assert np.quantile(late, 0.9) <= most
    if (kind, scatter) == ("step", 0.1):
        assert np.all(np.abs(dates + 0.5) <= 1.5)


@pytest.mark.quick
def test_a_step_of_five_times_the_scatter_is_found_within_four_points() -> None:
    late, _ = delays("step", 0.5, 0.1, 12, 50)
    assert np.quantile(late, 0.9) <= 4
