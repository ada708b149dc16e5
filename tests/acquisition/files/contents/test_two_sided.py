"""The lower half of a two-sided FRF is used, the mirror image is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition import Description, inspect_file
from acquisition.files.contents.two_sided import find_lower_half
from modal import Mode, synthesize_frf

DECAY = np.exp(-np.arange(301) / 40.0) * np.sin(0.4 * np.arange(301))


@pytest.mark.parametrize("n", [300, 301])
@pytest.mark.parametrize(("first", "omitted"), [(0, 0), (1, 0), (4, 9), (1, 12)])
def test_lines_above_half_the_sample_rate_are_left_out(n: int, first: int, omitted: int) -> None:
    part = slice(first, n - omitted)
    kept = find_lower_half(np.arange(float(n))[part], np.fft.fft(DECAY[:n])[part])
    assert kept.tolist() == list(range(n // 2 + 1 - first))


@pytest.mark.parametrize("digits", [4, 9])
def test_printed_digits_are_no_obstacle(digits: int) -> None:
    spectrum = np.fft.fft(DECAY)
    printed = [complex(float(f"{z.real:.{digits}g}"), float(f"{z.imag:.{digits}g}")) for z in spectrum]
    assert find_lower_half(np.arange(301.0), np.array(printed)).size == 151


def test_lines_at_negative_frequencies_are_left_out_in_either_order() -> None:
    frequency, spectrum = np.asarray(np.fft.fftfreq(301, 1e-3), dtype=np.float64), np.fft.fft(DECAY)
    for order in (np.arange(301), np.argsort(frequency)):
        kept = find_lower_half(frequency[order], spectrum[order])
        assert frequency[order][kept].tolist() == pytest.approx(np.arange(151) / 0.301)
        assert kept.size == 151


@pytest.mark.parametrize("form", ["receptance", "mobility", "accelerance"])
@pytest.mark.parametrize("seed", range(20))
def test_a_one_sided_frf_of_any_modes_is_used_whole(seed: int, form: str) -> None:
    random = np.random.default_rng(seed)
    modes = [
        Mode(
            random.uniform(100, 3000), 10 ** random.uniform(-4, -1), random.choice([-1, 1]) * 10 ** random.uniform(5, 9)
        )
        for _ in range(random.integers(1, 8))
    ]
    frf = synthesize_frf(modes, np.arange(float(random.integers(0, 100)), 4000.0, 2.0))
    assert find_lower_half(frf.frequency, getattr(frf, form)).size == frf.frequency.size


def test_a_real_half_spectrum_and_uneven_lines_are_used_whole() -> None:
    half = np.fft.rfft(DECAY)
    assert find_lower_half(np.arange(151.0), half).size == 151
    assert find_lower_half(np.geomspace(1, 300, 301), np.fft.fft(DECAY)).size == 301
    assert find_lower_half(np.arange(301.0), np.abs(np.fft.fft(DECAY)).astype(complex)).size == 301


@pytest.mark.parametrize("unit", ["m/N", "m/s^2/N"])
def test_a_file_states_that_half_of_its_lines_are_used(tmp_path: Path, unit: str) -> None:
    values, file = np.fft.fft(DECAY), tmp_path / "frf.csv"
    header = f"frequency [Hz],real [{unit}],imag [{unit}],coherence"
    table = np.c_[np.arange(301.0), values.real, values.imag, np.ones(301)]
    np.savetxt(file, table, delimiter=",", header=header, comments="")
    recording = inspect_file(file, Description()).require_measurable()
    assert recording.frf is not None
    assert recording.frf.frequency[-1] == 150
    assert recording.frf.coherence is not None
    assert [fact.origin for fact in recording.facts if fact.name == "FRF"] == ["default"]
