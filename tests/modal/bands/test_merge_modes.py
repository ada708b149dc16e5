"""Peaks that are no exact poles: fitted as one mode, whose errors hold all that the mode did."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from acquisition import Frf, from_accelerance
from modal import Mode, Trust, assess_trust, extract_modes, fit_common_modes, fit_modes, synthesize_frf
from modal.bands.residual_analysis import moving_mode_variance

LINES = np.arange(100.0, 3000.0, 1.0)
FREQUENCY, ZETA, STIFFNESS = 1000.0, 0.01, 3e7
Complexes = NDArray[np.complex128]


def noisy(receptance: Complexes, level: float = 1e-3, seed: int = 0) -> Frf:
    """Noise of level times the FRF on each line."""
    noise = np.random.default_rng(seed).normal(size=(2, receptance.size)) / np.sqrt(2)
    return Frf(LINES, receptance * (1 + level * (noise[0] + 1j * noise[1])))


def at(*shifts: float, stiffness: float = STIFFNESS, scale: float = 1.0) -> Complexes:
    """Return the mean receptance of a mode whose frequency is off by these numbers of half-widths."""
    modes = [Mode(scale * FREQUENCY * (1 + ZETA * shift), ZETA, stiffness) for shift in shifts]
    return np.asarray(np.mean([synthesize_frf([mode], scale * LINES).receptance for mode in modes], axis=0))


def drift(span: float) -> list[float]:
    return [float(shift) for shift in np.linspace(-span / 2, span / 2, 20)]


def smoothed(receptance: Complexes, lines: int) -> Complexes:
    return np.asarray(np.convolve(np.pad(receptance, lines // 2, mode="edge"), np.ones(lines) / lines, "valid"))


def softening(share: float) -> Complexes:
    """Return the response to a hit of a mode that is lower by a share of its half-width, times its amplitude."""
    rate = 16384.0
    time = np.arange(int(rate)) / rate
    amplitude = np.exp(-2 * np.pi * ZETA * FREQUENCY * time)
    phase = 2 * np.pi * np.cumsum(FREQUENCY * (1 - share * ZETA * amplitude)) / rate
    response = np.fft.rfft(amplitude * np.sin(phase)) / rate * 2 * np.pi * FREQUENCY / STIFFNESS
    return np.asarray(response[100:3000])


def codes(mode: Mode) -> set[str]:
    return {remark.code for remark in mode.remarks}


@pytest.mark.parametrize("span", [0.5, 1.0, 2.0])
def test_a_mode_that_drifts_while_hits_are_averaged_is_one_mode_whose_interval_holds_its_way(span: float) -> None:
    (mode,) = fit_modes(noisy(at(*drift(span))))
    assert assess_trust(mode) is not Trust.REJECTED
    assert "uneven-peak" in codes(mode)
    limits = mode.interval()
    assert limits[0, 0] < FREQUENCY * (1 - ZETA * span / 2) < FREQUENCY * (1 + ZETA * span / 2) < limits[0, 1]
    assert limits[1, 0] < ZETA < limits[1, 1]
    assert limits[2, 0] < STIFFNESS < limits[2, 1]


@pytest.mark.parametrize(
    "receptance",
    [smoothed(at(0.0), 5), smoothed(at(0.0), 15), softening(0.5), softening(1.0)],
    ids=["five lines", "fifteen lines", "softening by half", "softening"],
)
def test_smoothed_lines_and_a_mode_that_softens_are_one_mode(receptance: Complexes) -> None:
    (mode,) = fit_modes(noisy(receptance))
    assert mode.is_driving_point
    assert mode.stiffness == pytest.approx(STIFFNESS, abs=2 * mode.standard_error[2] + 0.05 * STIFFNESS)


def test_an_undisturbed_mode_has_nothing_merged() -> None:
    for seed in range(10):
        (mode,) = fit_modes(noisy(at(0.0), seed=seed))
        assert "uneven-peak" not in codes(mode)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("ratio", "zeta"), [(1.02, 0.01), (1.03, 0.03)])
@pytest.mark.parametrize("level", [1e-3, 1e-2])
def test_two_real_modes_stay_two(ratio: float, zeta: float, sign: int, level: float) -> None:
    true = [Mode(FREQUENCY, zeta, STIFFNESS), Mode(FREQUENCY * ratio, zeta, sign * 1.4 * STIFFNESS)]
    for seed in range(4):
        found = fit_modes(noisy(synthesize_frf(true, LINES).receptance, level, seed))
        assert [mode.frequency for mode in found] == pytest.approx([mode.frequency for mode in true], rel=3e-3)
        assert all(assess_trust(mode) is Trust.TRUSTED for mode in found)


def test_without_noise_the_closest_pair_stays_two() -> None:
    true = [Mode(FREQUENCY, 0.03, STIFFNESS), Mode(1005.0, 0.03, 2 * STIFFNESS)]
    assert len(fit_modes(synthesize_frf(true, LINES))) == 2


def test_a_pair_that_another_frf_confirms_is_real() -> None:
    """Two modes turned against each other are taken for one at the tip alone, but at the nose the second is larger.

    The halves of a mode that drifts have the same shape.
    """
    first, second = Mode(993.0, ZETA, STIFFNESS, phase_deg=15.0), Mode(1004.0, ZETA, STIFFNESS, phase_deg=-15.0)
    tip = noisy(synthesize_frf([first, second], LINES).receptance)
    nose = noisy(synthesize_frf([first, Mode(1004.0, ZETA, STIFFNESS / 3, phase_deg=-15.0)], LINES).receptance, seed=1)
    assert len(fit_modes(tip)) == 1
    assert len(fit_common_modes([tip, nose])) == 2
    drifts = [noisy(at(*drift(1.0), stiffness=stiffness), seed=2) for stiffness in (3e7, -9e7)]
    (mode,) = fit_common_modes(drifts)
    assert mode.shape == pytest.approx([1.0, -1 / 3], rel=0.01)


@settings(max_examples=8, deadline=None)
@given(scale=st.floats(0.2, 5.0), stiffness=st.floats(1e5, 1e10))
def test_merging_depends_on_no_unit(scale: float, stiffness: float) -> None:
    noise = np.random.default_rng(0).normal(size=(2, LINES.size)) * 1e-3
    receptance = at(*drift(1.0), stiffness=stiffness, scale=scale) * (1 + noise[0] + 1j * noise[1])
    (mode,) = fit_modes(Frf(scale * LINES, receptance))
    assert mode.frequency / scale == pytest.approx(FREQUENCY, rel=1e-3)
    assert mode.standard_error[0] / scale == pytest.approx(0.58 * ZETA * FREQUENCY / 2, rel=0.3)


def test_the_peak_of_a_mean_is_lower_by_the_mean_square_of_its_shifts() -> None:
    """1 - mean(1 / (1 + i x)) is the mean of x^2, to second order: the error of zeta and K of a mode that moves."""
    shifts = np.array(drift(0.4))
    (band,) = extract_modes([from_accelerance(LINES, synthesize_frf([Mode(1e3, ZETA, 3e7)], LINES).accelerance)]).bands
    spread = np.array([np.std(shifts) * ZETA * FREQUENCY])
    error = np.sqrt(moving_mode_variance(band.fit, spread))
    loss = 1 - float(np.mean(1 / (1 + 1j * shifts)).real)
    assert error[0] == pytest.approx(spread[0])
    assert error[1] / ZETA == pytest.approx(loss, rel=0.05)
    assert error[2] * STIFFNESS == pytest.approx(loss, rel=0.05)
