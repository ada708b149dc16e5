"""Modes closer than a half-power width: no dip between them, and one peak."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Frf, from_accelerance
from modal import Mode, fit_modes, pick_peaks, synthesize_frf
from modal.fitting.band_fit import MIN_RESIDUAL_TERMS
from modal.fitting.fit_band import fit_band, mode_pair_gain

LINES = np.arange(5.0, 6000.0, 5.0)
NEIGHBOURS = [Mode(900.0, 0.03, 4e7), Mode(2900.0, 0.03, 3e7)]


def pair(ratio: float, damping: float = 0.03) -> list[Mode]:
    return [Mode(1722.0, damping, 3.5e7), Mode(1722.0 * ratio, damping, 5e7)]


def noisy(modes: list[Mode], level: float, seed: int) -> Frf:
    """Noise of level times the largest accelerance on each line."""
    exact = synthesize_frf([*modes, *NEIGHBOURS], LINES).accelerance
    noise = np.random.default_rng(seed).normal(size=(2, LINES.size)) / np.sqrt(2) * level * np.max(np.abs(exact))
    return from_accelerance(LINES, exact + noise[0] + 1j * noise[1])


def between(modes: list[Mode]) -> list[Mode]:
    return [mode for mode in modes if 1600 < mode.frequency < 2100]


def codes_between(frf: Frf) -> set[str]:
    return {remark.code for mode in between(fit_modes(frf)) for remark in mode.remarks}


def values(modes: list[Mode]) -> NDArray[np.float64]:
    return np.array([(m.frequency, m.damping_ratio, m.stiffness) for m in modes])


@pytest.mark.parametrize("damping", [0.005, 0.03, 0.1])
@pytest.mark.parametrize("ratio", [1.02, 1.03, 1.05])
def test_without_noise_both_are_found_to_many_digits(ratio: float, damping: float) -> None:
    true = pair(ratio, damping)
    found = fit_modes(synthesize_frf(true, LINES))
    assert values(found) == pytest.approx(values(true), rel=1e-6)


@pytest.mark.parametrize("ratio", [1.02, 1.03, 1.05])
def test_in_noise_both_are_found_within_their_errors(ratio: float) -> None:
    for seed in range(5):
        frf = noisy(pair(ratio), 1e-3, seed)
        assert len(between(pick_peaks(frf))) == 1
        found = between(fit_modes(frf))
        assert len(found) == 2
        errors = np.array([mode.standard_error for mode in found])
        assert np.all(np.abs(values(found) - values(pair(ratio))) < 4 * errors)
        assert all({remark.code for remark in mode.remarks} == {"overlaps"} for mode in found)


def test_what_is_too_noisy_to_tell_is_reported() -> None:
    said = 0
    for seed in range(12):
        found = between(fit_modes(noisy(pair(1.02), 4e-3, seed)))
        if len(found) == 1:
            said += any(remark.code == "several-modes" for remark in found[0].remarks)
        else:
            errors = np.array([mode.standard_error for mode in found])
            assert np.all(np.abs(values(found) - values(pair(1.02))) < 5 * errors)
            said += 1
    assert said >= 11


def test_two_modes_in_noise_of_a_percent_are_reported_to_be_several() -> None:
    codes = [codes_between(noisy(pair(1.02), 1e-2, seed)) for seed in range(12)]
    assert sum("several-modes" in said for said in codes) >= 10


def test_frequencies_of_suspected_modes_close_to_each_other_read_as_two() -> None:
    read = 0
    for seed in range(4):
        slow = replace(noisy(pair(1.02), 1e-2, seed), frequency=LINES / 200)
        said = [remark for mode in fit_modes(slow) for remark in mode.remarks if remark.code == "several-modes"]
        for remark in said:
            low, high = re.findall(r"\d+(?:\.\d+)?", remark.text)
            assert float(low) == pytest.approx(float(high), rel=0.2)
            assert float(low) < float(high)
            assert remark.cure
            read += 1
    assert read


@pytest.mark.parametrize("damping", [0.005, 0.03, 0.1])
@pytest.mark.parametrize("level", [1e-3, 1e-2, 3e-2])
def test_a_mode_alone_is_never_reported_to_be_several(level: float, damping: float) -> None:
    for seed in range(4):
        frf = noisy([Mode(1722.0, damping, 2e7, phase_deg=10.0 * seed)], level, seed)
        assert "several-modes" not in {remark.code for mode in fit_modes(frf) for remark in mode.remarks}


def test_a_satellite_that_takes_nothing_from_its_neighbour_is_not_reported() -> None:
    """The larger mode has the reported stiffness; a neighbour of a hundredth of its size does not matter."""
    modes = [Mode(1722.0, 0.03, 3.5e7), Mode(1722.0 * 1.02, 0.03, 3.5e9)]
    assert "several-modes" not in codes_between(noisy(modes, 1e-3, 0))


@pytest.mark.quick
@pytest.mark.parametrize("turn", [1.0, 1j])
def test_the_gain_of_a_pair_is_what_a_mode_leaves_of_two_near_each_other(turn: complex) -> None:
    line, weight = np.arange(1300.0, 2200.0, 5.0), np.ones((1, 180))
    own = turn * synthesize_frf([Mode(1740.0, 0.03, 4e7), Mode(1756.0, 0.033, 3e7)], line).receptance[np.newaxis] * 1e9
    fit = fit_band(line, own, weight, np.array([[1745.0], [0.03]]), MIN_RESIDUAL_TERMS)
    assert fit is not None
    assert 0.95 < mode_pair_gain(fit, line, weight, MIN_RESIDUAL_TERMS, 0) / fit.sum_of_squares <= 1


def test_opposite_constants_are_distinguished_too() -> None:
    true = [Mode(1722.0, 0.03, 3.5e7), Mode(1790.0, 0.03, -5e7)]
    assert values(fit_modes(synthesize_frf(true, LINES))) == pytest.approx(values(true), rel=1e-6)


def test_one_mode_is_not_taken_for_two() -> None:
    for seed in range(20):
        assert len(between(fit_modes(noisy([Mode(1722.0, 0.03, 2e7)], 1e-3, seed)))) == 1


def test_three_modes_in_one_peak() -> None:
    true = [Mode(1700.0, 0.02, 4e7), Mode(1740.0, 0.02, 5e7), Mode(1790.0, 0.02, 4e7)]
    assert values(fit_modes(synthesize_frf(true, LINES))) == pytest.approx(values(true), rel=1e-5)
