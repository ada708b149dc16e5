"""Speed variation, on signals with known variation."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.cuts.chatter_detection.peak_classification import estimate_unsteadiness
from lobewatch.cuts.chatter_detection.spectrum import compute_spectrum, find_peaks
from lobewatch.cuts.chatter_detection.tooth_passing_comb import SpindleSpeed

Floats = NDArray[np.float64]
RATE, SECONDS, TURN = 25600.0, 1.2, 200.0
STEADY = SpindleSpeed(TURN, 1e-3, 1.0, 5, 0.0)
ORDERS = {4: 10.0, 8: 8.0, 12: 6.0, 16: 5.0, 20: 4.0}
"""Multiples with their amplitudes (m/s^2)."""
LEAST, MOST = 1e-4, 2e-3


def wavers(
    change: Callable[[Floats], Floats], beside: Mapping[float, float], orders: Mapping[int, float] = ORDERS
) -> float:
    """Estimate the unsteadiness of a speed that changes as a function of time (s); beside: other peaks."""
    time = np.arange(round(RATE * SECONDS)) / RATE
    turned = 2 * np.pi * TURN * np.cumsum(1 + change(time)) / RATE
    signal = np.random.default_rng(7).normal(scale=0.01, size=time.size)
    signal += sum(loud * np.sin(order * turned + order) for order, loud in orders.items())
    signal += sum(loud * np.sin(2 * np.pi * frequency * time) for frequency, loud in beside.items())
    spectrum = compute_spectrum(signal, RATE)
    return estimate_unsteadiness(signal, RATE, find_peaks(spectrum), STEADY, spectrum.bin_width)


def step(change: float, quarter: int) -> Callable[[Floats], Floats]:
    """Change the speed in one quarter of the cut."""
    return lambda time: np.where(np.floor(4 * time / SECONDS) == quarter, change, 0.0)


@pytest.mark.parametrize("quarter", range(4))
@pytest.mark.parametrize("change", [-3e-4, 1.5e-4, 5e-4])
def test_a_speed_wavers_by_three_times_the_largest_change_of_a_quarter(change: float, quarter: int) -> None:
    assert wavers(step(change, quarter), {}) == pytest.approx(3 * abs(change), rel=0.03)


def test_a_steady_spindle_wavers_by_what_every_spindle_does_and_none_by_more_than_is_looked_for() -> None:
    assert wavers(np.zeros_like, {}) == LEAST
    assert wavers(step(1.2e-3, 2), {}) == MOST


def test_lines_that_lie_too_far_from_multiples_are_not_taken_for_them() -> None:
    """Peaks of a shaft that turns 0.15 % faster, louder than the multiples, up to 2 % of order 28."""
    shaft = {1.0015 * TURN * order: 30.0 for order in range(21, 29) if order % 4}
    assert wavers(np.zeros_like, shaft) == LEAST


def test_multiples_that_do_not_agree_are_no_change_of_speed() -> None:
    """Lines within a bin of multiples, each off by as much, up and down in turn: modes, not the spindle."""
    near = {TURN * order * (1 + sign * 3e-4): 30.0 for order, sign in zip(range(5, 13, 1), [1, -1] * 4, strict=True)}
    assert wavers(np.zeros_like, near) == LEAST


def test_multiples_of_a_spindle_that_wavers_all_along_lie_further_away() -> None:
    """Turning 5e-4 faster than it was taken for, with lines more than a bin away from its multiples."""
    assert wavers(lambda time: np.full(time.size, 5e-4), {}, {12: 6.0, 16: 5.0, 20: 4.0}) == pytest.approx(
        1.5e-3, rel=0.01
    )


@pytest.mark.parametrize(("orders", "is_heard"), [((2, 3, 4), True), ((1, 2, 3), False), ((4, 8), False)])
def test_three_multiples_must_have_changed_alike_and_the_first_is_that_of_air(
    orders: tuple[int, ...], is_heard: bool
) -> None:
    wavering = wavers(step(1e-3, 1), {}, dict.fromkeys(orders, 10.0))
    assert (wavering > 5 * LEAST) is is_heard
    assert (wavering == LEAST) is not is_heard


def test_chatter_as_far_from_some_multiples_all_along_is_no_change_of_speed() -> None:
    """Six of eight lines, 7e-4 above their multiples in all quarters, while the others are exact."""
    near = {TURN * order * 1.0007: 30.0 for order in (23, 24, 27, 28, 29, 31)}
    assert wavers(np.zeros_like, near, {4: 50.0, 5: 50.0}) == LEAST
