"""Lines and noise of spectra of signals that are known."""

from __future__ import annotations

import numpy as np
import pytest

from lobewatch.cuts.chatter_detection.spectrum import compute_spectrum, find_peaks, find_separate_peaks

pytestmark = pytest.mark.quick

RATE = 25600.0


@pytest.mark.parametrize("frequency", [1000.0, 1000.3, 1000.5, 3333.3, 9876.54])
def test_a_sine_is_one_line_with_its_frequency_and_amplitude(frequency: float) -> None:
    time = np.arange(25600) / RATE
    noise = np.random.default_rng(2).normal(scale=0.05, size=time.size)
    spectrum = compute_spectrum(3.0 * np.sin(2 * np.pi * frequency * time + 0.4) + noise, RATE)
    heard = find_peaks(spectrum)
    assert spectrum.bin_width == 1.0
    assert heard.frequency == pytest.approx([frequency], abs=0.01)
    assert heard.amplitude == pytest.approx([3.0], rel=0.01)
    assert heard.energy == pytest.approx(9.0, rel=0.02)


def test_the_noise_of_a_spectrum_is_its_mean_power_with_and_without_lines() -> None:
    """White noise: four times its variance over the number of samples and the window's share of it."""
    signal = np.random.default_rng(3).normal(scale=0.5, size=51200)
    phase = 2 * np.pi * (np.arange(signal.size) + 0.5) / signal.size
    window = 0.35875 - 0.48829 * np.cos(phase) + 0.14128 * np.cos(2 * phase) - 0.01168 * np.cos(3 * phase)
    power = 4 * 0.25 * np.sum(window**2) / np.sum(window) ** 2
    time = np.arange(signal.size) / RATE
    frequencies = np.arange(1000.0, 1400.0, 20.0)
    crowd = sum(np.sin(2 * np.pi * frequency * time) for frequency in frequencies)
    for heard in (signal, signal + crowd):
        spectrum = compute_spectrum(heard, RATE)
        assert np.mean(spectrum.noise) == pytest.approx(power, rel=0.08)
        assert np.max(spectrum.noise) < 3 * power
    assert len(find_peaks(compute_spectrum(signal, RATE))) == 0
    assert find_peaks(compute_spectrum(signal + crowd, RATE)).frequency == pytest.approx(
        np.arange(1000.0, 1400.0, 20), abs=0.1
    )


@pytest.mark.parametrize(("apart", "count"), [(6.0, 2), (2.0, 1)])
def test_two_sines_are_distinguished_where_the_window_can(apart: float, count: int) -> None:
    time = np.arange(25600) / RATE
    both = np.sin(2 * np.pi * 1000 * time) + np.sin(2 * np.pi * (1000 + apart) * time + 1.0)
    assert (
        len(find_peaks(compute_spectrum(both + np.random.default_rng(2).normal(scale=1e-3, size=time.size), RATE)))
        == count
    )


def test_faint_lines_next_to_a_loud_one_are_left_out_by_distance_and_by_edge() -> None:
    """An edge of 8 Hz leaves out less than 0.08 at 100 Hz and less than 0.02 at 400 Hz, of a line of 1."""
    time = np.arange(25600) / RATE
    lines = {1000.0: 1.0, 1020.0: 0.5, 1100.0: 0.06, 1400.0: 0.06}
    signal = sum(amplitude * np.sin(2 * np.pi * frequency * time) for frequency, amplitude in lines.items())
    spectrum = compute_spectrum(signal + np.random.default_rng(2).normal(scale=1e-3, size=time.size), RATE)
    for about, kept in (((), list(lines)), ((30.0,), [1000, 1100, 1400]), ((30.0, 8.0), [1000, 1400])):
        assert find_separate_peaks(spectrum, *about).frequency == pytest.approx(kept, abs=0.1)
