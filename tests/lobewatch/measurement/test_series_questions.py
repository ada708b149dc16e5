"""Questions from the numbers of a series: stiffness, frequency, and x against y."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lobewatch.machine.folder_updates import add_event, exclude_entry
from lobewatch.measurement.series_questions import (
    EarlierTest,
    SeriesReference,
    check_same_direction,
    check_series,
    expect_direction_difference,
    expect_stiffness,
)
from modal import Mode
from tests.lobewatch.conftest import Shop

START = datetime(2026, 1, 15, 9, tzinfo=UTC)
Values = tuple[float, float]
F, K = 1000.0, 2e7


def series(*values: Values, level: int | None = None, hours: float = 0.0) -> tuple[EarlierTest, ...]:
    """Return monthly tests of these frequencies and stiffnesses; level: number of the test that begins a new one."""
    return tuple(
        EarlierTest(START + timedelta(days=30 * number, hours=hours), f, k, number == level)
        for number, (f, k) in enumerate(values)
    )


def asked(f: float, k: float, own: tuple[EarlierTest, ...], across: tuple[EarlierTest, ...] = ()) -> list[str]:
    return [remark.code for remark in check_series(Mode(f, 0.03, k), SeriesReference(own, across))]


def scattered(n: int, std: float) -> list[Values]:
    """Return n tests that alternate by a standard deviation of successive changes."""
    return [(F, K * np.exp(std * (-1) ** i / np.sqrt(2))) for i in range(n)]


@pytest.mark.quick
@pytest.mark.parametrize(("ratio", "is_asked"), [(1.11, False), (1.13, True), (1 / 1.11, False), (1 / 1.13, True)])
def test_a_quiet_series_asks_beyond_twelve_percent(ratio: float, is_asked: bool) -> None:
    own = series(*[(F, K)] * 40)
    assert asked(F, K * ratio, own) == (["stiffness-jump"] if is_asked else [])


@pytest.mark.quick
def test_the_limit_follows_the_scatter_of_the_series() -> None:
    reference = SeriesReference(series(*scattered(200, 0.06)))
    expected = expect_stiffness(reference, F)
    assert expected is not None
    changes = 1.4826 * 0.06  # successive changes are all sqrt(2) std, their standard deviation is taken as 1.48 of that
    assert expected.limit == pytest.approx(4 * changes, rel=0.02)
    assert expected.value == pytest.approx(K, rel=0.05)


@pytest.mark.quick
def test_the_median_of_the_series_counts_and_not_the_newest_test() -> None:
    drift = series(*[(F, K * 1.02**i) for i in range(12)])
    expected = expect_stiffness(SeriesReference(drift), F)
    assert expected is not None
    assert expected.value == pytest.approx(K * 1.02**5.5, rel=1e-6)


@pytest.mark.quick
def test_a_single_test_moves_nothing() -> None:
    expected = expect_stiffness(SeriesReference(series(*[(F, K)] * 9, (F, 1.1 * K))), F)
    assert expected is not None
    assert expected.value == pytest.approx(K, rel=1e-12)


@pytest.mark.quick
@pytest.mark.parametrize("exponent", [0.1, 2.0, 3.8])
def test_worn_bearings_change_the_stiffness_and_ask_nothing(exponent: float) -> None:
    worn = [(F * w, K * w**exponent) for w in np.linspace(1, 0.9, 24)]
    assert not any(asked(*values, series(*worn[:i])) for i, values in enumerate(worn))


@pytest.mark.quick
def test_a_gain_is_asked_about_on_worn_bearings_too() -> None:
    worn = [(F * w, K * w**0.5) for w in np.linspace(1, 0.9, 12)]
    f, k = worn[-1]
    for gain in (1.4, 1 / 1.4):
        assert asked(f, k * gain, series(*worn[:-1])) == ["stiffness-jump"]


@pytest.mark.quick
def test_two_steps_are_asked_both_times_and_an_answer_begins_a_level() -> None:
    first = [(F, K)] * 6
    assert asked(F, 1.4 * K, series(*first)) == ["stiffness-jump"]
    after = [*first, (F, 1.4 * K)]
    assert asked(F, 1.96 * K, series(*after)) == ["stiffness-jump"]
    accepted = series(*after, level=6)
    assert asked(F, 1.4 * K, accepted) == []
    assert asked(F, 1.96 * K, accepted) == ["stiffness-jump"]
    assert asked(F, K, accepted) == ["stiffness-jump"]


@pytest.mark.quick
@pytest.mark.parametrize("honest", [1, 3, 6])
@pytest.mark.parametrize("step", [1.25, 1.4, 1.1, 1 / 1.25, 1 / 1.1])
def test_a_gain_in_five_steps_is_asked_about_from_the_second_test_on(honest: int, step: float) -> None:
    values = [(F, K * np.exp(0.02 * (-1) ** i) * step ** min(max(i - honest + 1, 0), 5)) for i in range(honest + 8)]
    tests: list[Values] = []
    silent = 0
    for value in values:  # both directions change alike, and tests in question are no reference
        codes = asked(*value, series(*tests), series(*tests, hours=1))
        tests += [] if codes else [value]
        silent += not codes
    assert silent < len(values)


@pytest.mark.quick
def test_small_steps_are_asked_against_the_first_tests() -> None:
    steps = series(*[(F, K * 1.02**i) for i in range(9)])
    assert asked(F, K * 1.02**5, steps[:5]) == []
    expected = expect_stiffness(SeriesReference(steps), F)
    assert expected is not None
    assert not expected.is_beyond(K * 1.02**9)
    assert asked(F, K * 1.02**9, steps) == ["stiffness-jump"]


@pytest.mark.quick
@pytest.mark.parametrize("n", [2, 5, 12])
def test_a_young_series_cannot_raise_its_own_limit(n: int) -> None:
    wild = series(*scattered(n, 0.3))
    expected = expect_stiffness(SeriesReference(wild, wild), F)
    assert expected is not None
    assert expected.limit <= 4 * 0.06 * np.sqrt(2)


@pytest.mark.quick
def test_the_slope_stays_within_models_of_spindles() -> None:
    steep = series(*[(F * w, K * w**9) for w in np.linspace(1, 0.95, 12)])
    expected = expect_stiffness(SeriesReference(steep), 0.9 * F)
    middle = float(np.median([test.frequency for test in steep]))
    assert expected is not None
    assert expected.value == pytest.approx(K * (middle / F) ** 9 * (0.9 * F / middle) ** 3.9, rel=2e-3)


@pytest.mark.quick
@pytest.mark.parametrize(("rise", "is_asked"), [(0.12, True), (0.052, True), (0.048, False), (-0.14, False)])
def test_a_rise_asks_for_the_tool_and_a_fall_does_not(rise: float, is_asked: bool) -> None:
    values = F * (1 + rise), K * (1 + rise) ** 3
    assert asked(*values, series(*[(F, K)] * 8)) == (["frequency-jump"] if is_asked else [])


@pytest.mark.quick
def test_a_rise_is_one_beyond_the_recent_tests() -> None:
    worn = [(F * w, K) for w in [1.0] * 6 + [0.9] * 5]
    assert asked(F * 0.97, K, series(*worn)) == ["frequency-jump"]
    assert asked(F * 0.94, K, series(*worn)) == []


@pytest.mark.quick
def test_a_series_that_is_reclamped_badly_asks_later() -> None:
    wild = [(F * np.exp(0.015 * (-1) ** i), K) for i in range(60)]
    assert asked(F * 1.12, K * 1.25, series(*wild)) == []
    assert asked(F * 1.25, K * 1.9, series(*wild)) == ["frequency-jump"]


@pytest.mark.quick
@pytest.mark.parametrize(
    ("f", "ratio", "is_asked"), [(1.01, 1.9, False), (1.01, 2.1, True), (0.99, 1 / 2.1, True), (1.2, 3.0, False)]
)
def test_the_first_test_of_a_direction_is_compared_with_the_other(f: float, ratio: float, is_asked: bool) -> None:
    across = series((F, K), (F, 1.05 * K))
    assert asked(f * F, 1.025 * ratio * K, (), across) == (["direction-stiffness"] if is_asked else [])


@pytest.mark.quick
def test_nothing_is_compared_without_force_or_earlier_tests() -> None:
    free = [(F, np.nan)] * 3
    assert asked(F, K, series(*free)) == []
    assert asked(F, K, ()) == []
    mode = Mode(F, 0.03, np.nan, relative_peak=1.0)
    assert [*check_series(mode, SeriesReference(series((F, K))))] == []


@given(st.floats(1e-3, 1e3), st.floats(1e-6, 1e6), st.lists(st.floats(0.7, 1.4), min_size=2, max_size=8))
def test_units_change_no_question(hertz: float, newton: float, ratios: list[float]) -> None:
    values = [(F * ratio**0.2, K * ratio) for ratio in ratios]
    *earlier, now = values
    scaled = [(f * hertz, k * newton) for f, k in earlier]
    a, b = (
        expect_stiffness(SeriesReference(series(*each)), f) for each, f in ((earlier, now[0]), (scaled, now[0] * hertz))
    )
    assert a is not None
    assert b is not None
    assert (b.value / newton, b.limit) == pytest.approx((a.value, a.limit), rel=1e-6)


def same_direction(change: float, own: list[float], *others: float, error: float = 3e-5) -> bool:
    """Return whether y raises the question; own: differences of y and x on earlier days; others: weaker modes."""
    covariance = np.diag([error * F, 1e-4, 1e5]) ** 2
    now = Mode(F * (1 + change), 0.03, K, covariance=covariance)
    weaker = [
        Mode(3 * F * (1 + other), 0.03, 3 * K, covariance=np.diag([3 * error * F, 1, 1]) ** 2) for other in others
    ]
    y = series(*[(F * (1 + difference), K) for difference in own], hours=1)
    x = series(*[(F, K)] * (len(own) + 1))
    reference = SeriesReference(y, x, (F, 3 * F))
    return check_same_direction(now, [now, *weaker], reference) is not None


@pytest.mark.quick
@pytest.mark.parametrize(
    ("change", "own", "is_asked"),
    [
        (3e-5, [], True),
        (-3e-5, [], True),
        (1e-3, [], False),
        (0.0, [], False),
        (3e-5, [0.013, 0.014, 0.013, 0.0135], True),
        (3e-5, [0.001], False),
        (3e-5, [0.001, -0.0013, 0.0002, -0.0004, 0.002], False),
        (0.0134, [0.013, 0.014, 0.013, 0.0135], False),
        (4e-5, [2.8e-4] * 22, False),
        (-4e-5, [2.8e-4] * 22, True),
    ],
)
def test_y_that_repeats_x_is_asked_about_unless_both_are_always_alike(
    change: float, own: list[float], is_asked: bool
) -> None:
    assert same_direction(change, own) is is_asked


@pytest.mark.quick
def test_a_mode_that_differs_is_another_direction() -> None:
    assert same_direction(3e-5, [], 2e-5)
    assert not same_direction(3e-5, [], 2e-3)
    assert not same_direction(3e-5, [], 2e-5, 0.02)


@pytest.mark.quick
def test_a_noisy_test_cannot_tell() -> None:
    assert not same_direction(0.0, [], error=1e-3)
    assert not same_direction(0.0, [], error=np.nan)


@pytest.mark.quick
def test_the_difference_of_x_and_y_is_learned_from_days_with_both() -> None:
    days, y = series(*[(F, K)] * 5), series(*[(F * np.exp(0.02), K)] * 5, hours=3)
    centre, std = expect_direction_difference(SeriesReference(y, days))
    assert centre == pytest.approx(0.02)
    assert std == pytest.approx(0.02 * np.sqrt(2 / 7))
    apart = series(*[(F * np.exp(0.02), K)] * 5, hours=30)
    assert expect_direction_difference(SeriesReference(apart, days)) == (0.0, 0.05)


def questions(shop: Shop) -> list[list[str]]:
    return [[remark.code for remark in row.questions] for row in shop.logbook.history.rows]


def test_a_series_in_a_folder_asks_and_remembers_answers(shop: Shop) -> None:
    shop.put("")
    for month in range(4):
        shop.tap_both(30 * month, 1 - 0.002 * month)
    assert questions(shop) == [[]] * 8
    changed = shop.tap(120, 1713.0 * 0.992, stiffness=1.45 * 3.5e7)
    again = shop.tap(150, 1713.0 * 0.990, stiffness=1.45 * 3.5e7)
    assert questions(shop)[8:] == [["stiffness-jump"]] * 2
    shop.folder.accept(changed, "stiffness-jump")
    assert questions(shop)[8:] == [[]] * 2
    shop.tap(180, 1713.0 * 0.988, stiffness=3.5e7)
    shop.tap(210, 1713.0 * 0.988 * 1.12, stiffness=1.45 * 1.45 * 3.5e7)
    assert questions(shop)[10:] == [["stiffness-jump"], ["frequency-jump"]]
    assert again != changed


def test_an_excluded_test_is_no_reference_and_rows_stay_as_computed_from_the_start(shop: Shop) -> None:
    shop.put("")
    ids = [shop.tap(30 * month, 1713.0, stiffness=3.5e7 * (1.45 if month < 3 else 1.0)) for month in range(6)]
    before = questions(shop)
    assert before[3:] == [["stiffness-jump"]] * 3
    for tap_id in ids[:3]:
        exclude_entry(shop.folder, tap_id, "wrong range")
    assert questions(shop) == [[]] * 3
    shop.folder.history_path.unlink()
    assert questions(shop) == [[]] * 3


def test_a_new_baseline_allows_a_rise(shop: Shop) -> None:
    shop.put("")
    shop.tap(0, 1713.0)
    add_event(shop.folder, "bearings replaced", START + timedelta(days=20), new_baseline=True)
    shop.tap(30, 1.12 * 1713.0, stiffness=1.45 * 3.5e7)
    assert questions(shop) == [[], []]


def test_a_sensor_left_in_x_is_asked_about_in_a_folder(shop: Shop) -> None:
    shop.put("")
    shop.tap_both(0)
    shop.tap(30, 1713.0)
    shop.tap(30.1, 1713.0 * (1 + 2e-5), "y")
    assert questions(shop) == [[], [], [], ["same-direction"]]
