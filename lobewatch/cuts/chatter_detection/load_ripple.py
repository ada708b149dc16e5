"""Ripple of the loudness or the speed of a cut, which is no chatter.

Where depth or speed ripple, tooth passing is modulated as a whole: around all its multiples, and around those of the
spindle, stand the same side bands relative to each. Ripple of the speed is undone by sampling again at equal angles
(Fyfe & Munck 1997, Mech. Syst. Signal Process. 11, 187-205), ripple of the loudness is known by its side bands.
"""

from typing import NamedTuple

import numpy as np
import scipy

from lobewatch.arrays import Complexes, Flags, Floats, Indices
from lobewatch.cuts.chatter_detection import spectrum as spectral
from lobewatch.cuts.chatter_detection.spectrum import Spectra, SpectralPeaks, Spectrum
from lobewatch.cuts.chatter_detection.tooth_passing_comb import refine_comb

MAX_RIPPLE_FREQUENCY = 30.0
"""Highest frequency of a ripple (Hz): ball screws, ribs and small circles are slower."""
MIN_RIPPLE_FREQUENCY = 0.5
"""Lowest frequency of a ripple (Hz); chosen."""
MAX_BAND_SHARE = 0.45
"""Half width of the band around a multiple over the spindle frequency, at most; chosen."""
BAND_MARGIN = 1.3
"""Half width of that band over the highest frequency of a ripple; chosen."""
N_CARRIERS = 12
"""Number of loudest multiples of each axis that are followed; chosen."""
MIN_CARRIER_CLEARNESS = 1e3
"""Smallest power of a followed multiple over the noise; chosen."""


class Ripple(NamedTuple):
    """Ripple of a cut: the same relative side bands around all multiples of tooth passing."""

    frequency: float
    """Frequency of the ripple (Hz)."""
    loudness: float
    """Amplitude of the loudness over its mean."""
    speed: float
    """Amplitude of the spindle speed over its mean."""

    def energy_beyond(self, peaks: SpectralPeaks, turn: float, bin_width: float) -> float:
        """Return the energy of peaks that are no ripples away from a near multiple of the spindle frequency; in Hz.

        A stable cut with a steady ripple, and its modes that ring after each rib, have next to none there.
        """
        reach = np.ceil(MAX_SIDEBAND_DISTANCE / turn)
        orders = np.round(peaks.frequency / turn) + np.arange(-reach, reach + 1)[:, np.newaxis]
        beyond = peaks.frequency - turn * orders
        away = np.abs(beyond - self.frequency * np.round(beyond / self.frequency))
        is_ripple = (np.abs(beyond) < MAX_SIDEBAND_DISTANCE) & (away < spectral.PEAK_TOLERANCE * bin_width)
        return peaks[~np.any(is_ripple, axis=0)].energy


class Envelopes(NamedTuple):
    """Multiples of the spindle frequency as they change in time."""

    frequency: Floats
    """Frequency of each multiple (Hz), shape (n,)."""
    value: Complexes
    """Complex amplitude of each multiple over time, shape (n, times)."""
    rate: float
    """Sample rate of the times (Hz)."""


def follow_multiples(axes: Floats, spectra: Spectra, turn: float) -> Envelopes:
    """Follow the loudest multiples of the spindle frequency `turn` (Hz); axes: signals, shape (axes, n)."""
    rate, size = spectra[0].sample_rate, axes.shape[1]
    band = min(BAND_MARGIN * MAX_RIPPLE_FREQUENCY, MAX_BAND_SHARE * turn)
    half = int(band * size / rate)
    frequencies, envelopes = [], []
    for axis, spectrum in zip(axes, spectra, strict=True):
        transform = scipy.fft.rfft(axis - np.mean(axis))
        for frequency in _find_carriers(spectrum, turn):
            middle = round(frequency * size / rate)
            if middle > half and middle + half < transform.size:
                bins = transform[middle - half : middle + half + 1] * scipy.signal.windows.tukey(2 * half + 1, 0.3)
                padded = np.zeros(4 * half, dtype=complex)
                padded[: half + 1], padded[-half:] = bins[half:], bins[:half]
                envelope = scipy.fft.ifft(padded) * (padded.size / size)
                times = np.arange(padded.size) * (size / rate / padded.size)
                frequencies.append(frequency)
                envelopes.append(envelope * np.exp(2j * np.pi * (middle * rate / size - frequency) * times))
    value = np.array(envelopes).reshape(len(envelopes), 4 * half)
    return Envelopes(np.array(frequencies), value, 4 * half * rate / size)


def _find_carriers(spectrum: Spectrum, turn: float) -> Floats:
    """Find the loudest multiples of a turn (Hz) that are clear of the noise, above the first."""
    multiples = turn * np.arange(2, int(spectrum.sample_rate / 2 / turn), dtype=np.float64)
    power = spectrum.max_power_near(multiples, 2 * spectral.PEAK_TOLERANCE)
    clear = power > MIN_CARRIER_CLEARNESS * np.interp(multiples, spectrum.frequency, spectrum.noise)
    loudest = np.argsort(-np.where(clear, power, 0.0))[:N_CARRIERS]
    return np.asarray(multiples[loudest[clear[loudest]]])


MIN_AGREEMENT = 0.6
"""Smallest share of the multiples whose phases change like those of the others; chosen."""
MIN_AGREEING_CARRIERS = 3
"""Smallest number of multiples that must agree, as chatter near one of them is no ripple."""
MIN_DEVIATION = 2e-6
"""Smallest standard deviation of the turning of the spindle from an even one (s): 4 degrees at 5 kHz; chosen."""
MAX_SPEED_RIPPLE = 5e-3
"""Largest relative change of the speed of a spindle in a cut, beyond which the phases are of no comb; chosen."""
N_DEVIATION_STEPS = 3
"""Number of steps in which the common turning is found; chosen."""
EDGE_BANDS = 1.5
"""Reciprocals of the band that are disturbed at the ends of an envelope; chosen."""


def find_deviation(envelopes: Envelopes) -> Floats:
    """Find by how much the spindle is ahead of an even turning (s) at each time, shape (times,); empty if it is even.

    The phases of the multiples, each over its frequency, must agree.
    """
    if len(envelopes.frequency) < MIN_AGREEING_CARRIERS:
        return np.zeros(0)
    rate = 2 * np.pi * envelopes.frequency[:, np.newaxis]
    inside = _inner_times(envelopes.value.shape[1])
    common, turned = np.zeros(envelopes.value.shape[1]), envelopes.value
    for _ in range(N_DEVIATION_STEPS):
        rest = np.unwrap(np.angle(turned), axis=1) / rate
        rest -= np.median(rest[:, inside], axis=1, keepdims=True)
        ahead = common + rest
        common = np.median(ahead, axis=0)
        turned = envelopes.value * np.exp(-1j * rate * common)
    common[: inside.start], common[inside.stop :] = common[inside.start], common[inside.stop - 1]
    is_likely = np.max(np.abs(np.diff(common))) * envelopes.rate < MAX_SPEED_RIPPLE
    is_common = np.std(common[inside]) > MIN_DEVIATION and _agreement(ahead[:, inside]) > MIN_AGREEMENT
    return common if is_likely and is_common else np.zeros(0)


def _inner_times(count: int) -> slice:
    """Return the times that the ends do not disturb; a band has four times for each of its reciprocals."""
    edge = round(4 * EDGE_BANDS)
    return slice(edge, max(count - edge, edge + 1))


def _agreement(changes: Floats) -> float:
    """Return the share of rows that differ from the median of the others by less than half of its size."""
    rows = changes - np.mean(changes, axis=1, keepdims=True)
    others = np.stack([np.median(np.delete(rows, i, axis=0), axis=0) for i in range(len(rows))])
    return float(np.mean(np.std(rows - others, axis=1) < 0.5 * np.std(others, axis=1)))


MIN_LOUDNESS_RIPPLE, MIN_SPEED_RIPPLE = 0.03, 1e-4
"""Smallest ripple of loudness and of speed, relative, that is reported; chosen."""
MIN_RIPPLE_SHARE = 0.5
"""Smallest share of the changes of a ripple that its frequency explains; corners and entries have none; chosen."""


def find_ripple(envelopes: Envelopes, ahead: Floats) -> Ripple | None:
    """Find the ripple that most multiples share, or None.

    ahead: by how much the spindle is ahead (s), as by `find_deviation`; empty if it turns evenly.
    """
    if len(envelopes.frequency) < MIN_AGREEING_CARRIERS:
        return None
    inside = _inner_times(envelopes.value.shape[1])
    level = np.abs(envelopes.value[:, inside])
    level /= np.mean(level, axis=1, keepdims=True)
    speed = np.gradient(ahead, 1 / envelopes.rate)[inside] if ahead.size else np.zeros(level.shape[1])
    loudness = np.median(level, axis=0) if _agreement(level) > MIN_AGREEMENT else np.ones(level.shape[1])
    loud_hz, loud_size = _main_swing(loudness, envelopes.rate)
    speed_hz, speed_size = _main_swing(speed, envelopes.rate)
    loud, fast = loud_size / MIN_LOUDNESS_RIPPLE, speed_size / MIN_SPEED_RIPPLE
    if max(loud, fast) < 1:
        return None
    return Ripple(loud_hz if loud > fast else speed_hz, loud_size if loud > 1 else 0.0, speed_size if fast > 1 else 0.0)


SWING_PADDING = 4
"""Zero-padding factor of the search for the frequency of a ripple; chosen."""


def _main_swing(values: Floats, rate: float) -> tuple[float, float]:
    """Return frequency (Hz) and amplitude of the swing that explains most of the changes of values; 0 if none does."""
    changes = (values - np.mean(values)) * np.hanning(values.size)
    power = np.abs(np.fft.rfft(changes, SWING_PADDING * values.size)) ** 2
    frequency = np.fft.rfftfreq(SWING_PADDING * values.size, 1 / rate)
    inside = (frequency >= MIN_RIPPLE_FREQUENCY) & (frequency <= MAX_RIPPLE_FREQUENCY)
    best = int(np.argmax(np.where(inside, power, 0.0)))
    near = np.abs(frequency - frequency[best]) < 2.5 * rate / values.size
    total = float(np.sum(power))
    if not inside[best] or float(np.sum(power[near])) <= MIN_RIPPLE_SHARE * total:
        return 0.0, 0.0
    before, top, after = np.log(np.maximum(power[best - 1 : best + 2], np.finfo(np.float64).tiny))
    shift = 0.5 * (before - after) / min(before - 2 * top + after, -abs(before - after), -1e-12)
    return float((best + shift) * frequency[1]), float(np.sqrt(2) * np.std(values))


RESAMPLING_FACTOR = 3
"""Oversampling before a signal is sampled at equal angles, as splines are inexact near half the rate; chosen."""


def sample_evenly(axes: Floats, deviation: Floats) -> Floats:
    """Sample signals again at equal angles of the spindle; axes: shape (axes, n), deviation in samples, shape (n,)."""
    size = axes.shape[1]
    places = RESAMPLING_FACTOR * (np.arange(size) - deviation)
    fine = RESAMPLING_FACTOR * scipy.fft.irfft(scipy.fft.rfft(axes, axis=1), RESAMPLING_FACTOR * size, axis=1)
    return np.stack([scipy.ndimage.map_coordinates(axis, [places], order=3, mode="nearest") for axis in fine])


MAX_SIDEBAND_RATIO = 4.0
"""Largest amplitude of a side band of ripple over the usual one of other multiples, both relative; chosen."""
MAX_SIDEBAND_AMPLITUDE = 0.4
"""Largest amplitude of a side band of ripple over its multiple: half of a loudness that ripples by 80 %."""
MAX_SIDEBAND_DISTANCE = 200.0
"""Largest distance of a side band of ripple from its multiple (Hz): ribs at 25 Hz have eight."""
MAX_LOAD_DISTANCE = 4.0
"""Distance of a peak from a multiple (Hz) within which it may show corners, entry and exit; chosen."""
MIN_PAIR_RATIO = 0.5
"""Smallest amplitude ratio of two side bands that ripple makes next to a multiple, if no other can be compared; chosen.

Chatter is above or below a multiple."""
MIN_KNOWN_SIDEBANDS = 4
"""Smallest number of places next to other multiples where a common side band would be clear of the noise; chosen."""
NOISE_MARGIN = 2.0
"""Expected amplitude of a side band over the noise, below which its absence shows nothing; chosen."""
MAX_HARMONIC_RATIO = 3.0
"""Largest amplitude of a harmonic of a ripple over its first one divided by the order: pulses of a tenth have 3."""
OWN_SIDEBAND_BINS = 4.0
"""Distance from a multiple within which there is no side band of another one (bins), half the main lobe."""


def find_ripple_peaks(
    left: SpectralPeaks, comb: SpectralPeaks, spectrum: Spectrum, turn: float, ripple: Ripple | None
) -> Flags:
    """Return whether each peak is a side band of ripple: most multiples have it, relative to their amplitudes.

    left: peaks that are no multiples of the spindle frequency `turn` (Hz); comb: those that are; ripple: if it is
    known, of which a mode may amplify the first side band of one multiple. A peak up to `MAX_LOAD_DISTANCE` from a
    multiple that is louder, or that has a like peak on its other side, is a slow change of the load. Result of shape
    (n,).
    """
    comb = _join_first_order(comb, spectrum, turn)
    beyond = left.frequency[:, np.newaxis] - comb.frequency
    ratio = left.amplitude[:, np.newaxis] / comb.amplitude
    peak, own = np.nonzero((np.abs(beyond) < MAX_SIDEBAND_DISTANCE) & (ratio < MAX_SIDEBAND_AMPLITUDE))
    least, distance = ratio[peak, own] / MAX_SIDEBAND_RATIO, beyond[peak, own]
    usual = _usual_sidebands(comb, own, distance, least, spectrum, turn)
    mirrored = np.sqrt(spectrum.max_power_near(comb.frequency[own] - distance, spectral.PEAK_TOLERANCE))
    is_near = np.abs(distance) < MAX_RIPPLE_FREQUENCY
    is_pair = np.isnan(usual) & is_near & (mirrored > MIN_PAIR_RATIO * left.amplitude[peak])
    nearest = turn * np.round(left.frequency / turn)
    around = np.stack([nearest, 2 * nearest - left.frequency])
    louder = np.sqrt(spectrum.max_power_near(around, spectral.PEAK_TOLERANCE)) / [[1.0], [MIN_PAIR_RATIO]]
    is_load = np.abs(left.frequency - nearest) < MAX_LOAD_DISTANCE
    is_load &= np.max(louder, axis=0) > left.amplitude
    is_usual = (usual > least) & _has_nearer(usual, distance, comb, spectrum, turn)
    beyond_first = np.abs(left.frequency - nearest) - (ripple.frequency if ripple else np.inf)
    is_first = np.abs(beyond_first) < spectral.PEAK_TOLERANCE * spectrum.bin_width
    return np.asarray((np.bincount(peak, is_pair | is_usual, len(left)) > 0) | is_load | is_first)


def _join_first_order(comb: SpectralPeaks, spectrum: Spectrum, turn: float) -> SpectralPeaks:
    """Join a comb and the spindle frequency (Hz), which is in air, too, but ripples like its multiples in a cut."""
    first = np.array([turn])
    power = spectrum.max_power_near(first, spectral.PEAK_TOLERANCE)
    noise = np.interp(first, spectrum.frequency, spectrum.noise)
    return spectral.join_peaks([comb, SpectralPeaks(first, np.sqrt(power), power / noise)])


def _usual_sidebands(
    comb: SpectralPeaks, own: Indices, distance: Floats, least: Floats, spectrum: Spectrum, turn: float
) -> Floats:
    """Return the median relative amplitude of side bands at distances (Hz), without those of the own multiple.

    least: relative amplitude that must be clear of the noise; NaN where too few multiples are as loud.
    """
    loudest = np.argsort(-comb.amplitude)[:N_CARRIERS]
    places = comb.frequency[loudest][:, np.newaxis, np.newaxis] + np.stack([distance, -distance])
    amplitude = comb.amplitude[loudest][:, np.newaxis, np.newaxis]
    found = np.sqrt(spectrum.max_power_near(places, spectral.PEAK_TOLERANCE)) / amplitude
    noise = np.sqrt(np.interp(places, spectrum.frequency, spectrum.noise)) / amplitude
    is_known = (NOISE_MARGIN * noise < least) & (loudest[:, np.newaxis, np.newaxis] != own)
    is_known &= (places > 0) & (spectral.fold_frequency(places, turn) > OWN_SIDEBAND_BINS * spectrum.bin_width)
    known = np.where(is_known, found, np.nan).reshape(2 * loudest.size, distance.size)
    is_enough = np.count_nonzero(np.isfinite(known), axis=0) >= MIN_KNOWN_SIDEBANDS
    return np.where(is_enough, np.nanmedian(np.where(is_enough, known, 0.0), axis=0), np.nan)


def _has_nearer(usual: Floats, distance: Floats, comb: SpectralPeaks, spectrum: Spectrum, turn: float) -> Flags:
    """Return whether side bands beyond `MAX_RIPPLE_FREQUENCY` have a nearer one, of which they may be a harmonic.

    usual: median relative amplitude of side bands at distances (Hz). Harmonics of a load that steps fall as 1 / order.
    """
    step = spectrum.bin_width
    lowest = min(OWN_SIDEBAND_BINS * step, MAX_RIPPLE_FREQUENCY)
    near = np.arange(lowest, MAX_RIPPLE_FREQUENCY + step, step / 2)
    no_own, any_noise = np.full(near.size, len(comb)), np.full(near.size, np.inf)
    first = np.nan_to_num(_usual_sidebands(comb, no_own, near, any_noise, spectrum, turn))
    order = np.arange(2, int(MAX_SIDEBAND_DISTANCE / lowest) + 1)[:, np.newaxis]
    largest = MAX_HARMONIC_RATIO * np.interp(np.abs(distance) / order, near, first, left=0.0, right=0.0) / order
    return np.asarray((np.abs(distance) < MAX_RIPPLE_FREQUENCY) | (usual < np.max(largest, axis=0)))


def widen_air(air: Spectrum) -> Spectrum:
    """Return the spectrum of air whose lines are as wide as sampling at equal angles makes them."""
    wide = 2 * round(MAX_RIPPLE_FREQUENCY / air.frequency[1]) + 1
    return air._replace(power=scipy.ndimage.maximum_filter1d(air.power, wide))


MIN_SLOW_SHARE, MIN_SLOW_BINS = 0.6, 10.0
"""Smallest share of peaks that are multiples of a slow line, and smallest frequency of it (bins); chosen.

A quarter of all peaks are multiples of a line at ten bins by chance."""


def remove_slow_comb(peaks: SpectralPeaks, bin_width: float, turn: float) -> SpectralPeaks:
    """Remove the multiples of a load that steps slowly, if most peaks are some; all in Hz.

    turn: spindle frequency; a line of which that is a multiple is none of the load, but chatter of several turns.
    """
    is_slow = (peaks.frequency < MAX_RIPPLE_FREQUENCY) & (peaks.frequency > MIN_SLOW_BINS * bin_width)
    slow, reach = peaks[is_slow].loudest(1), spectral.PEAK_TOLERANCE * bin_width
    steps = refine_comb(float(slow.frequency[0]), peaks, bin_width) if len(slow) else None
    if steps is None or steps.share < MIN_SLOW_SHARE or spectral.fold_frequency(turn, steps.frequency) < reach:
        return peaks
    return peaks[spectral.fold_frequency(peaks.frequency, steps.frequency) > reach]


UNEVEN_MARGIN = 3.0
"""Least distance of the power compared in time from spindle harmonics and tones of the air (Hz); chosen."""
UNEVEN_PIECE_LENGTH, UNEVEN_PIECES = 0.08, 8
"""Length of the loudest piece that is compared in time (s), and number of starts within a length; chosen.

Modes ring for less after a rib. Chatter that comes and goes with a ripple of 5 Hz lasts longer."""
WINDOW_EDGE = 0.15
"""Share of a window at each end that is not compared in time, as little of it remains; chosen."""
SILENT_POWER = 1e-9
"""Power over the largest below which it counts as zero; chosen."""


def compute_evenness(signal: Floats, spectrum: Spectrum, air: Floats, turn: float, lowest: float) -> float:
    """Return how even the power of a signal without its spindle harmonics is, from 0 (pulses) to 1 (constant).

    Squared mean over mean square of its loudest piece. Modes ring in pulses after each rib, chatter lasts or grows.
    air: frequencies of tones in the air (Hz); turn: of the spindle (Hz); lowest: of chatter (Hz), as ripple itself is
    slower and lasts. The power is the mean of a turn.
    """
    rate, size = spectrum.sample_rate, signal.size
    taper = scipy.signal.windows.hann(size, sym=False)
    transform = scipy.fft.rfft((signal - np.mean(signal)) * taper)
    every = np.arange(transform.size) * (rate / size)
    gap = max(UNEVEN_MARGIN, OWN_SIDEBAND_BINS * rate / size)
    is_other = (spectral.fold_frequency(every, turn) > gap) & (every > lowest)
    is_other &= np.interp(every, spectrum.frequency, spectrum.power / spectrum.noise) > spectral.MIN_PEAK_POWER
    for tone in air:
        is_other &= np.abs(every - tone) > gap
    power = scipy.fft.irfft(np.where(is_other, transform, 0.0), size) ** 2
    inside = slice(round(WINDOW_EDGE * size), round((1 - WINDOW_EDGE) * size))
    level = scipy.ndimage.uniform_filter1d(power, max(round(rate / turn), 1))[inside] / taper[inside] ** 2
    length = min(round(UNEVEN_PIECE_LENGTH * rate), level.size)
    pieces = np.lib.stride_tricks.sliding_window_view(level, length)[:: max(length // UNEVEN_PIECES, 1)]
    loudest = pieces[int(np.argmax(np.sum(pieces, axis=1)))] / max(np.max(level), np.finfo(np.float64).tiny)
    times, log = np.arange(length), np.log(np.maximum(loudest, SILENT_POWER))
    growth = max(float(np.polyfit(times, log, 1)[0]), 0.0)
    return max(_evenness(loudest), _evenness(loudest * np.exp(-growth * times)))


def _evenness(power: Floats) -> float:
    return float(np.mean(power) ** 2 / max(np.mean(power**2), np.finfo(np.float64).tiny))
