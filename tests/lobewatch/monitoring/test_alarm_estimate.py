"""Kind, beginning and size of a drop from all points: closed forms, invariances, simulated drops."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import t as students

from lobewatch.monitoring.alarm_estimate import SeriesChange, estimate_drop
from lobewatch.monitoring.change_detection import detect_changes, monitor_drops
from lobewatch.monitoring.series_points import Readings

Floats = NDArray[np.float64]
SCATTER = 0.1 * np.array([1, -1, 1, 1, -1, -1, 1, -1] * 5)
"""Scatter of 40 points."""


def late(points: int, count: int = 40) -> Floats:
    return np.arange(float(count)) - points


DROPS: dict[str, tuple[Floats, str, int, float]] = {
    "step": ((late(20) >= 0).astype(np.float64), "step", 20, 1.0),
    "slope": (0.1 * np.maximum(late(20), 0), "slope", 20, 1.9),
    "line": (0.1 * late(0), "slope", 1, 3.9),
    "faster and faster": (np.maximum(late(12), 0) ** 2 / 100, "slope", 12, 7.29),
    "crash, then slope": ((late(20) >= 0) * (2 + 0.1 * late(20)), "mixed", 20, 3.9),
    "step, later slope": (2.0 * (late(10) >= 0) + 0.2 * np.maximum(late(25), 0), "mixed", 10, 4.8),
    "slope, then partly repaired": (0.2 * np.maximum(late(10), 0) - 2 * (late(24) >= 0), "mixed", 10, 3.8),
    "slope, then held": (0.2 * np.clip(late(10), 0, 10), "dropped", 10, 2.0),
    "two steps": ((late(12) >= 0).astype(np.float64) + (late(26) >= 0), "dropped", 12, 2.0),
    "slope, repair, then held": (0.2 * np.clip(late(10), 0, 15) - 2 * (late(26) >= 0), "dropped", 10, 1.0),
}
"""Drop (%), kind, point and present size of each."""


@pytest.mark.parametrize("name", DROPS)
def test_kind_beginning_and_size_of_a_clear_drop(name: str) -> None:
    drop, kind, point, size = DROPS[name]
    found = estimate_drop(Readings(SCATTER - drop))
    assert found.kind == kind
    assert abs(found.point - point) <= {"line": 0, "faster and faster": 5}.get(name, 2)
    assert found.size == pytest.approx(size, abs=found.half_width)
    assert 0.04 < found.half_width < 0.25


def test_the_interval_of_a_clear_step_is_that_of_two_means() -> None:
    y = np.repeat([0.0, -1.0], 20) + SCATTER
    error = students.ppf(0.975, 38) * np.sqrt(40 / 38 * 0.01 * (1 / 20 + 1 / 20))
    found = estimate_drop(Readings(y))
    assert found.size == pytest.approx(1.0, abs=0.02)
    assert error < found.half_width < 1.4 * error


@settings(max_examples=10, deadline=None)
@given(scale=st.floats(0.1, 10), shift=st.floats(-50, 50), days=st.floats(0.5, 100), name=st.sampled_from([*DROPS]))
def test_units_and_origins_change_no_estimate(scale: float, shift: float, days: float, name: str) -> None:
    y = SCATTER - DROPS[name][0]
    plain, found = estimate_drop(Readings(y)), estimate_drop(Readings(scale * y + shift, days=days * late(-7)))
    assert (found.kind, found.point) == (plain.kind, plain.point)
    assert found.size / scale == pytest.approx(plain.size, rel=1e-5)
    assert found.half_width / scale == pytest.approx(plain.half_width, rel=1e-5)


def test_a_slope_is_one_over_days_and_not_over_points() -> None:
    days = np.cumsum(np.tile([1.0, 9.0, 30.0, 2.0], 10))
    found = estimate_drop(Readings(SCATTER - 0.01 * np.maximum(days - days[16], 0), days=days))
    assert (found.kind, found.point) == ("slope", 16)
    assert found.size == pytest.approx(0.01 * (days[-1] - days[16]), abs=found.half_width)


def test_a_step_between_points_of_one_date_is_found() -> None:
    days = np.minimum(10.0 * np.arange(11), 60.0)
    found = estimate_drop(Readings(SCATTER[:11] - 3.0 * (late(8, 11) >= 0), days=days))
    assert found.size == pytest.approx(3.0, abs=found.half_width)
    assert found.half_width < 0.3


def test_many_points_are_averaged_and_the_beginning_is_that_of_the_series() -> None:
    y = np.tile(SCATTER, 9) - 1.0 * (np.arange(360) >= 180)
    found = estimate_drop(Readings(y))
    assert (found.kind, found.point) == ("step", 180)
    assert found.size == pytest.approx(1.0, abs=0.03)


def test_what_the_temperature_explains_is_not_in_the_size() -> None:
    warmth = 20 + 8 * np.sin(late(0))
    found = estimate_drop(Readings(SCATTER - 0.015 * warmth - DROPS["step"][0], warmth))
    assert found.kind == "step"
    assert found.size == pytest.approx(1.0, abs=0.05)


def test_an_alarm_follows_its_points_and_keeps_the_point_that_raised_it() -> None:
    y = np.tile(SCATTER[:20], 6) - 0.05 * np.maximum(np.arange(120) - 40, 0)
    seen = [detect_changes(Readings(y[:n])).open_drops[-1] for n in (60, 120)]
    assert seen[0].triggered_at == seen[1].triggered_at
    for drop, size in zip(seen, (0.95, 3.95), strict=True):
        assert drop.change.kind == "slope"
        assert drop.change.size == pytest.approx(size, abs=drop.change.half_width)


def test_a_slope_of_the_monitor_begins_at_the_second_point_at_the_earliest() -> None:
    watched = monitor_drops(Readings(SCATTER[:20] - 0.3 * late(0, 20)))
    assert watched.first_alarm is not None
    assert (watched.change_at(19).kind, watched.change_at(19).point) == ("slope", 1)


def test_after_a_rise_the_beginning_counts_from_the_first_point_of_the_series() -> None:
    y = np.tile(SCATTER, 2)
    y[20:] += 3.0
    y[60:] -= 2.0
    (drop,) = detect_changes(Readings(y)).open_drops
    assert (drop.change.kind, drop.change.point) == ("step", 60)
    assert drop.change.size == pytest.approx(2.0, abs=drop.change.half_width)


COURSES: dict[str, Callable[[Floats], Floats]] = {
    "step": np.ones_like,
    "slope": lambda i: i / 12,
    "crash, then slope": lambda i: 0.6 + i / 24,
    "slope, then held": lambda i: np.asarray(1.5 * np.minimum(i / 6, 1)),
    "two steps": lambda i: np.where(i > 5, 1.8, 1.0),
    "slope, then repaired": lambda i: np.where(i <= 10, i / 6, 0.5),
}
"""Drop at the points after the last healthy one, as a share of its size."""
PURE = ("step", "slope")


def simulated(course: str, after: int, count: int) -> list[tuple[SeriesChange, float]]:
    """Estimates at the open alarms of drops of 0.6 to 2 % after 20 points, scatter 0.3 %, and their true sizes."""
    random, found = np.random.default_rng([after, *course.encode()]), []
    for _ in range(count):
        drop = random.uniform(0.6, 2.0) * COURSES[course](np.arange(1.0, after + 1))
        y = 0.3 * random.normal(size=20 + after)
        y[20:] -= drop
        found += [(one.change, float(drop[-1])) for one in detect_changes(Readings(y)).open_drops[-1:]]
    return found


def is_held(change: SeriesChange, truth: float) -> bool:
    return abs(change.size - truth) <= change.half_width


def test_most_intervals_hold_the_size_and_most_pure_drops_have_their_kind() -> None:
    found = {course: simulated(course, 24, 6) for course in COURSES}
    assert np.mean([is_held(*one) for each in found.values() for one in each]) >= 0.85
    assert np.mean([change.kind == course for course in PURE for change, _ in simulated(course, 36, 10)]) >= 0.85


@pytest.mark.long
@pytest.mark.parametrize("after", [8, 24, 60])
@pytest.mark.parametrize("course", COURSES)
def test_intervals_of_400_alarms_of_each_course_hold_the_size(course: str, after: int) -> None:
    found = simulated(course, after, 400)
    share = 100 * np.mean([is_held(*one) for one in found])
    kinds = 100 * np.mean([change.kind == course for change, _ in found])
    print(f"{course}, {after} points: {len(found)} alarms, {share:.1f} % held, kind right in {kinds:.0f} %")  # noqa: T201
    least = 82 if (course, after) == ("slope, then held", 8) else 88  # two points of hold: 84 to 86 % measured
    assert least <= share <= 99
