"""A Hann window over the record shows in the shape of narrow peaks, other widening does not."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition import Frf, from_accelerance
from modal import Mode, Trust, assess_trust, extract_modes, fit_modes, synthesize_frf
from modal.bands.window_shape import has_hann_shape

SLENDER = (Mode(140.0, 0.005, 2e7), Mode(380.0, 0.0025, 3e7), Mode(600.0, 0.0019, 1e8))
RATE, SAMPLES = 5120.0, 16384
RECORD = SAMPLES / RATE
LINES = np.fft.rfftfreq(SAMPLES, 1 / RATE)
BAND = slice(320, 2240)


def measured(
    window: float | None = None, noise: float = 1e-3, drift: float = 0.0, modes: tuple[Mode, ...] = SLENDER
) -> Frf:
    """Return the FRF of one hit; window: time from the start of a Hann window to the hit (s); drift: of f."""
    states = [
        [m.scaled(1 + part, 1.0, "") for m in modes] for part in np.linspace(-drift / 2, drift / 2, 20 if drift else 1)
    ]
    values = np.zeros(LINES.size, complex)
    values[1:] = np.mean([synthesize_frf(state, LINES[1:]).accelerance for state in states], axis=0)
    if window is not None:
        time = np.arange(SAMPLES) / RATE
        values = np.fft.rfft(np.fft.irfft(values, SAMPLES) * np.sin(np.pi * (time + window) / RECORD) ** 2)
    random = np.random.default_rng(1).normal(size=(2, LINES.size))
    values = values * (1 + noise * (random[0] + 1j * random[1]))
    return from_accelerance(LINES[BAND], values[BAND])


def is_seen(frf: Frf) -> bool:
    state = extract_modes([frf])
    return has_hann_shape(frf, [resonance for band in state.bands for resonance in band.resonances])


@pytest.mark.parametrize("noise", [1e-4, 1e-3, 3e-3])
@pytest.mark.parametrize("place", [0.5, 0.25])
def test_a_window_is_seen_wherever_the_hit_is(place: float, noise: float) -> None:
    assert is_seen(measured(place * RECORD, noise))


@pytest.mark.parametrize("noise", [1e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("drift", [0.0, 5e-4, 1e-3, 2e-3, 4e-3])
def test_neither_noise_nor_a_drift_is_a_window(drift: float, noise: float) -> None:
    assert not is_seen(measured(noise=noise, drift=drift))


def test_wide_peaks_and_uneven_lines_show_no_window() -> None:
    damped = tuple(Mode(mode.frequency, 0.03, mode.stiffness) for mode in SLENDER)
    assert not is_seen(measured(RECORD / 2, modes=damped))
    uneven = np.geomspace(100.0, 700.0, 1500)
    assert not is_seen(from_accelerance(uneven, synthesize_frf(list(SLENDER), uneven).accelerance))


@pytest.mark.parametrize("noise", [1e-4, 1e-3])
def test_modes_under_a_window_are_doubtful_and_their_zeta_is_covered(noise: float) -> None:
    modes = fit_modes(measured(RECORD / 2, noise))
    assert {assess_trust(mode) for mode in modes} == {Trust.DOUBTFUL}
    assert all("smoothed-lines" in [remark.code for remark in mode.remarks] for mode in modes)
    for true in SLENDER:
        near = [mode for mode in modes if abs(mode.frequency - true.frequency) < 1]
        assert all(low <= true.damping_ratio <= high for low, high in (mode.interval()[1] for mode in near))


@pytest.mark.parametrize("half_width", [4.0, 8.0])
def test_error_of_zeta_under_a_window_is_its_own_size(half_width: float) -> None:
    """The convolution with the window adds 0.65 / half_width^2 to zeta, half_width in lines."""
    f, step = 400.0, 1 / RECORD
    modes = (Mode(f, half_width * step / f, 3e7), Mode(600.0, half_width * step / 600, 1e8))
    found = min(fit_modes(measured(RECORD / 2, 1e-5, modes=modes)), key=lambda mode: abs(mode.frequency - f))
    excess = found.damping_ratio / modes[0].damping_ratio - 1
    assert excess == pytest.approx(0.65 / half_width**2, rel=0.3)
    assert float(found.standard_error[1]) / found.damping_ratio == pytest.approx(excess, rel=0.6)
