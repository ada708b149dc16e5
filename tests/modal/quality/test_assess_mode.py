"""Remarks on modes by their quality."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition import Frf, Remark, estimate_frf, from_accelerance
from modal import Mode, fit_modes, synthesize_frf
from tests.modal.test_moving_modes import tap

LINES = np.arange(5.0, 4000.0, 5.0)
MODE = Mode(1722.0, 0.03, 3.5e7)


def noisy(modes: list[Mode], level: float = 1e-3, hits: int = 10, seed: int = 0) -> Frf:
    exact = synthesize_frf(modes, LINES).accelerance
    noise = np.random.default_rng(seed).normal(size=(2, hits, LINES.size)) / np.sqrt(2)
    each = exact + level * np.max(np.abs(exact)) * (noise[0] + 1j * noise[1])
    mean = each.mean(axis=0)
    return from_accelerance(LINES, mean, np.abs(mean) ** 2 / np.mean(np.abs(each) ** 2, axis=0), hits)


def remarks(mode: Mode) -> dict[str, Remark]:
    """By code; each says which mode it is about."""
    assert all(remark.about == f"{mode.frequency:.0f} Hz" for remark in mode.remarks)
    return {remark.code: remark for remark in mode.remarks}


def on_the_only_mode(frf: Frf, band: tuple[float, float] | None = None) -> dict[str, Remark]:
    (mode,) = fit_modes(frf, band)
    return remarks(mode)


def test_nothing_speaks_against_a_clean_driving_point() -> None:
    for seed in range(10):
        (mode,) = fit_modes(noisy([MODE], seed=seed))
        assert mode.remarks == ()
        assert abs(mode.phase_deg) < 4 * mode.phase_deg_std < 2
        assert mode.misfit == pytest.approx(1.0, abs=0.25)
        assert mode.coherence == pytest.approx(1.0, abs=1e-3)
        assert mode.half_power_damping == pytest.approx(0.03, rel=0.1)


@pytest.mark.parametrize("swapped", [1, -1])
def test_a_negative_stiffness_says_so(swapped: int) -> None:
    frf = noisy([MODE])
    said = on_the_only_mode(replace(frf, receptance=swapped * frf.receptance))
    assert set(said) == ({"not-driving-point"} if swapped < 0 else set())


@pytest.mark.parametrize("degrees", [-40.0, 40.0])
def test_a_complex_constant_is_measured_and_reported(degrees: float) -> None:
    turned = synthesize_frf([MODE], LINES).receptance * np.exp(1j * np.radians(degrees))
    (mode,) = fit_modes(Frf(LINES, turned))
    assert mode.phase_deg == pytest.approx(degrees, abs=0.1)
    assert f"{degrees:+.0f} ±" in remarks(mode)["complex-mode"].text


def test_low_coherence_is_reported() -> None:
    frf = noisy([MODE])
    assert frf.coherence is not None
    said = on_the_only_mode(replace(frf, coherence=np.where(np.abs(LINES - 1722) < 100, 0.8, frf.coherence)))
    assert "0.80" in said["low-coherence"].text


def test_an_edge_through_the_peak_is_reported() -> None:
    assert "500..1750 Hz" in on_the_only_mode(noisy([MODE]), (500.0, 1750.0))["cut-by-edge"].text
    assert "cut-by-edge" not in on_the_only_mode(noisy([MODE]), (500.0, 1900.0))


def test_a_record_too_short_for_the_decay_is_reported() -> None:
    (mode,) = fit_modes(synthesize_frf([Mode(1722.0, 0.001, 3.5e7)], LINES))
    left = 100 * np.exp(-2 * np.pi * 0.001 * 1722.0 / 5.0)
    assert f"{left:.0f} %" in remarks(mode)["still-ringing"].text


def test_what_the_fit_leaves_is_reported() -> None:
    clearly = 1 - 0.1 * np.sin(LINES / 12.0)
    (mode, *_) = fit_modes(Frf(LINES, synthesize_frf([MODE], LINES).receptance * clearly))
    assert mode.misfit is not None
    assert mode.misfit > 2
    assert f"{mode.misfit:.1f} times" in remarks(mode)["misfit"].text


def test_stiffness_of_a_truncated_peak_is_right_within_its_error() -> None:
    for seed in range(5):
        (mode,) = fit_modes(noisy([MODE], seed=seed), (500.0, 1750.0))
        assert abs(mode.stiffness - MODE.stiffness) < 4 * mode.standard_error[2]


def test_an_uncertain_mode_has_a_remedy_and_another_one_without_hits() -> None:
    hits = tap([0.0, -1.0, -2.0], 0.01, 3)
    frf = estimate_frf(hits)
    with_hits, without = (
        {remark.code: remark.cure for mode in modes for remark in mode.remarks}
        for modes in (fit_modes(frf, hits=hits), fit_modes(frf))
    )
    both = {"uncertain", "several-modes"} & with_hits.keys() & without.keys()
    assert both
    for code in both:
        assert with_hits[code]
        assert without[code]
        assert with_hits[code] != without[code]
