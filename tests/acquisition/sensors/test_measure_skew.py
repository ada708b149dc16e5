"""Skew of two channels with the same signal, and its sign in the FRF, against closed forms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from acquisition import Channel, Structure, TapsEmulator, TapsSource, Trigger, capture_hits, estimate_frf, measure_skew

RATE = 25600.0
Array = NDArray[np.float64]


def both(skew: float, noise: float = 1e-3, seed: int = 1, seconds: float = 0.8) -> tuple[Array, Array]:
    """Return one signal on two channels, the second sampled later by this many samples. noise: share of the signal rms.

    The signal is a piece of a periodic one, white below 0.4 of the sample rate, so that it is known at every time.
    """
    random = np.random.default_rng(seed)
    length = int(seconds * RATE)
    size = length + 5000
    cycles = np.fft.rfftfreq(size)
    spectrum = np.where((cycles > 0) & (cycles < 0.4), random.normal(size=(2, cycles.size)).T @ [1, 1j], 0.0)
    first, second = np.fft.irfft(np.stack([spectrum, spectrum * np.exp(2j * np.pi * cycles * skew)]), size)[:, :length]
    errors = random.normal(scale=noise * np.std(first), size=(2, length))
    return first + errors[0], second + errors[1]


@pytest.mark.parametrize("skew", [0.0, 0.5, -0.5, 0.013, 1.0, -3.7])
def test_a_known_skew_is_found_to_a_thousandth_of_a_sample(skew: float) -> None:
    found = measure_skew(*both(skew), RATE)
    assert found.skew * RATE == pytest.approx(skew, abs=5e-5)
    assert found.skew == pytest.approx(skew / RATE, abs=5 * found.std)
    assert found.coherent_share > 0.6


@pytest.mark.parametrize("noise", [1e-4, 0.1])
def test_the_standard_error_is_honest(noise: float) -> None:
    deviations = []
    for seed in range(60):
        found = measure_skew(*both(0.5, noise=noise, seed=seed, seconds=0.7), RATE)
        deviations.append((found.skew * RATE - 0.5) / (found.std * RATE))
    assert 0.7 < np.sqrt(np.mean(np.square(deviations))) < 1.4


@given(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3), st.floats(-5, 5))
def test_units_gains_and_offsets_do_not_matter(one: float, other: float, offset: float) -> None:
    first, second = SIGNALS
    plain = measure_skew(first, second, RATE)
    scaled = measure_skew(one * (first + offset), other * (second - offset), RATE)
    assert scaled.skew == pytest.approx(plain.skew, abs=1e-9 / RATE)


SIGNALS = both(0.4)


def test_exchanged_channels_have_the_opposite_skew() -> None:
    first, second = SIGNALS
    there, back = measure_skew(first, second, RATE), measure_skew(second, first, RATE)
    assert back.skew == pytest.approx(-there.skew, rel=1e-9)


def test_different_signals_a_hum_and_an_inverted_channel_are_rejected() -> None:
    first, second = SIGNALS
    random = np.random.default_rng(1)
    with pytest.raises(ValueError, match=r"coherence over .* 0% .* 10%"):
        measure_skew(first, random.normal(size=first.size), RATE)
    hum = np.sin(2 * np.pi * 50 * np.arange(first.size) / RATE)
    one, other = hum + 1e-3 * random.normal(size=(2, first.size))
    with pytest.raises(ValueError, match="coherence over "):
        measure_skew(one, other, RATE)
    with pytest.raises(ValueError, match="opposite signs"):
        measure_skew(first, -second, RATE)


def test_records_that_are_none_are_rejected() -> None:
    first, second = SIGNALS
    with pytest.raises(ValueError, match=r"first record .*16384 "):
        measure_skew(first[:1000], second[:1000], RATE)
    with pytest.raises(ValueError, match="second record"):
        measure_skew(first, np.where(np.arange(second.size) == 7, np.nan, second), RATE)
    with pytest.raises(ValueError, match="differ in length"):
        measure_skew(first, second[:-1], RATE)
    with pytest.raises(ValueError, match="sample_rate=0"):
        measure_skew(first, second, 0)


@dataclass
class ScannedHits:
    """Structure hit four times a second, on a DAQ whose second channel is sampled later by a skew (s)."""

    structure: Structure
    skew: float

    def __call__(self, first_scan: int, n_scans: int) -> Array:
        time, width = (first_scan + np.arange(n_scans)) / RATE, 0.6e-3
        hit = np.maximum(np.floor((time - 0.1) / 0.25), 0)
        after = time - 0.1 - 0.25 * hit
        force = np.where((after >= 0) & (after <= width), 200 * np.sin(np.pi * after / width) ** 4, 0.0)
        return np.stack([force, 200 * self.structure.response(after + self.skew, width)])


def test_the_skew_of_a_scanned_daq_does_not_turn_the_phase_of_the_frf(
    channels: tuple[Channel, Channel], true_receptance: Callable[[Array], NDArray[np.complex128]], structure: Structure
) -> None:
    """Check Channel.skew > 0: the response is sampled later, so its spectrum leads and is turned back."""
    skew = 10e-6
    known = (replace(channels[0], adc_bits=24), replace(channels[1], adc_bits=24, skew=skew))
    signal = ScannedHits(structure, skew)
    with TapsEmulator(signal, known, RATE, realtime=False) as device, TapsSource(device.port) as source:
        source.start()
        hits = list(islice(capture_hits(source, Trigger(20.0, 5800, 512)), 3))
        source.stop()
    frf = estimate_frf(hits).in_band((1600.0, 3100.0))
    phase = np.angle(frf.receptance / true_receptance(frf.frequency))
    assert np.max(np.abs(phase)) < 0.1 * 2 * np.pi * 3000 * skew
    uncorrected = estimate_frf([replace(hit, channels=channels) for hit in hits]).in_band((1600.0, 3100.0))
    turned = np.angle(uncorrected.receptance / frf.receptance)
    assert turned == pytest.approx(2 * np.pi * frf.frequency * skew, abs=1e-9)
