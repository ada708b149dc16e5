"""Hits that find the machine in different states: one mode whose interval holds every state that was met."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import t

from acquisition import Hit, Remark, estimate_frf
from modal import Mode, Trust, assess_trust, fit_decays, fit_modes, match_modes, synthesize_frf, trust_rules
from modal.hit_scatter import single_hit_factors

RATE, SAMPLES, HITS = 12800.0, 6400, 10
FREQUENCY, STIFFNESS = 1500.0, 3e7


def make_hit(modes: Sequence[Mode], peak: float, random: np.random.Generator) -> Hit:
    """Half-sine squared pulse of 0.3 ms and white noise on both channels."""
    time = np.arange(SAMPLES) / RATE - 0.01
    force = peak * np.where((time > 0) & (time < 3e-4), np.sin(np.pi * time / 3e-4) ** 2, 0.0)
    frequency = np.fft.rfftfreq(2 * SAMPLES, 1 / RATE)[1:]
    transfer = np.concatenate([[0.0], synthesize_frf(modes, frequency).accelerance])
    response = np.fft.irfft(transfer * np.fft.rfft(force, 2 * SAMPLES))[:SAMPLES]
    return Hit(force + random.normal(0, 0.05, SAMPLES), response + random.normal(0, 0.5, SAMPLES), RATE)


def tap(shifts: Sequence[float], zeta: float, seed: int, other: float = 0.0) -> list[Hit]:
    """Return hits whose mode is off by these numbers of half-widths; other: ratio of a second mode's frequency."""
    random = np.random.default_rng(seed)
    hits = []
    for shift in shifts:
        factor = 1 + zeta * shift
        far = [
            Mode(factor * 2600.0, zeta, 9e8),
            *([Mode(factor * other * FREQUENCY, zeta, STIFFNESS)] if other else []),
        ]
        hits.append(make_hit([Mode(factor * FREQUENCY, zeta, STIFFNESS), *far], random.uniform(150, 350), random))
    return hits


def near(hits: list[Hit]) -> list[Mode]:
    return [mode for mode in fit_modes(estimate_frf(hits), hits=hits) if abs(mode.frequency / FREQUENCY - 1) < 0.1]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("shifts", "zeta"),
    [
        (np.linspace(0, -1, HITS).tolist(), 0.01),
        (np.linspace(0, -2, HITS).tolist(), 0.01),
        (HITS // 2 * [0.0, -1.0], 0.012),
        (HITS // 2 * [0.0, -1.6], 0.02),
    ],
    ids=["drift of one half-width", "drift of two", "two states", "two states far apart"],
)
def test_what_moves_from_hit_to_hit_is_one_mode_that_holds_every_state(
    shifts: list[float], zeta: float, seed: int
) -> None:
    (mode,) = near(tap(shifts, zeta, seed))
    assert assess_trust(mode) is not Trust.REJECTED
    limits = mode.interval()
    for shift in shifts:
        assert limits[0, 0] < FREQUENCY * (1 + zeta * shift) < limits[0, 1]
    assert limits[1, 0] < zeta < limits[1, 1]
    assert limits[2, 0] < STIFFNESS < limits[2, 1]
    assert {"uneven-peak", "scatter"} & {remark.code for remark in mode.remarks}


def test_hits_of_a_machine_at_rest_have_narrow_errors_and_no_remark() -> None:
    for seed in range(4):
        (mode,) = near(tap(HITS * [0.0], 0.01, seed))
        assert not mode.remarks
        assert mode.standard_error[0] < 2e-3 * 0.01 * FREQUENCY
        assert mode.quantile() == pytest.approx(t.ppf(0.975, HITS - 1))


@pytest.mark.parametrize(("ratio", "zeta"), [(1.02, 0.01), (1.03, 0.03)])
def test_two_modes_that_every_hit_has_stay_two(ratio: float, zeta: float) -> None:
    for seed in range(3):
        found = near(tap(HITS * [0.0], zeta, seed, ratio))
        assert [mode.frequency / FREQUENCY for mode in found] == pytest.approx([1.0, ratio], rel=1e-3)
        assert all(assess_trust(mode) is Trust.TRUSTED for mode in found)


def near_decays(hits: list[Hit]) -> list[Mode]:
    start = round(0.0105 * RATE)
    found = fit_decays([hit.acceleration[start:] for hit in hits], RATE, (300.0, 0.4 * RATE))
    return [mode for mode in found if abs(mode.frequency / FREQUENCY - 1) < 0.1]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "shifts", [np.linspace(0, -1, HITS).tolist(), HITS // 2 * [0.0, -1.0]], ids=["drift", "states"]
)
def test_decays_of_what_moves_from_hit_to_hit_are_one_mode_that_holds_every_state(
    shifts: list[float], seed: int
) -> None:
    (mode,) = near_decays(tap(shifts, 0.01, seed))
    low, high = mode.interval()[0]
    assert low < FREQUENCY * (1 + 0.01 * min(shifts)) < FREQUENCY < high
    assert "uneven-peak" in {remark.code for remark in mode.remarks}


@pytest.mark.parametrize(("ratio", "zeta"), [(1.01, 0.01), (1.02, 0.01), (1.03, 0.03)])
def test_two_modes_that_every_decay_has_stay_two(ratio: float, zeta: float) -> None:
    for seed in range(3):
        found = near_decays(tap(HITS * [0.0], zeta, seed, ratio))
        assert [mode.frequency / FREQUENCY for mode in found] == pytest.approx([1.0, ratio], rel=1e-3)


@given(st.lists(st.tuples(st.floats(1, 9), st.floats(-1, 1)), min_size=3, max_size=12))
def test_a_hit_alone_is_as_far_from_the_mean_by_power_as_the_mean_without_it(hits: list[tuple[float, float]]) -> None:
    power, value = np.array(hits).T
    mean = power @ value / power.sum()
    without = (power @ value - power * value) / (power.sum() - power)
    assert single_hit_factors(power) * (without - mean) == pytest.approx(value - mean, abs=1e-9)


def test_degrees_of_freedom_grow_as_the_hits_make_less_of_the_error() -> None:
    """Welch-Satterthwaite: (n - 1) over the squared share of the hits in the variance."""
    covariance = np.diag([1.0, 1e-8, 1e10])
    mode = Mode(FREQUENCY, 0.01, STIFFNESS, jackknife=covariance, n_hits=3, scatter_freedom=(3 - 1) / 0.5**2)
    assert mode.quantile() == pytest.approx(t.ppf(0.975, 8))
    assert Mode(FREQUENCY, 0.01, STIFFNESS, jackknife=covariance, n_hits=3).quantile() == pytest.approx(t.ppf(0.975, 2))


@pytest.mark.parametrize("code", ["uneven-peak", "several-modes", "scatter"])
def test_a_mode_that_stands_for_several_states_is_doubtful_where_another_is_rejected(code: str) -> None:
    wide = np.diag([1.0, 1e-8, (0.4 * STIFFNESS) ** 2])
    moving = Mode(FREQUENCY, 0.01, STIFFNESS, wide, remarks=(Remark(code, "", "a text"),))
    assert dict(trust_rules(moving))["uncertain"] is Trust.DOUBTFUL
    assert assess_trust(moving) is Trust.DOUBTFUL
    assert assess_trust(Mode(FREQUENCY, 0.01, STIFFNESS, wide)) is Trust.REJECTED


def test_a_mode_that_no_other_measurement_has_is_doubtful() -> None:
    own, other = Mode(412.0, 0.01, STIFFNESS), [Mode(FREQUENCY, 0.01, STIFFNESS)]
    assert [assess_trust(mode) for n in (1, 2, 3) for mode in match_modes([own], n * [other])] == [
        Trust.TRUSTED,
        Trust.DOUBTFUL,
        Trust.DOUBTFUL,
    ]
    assert assess_trust(match_modes([own], [[own], other, other])[0]) is Trust.TRUSTED
