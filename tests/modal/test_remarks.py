"""What speaks against a mode is said with the mode."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition import Frf, from_accelerance
from modal import Mode, fit_modes, synthesize

LINES = np.arange(5.0, 4000.0, 5.0)
MODE = Mode(1722.0, 0.03, 3.5e7)


def noisy(modes: list[Mode], level: float = 1e-3, hits: int = 10, seed: int = 0) -> Frf:
    exact = synthesize(modes, LINES).accelerance
    noise = np.random.default_rng(seed).normal(size=(2, hits, LINES.size)) / np.sqrt(2)
    each = exact + level * np.max(np.abs(exact)) * (noise[0] + 1j * noise[1])
    mean = each.mean(axis=0)
    return from_accelerance(LINES, mean, np.abs(mean) ** 2 / np.mean(np.abs(each) ** 2, axis=0), hits)


def doubts(frf: Frf, band: tuple[float, float] | None = None) -> str:
    (mode,) = fit_modes(frf, band)
    return "; ".join(mode.doubts)


def test_nothing_speaks_against_a_clean_driving_point() -> None:
    for seed in range(10):
        (mode,) = fit_modes(noisy([MODE], seed=seed))
        assert mode.doubts == ()
        assert mode.residue_phase == pytest.approx(0.0, abs=0.05)
        assert mode.misfit == pytest.approx(1.0, abs=0.25)
        assert mode.coherence == pytest.approx(1.0, abs=1e-3)
        assert mode.half_power_damping == pytest.approx(0.03, rel=0.1)


@pytest.mark.parametrize("swapped", [1, -1])
def test_a_negative_stiffness_says_so(swapped: int) -> None:
    frf = noisy([MODE])
    said = doubts(replace(frf, receptance=swapped * frf.receptance))
    assert ("sign swapped" in said) == (swapped < 0)


@pytest.mark.parametrize("degrees", [-40.0, 40.0])
def test_a_complex_constant_is_measured_and_said(degrees: float) -> None:
    turned = synthesize([MODE], LINES).receptance * np.exp(1j * np.radians(degrees))
    (mode,) = fit_modes(Frf(LINES, turned))
    assert mode.residue_phase == pytest.approx(np.radians(degrees), abs=0.05)
    assert f"{degrees:+.0f}°"[:2] in "; ".join(mode.doubts)
    assert "off real" in "; ".join(mode.doubts)


def test_low_coherence_is_said() -> None:
    frf = noisy([MODE])
    assert frf.coherence is not None
    said = doubts(replace(frf, coherence=np.where(np.abs(LINES - 1722) < 100, 0.8, frf.coherence)))
    assert "coherence 0.80 at its peak, below 0.9" in said


def test_an_edge_through_the_peak_is_said() -> None:
    assert "cut by the edge of the lines, 500..1750 Hz" in doubts(noisy([MODE]), (500.0, 1750.0))
    assert "edge" not in doubts(noisy([MODE]), (500.0, 1900.0))


def test_a_record_too_short_for_the_decay_is_said() -> None:
    (mode,) = fit_modes(synthesize([Mode(1722.0, 0.001, 3.5e7)], LINES))
    left = 100 * np.exp(-2 * np.pi * 0.001 * 1722.0 / 5.0)
    assert f"{left:.0f} % of it still rings when the record ends" in "; ".join(mode.doubts)


def test_what_the_fit_leaves_is_said() -> None:
    clearly = 1 - 0.1 * np.sin(LINES / 12.0)
    (mode, *_) = fit_modes(Frf(LINES, synthesize([MODE], LINES).receptance * clearly))
    assert mode.misfit is not None
    assert mode.misfit > 2
    assert "times the noise" in "; ".join(mode.doubts)


def test_stiffness_of_a_truncated_peak_is_right_within_its_error() -> None:
    for seed in range(5):
        (mode,) = fit_modes(noisy([MODE], seed=seed), (500.0, 1750.0))
        assert abs(mode.stiffness - MODE.stiffness) < 4 * mode.standard_error[2]
