"""Frequencies of one mode over the hits: constant, drift, change with force, two states."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modal import HitChangeKind
from modal.frequency_series import FrequencyChange, find_frequency_change

NUMBER = np.arange(10)
ERROR = np.full(10, 0.01)
FORCE = np.array([210.0, 330, 160, 290, 240, 180, 310, 200, 270, 250])


def noise(seed: int, count: int = 10) -> np.ndarray:
    return 0.01 * np.random.default_rng(seed).normal(size=count)


def change_of(frequency: np.ndarray) -> FrequencyChange:
    change = find_frequency_change(NUMBER, frequency, ERROR, FORCE)
    assert change is not None
    return change


def test_a_line_over_hit_number_is_a_drift_from_the_first_hit_to_the_last() -> None:
    change = change_of(500 - 0.02 * NUMBER)
    assert change.kind is HitChangeKind.DRIFT
    assert change.spread == pytest.approx(-0.18)
    assert change.spread_std == pytest.approx(0.01 / np.std(NUMBER / 9) / np.sqrt(10))


def test_a_line_over_force_is_a_change_from_the_softest_hit_to_the_hardest() -> None:
    change = change_of(500 - 0.002 * FORCE)
    assert change.kind is HitChangeKind.FORCE
    assert change.spread == pytest.approx(-0.002 * np.ptp(FORCE))


@pytest.mark.parametrize("upper", [[1, 3, 5, 7, 9], [7, 8, 9], [0, 4]])
def test_two_values_are_two_states_with_their_hits(upper: list[int]) -> None:
    change = change_of(500 + 0.3 * np.isin(NUMBER, upper))
    assert change.kind is HitChangeKind.TWO_STATES
    assert change.spread == pytest.approx(0.3)
    assert set(np.flatnonzero(change.smaller_state)) in ({*upper}, {*NUMBER} - {*upper})
    assert np.count_nonzero(change.smaller_state) <= 5


def test_values_in_no_order_are_scatter() -> None:
    change = change_of(500 + np.array([0.0, 0.3, 0.1, 0.4, 0.2, 0.05, 0.35, 0.15, 0.25, 0.1]))
    assert change.kind is HitChangeKind.SCATTER
    assert change.spread == pytest.approx(0.4)


@pytest.mark.parametrize("count", [4, 6, 10, 20])
def test_errors_are_no_change(count: int) -> None:
    force = 150 + 200 * np.random.default_rng(count).uniform(size=count)
    series = [500 + noise(seed, count) for seed in range(300)]
    found = [find_frequency_change(np.arange(count), f, np.full(count, 0.01), force) for f in series]
    assert found == [None] * 300


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.floats(0.1, 10), st.floats(-100, 100))
def test_kind_and_spread_follow_scale_offset_and_order(seed: int, scale: float, offset: float) -> None:
    frequency = 500 - 0.05 * NUMBER + noise(seed)
    change = change_of(frequency)
    scaled = find_frequency_change(NUMBER, scale * frequency + offset, scale * ERROR, FORCE)
    backwards = find_frequency_change(NUMBER, frequency[::-1], ERROR, FORCE[::-1])
    assert scaled is not None
    assert backwards is not None
    assert change.kind is scaled.kind is backwards.kind is HitChangeKind.DRIFT
    assert scaled.spread == pytest.approx(scale * change.spread)
    assert backwards.spread == pytest.approx(-change.spread)
