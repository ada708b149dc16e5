"""Spectra of recorded cuts, their peaks above the noise, and folded frequencies."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from lobewatch.arrays import Flags, Floats, Indices


def fold_frequency(frequency: Floats | float, rate: Floats | float) -> Floats:
    """Fold frequencies (Hz) to between 0 and half of a rate (Hz), of samples or of teeth."""
    remainder = np.mod(frequency, rate)
    return np.asarray(np.minimum(remainder, rate - remainder))


def sideband_distance(frequency: Floats | float, chatter: float, teeth: float) -> Floats:
    """Return the distance (Hz) of frequencies from the nearest sideband +-chatter + k teeth."""
    return np.minimum(fold_frequency(frequency - chatter, teeth), fold_frequency(frequency + chatter, teeth))


BLACKMAN_HARRIS = (0.35875, -0.48829, 0.14128, -0.01168)
"""Coefficients of the Blackman-Harris window, side lobes -92 dB (Harris 1978, Proc. IEEE 66, 51-83)."""
PADDING_FACTOR = 2
"""Length of the transform over that of the signal (zero padding)."""
NOISE_BINS = 64
"""Number of bins for the local noise."""
NOISE_QUANTILE = 0.25
"""Quantile of the power in these bins that is the noise; peaks may fill the rest."""
MIN_PEAK_POWER = 25.0
"""Smallest power of a peak over the noise; noise reaches it once in 1e11 bins."""
MIN_PEAK_DISTANCE = 1.5
"""Smallest distance of two separate peaks (bins)."""
SKIRT_BINS = 10.0
"""Largest distance of the skirt of a peak (bins): 5 of the width of the window."""
SKIRT_AMPLITUDE_RATIO = 3.0
"""Amplitude of a peak over that of a fainter one on its skirt, a tenth of its power."""
PEAK_FREQUENCY_ERROR = 0.3
"""Standard error of the frequency of a peak times the root of its signal-to-noise ratio (bins)."""
MIN_UNSTEADINESS = 1e-4
"""Relative speed variation of every spindle; chosen."""
PEAK_TOLERANCE = 1.2
"""Largest distance of a peak from a frequency that it belongs to (bins)."""
MAX_AIR_POWER_RATIO = 9.0
"""Power of a peak over its power in air, up to which it is not caused by the cut."""
AIR_PEAK_TOLERANCE = 2.0
"""Distance up to which a peak in air is the same peak (bins of the air spectrum)."""
MAX_HARMONICS = 16
"""Number of harmonics below half the sample rate, under which any harmonic limits the folded ones; chosen."""
MIN_PEAK_FREQUENCY_ERROR = 0.03
"""Smallest standard error of the frequency of a peak (bins)."""


class Spectrum(NamedTuple):
    """Spectrum of a part of a recording."""

    frequency: Floats
    """Frequencies (Hz), shape (n,)."""
    power: Floats
    """Squared sine amplitude ((m/s^2)^2), shape (n,)."""
    noise: Floats
    """Power of the noise ((m/s^2)^2), shape (n,)."""
    bin_width: float
    """Reciprocal length of the part (Hz)."""
    sample_rate: float
    """Sample rate of the recording (Hz)."""

    def max_power_near(self, frequency: Floats, bins: float) -> Floats:
        """Return the largest power within some bins of frequencies (Hz)."""
        wide = 2 * max(round(bins * self.bin_width / self.frequency[1]), 1) + 1
        return np.asarray(np.interp(frequency, self.frequency, scipy.ndimage.maximum_filter1d(self.power, wide)))


Spectra = Sequence[Spectrum]
"""Spectra of all axes."""


@dataclass(frozen=True, eq=False)
class SpectralPeaks:
    """Peaks of a spectrum."""

    frequency: Floats
    """Frequency of each peak (Hz), shape (n,)."""
    amplitude: Floats
    """Amplitude of each peak (m/s^2), shape (n,)."""
    clearness: Floats
    """Signal-to-noise ratio of the power of each peak, shape (n,)."""

    def __getitem__(self, places: Flags | Indices) -> "SpectralPeaks":
        return SpectralPeaks(self.frequency[places], self.amplitude[places], self.clearness[places])

    def __len__(self) -> int:
        return self.frequency.size

    @property
    def energy(self) -> float:
        """Energy of all peaks ((m/s^2)^2)."""
        return float(np.sum(self.amplitude**2))

    def loudest(self, count: int) -> "SpectralPeaks":
        """Return the loudest peaks, the loudest first, at most `count`."""
        return self[np.argsort(-self.amplitude)[:count]]

    def frequency_error(self, bin_width: float) -> Floats:
        """Return the standard error of each frequency (Hz), shape (n,); bin_width: of the spectrum (Hz)."""
        error = np.hypot(PEAK_FREQUENCY_ERROR / np.sqrt(self.clearness), MIN_PEAK_FREQUENCY_ERROR)
        return np.asarray(bin_width * error)


def compute_spectrum(signal: Floats, sample_rate: float) -> Spectrum:
    """Compute the spectrum of a part of a recording; signal in m/s^2, shape (n,)."""
    size = scipy.fft.next_fast_len(PADDING_FACTOR * signal.size, real=True)
    power, step = compute_power(signal, size), sample_rate / size
    return Spectrum(np.arange(power.size) * step, power, _noise_level(power), sample_rate / signal.size, sample_rate)


def compute_power(signal: Floats, size: int) -> Floats:
    """Compute the squared amplitude at each frequency, shape (size // 2 + 1,), of a zero-padded signal."""
    phase = 2 * np.pi * (np.arange(signal.size) + 0.5) / signal.size
    window = sum(share * np.cos(k * phase) for k, share in enumerate(BLACKMAN_HARRIS))
    return np.asarray((2 * np.abs(scipy.fft.rfft((signal - np.mean(signal)) * window, size)) / np.sum(window)) ** 2)


def compute_spectra(signal: Floats, sample_rate: float) -> list[Spectrum]:
    """Compute the spectrum of each axis; signal of shape (n,) or (axes, n)."""
    return [compute_spectrum(axis, sample_rate) for axis in np.atleast_2d(signal)]


def _noise_level(power: Floats) -> Floats:
    """Return the mean noise power, from the quiet bins of each neighborhood (power of noise is exponential)."""
    count = max(power.size // (PADDING_FACTOR * NOISE_BINS), 2)
    size, n_longer = divmod(power.size, count)
    end = n_longer * (size + 1)
    blocks = power[:end].reshape(n_longer, size + 1), power[end:].reshape(count - n_longer, size)
    quiet = np.concatenate([np.quantile(block, NOISE_QUANTILE, axis=1) for block in blocks if len(block)])
    sizes = np.repeat([size + 1, size], [n_longer, count - n_longer])
    level, middle = quiet / -np.log(1 - NOISE_QUANTILE), np.cumsum(sizes) - sizes / 2
    return np.asarray(np.maximum(np.interp(np.arange(power.size), middle, level), np.finfo(np.float64).tiny))


def remove_skirts(peaks: SpectralPeaks, bin_width: float) -> SpectralPeaks:
    """Remove peaks next to a far louder one: a wavering speed widens a peak, with a row of peaks on its slope.

    bin_width: of the spectrum (Hz).
    """
    apart = np.abs(peaks.frequency[:, np.newaxis] - peaks.frequency) < SKIRT_BINS * bin_width
    return peaks[~np.any(apart & (peaks.amplitude > SKIRT_AMPLITUDE_RATIO * peaks.amplitude[:, np.newaxis]), axis=1)]


def join_peaks(axes: Sequence[SpectralPeaks]) -> SpectralPeaks:
    """Join the peaks of several axes."""
    parts = zip(*((peaks.frequency, peaks.amplitude, peaks.clearness) for peaks in axes), strict=True)
    return SpectralPeaks(*map(np.concatenate, parts))


def find_peaks(spectrum: Spectrum, clear: float = MIN_PEAK_POWER) -> SpectralPeaks:
    """Find peaks with `clear` times the noise power; frequency and amplitude by a parabola through log power."""
    power = spectrum.power
    wide = 2 * max(round(MIN_PEAK_DISTANCE * spectrum.bin_width / spectrum.frequency[1]), 1) + 1
    at = np.flatnonzero((power == scipy.ndimage.maximum_filter1d(power, wide)) & (power > clear * spectrum.noise))
    at = at[(at > 2 * PADDING_FACTOR) & (at < power.size - 1)]
    before, top, after = (np.log(np.maximum(power[at + shift], np.finfo(np.float64).tiny)) for shift in (-1, 0, 1))
    bend = before - 2 * top + after
    shift = 0.5 * (before - after) / np.where(bend < 0, bend, -1.0)
    amplitude = np.sqrt(np.exp(top - 0.25 * (before - after) * shift))
    return SpectralPeaks((at + shift) * spectrum.frequency[1], amplitude, power[at] / spectrum.noise[at])


def find_separate_peaks(spectrum: Spectrum, distance: float = 0.0, edge: float = 0.0) -> SpectralPeaks:
    """Find peaks without those on the skirts of others.

    distance: from any louder peak, at least (Hz); edge: smallest amplitude over that of another peak times their
    distance (Hz).
    """
    peaks = remove_skirts(find_peaks(spectrum), spectrum.bin_width)
    apart = np.abs(peaks.frequency[:, np.newaxis] - peaks.frequency)
    least = np.where(apart < distance, 1.0, edge / np.maximum(apart, spectrum.bin_width))
    np.fill_diagonal(least, 0.0)
    return peaks[np.all(peaks.amplitude[:, np.newaxis] >= least * peaks.amplitude, axis=1)]
