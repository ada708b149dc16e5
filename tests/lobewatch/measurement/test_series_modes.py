"""Questions from all modes of a series: another spindle, exchanged directions, unstated window."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lobewatch.measurement.recording_questions import check_followed_band
from lobewatch.measurement.series_modes import (
    MAX_MODE_FALL,
    check_common_damping,
    check_exchanged_directions,
    check_other_modes,
    check_other_stiffness,
    find_series_questions,
)
from lobewatch.measurement.series_questions import EarlierTest, SeriesReference
from modal import Mode

START = datetime(2026, 1, 15, 9, tzinfo=UTC)
TOOL, SPINDLE = (1500.0, 0.03, 1e7), (700.0, 0.02, 4e7)
Values = tuple[float, float, float]
pytestmark = pytest.mark.quick


def months_of(modes: Sequence[Values], count: int = 6, scatter: float = 0.0, seed: int = 0) -> tuple[EarlierTest, ...]:
    """Return monthly tests of these modes, whose frequencies scatter together."""
    factors = np.exp(scatter * np.random.default_rng(seed).standard_normal(count))
    return tuple(
        EarlierTest(
            START + timedelta(days=30 * number),
            factor * modes[0][0],
            modes[0][2],
            modes=tuple((factor * f, zeta, stiffness, 0.0) for f, zeta, stiffness in modes),
        )
        for number, factor in enumerate(factors)
    )


def of(*modes: Values) -> list[Mode]:
    return [Mode(*values) for values in modes]


def moved(values: Values, ratio: float) -> Values:
    return values[0] * ratio, *values[1:]


@pytest.mark.parametrize("ratio", [1.07, 1.3, 0.88, 0.6])
@pytest.mark.parametrize("count", [1, 6])
def test_a_spindle_mode_elsewhere_is_asked_about_although_the_tool_is_the_same(ratio: float, count: int) -> None:
    now = of(TOOL, moved(SPINDLE, ratio))
    asked = find_series_questions(now[0], now, SeriesReference(months_of((TOOL, SPINDLE), count)))
    assert [remark.code for remark in asked] == ["mode-jump"]


@pytest.mark.parametrize("ratio", [1.04, 1 - MAX_MODE_FALL + 0.01])
def test_warmth_and_wear_of_another_mode_ask_nothing(ratio: float) -> None:
    assert check_other_modes(of(TOOL, moved(SPINDLE, ratio)), SeriesReference(months_of((TOOL, SPINDLE)))) is None


@pytest.mark.parametrize("now", [[TOOL], [TOOL, (700.0, 0.02, 4e9)], [TOOL, SPINDLE, (1000.0, 0.02, 3e7)]])
def test_a_mode_that_is_only_gone_weak_or_only_new_asks_nothing(now: list[Values]) -> None:
    assert check_other_modes(of(*now), SeriesReference(months_of((TOOL, SPINDLE)))) is None


def test_a_fall_of_all_modes_is_that_of_the_followed_one() -> None:
    now = of(moved(TOOL, 0.87), moved(SPINDLE, 0.87))
    assert find_series_questions(now[0], now, SeriesReference(months_of((TOOL, SPINDLE)))) == ()


def test_a_mode_that_not_all_recent_tests_have_asks_nothing() -> None:
    tests = (*months_of((TOOL,), 1), *months_of((TOOL, SPINDLE), 3))
    assert check_other_modes(of(TOOL, moved(SPINDLE, 1.3)), SeriesReference(tests)) is None


def test_a_spindle_mode_beside_that_of_the_tool_is_not_taken_for_it() -> None:
    now = of(TOOL, moved(SPINDLE, 1430 / SPINDLE[0]))
    asked = find_series_questions(now[0], now, SeriesReference(months_of((TOOL, SPINDLE))))
    assert [(remark.code, remark.about) for remark in asked] == [("mode-jump", "1430 Hz")]


@pytest.mark.parametrize(
    ("band", "is_asked"), [((50.0, 1400.0), True), ((1600.0, 4000.0), True), ((50.0, 1500.0), False), (None, False)]
)
def test_a_followed_mode_out_of_the_usable_band_is_asked_about(
    band: tuple[float, float] | None, is_asked: bool
) -> None:
    asked = check_followed_band(Mode(*TOOL), band)
    assert [remark.code for remark in [asked] if remark] == ["other-band"] * is_asked


def test_an_earlier_mode_that_is_gone_is_not_the_one_beside_it() -> None:
    tests = months_of((TOOL, (1450.0, 0.02, 1e7)))
    asked = check_other_modes(of(TOOL, (900.0, 0.02, 1e7)), SeriesReference(tests))
    assert asked is not None
    assert asked.about == "900 Hz"


def stiffer(values: Values, ratio: float) -> Values:
    return *values[:2], values[2] * ratio


@pytest.mark.parametrize(("ratio", "is_asked"), [(1.35, True), (0.7, True), (1.15, False), (1.0, False)])
def test_the_stiffness_of_another_mode_is_asked_about(ratio: float, is_asked: bool) -> None:
    now = of(SPINDLE, stiffer(TOOL, ratio))
    asked = find_series_questions(now[0], now, SeriesReference(months_of((SPINDLE, TOOL))))
    assert [(remark.code, remark.about) for remark in asked] == [("stiffness-jump", "1500 Hz")] * is_asked


def test_the_stiffness_of_another_mode_needs_three_tests_a_strong_mode_and_its_frequency() -> None:
    now = of(SPINDLE, stiffer(TOOL, 1.5))
    few, enough = (SeriesReference(months_of((SPINDLE, TOOL), count)) for count in (2, 3))
    assert check_other_stiffness(now, few) is None
    assert check_other_stiffness(now, enough) is not None
    weak = stiffer(SPINDLE, 5.0)
    assert check_other_stiffness(of(TOOL, stiffer(weak, 1.5)), SeriesReference(months_of((TOOL, weak)))) is None
    elsewhere = moved(stiffer(TOOL, 1.5), 1.06)
    assert check_other_stiffness(of(SPINDLE, elsewhere), SeriesReference(months_of((SPINDLE, TOOL)))) is None


def test_a_stiffness_that_scatters_in_the_other_direction_raises_the_limit() -> None:
    scatter = np.exp(0.2 * np.random.default_rng(2).standard_normal(30))
    across = tuple(months_of((SPINDLE, stiffer(TOOL, by)), 1)[0] for by in scatter)
    now, own = of(SPINDLE, stiffer(TOOL, 1.35)), months_of((SPINDLE, TOOL), 3)
    assert check_other_stiffness(now, SeriesReference(own)) is not None
    assert check_other_stiffness(now, SeriesReference(own, across)) is None


def test_the_stiffness_scatter_of_all_modes_counts() -> None:
    scatter = np.exp(0.3 * np.random.default_rng(3).standard_normal(20))
    others = SPINDLE, (1000.0, 0.02, 3e7), (2200.0, 0.02, 2e7)
    own = tuple(months_of((*(stiffer(other, by) for other in others), TOOL), 1)[0] for by in scatter)
    now = of(*others, stiffer(TOOL, 1.35))
    assert check_other_stiffness(now, SeriesReference(own)) is None
    assert check_other_stiffness(now, SeriesReference(months_of((*others, TOOL), 20))) is not None


@given(seed=st.integers(0, 2**32 - 1), first=st.floats(-0.08, 0.08), second=st.floats(-0.08, 0.08))
def test_exchanged_directions_are_asked_about_and_right_ones_are_not(seed: int, first: float, second: float) -> None:
    other = (moved(TOOL, np.exp(first)), moved(SPINDLE, np.exp(second)))
    x, y = (months_of(modes, 6, 0.003, seed) for modes in ((TOOL, SPINDLE), other))
    right = SeriesReference(x, y, tuple(f for f, *_ in other))
    wrong = SeriesReference(x, y, (TOOL[0], SPINDLE[0]))
    assert check_exchanged_directions(of(TOOL, SPINDLE), right) is None
    asked = check_exchanged_directions(of(*other), wrong)
    if max(abs(first), abs(second)) > 0.003:
        assert asked is not None
    if max(abs(first), abs(second)) < 0.0005:
        assert asked is None


def test_directions_that_differ_otherwise_are_not_exchanged() -> None:
    x, y = months_of((TOOL,)), months_of((moved(TOOL, 1.02),))
    for ratio in (1.0, 1.01, 0.94):
        assert check_exchanged_directions(of(moved(TOOL, ratio)), SeriesReference(x, y, (TOOL[0],))) is None
    assert check_exchanged_directions(of(moved(TOOL, 1.02)), SeriesReference(x, y, (TOOL[0],))) is not None


@pytest.mark.parametrize("count", [3, 6])
def test_the_difference_that_shows_exchanged_directions_is_that_of_student(count: int) -> None:
    """Closed form without scatter: n + 1 degrees of freedom, and a prior of two days with 0.001."""
    limit = np.sqrt(2 * 0.001**2 * (1 + 1 / count) / 4 * (1000 ** (2 / (count + 2)) - 1))
    for share, is_asked in ((0.98, False), (1.02, True)):
        other = moved(TOOL, np.exp(share * limit))
        days = months_of((other,), count), months_of((TOOL,), count)
        asked = check_exchanged_directions(of(TOOL), SeriesReference(*days, (other[0],)))
        assert (asked is not None) == is_asked


def test_modes_too_far_from_each_other_are_not_compared_over_directions() -> None:
    days = months_of((TOOL,)), months_of((moved(TOOL, 1.3),))
    assert check_exchanged_directions(of(moved(TOOL, 1.3)), SeriesReference(*days, (TOOL[0],))) is None


def damped(rise: float, factor: float = 1.0) -> list[Mode]:
    """Return the modes with all decay rates times a factor and raised by a constant (1/s)."""
    return [Mode(f, factor * zeta + rise / (2 * np.pi * f), stiffness) for f, zeta, stiffness in (TOOL, SPINDLE)]


@pytest.mark.parametrize(("rise", "is_asked"), [(30.0, True), (1.0, False), (-30.0, False)])
def test_a_constant_rise_of_all_decay_rates_is_an_unstated_window(rise: float, is_asked: bool) -> None:
    asked = check_common_damping(damped(rise), SeriesReference(months_of((TOOL, SPINDLE))))
    assert (asked is not None) == is_asked
    assert asked is None or "all modes decay faster by 30 1/s, as with an exponential window of 33.3 ms" in str(asked)


@pytest.mark.parametrize("count", [6, 20])
def test_the_rise_that_is_asked_about_is_that_of_student(count: int) -> None:
    """Closed form without scatter: 0.03 / sqrt(n) sqrt(1 + 1/n) times Student's limit of n degrees of freedom."""
    weights = np.array([(f * zeta) ** -2 for f, zeta, _ in (TOOL, SPINDLE)])
    rates = np.array([2 * np.pi * f * zeta for f, zeta, _ in (TOOL, SPINDLE)])
    limit = np.sqrt(count * np.expm1(3.8**2 / (count + 1))) * 0.03 / np.sqrt(count) * np.sqrt(1 + 1 / count)
    reference = SeriesReference(months_of((TOOL, SPINDLE), count))
    rise = limit * float(rates @ weights / np.sum(weights))
    assert check_common_damping(damped(0.98 * rise), reference) is None
    assert check_common_damping(damped(1.02 * rise), reference) is not None


def test_a_window_that_comes_and_goes_raises_the_limit() -> None:
    rises = 25.0 * np.random.default_rng(4).standard_normal(8)
    tests = tuple(
        months_of([(mode.frequency, mode.damping_ratio, mode.stiffness) for mode in damped(rise)], 1)[0]
        for rise in rises
    )
    assert check_common_damping(damped(30.0), SeriesReference(tests)) is None


def test_a_window_raises_all_modes() -> None:
    def raised(*rises: float) -> list[Mode]:
        modes = zip((TOOL, SPINDLE), rises, strict=True)
        return [Mode(f, zeta + rise / (2 * np.pi * f), stiffness) for (f, zeta, stiffness), rise in modes]

    reference = SeriesReference(months_of((TOOL, SPINDLE), 20))
    assert check_common_damping(raised(0.1, 3.9), reference) is not None
    assert check_common_damping(raised(-0.1, 3.9), reference) is None


def test_damping_raised_by_a_share_or_in_one_mode_is_no_window() -> None:
    reference = SeriesReference(months_of((TOOL, SPINDLE)))
    assert check_common_damping(damped(0.0, factor=1.6), reference) is None
    assert check_common_damping([damped(30.0)[0], Mode(*SPINDLE)], reference) is None
    assert check_common_damping([Mode(*TOOL), damped(30.0)[1]], reference) is None


def test_a_window_needs_three_tests_the_same_frequencies_and_two_modes() -> None:
    few, enough = (SeriesReference(months_of((TOOL, SPINDLE), count)) for count in (2, 3))
    assert check_common_damping(damped(30.0), few) is None
    assert check_common_damping(damped(30.0), enough) is not None
    assert check_common_damping(damped(30.0)[:1], enough) is None
    shifted = [Mode(1.03 * mode.frequency, mode.damping_ratio, mode.stiffness) for mode in damped(30.0)]
    assert check_common_damping(shifted, enough) is None


def test_the_limit_follows_the_scatter_of_the_damping() -> None:
    scatter = np.exp(0.3 * np.random.default_rng(1).standard_normal((12, 2)))
    tests = [
        test._replace(
            modes=tuple((f, zeta * by, k, 0.0) for (f, zeta, k), by in zip((TOOL, SPINDLE), row, strict=True))
        )
        for test, row in zip(months_of((TOOL, SPINDLE), 12), scatter, strict=True)
    ]
    assert check_common_damping(damped(30.0), SeriesReference(tuple(tests))) is None
