"""Acceleration of the spindle housing during an emulated cut."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.emulation.milling import TipMotion

Floats = NDArray[np.float64]

SENSOR_MOUNT_FREQUENCY = 20e3
"""Above this frequency (Hz) the sensor, glued or on a magnet, hears less and less (12 dB an octave)."""
IDLE_HAMMER_NOISE = 0.1
"""rms of a hammer that lies idle (N)."""
HOUSING_OVERSAMPLING = 4
"""How much finer the motion is laid out before samples are taken from it."""
FFT_LENGTH_STEP = 4096
"""The motion is filled up to a multiple of so many samples: a length with a large prime factor is slow."""


@dataclass(frozen=True, eq=False)
class Housing:
    """The way from tool tip to sensor, and what else is heard there."""

    gain: tuple[float, float]
    """Acceleration of the housing over that of the tip along x and y, away from the modes of the housing."""
    modes: tuple[tuple[float, float, float], ...] = ()
    """Modes of the housing: frequency (Hz), damping ratio, and share of the gain that it adds at low frequency."""
    tones: tuple[tuple[float, float], ...] = ()
    """Frequency (Hz) and amplitude (m/s^2) of what sounds whether it cuts or not: pump, bearing, mains."""
    unbalance: float = 0.0
    """Amplitude at the frequency of the spindle (m/s^2)."""
    noise: float = 0.0
    """rms of the sensor and its cable (m/s^2)."""

    def transfer(self, frequency: NDArray[np.floating[Any]]) -> NDArray[np.complex128]:
        """Acceleration heard over acceleration of a tip, for a gain of 1, at frequencies (Hz), shape (n,)."""
        total = np.ones(frequency.shape, dtype=complex)
        for natural, zeta, share in self.modes:
            r = frequency / natural
            total += share / (1 - r**2 + 2j * zeta * r)
        r = frequency / SENSOR_MOUNT_FREQUENCY
        heard: NDArray[np.complex128] = total / (1 - r**2 + 2j * np.sqrt(0.5) * r)
        return heard


def make_random_housing(random: np.random.Generator, speed_rpm: float) -> Housing:
    """A housing as machines have them: gain 0.02 to 0.3, two or three modes, pump, bearing and mains, unbalance."""
    gain = np.exp(random.uniform(np.log(0.02), np.log(0.3)))
    modes = random.uniform((300.0, 0.01, 0.05), (6000.0, 0.05, 0.5), (int(random.integers(2, 4)), 3))
    pump = random.uniform(200, 6000)
    bearing = random.uniform(3.2, 9.8) * speed_rpm / 60
    mains = random.choice([50.0, 60.0]) * random.integers(1, 7)
    return Housing(
        (gain * random.uniform(0.5, 1), gain * random.uniform(0.5, 1)),
        tuple((float(f), float(zeta), float(share)) for f, zeta, share in modes),
        tuple((float(f), float(10 ** random.uniform(-1, 0.8))) for f in (pump, bearing, mains)),
        unbalance=float(10 ** random.uniform(-1, 0.5)),
        noise=float(10 ** random.uniform(-1.3, -0.3)),
    )


def sample_housing(
    motion: TipMotion, housing: Housing, speed_rpm: float, sample_rate: float, random: np.random.Generator
) -> Floats:
    """Acceleration of the housing (m/s^2) in a passage as a device samples it at a rate (Hz), shape (n,).

    speed_rpm: the true one. The device has no filter: what lies above half the sample rate is folded below it.
    """
    sound = HousingSignal(motion, housing, speed_rpm, sample_rate, random)
    return np.asarray(sound(0, sound.n_scans)[1])


@dataclass(eq=False)
class HousingSignal:
    """Signal function: (first_scan, n) -> force (N) and acceleration (m/s^2), shape (2, n), of a passage, repeated.

    The hammer lies idle. Call it in order.
    """

    motion: TipMotion
    """Motion of the tip, from rest to rest."""
    housing: Housing
    """Housing that the sensor is on."""
    speed_rpm: float
    """True spindle speed (rpm)."""
    sample_rate: float
    """Samples a second (Hz); what lies above half of it is folded below it."""
    random: np.random.Generator
    """Source of every random number."""
    _tip: Floats = field(init=False)
    _phases: Floats = field(init=False)

    def __post_init__(self) -> None:
        """Lay out what comes from the tip."""
        fine = _housing_acceleration(self.motion, self.housing)
        time = np.arange(int(self.motion.acceleration.shape[1] * self.sample_rate / self.motion.sample_rate))
        self._tip = np.interp(
            time * (HOUSING_OVERSAMPLING * self.motion.sample_rate / self.sample_rate), np.arange(fine.size), fine
        )
        self._phases = self.random.uniform(0, 2 * np.pi, len(self.housing.tones) + 1)

    @property
    def n_scans(self) -> int:
        """Of one passage."""
        return self._tip.size

    def __call__(self, first_scan: int, n_scans: int) -> Floats:
        """The next n_scans scans."""
        scan = np.arange(first_scan, first_scan + n_scans)
        signals = self.random.normal(scale=[[IDLE_HAMMER_NOISE], [self.housing.noise]], size=(2, n_scans))
        signals[1] += self._tip[scan % self._tip.size]
        lines = (*self.housing.tones, (self.speed_rpm / 60, self.housing.unbalance))
        for (frequency, amplitude), phase in zip(lines, self._phases, strict=True):
            signals[1] += amplitude * np.sin(2 * np.pi * frequency * scan / self.sample_rate + phase)
        return signals


def _housing_acceleration(motion: TipMotion, housing: Housing) -> Floats:
    """Acceleration of the housing from the tip, FINER times as many samples."""
    n = motion.acceleration.shape[1]
    long = math.ceil(n / FFT_LENGTH_STEP) * FFT_LENGTH_STEP
    spectrum = np.fft.rfft(np.array(housing.gain) @ motion.acceleration, long)
    spectrum *= housing.transfer(np.fft.rfftfreq(long, 1 / motion.sample_rate))
    return HOUSING_OVERSAMPLING * np.fft.irfft(spectrum, HOUSING_OVERSAMPLING * long)[: HOUSING_OVERSAMPLING * n]
