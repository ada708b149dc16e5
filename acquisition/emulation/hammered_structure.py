"""Signals of hammer and accelerometer on a structure of known modes, exact in continuous time.

A pulse is F(t) = A sin^4(pi t/T), 0 <= t <= T: a sum of three cosines. The response of each mode is known in closed
form: a forced and a free part during the pulse, a free part after it. Hence the samples contain no integration error.
A static residual flexibility represents the modes left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from acquisition.arrays import AnyFloats, Complexes, Floats

NOISE_BLOCK_SCANS = 512
"""Scans whose noise is generated at once. Blocks of any multiple of them have the same noise."""
_PULSE_HARMONICS = np.array([3 / 8, -1 / 2, 1 / 8])
"""sin^4(pi t/T) = 3/8 - 1/2 cos(2 pi t/T) + 1/8 cos(4 pi t/T)."""


@dataclass(frozen=True, eq=False)
class Structure:
    """Dynamics from the hammer's point to the sensor: modes with viscous damping and a static residual.

    Examples
    --------
    >>> spindle = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> time = np.arange(4096) / 10240.0
    >>> response = spindle.response(time, width=1e-3)  # m/s^2 after a pulse of 1 N
    >>> bool(abs(response[time > 0.3]).max() < 1e-3 * abs(response).max())
    True
    """

    frequency: Floats
    """Undamped natural frequencies (Hz), shape (n,)."""
    damping_ratio: Floats
    """Viscous damping ratios (-), shape (n,)."""
    stiffness: Floats
    """Modal stiffnesses from hammer to sensor (N/m), shape (n,). Negative if both move in opposite directions."""
    residual: float = 0.0
    """Static flexibility of all other modes (m/N)."""

    def response(self, time: AnyFloats, width: float) -> Floats:
        """Return the acceleration after a pulse sin^4(pi t/T) of 1 N.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Times after the start of the pulse (s).
        width
            Foot width T of the pulse (s).

        Returns
        -------
        ndarray, shape (n,)
            Acceleration (m/s^2).
        """
        w = 2 * np.pi * self.frequency
        nu = 2 * np.pi / width * np.arange(3)
        decay = self.damping_ratio * w
        root = -decay + 1j * w * np.sqrt(1 - self.damping_ratio**2)
        r = nu / w[:, None]
        forced = _PULSE_HARMONICS / (self.stiffness[:, None] * (1 - r**2 + 2j * self.damping_ratio[:, None] * r))
        start = -_free_amplitude(forced.sum(1).real, (forced * 1j * nu).sum(1).real, root)
        end = start * np.exp(root * width)
        after = _free_amplitude(forced.sum(1).real + end.real, (forced * 1j * nu).sum(1).real + (root * end).real, root)
        during, later = (time >= 0) & (time < width), time >= width
        result = np.zeros(time.shape)
        wave = np.exp(1j * np.outer(nu, time[during]))
        quasi_static = (self.residual * _PULSE_HARMONICS * -(nu**2)) @ wave
        free = (start * root**2) @ np.exp(np.outer(root, time[during]))
        result[during] = ((forced * -(nu**2)).sum(0) @ wave).real + quasi_static.real + free.real
        result[later] = ((after * root**2) @ np.exp(np.outer(root, time[later] - width))).real
        return result


def _free_amplitude(displacement: Floats, velocity: Floats, root: Complexes) -> Complexes:
    """Return C such that Re(C exp(root t)) has this displacement and velocity at t = 0, shape (n,)."""
    return displacement + 1j * (root.real * displacement - velocity) / root.imag


@dataclass(frozen=True)
class Hammering:
    """Impacts of an emulated operator."""

    force_range: tuple[float, float] = (150.0, 350.0)
    """Range of the peak force (N)."""
    width_range: tuple[float, float] = (0.55e-3, 0.75e-3)
    """Range of the foot width of the pulse (s)."""
    interval_range: tuple[float, float] = (0.4, 0.5)
    """Range of the time between impacts (s)."""
    double_hits: float = 0.05
    """Share of double hits: two touches that are equal within 10 %."""
    overloads: float = 0.05
    """Share of impacts that are far too hard."""
    force_noise: float = 0.1
    """Noise of the force (N rms)."""
    response_noise: float = 2.0
    """Noise of the acceleration (m/s^2 rms)."""


@dataclass(eq=False)
class HammeredStructure:
    """Signal function (first_scan, n_scans) of a structure that is hit. Call it in order.

    It returns force (N) and acceleration (m/s^2), shape (2, n_scans), with one more row per cross structure.
    """

    structure: Structure
    """Structure that is hit."""
    sample_rate: float
    """Sample rate (Hz)."""
    random: np.random.Generator
    """Generator of all random numbers."""
    hammering: Hammering = field(default_factory=Hammering)
    """Impacts."""
    cross_structures: Sequence[Structure] = ()
    """Modes from the hammer to each further sensor."""
    _noise: np.random.Generator = field(init=False)
    _next_hit: float = field(default=0.0, init=False)
    _waves: list[tuple[int, Floats]] = field(default_factory=list, init=False)

    def __post_init__(self) -> None:
        """Give the noise its own generator, so that hits do not depend on the block length."""
        self._noise = self.random.spawn(1)[0]

    def __call__(self, first_scan: int, n_scans: int) -> Floats:
        """Return the next scans."""
        while self._next_hit < first_scan + n_scans:
            self._next_hit += self.random.uniform(*self.hammering.interval_range) * self.sample_rate
            self._waves.append(self._hit(self._next_hit))
        signals = self._draw_noise(n_scans)
        self._waves = [(start, wave) for start, wave in self._waves if start + wave.shape[1] > first_scan]
        for start, wave in self._waves:
            low, high = max(start, first_scan), min(start + wave.shape[1], first_scan + n_scans)
            if low < high:
                signals[:, low - first_scan : high - first_scan] += wave[:, low - start : high - start]
        return signals

    def _draw_noise(self, n_scans: int) -> Floats:
        rms = [self.hammering.force_noise, *[self.hammering.response_noise] * (1 + len(self.cross_structures))]
        pieces, rest = divmod(n_scans, NOISE_BLOCK_SCANS)
        blocks = self._noise.standard_normal((pieces, len(rms), NOISE_BLOCK_SCANS))
        noise = np.concatenate([*blocks, self._noise.standard_normal((len(rms), rest))], axis=1)
        return np.asarray(np.array(rms)[:, np.newaxis] * noise)

    def _hit(self, scan: float) -> tuple[int, Floats]:
        peak = self.random.uniform(*self.hammering.force_range)
        width = self.random.uniform(*self.hammering.width_range)
        fault = self.random.uniform()
        if fault > 1 - self.hammering.overloads:
            peak *= 20
        structures = self.structure, *self.cross_structures
        slowest = min(np.min(2 * np.pi * modes.frequency * modes.damping_ratio) for modes in structures)
        length = int((13 * width + 14 / slowest) * self.sample_rate)  # until it has decayed to a millionth
        start = int(np.ceil(scan))
        time = (start - scan + np.arange(length)) / self.sample_rate
        wave = peak * self._pulse(time, width)
        if fault < self.hammering.double_hits:
            delay = self.random.uniform(4, 12) * width
            wave += self.random.uniform(0.9, 1.1) * peak * self._pulse(time - delay, width)
        return start, wave

    def _pulse(self, time: AnyFloats, width: float) -> Floats:
        force = np.where((time >= 0) & (time <= width), np.sin(np.pi * time / width) ** 4, 0.0)
        structures = (self.structure, *self.cross_structures)
        return np.stack([force, *(structure.response(time, width) for structure in structures)])
