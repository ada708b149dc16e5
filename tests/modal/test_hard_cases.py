"""FRFs as they come: hum, drift, light and heavy damping, odd frequency axes, few and many lines."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Frf, from_accelerance
from acquisition.frf import FrfQuantity
from modal import Mode, Trust, assess_trust, find_truncated_peaks, fit_modes, synthesize_frf

LINES = np.arange(5.0, 4000.0, 5.0)
SPINDLE = [Mode(900.0, 0.03, 4e7), Mode(1722.0, 0.03, 3.5e7), Mode(2900.0, 0.03, 3e7)]


def damped(zeta: float) -> list[Mode]:
    return [Mode(mode.frequency, zeta, mode.stiffness) for mode in SPINDLE]


def measured(
    modes: list[Mode],
    lines: NDArray[np.float64],
    hits: int = 10,
    seed: int = 0,
    extra: NDArray[np.complex128] | NDArray[np.float64] | float = 0.0,
) -> Frf:
    """Mean of hits with noise of 0.002 times the largest accelerance, and extra (hits, n) times that accelerance."""
    exact = synthesize_frf(modes, lines).accelerance
    noise = np.random.default_rng(seed).normal(size=(2, hits, lines.size)) / np.sqrt(2)
    each = exact + np.max(np.abs(exact)) * (0.002 * (noise[0] + 1j * noise[1]) + extra)
    mean = each.mean(axis=0)
    coherence = np.abs(mean) ** 2 / np.mean(np.abs(each) ** 2, axis=0)
    return from_accelerance(lines, mean, coherence if hits > 1 else None, hits)


def assert_found(found: list[Mode], true: list[Mode]) -> None:
    """All of them and no other, within 4.5 standard errors that are no excuse (a tenth of the value at most)."""
    assert len(found) == len(true)
    for a, b in zip(found, true, strict=True):
        values = np.array([b.frequency, b.damping_ratio, b.stiffness])
        error = np.array([a.frequency, a.damping_ratio, a.stiffness]) - values
        assert np.all(np.abs(error) < 4.5 * a.standard_error)
        assert np.all(a.standard_error < 0.1 * np.abs(values))


@pytest.mark.parametrize("zeta", [0.0005, 0.005, 0.05, 0.1])
@pytest.mark.parametrize("hits", [1, 10])
def test_light_and_heavy_damping(zeta: float, hits: int) -> None:
    assert_found(fit_modes(measured(damped(zeta), np.arange(1.0, 4000.0), hits)), damped(zeta))


@pytest.mark.parametrize("n_lines", [200, 2000, 20000])
def test_few_and_many_lines(n_lines: int) -> None:
    assert_found(fit_modes(measured(SPINDLE, np.linspace(4000 / n_lines, 4000, n_lines))), SPINDLE)


@pytest.mark.long
def test_two_hundred_thousand_lines() -> None:
    assert_found(fit_modes(measured(SPINDLE, np.linspace(0.02, 4000, 200_000), 3)), SPINDLE)


@pytest.mark.parametrize(
    "lines",
    [
        np.sort(np.random.default_rng(3).uniform(300, 4000, 1500)),
        np.geomspace(200.0, 4000.0, 1200),
        np.arange(603.7, 3800.0, 5.3),
    ],
    ids=["uneven", "logarithmic", "begins at 604 Hz"],
)
def test_axes_of_other_programs(lines: NDArray[np.float64]) -> None:
    assert_found(fit_modes(measured(SPINDLE, lines)), SPINDLE)


def test_drift_of_the_integrated_acceleration() -> None:
    lines = np.arange(0.5, 4000.0, 0.5)
    random = np.random.default_rng(1)
    slow = (random.normal(size=(10, 1)) + 1j * random.normal(size=(10, 1))) * 2000 / lines**2
    assert_found([m for m in fit_modes(measured(SPINDLE, lines, extra=slow)) if m.frequency > 50], SPINDLE)


def test_hum_of_the_mains_on_the_peak() -> None:
    random = np.random.default_rng(2)
    hum = np.where(LINES % 250 == 0, 0.3, 0.0) * np.exp(2j * np.pi * random.uniform(size=(10, LINES.size)))
    with_hum, without = fit_modes(measured(SPINDLE, LINES, extra=hum)), fit_modes(measured(SPINDLE, LINES))
    assert_found(with_hum, SPINDLE)
    assert np.all(with_hum[1].standard_error < 4 * without[1].standard_error)


def test_one_stray_line_of_a_single_hit_is_left_out() -> None:
    stray = np.where(LINES == 1700.0, 0.1, 0.0) * np.ones((1, 1))
    found, without = fit_modes(measured(SPINDLE, LINES, 1, extra=stray)), fit_modes(measured(SPINDLE, LINES, 1))
    assert_found(found, SPINDLE)
    assert found[1].standard_error == pytest.approx(without[1].standard_error, rel=0.3)


@pytest.mark.parametrize("high", [1760.0, 1800.0, 1900.0])
def test_a_mode_near_the_edge_of_the_band(high: float) -> None:
    assert_found(fit_modes(measured(SPINDLE, LINES), (500.0, high)), SPINDLE[:2])


def test_a_weak_mode_on_the_flank_of_a_strong_one_is_found() -> None:
    """It has no peak of its own; left out, it shifts zeta and K of the strong one by one standard error."""
    pair = [Mode(1500.0, 0.03, 3e7), Mode(1900.0, 0.03, 1.5e9)]
    for seed in range(5):
        assert_found(fit_modes(measured(pair, LINES, 1, seed)), pair)


def test_a_ripple_of_a_percent_next_to_a_mode_is_no_mode() -> None:
    pair = [Mode(1500.0, 0.03, 3e7), Mode(1900.0, 0.03, 3e9)]
    for seed in range(5):
        assert len(fit_modes(measured(pair, LINES, 1, seed))) == 1


def test_lines_of_hum_next_to_a_mode_are_no_modes() -> None:
    """Taken for modes they would narrow its band, and K be less certain."""
    lines, true = np.arange(1.0, 4000.0), SPINDLE[2:]
    for seed in range(3):
        turns = np.random.default_rng(seed).uniform(size=(1, lines.size))
        hum = np.where(lines % 50 == 0, 0.02, 0.0) * np.exp(2j * np.pi * turns)
        found, without = fit_modes(measured(true, lines, 1, seed, hum)), fit_modes(measured(true, lines, 1, seed))
        assert_found(found, true)
        assert found[0].standard_error[2] < 1.5 * without[0].standard_error[2]


@pytest.mark.parametrize("ends", [(1480.0, 4000.0), (4.0, 1520.0)])
def test_a_peak_a_few_lines_from_the_edge_is_found_and_flagged(ends: tuple[float, float]) -> None:
    true = [Mode(1500.0, 0.03, 3e7)]
    for seed in range(5):
        found = fit_modes(measured(true, np.arange(*ends, 4.0), 1, seed))
        assert_found(found, true)
        assert found[0].remarks[0].code == "cut-by-edge"


@pytest.mark.parametrize("ends", [(1496.0, 4000.0), (1520.0, 4000.0), (4.0, 1506.0), (4.0, 1482.0)])
def test_a_peak_on_the_edge_or_just_beyond_is_reported(ends: tuple[float, float]) -> None:
    lines = np.arange(*ends, 4.0)
    frf = measured([Mode(1500.0, 0.03, 3e7), Mode(700.0, 0.02, 3e8), Mode(2900.0, 0.02, 3e8)], lines, 1)
    found = fit_modes(frf)
    assert len(found) == 1
    assert find_truncated_peaks(frf, found) == [lines[0] if ends[0] > 1000 else lines[-1]]


def test_an_edge_on_a_flank_or_on_a_fitted_peak_is_no_cut() -> None:
    frf = measured(SPINDLE, LINES, 1)
    for band in ((1200.0, 2400.0), (5.0, 2500.0), (1500.0, 3995.0), (500.0, 1750.0)):
        assert find_truncated_peaks(frf, fit_modes(frf, band), band) == []
    assert find_truncated_peaks(frf, [], (500.0, 1730.0)) == [1730.0]


@pytest.mark.parametrize("low", [975.0, 1000.0, 2025.0])
def test_a_fall_to_an_antiresonance_is_no_cut(low: float) -> None:
    """Several half-widths above a mode the others turn its mobility real for some lines."""
    assert find_truncated_peaks(measured(SPINDLE, LINES, 10), [], (low, 3995.0)) == []


def test_the_line_of_a_mass_is_no_peak() -> None:
    w = 2 * np.pi * LINES
    assert (
        find_truncated_peaks(from_accelerance(LINES, synthesize_frf(SPINDLE, LINES).accelerance + 0.5 + 0j * w), [])
        == []
    )


def test_a_strong_mode_next_to_the_band_does_not_bend_a_weak_one_in_it_unreported() -> None:
    weak = Mode(3300.0, 0.03, 1.4e9)
    strong = [SPINDLE[1], Mode(3900.0, 0.03, 2.6e8)]
    for seed in range(5):
        for mode in fit_modes(measured([weak, *strong], LINES, seed=seed), (100.0, 3500.0)):
            if mode.frequency > 3000:
                off = abs(mode.stiffness - weak.stiffness) > 4 * mode.standard_error[2]
                assert not off or any(remark.code == "bent-by-neighbour" for remark in mode.remarks)


@pytest.mark.parametrize("inside", [3400.0, 3700.0, 3850.0])
def test_a_mode_beyond_the_last_line_makes_that_before_it_doubtful(inside: float) -> None:
    """10 half-widths beyond it shifts zeta and K by more than the interval, and what the fit leaves is white."""
    for seed in range(8):
        with_it = [Mode(1500.0, 0.03, 3e7), Mode(inside, 0.03, 6e7), Mode(4300.0, 0.03, 6e7)]
        *_, last = fit_modes(measured(with_it, LINES, seed=seed))
        assert assess_trust(last) is not Trust.TRUSTED
        *_, last = fit_modes(measured(with_it[:2], LINES, seed=seed))
        assert assess_trust(last) is Trust.TRUSTED


def test_accelerance_mobility_and_receptance_of_one_structure_have_the_same_modes() -> None:
    receptance = synthesize_frf(SPINDLE, LINES).receptance
    for kind in get_args(FrfQuantity):
        for a, b in zip(fit_modes(Frf(LINES, receptance, measured_as=kind)), SPINDLE, strict=True):
            assert a.frequency == pytest.approx(b.frequency, rel=1e-9)
            assert a.damping_ratio == pytest.approx(b.damping_ratio, rel=1e-7)
            assert a.stiffness == pytest.approx(b.stiffness, rel=1e-7)


def test_residual_terms_of_accelerance_are_a_constant_and_a_parabola() -> None:
    w = 2 * np.pi * LINES
    accelerance = synthesize_frf([SPINDLE[1]], LINES).accelerance + 4.0 - 2j + (3e-9 + 1e-9j) * w**2
    inside = (LINES > 1200) & (LINES < 2400)
    (found,) = fit_modes(from_accelerance(LINES[inside], accelerance[inside]))
    assert found.stiffness == pytest.approx(3.5e7, rel=1e-9)
    assert found.damping_ratio == pytest.approx(0.03, rel=1e-9)
