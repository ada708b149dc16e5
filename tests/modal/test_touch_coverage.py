"""Stiffness of simulated structures from hits with further touches: bias, and coverage of the interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Hit, estimate_frf
from modal import fit_modes

Array = NDArray[np.float64]
N_HITS = 10


@dataclass(frozen=True)
class Disturbance:
    """Disturbances of the force of a hit besides its main pulse."""

    touches: int = 1
    """Number of further touches of 1 to 30 % of the main pulse, 0.5 to 20 ms after it."""
    noise: float = 0.05
    """N rms."""
    high_pass: float = 0.0
    """Corner frequency of the conditioner (Hz)."""
    hum: float = 0.0
    """Peak at 50 Hz (N)."""


@dataclass(frozen=True)
class Truth:
    """A driving point of three modes, and its recording."""

    modes: Array
    """Frequency (Hz), damping ratio and stiffness (N/m) of each."""
    rate: float
    seconds: float
    width: float
    """Foot of the main pulse (s)."""


def draw_truth(random: np.random.Generator) -> Truth:
    rate = float(np.exp(random.uniform(np.log(10e3), np.log(100e3))))
    shortest = max(2.5e-4, 8 / rate)
    width = float(np.exp(random.uniform(np.log(shortest), np.log(max(1e-3, 1.3 * shortest)))))
    places = (np.array([0.15, 0.42, 0.69]) + random.uniform(0, 0.2, 3)) / width
    zeta = random.uniform(0.008, 0.03, 3)
    stiffness = np.exp(random.uniform(np.log(2e7), np.log(4e8), 3))
    seconds = max(0.25, 5 / (2 * np.pi * float(np.min(places * zeta))) + 0.05)
    return Truth(np.column_stack([places, zeta, stiffness]), rate, seconds, width)


def make_hit(random: np.random.Generator, truth: Truth, how: Disturbance) -> Hit:
    """Make a hit at twice the sample rate, and filter force and response alike."""
    n = int(truth.seconds * truth.rate)
    time, frequency = np.arange(4 * n) / (2 * truth.rate), np.fft.rfftfreq(4 * n, 0.5 / truth.rate)
    start, peak, force = 0.02 + random.uniform() / truth.rate, random.uniform(150, 350), np.zeros(4 * n)
    earliest = max(0.5e-3, 1.1 * truth.width)
    pulses = [(0.0, 1.0, 1.0)]
    for _ in range(how.touches):
        delay, share = np.exp(random.uniform(np.log([earliest, 0.01]), np.log([20e-3, 0.3])))
        pulses.append((delay, share, random.uniform(0.8, 1.6)))
    for delay, share, wider in pulses:
        u = (time - start - delay) / (wider * truth.width)
        force += np.where((u > 0) & (u < 1), peak * share * np.sin(np.pi * u) ** 2, 0.0)
    spectrum = np.fft.rfft(force) / np.sqrt(1 + (frequency / (0.45 * truth.rate)) ** 16)
    receptance = sum(1 / k / (1 - (frequency / f) ** 2 + 2j * z * frequency / f) for f, z, k in truth.modes)
    high_pass = 1j * frequency / (1j * frequency + how.high_pass) if how.high_pass else 1.0
    parts = spectrum * high_pass, -((2 * np.pi * frequency) ** 2) * receptance * spectrum
    recorded, response = (np.fft.irfft(part, 4 * n)[::2][:n] for part in parts)
    recorded += how.noise * random.normal(size=n) + how.hum * np.sin(100 * np.pi * time[: 2 * n : 2] + start * 1e6)
    response += 1e-3 * np.max(np.abs(response)) * random.normal(size=n)
    return Hit(recorded, response, truth.rate, int(0.02 * truth.rate))


def measure_stiffness(truths: int, seed: int, how: Disturbance) -> tuple[Array, int, int]:
    """Return the relative errors of K of all modes, how many 95 % intervals miss the truth, and the lost modes."""
    errors, missed, lost = [], 0, 0
    for random in np.random.default_rng(seed).spawn(truths):
        truth = draw_truth(random)
        hits = [make_hit(random, truth, how) for _ in range(N_HITS)]
        found = fit_modes(estimate_frf(hits), hits=hits)
        for frequency, zeta, stiffness in truth.modes:
            near = [mode for mode in found if abs(mode.frequency - frequency) < 0.3 * zeta * frequency]
            if len(near) != 1:
                lost += 1
                continue
            low, high = near[0].interval()[2]
            errors.append(near[0].stiffness / stiffness - 1)
            missed += not low <= stiffness <= high
    return np.array(errors), missed, lost


CASES = {
    "quiet": Disturbance(),
    "noisy": Disturbance(noise=0.5),
    "three": Disturbance(touches=3, noise=0.2),
    "high pass": Disturbance(high_pass=2.0),
    "hum": Disturbance(hum=2.0),
}


@pytest.mark.parametrize("case", CASES)
def test_touches_do_not_bias_the_stiffness(case: str) -> None:
    errors, missed, lost = measure_stiffness(4, 1, CASES[case])
    assert abs(float(np.median(errors))) < 0.005
    assert missed <= 2
    assert lost == 0


@pytest.mark.long
@pytest.mark.parametrize("case", CASES)
def test_the_interval_of_the_stiffness_holds_the_truth_in_93_percent(case: str) -> None:
    errors, missed, lost = measure_stiffness(60, 2, CASES[case])
    assert abs(float(np.median(errors))) < 0.001
    assert missed <= 0.07 * errors.size
    assert lost <= 0.02 * errors.size
