"""FRFs that hold no modes, or none that can be believed."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Frf
from modal import ConjugateError, Mode, fit_modes, pick_peaks, synthesize_frf

LINES = np.arange(5.0, 4000.0, 5.0)
GOOD = synthesize_frf([Mode(1722.0, 0.03, 3.5e7), Mode(2900.0, 0.02, -4e7)], LINES)

Extraction = Callable[..., list[Mode]]
both = pytest.mark.parametrize("extract", [fit_modes, pick_peaks])


@both
def test_zeros_are_no_response(extract: Extraction) -> None:
    with pytest.raises(ValueError, match=r"zero.*sensor"):
        extract(Frf(LINES, np.zeros(LINES.size, complex)))


@both
@pytest.mark.parametrize("n_lines", [2, 3, 7])
def test_too_few_lines(extract: Extraction, n_lines: int) -> None:
    with pytest.raises(ValueError, match=f"{n_lines} lines .*8 lines"):
        extract(Frf(LINES[:n_lines], GOOD.receptance[:n_lines]))


@both
@pytest.mark.parametrize("band", [(5000.0, 6000.0), (2000.0, 1000.0), (1721.0, 1722.0), (np.nan, 2000.0)])
def test_band_without_lines(extract: Extraction, band: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match=rf"{band[0]:g}.*{band[1]:g} Hz"):
        extract(GOOD, band)


@both
@pytest.mark.parametrize("modes", [[Mode(1722.0, 0.03, 3.5e7)], [Mode(700.0, 0.005, -3e7), Mode(1722.0, 0.03, 3.5e7)]])
def test_conjugated_frf_is_rejected(extract: Extraction, modes: list[Mode]) -> None:
    frf = synthesize_frf(modes, LINES)
    with pytest.raises(ConjugateError, match=r"numpy\.conj"):
        extract(Frf(LINES, frf.receptance.conj()))
    assert len(extract(Frf(LINES, frf.receptance))) == len(modes)


@both
@pytest.mark.parametrize("receptance", [np.full(LINES.size, 1e-8), 1 / LINES**2, 1e-8 * np.exp(-1e-3j * LINES)])
def test_frf_without_resonance_gives_an_empty_list(extract: Extraction, receptance: NDArray[np.complex128]) -> None:
    assert extract(Frf(LINES, receptance)) == []


@both
@pytest.mark.parametrize("lost", [np.abs, np.real])
def test_magnitude_or_real_part_alone_is_rejected(extract: Extraction, lost: Callable[..., Any]) -> None:
    with pytest.raises(ValueError, match="phase"):
        extract(Frf(LINES, lost(GOOD.receptance)))


def test_values_that_are_none_are_rejected_by_the_frf() -> None:
    with pytest.raises(ValueError, match=f"{LINES.size} lines"):
        Frf(LINES, np.full(LINES.size, np.nan))
    with pytest.raises(ValueError, match=r"coherence.* 0 .*1"):
        Frf(LINES, GOOD.receptance, np.full(LINES.size, 1.1))


@both
def test_line_at_zero_hertz_is_left_out(extract: Extraction) -> None:
    lines = np.arange(0.0, 4000.0, 5.0)
    static = synthesize_frf([Mode(1722.0, 0.03, 3.5e7)], lines)
    (with_zero,), (without,) = extract(static), extract(Frf(lines[1:], static.receptance[1:]))
    assert with_zero.stiffness == pytest.approx(without.stiffness, rel=1e-12)


def test_no_mode_of_a_wild_frf_is_nonsense() -> None:
    for seed in range(8):
        random = np.random.default_rng(seed)
        wild = np.cumsum(random.normal(size=LINES.size)) + 1j * np.cumsum(random.normal(size=LINES.size))
        with contextlib.suppress(ValueError):
            for mode in fit_modes(Frf(LINES, np.asarray(wild * 1e-8))):
                assert LINES[0] < mode.frequency < LINES[-1]
                assert 0 < mode.damping_ratio < 1
                assert np.all(np.isfinite(mode.standard_error))
