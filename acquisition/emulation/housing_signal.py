"""Acceleration of the spindle housing during an emulated cut."""

import math
from dataclasses import dataclass, field

import numpy as np

from acquisition.arrays import AnyFloats, Complexes, Floats
from acquisition.emulation.milling import TipMotion

SENSOR_MOUNT_FREQUENCY = 20e3
"""Frequency above which the sensor mount attenuates by 12 dB per octave (Hz)."""
IDLE_HAMMER_NOISE = 0.1
"""Noise of an idle hammer (N rms)."""
HOUSING_OVERSAMPLING = 4
"""Oversampling of the motion before samples are taken from it."""
FFT_LENGTH_STEP = 4096
"""Length step to which the motion is padded. A length with a large prime factor is slow."""


@dataclass(frozen=True, eq=False)
class Housing:
    """Transfer path from tool tip to sensor, with the disturbances there."""

    gain: tuple[float, float]
    """Acceleration of the housing over that of the tip along x and y, away from the housing modes."""
    modes: tuple[tuple[float, float, float], ...] = ()
    """Housing modes: frequency (Hz), damping ratio, and share of the gain added at low frequency."""
    tones: tuple[tuple[float, float], ...] = ()
    """Frequency (Hz) and amplitude (m/s^2) of constant tones: pump, bearing, mains."""
    unbalance: float = 0.0
    """Amplitude at the frequency of the spindle (m/s^2)."""
    noise: float = 0.0
    """Noise of the sensor and its cable (m/s^2 rms)."""

    def transfer(self, frequency: AnyFloats) -> Complexes:
        """Return the transfer function from tip to sensor acceleration for a gain of 1.

        Parameters
        ----------
        frequency : ndarray, shape (n,)
            Frequencies (Hz).
        """
        total = np.ones(frequency.shape, dtype=complex)
        for natural, zeta, share in self.modes:
            r = frequency / natural
            total += share / (1 - r**2 + 2j * zeta * r)
        r = frequency / SENSOR_MOUNT_FREQUENCY
        transfer: Complexes = total / (1 - r**2 + 2j * np.sqrt(0.5) * r)
        return transfer


def make_random_housing(random: np.random.Generator, speed_rpm: float) -> Housing:
    """Make a random housing of a typical machine.

    The gain is 0.02 to 0.3, with two or three modes, tones of pump, bearing and mains, and unbalance.

    Parameters
    ----------
    random
        Generator of all random numbers.
    speed_rpm
        Spindle speed (rpm).

    Returns
    -------
    Housing
        Housing with its disturbances.
    """
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
    """Sample the acceleration of the housing in one passage.

    The device has no filter: content above half the sample rate is folded below it.

    Parameters
    ----------
    motion
        Motion of the tool tip, from rest to rest.
    housing
        Housing that carries the sensor.
    speed_rpm
        True spindle speed (rpm).
    sample_rate
        Sample rate of the device (Hz).
    random
        Generator of all random numbers.

    Returns
    -------
    ndarray, shape (n,)
        Acceleration (m/s^2).
    """
    signal = HousingSignal(motion, housing, speed_rpm, sample_rate, random)
    return np.asarray(signal(0, signal.n_scans)[1])


@dataclass(eq=False)
class HousingSignal:
    """Signal function (first_scan, n_scans) of a passage, repeated, with an idle hammer. Call it in order.

    It returns force (N) and acceleration (m/s^2), shape (2, n_scans).
    """

    motion: TipMotion
    """Motion of the tip, from rest to rest."""
    housing: Housing
    """Housing that carries the sensor."""
    speed_rpm: float
    """True spindle speed (rpm)."""
    sample_rate: float
    """Sample rate (Hz). Content above half of it is folded below it."""
    random: np.random.Generator
    """Generator of all random numbers."""
    _tip: Floats = field(init=False)
    _phases: Floats = field(init=False)

    def __post_init__(self) -> None:
        fine = _housing_acceleration(self.motion, self.housing)
        time = np.arange(int(self.motion.acceleration.shape[1] * self.sample_rate / self.motion.sample_rate))
        place = time * (HOUSING_OVERSAMPLING * self.motion.sample_rate / self.sample_rate)
        self._tip = np.interp(place, np.arange(fine.size), fine)
        self._phases = self.random.uniform(0, 2 * np.pi, len(self.housing.tones) + 1)

    @property
    def n_scans(self) -> int:
        """Scans per passage."""
        return self._tip.size

    def __call__(self, first_scan: int, n_scans: int) -> Floats:
        """Return the next scans."""
        scan = np.arange(first_scan, first_scan + n_scans)
        signals = self.random.normal(scale=[[IDLE_HAMMER_NOISE], [self.housing.noise]], size=(2, n_scans))
        signals[1] += self._tip[scan % self._tip.size]
        lines = (*self.housing.tones, (self.speed_rpm / 60, self.housing.unbalance))
        for (frequency, amplitude), phase in zip(lines, self._phases, strict=True):
            signals[1] += amplitude * np.sin(2 * np.pi * frequency * scan / self.sample_rate + phase)
        return signals


def _housing_acceleration(motion: TipMotion, housing: Housing) -> Floats:
    """Return the oversampled acceleration of the housing caused by the tip."""
    n = motion.acceleration.shape[1]
    length = math.ceil(n / FFT_LENGTH_STEP) * FFT_LENGTH_STEP
    spectrum = np.fft.rfft(np.array(housing.gain) @ motion.acceleration, length)
    spectrum *= housing.transfer(np.fft.rfftfreq(length, 1 / motion.sample_rate))
    return HOUSING_OVERSAMPLING * np.fft.irfft(spectrum, HOUSING_OVERSAMPLING * length)[: HOUSING_OVERSAMPLING * n]
