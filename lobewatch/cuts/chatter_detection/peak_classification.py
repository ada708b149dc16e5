"""Classify spectral peaks: spindle harmonics, air, folded harmonics and chatter."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lobewatch.arrays import Flags, Floats, Indices, Integers
from lobewatch.cuts.chatter_detection import spectrum as spectral
from lobewatch.cuts.chatter_detection.spectrum import Spectra, SpectralPeaks, Spectrum, find_peaks, fold_frequency
from lobewatch.cuts.chatter_detection.tooth_passing_comb import SpindleSpeed

N_STEADINESS_PARTS = 4
"""Number of parts into which a cut is divided."""
N_STEADINESS_PEAKS = 8
"""Number of checked harmonics."""
MAX_UNSTEADINESS = 2e-3
"""Largest relative speed change that is searched."""
UNSTEADINESS_FACTOR = 3.0
"""Speed variation over that of the means of the parts, as speed also varies within a part; chosen."""
MAX_STEADY_CHANGE = 0.5
"""Largest difference of the parts and distance of some peaks over that of most, which are no harmonics then; chosen."""
MIN_STEADINESS_PEAKS = 3
"""Smallest number of harmonics that must show the same change."""


def estimate_unsteadiness(
    signal: Floats, sample_rate: float, peaks: SpectralPeaks, turning: SpindleSpeed, bin_width: float
) -> float:
    """Estimate the relative variation of the spindle speed in a cut, from its peaks and their bin width (Hz).

    Peaks that are off in all parts alike, while others are not, are no harmonics.
    """
    order = np.round(peaks.frequency / turning.frequency)
    reach = bin_width + MAX_UNSTEADINESS * peaks.frequency / UNSTEADINESS_FACTOR
    comb = (np.abs(peaks.frequency - order * turning.frequency) < reach) & (order > 1)
    loudest = peaks[comb].loudest(N_STEADINESS_PEAKS)
    if not len(loudest):
        return spectral.MIN_UNSTEADINESS
    orders = np.round(loudest.frequency / turning.frequency)
    off = []
    for part in np.array_split(signal, N_STEADINESS_PARTS):
        heard = find_peaks(spectral.compute_spectrum(part, sample_rate)).frequency
        if heard.size:
            nearest = heard[np.argmin(np.abs(heard[:, np.newaxis] - orders * turning.frequency), axis=0)]
            off.append(nearest / (orders * turning.frequency) - 1)
    if _are_off_apart(off):
        return spectral.MIN_UNSTEADINESS
    changes = [_speed_change(of_part) for of_part in off]
    return max(spectral.MIN_UNSTEADINESS, min(UNSTEADINESS_FACTOR * max(changes, default=0.0), MAX_UNSTEADINESS))


def _are_off_apart(off: Sequence[Floats]) -> bool:
    """Return whether most peaks are off in all parts alike, but others are not; off: relative, of each in each part."""
    usual = np.array([np.median(of_part) for of_part in off])
    least = MAX_STEADY_CHANGE * np.min(np.abs(usual), initial=np.inf)
    return bool(off and np.ptp(usual) < least and max(np.min(np.abs(of_part)) for of_part in off) < least)


def _speed_change(off: Floats) -> float:
    """Return the speed change that most harmonics of one part agree on, else 0; off: relative, of each."""
    near = off[np.abs(off) < MAX_UNSTEADINESS]
    if near.size < max(MIN_STEADINESS_PEAKS, off.size / 2):
        return 0.0
    low, middle, high = np.quantile(near, [0.25, 0.5, 0.75])
    return abs(float(middle)) if high - low < abs(middle) else 0.0


AIR_PIECE_LENGTH = 0.5
"""Length of the overlapping pieces of air that are searched for intermittent tones (s); chosen."""
MIN_TONE_POWER_RATIO, TONE_NOISE_BINS = 12.0, 8
"""Smallest power of an intermittent tone over the noise, and number of bins on each side for the noise; chosen.

Noise near a peak reaches this once in 1000 recordings of 10 s of air."""
MAX_FOLDED_RATES = 2.0
"""Upper end of the searched harmonics (sample rates), as a device without a filter folds them back."""
UPPER_BAND_SHARE = 0.7
"""Share of half the sample rate above which the loudest harmonic limits the folded ones (`MAX_FOLDED_AMPLITUDE`)."""
MAX_FEW_HARMONICS = 24
"""Number of harmonics below half the sample rate, under which any of them limits the folded ones; chosen.

Harmonics up to 52 are loud where a sensor without a filter records a spindle of 3000 rpm at 1650 Hz."""
MIN_TOOTH_HARMONICS = 3
"""Number of tooth passing harmonics below half the sample rate, under which folded ones may have any amplitude."""
FOLDED_PEAK_SLACK = 1e-3
"""Relative extra tolerance of folded harmonics, as few peaks determine the speed less exactly."""
MAX_FOLDED_AMPLITUDE = 1.5
"""Largest amplitude of a folded harmonic over that of the loudest harmonic."""
MAX_WAVERING_ENERGY = 0.05
"""Energy of unexplained peaks over that of the harmonics, up to which a varying speed explains near peaks; chosen.

Near is within `MAX_UNSTEADINESS`. Value from a stable cut recorded by a microphone."""
MAX_SPEED_ERRORS = 3.0
"""Standard errors of the spindle frequency within which its harmonics are searched; chosen."""


class PeaksByOrigin(NamedTuple):
    """All peaks of a cut by origin."""

    comb: SpectralPeaks
    """Spindle harmonics without the first, which is in air, too."""
    tooth_order: Integers
    """Order of each harmonic modulo the number of teeth; 0 is tooth passing."""
    air: SpectralPeaks
    """Peaks that are in air, too."""
    folded: SpectralPeaks
    """Peaks at folded harmonics from above half the sample rate."""
    unexplained: SpectralPeaks
    """Unexplained peaks: chatter if there is any."""


def is_in_air(peaks: SpectralPeaks, air: Spectrum) -> Flags:
    """Return whether each peak is in air, too."""
    power = air.max_power_near(peaks.frequency, spectral.AIR_PEAK_TOLERANCE)
    return np.asarray(peaks.amplitude**2 <= spectral.MAX_AIR_POWER_RATIO * power)


def add_air_tones(air: Spectrum, signal: Floats, frequency: Floats) -> Spectrum:
    """Add intermittent tones of the air near frequencies (Hz) to its spectrum.

    signal: of the air, shape (n,). A tone counts if it exceeds its neighbours within a piece. A knock does not,
    nor does a tone that moves 40 Hz or more in a piece, such as a harmonic of a spindle that slows down.
    """
    size = min(round(AIR_PIECE_LENGTH * air.sample_rate), signal.size)
    step, level = air.sample_rate / size, np.zeros(frequency.size)
    reaches = round(spectral.AIR_PEAK_TOLERANCE), TONE_NOISE_BINS
    near, tolerance = (_bins_around(frequency / step, bins, size // 2) for bins in reaches)
    for begin in range(0, signal.size - size + 1, size // 2):
        power = spectral.compute_power(signal[begin : begin + size], size)
        tone, noise = np.max(power[near], axis=1), np.median(power[tolerance], axis=1) / np.log(2)
        level = np.maximum(level, np.where(tone > MIN_TONE_POWER_RATIO * noise, tone, 0.0))
    power = air.power.copy()
    np.maximum.at(power, np.round(frequency / air.frequency[1]).astype(int), level)
    return air._replace(power=power)


def _bins_around(middle: Floats, reach: int, last: int) -> Indices:
    """Return the bins within a reach of some, none beyond the last; shape (n, 2 reach + 1)."""
    return np.asarray(np.clip(np.round(middle).astype(np.intp)[:, np.newaxis] + np.arange(-reach, reach + 1), 0, last))


def find_cut_peaks(spectra: Spectra, air: Spectra, distance: float = 0.0, edge: float = 0.0) -> SpectralPeaks:
    """Find the peaks of all axes that are not in air; distance and edge as for `find_separate_peaks` (Hz)."""
    peaks = [spectral.find_separate_peaks(spectrum, distance, edge) for spectrum in spectra]
    return spectral.join_peaks([axis[~is_in_air(axis, quiet)] for axis, quiet in zip(peaks, air, strict=True)])


def is_undersampled(spectrum: Spectrum, turning: SpindleSpeed, teeth: int) -> bool:
    """Return whether fewer than three tooth passing harmonics are below half the sample rate."""
    return spectrum.sample_rate / 2 < MIN_TOOTH_HARMONICS * teeth * turning.frequency


MAX_TEETH = 12
"""Largest number of teeth that harmonics are compared with; chosen."""
MIN_TEETH_SHARE, MAX_STATED_TEETH_SHARE = 0.9, 0.5
"""Smallest energy share of the harmonics of another number of teeth, and largest of the stated one; chosen."""
MIN_HARMONIC_POWER = 1e-2
"""Smallest power of the first three harmonics of another number of teeth over the largest of all; chosen.

A single one may be loud by a mode."""
MAX_GAP_POWER = 2.5e-3
"""Largest power of missing harmonics over that of their neighbours: 5 % of the amplitude; chosen."""


def find_other_teeth(comb: SpectralPeaks, turning: SpindleSpeed, teeth: int) -> int:
    """Find a number of teeth whose harmonics a comb has instead of those of the stated number; 0 if there is none.

    A multiple of the stated number needs gaps between its harmonics, a divisor of it looks like run-out.
    """
    order, power = np.round(comb.frequency / turning.frequency).astype(np.int64), comb.amplitude**2
    by_order = np.bincount(order, power).astype(np.float64) if power.size else np.zeros(1)
    total = float(np.sum(power))
    is_stated = np.sum(by_order[::teeth]) > MAX_STATED_TEETH_SHARE * total
    for other in (n for n in range(MAX_TEETH, 1, -1) if teeth % n):
        first = by_order[other : MIN_TOOTH_HARMONICS * other + 1 : other]
        is_clear = first.size == MIN_TOOTH_HARMONICS and np.min(first) > MIN_HARMONIC_POWER * np.max(power)
        is_apart = _has_gaps(by_order, teeth, other) if other % teeth == 0 else not is_stated
        if is_clear and is_apart and np.sum(by_order[::other]) > MIN_TEETH_SHARE * total:
            return other
    return 0


def _has_gaps(power: Floats, teeth: int, other: int) -> bool:
    """Return whether the first harmonics of `other` teeth have hardly any of the stated ones between them."""
    reach = MIN_TOOTH_HARMONICS * other
    if power.size <= reach:
        return False
    own = power[other : reach + 1 : other]
    gaps = [np.max(power[first + teeth : first + other : teeth]) for first in range(other, reach, other)]
    return bool(np.all(gaps < MAX_GAP_POWER * np.minimum(own[:-1], own[1:])))


CLEAR_BAND_SHARE = 0.85
"""Share of half the sample rate that every recorder passes on: 3.4 of 4 kHz of a telephone (ITU-T G.712)."""


def is_narrow(peaks: PeaksByOrigin, spectrum: Spectrum, turning: SpindleSpeed, teeth: int) -> bool:
    """Return whether fewer than three tooth passing harmonics are heard, as not more fit into the band."""
    band = CLEAR_BAND_SHARE * spectrum.sample_rate / 2
    heard = np.concatenate([peaks.comb.frequency[peaks.tooth_order == 0], peaks.folded.frequency]) < band
    return bool(
        band < MIN_TOOTH_HARMONICS * teeth * turning.frequency and np.count_nonzero(heard) < MIN_TOOTH_HARMONICS
    )


def classify_peaks(
    peaks: SpectralPeaks, spectrum: Spectrum, air: Spectrum, turning: SpindleSpeed, teeth: int, unsteady: float
) -> PeaksByOrigin:
    """Classify peaks by origin; spindle harmonics above half the sample rate are folded.

    unsteady: by how much the speed varies, relative: harmonics are this much wider.
    """
    order = np.round(peaks.frequency / turning.frequency)
    away = np.abs(peaks.frequency - order * turning.frequency)
    unsure = order * (MAX_SPEED_ERRORS * turning.error + unsteady * turning.frequency)
    comb = (away < spectral.PEAK_TOLERANCE * spectrum.bin_width + unsure) & (order > 0)
    foreign = ~comb & is_in_air(peaks, air)
    half = spectrum.sample_rate / 2
    lowest = UPPER_BAND_SHARE * half if half > MAX_FEW_HARMONICS * turning.frequency else 0.0
    upper = comb & (peaks.frequency > lowest)
    loudest = float(np.max(peaks.amplitude[upper], initial=0.0))
    is_bounded = (peaks.amplitude <= MAX_FOLDED_AMPLITUDE * loudest) | is_undersampled(spectrum, turning, teeth)
    back = _is_folded(peaks, spectrum, turning, teeth, unsteady) & is_bounded & ~(comb | foreign)
    kept = comb & (order > 1)
    tooth = (order[kept] % teeth).astype(np.int64)
    left = _remove_wavering(peaks[~(comb | foreign | back)], peaks[kept], spectrum.bin_width, turning.frequency)
    return PeaksByOrigin(peaks[kept], tooth, peaks[foreign], peaks[back], left)


def _remove_wavering(left: SpectralPeaks, comb: SpectralPeaks, bin_width: float, turn: float) -> SpectralPeaks:
    """Remove faint peaks next to spindle harmonics, caused by a speed that wavers quickly."""
    if left.energy > MAX_WAVERING_ENERGY * comb.energy:
        return left
    near = MAX_UNSTEADINESS * left.frequency + spectral.PEAK_TOLERANCE * bin_width
    return left[fold_frequency(left.frequency, turn) > near]


def _is_folded(peaks: SpectralPeaks, spectrum: Spectrum, turning: SpindleSpeed, teeth: int, unsteady: float) -> Flags:
    """Return whether each peak is at a folded spindle harmonic from above half the sample rate."""
    rate = spectrum.sample_rate
    orders = np.arange(int(rate / 2 / turning.frequency) + 1, int(MAX_FOLDED_RATES * rate / turning.frequency) + 1)
    if not orders.size:
        return np.zeros(len(peaks), dtype=np.bool_)
    folded = fold_frequency(np.asarray(orders * turning.frequency), rate)
    slack = np.where(is_undersampled(spectrum, turning, teeth) & (orders % teeth == 0), FOLDED_PEAK_SLACK, 0.0)
    unsure = orders * (MAX_SPEED_ERRORS * turning.error + (unsteady + slack) * turning.frequency)
    away = np.abs(peaks.frequency[:, np.newaxis] - folded) - unsure
    return np.asarray(np.min(away, axis=1, initial=np.inf) < spectral.PEAK_TOLERANCE * spectrum.bin_width)


MIN_CHATTER_AMPLITUDE = 0.1
"""Smallest amplitude of a peak that names the chatter frequency, as a share of the loudest."""
MIN_FAMILY_AMPLITUDE = 1e-3
"""Smallest amplitude of a peak of the chatter family, as a share of the loudest."""
MAX_CHATTER_ANCHORS = 12
"""Largest number of peaks whose families are compared."""
CHATTER_HARMONICS = 3
"""Number of searched harmonics of a frequency."""
DISPLACEMENT_WEIGHT = 0.3
"""Weight of the displacement of a family relative to its number of peaks; chosen."""
MIN_FAMILY_ENERGY = 0.25
"""Smallest energy of the chosen family over that of the largest."""


class ChatterPeaks(NamedTuple):
    """One family of chatter peaks."""

    frequency: float
    """Frequency of the peak with the largest displacement (Hz)."""
    error: float
    """Standard error of the frequency (Hz)."""
    peaks: SpectralPeaks
    """All peaks at f_c plus multiples of the tooth passing frequency."""


def find_chatter_peaks(left: SpectralPeaks, tooth_frequency: float, bin_width: float) -> ChatterPeaks:
    """Find the family of peaks that chatter is named by, in Hz; left: at least one unexplained peak.

    Chatter that leaves the cut sounds with 2 f_c and 3 f_c and their sidebands too. So that of the loudest peaks is
    taken whose harmonics explain the most, and whose displacement, amplitude over frequency squared, is large.
    """
    part = left.amplitude > MIN_FAMILY_AMPLITUDE * np.max(left.amplitude)
    weight = np.where(part, (left.amplitude / left.frequency**2) ** 2, 0.0)
    named = np.where(left.amplitude >= MIN_CHATTER_AMPLITUDE * np.max(left.amplitude), weight, 0.0)
    anchors = [i for i in np.argsort(-named)[:MAX_CHATTER_ANCHORS] if named[i] > 0]
    clear = np.where(part, np.log10(left.clearness), 0.0)
    tops, reach = left.frequency[anchors], spectral.PEAK_TOLERANCE * bin_width
    families = [spectral.sideband_distance(left.frequency, top, tooth_frequency) < reach for top in tops]
    energy = np.array([np.sum(weight[family]) for family in families])
    explained = np.array([_find_explained(left, top, tooth_frequency, bin_width) @ clear for top in tops])
    large = energy / np.max(energy)
    score = np.where(large >= MIN_FAMILY_ENERGY, explained / np.max(explained) + DISPLACEMENT_WEIGHT * large, 0.0)
    best = families[int(np.argmax(score))]
    return _build_family(left, best, int(np.argmax(np.where(best, named, 0.0))), bin_width)


def find_loudest_family(left: SpectralPeaks, tooth_frequency: float, bin_width: float) -> ChatterPeaks:
    """Find the family of the loudest peak without faint side bands, in Hz; left: at least one peak."""
    top = int(np.argmax(left.amplitude))
    apart = spectral.sideband_distance(left.frequency, float(left.frequency[top]), tooth_frequency)
    is_loud = left.amplitude > MIN_CHATTER_AMPLITUDE * left.amplitude[top]
    return _build_family(left, is_loud & (apart < spectral.PEAK_TOLERANCE * bin_width), top, bin_width)


def _build_family(left: SpectralPeaks, family: Flags, top: int, bin_width: float) -> ChatterPeaks:
    """Build the family of a peak without its faint members."""
    part = family & (left.amplitude > MIN_FAMILY_AMPLITUDE * np.max(left.amplitude))
    return ChatterPeaks(float(left.frequency[top]), float(left.frequency_error(bin_width)[top]), left[part])


def has_sidebands(left: SpectralPeaks, chatter: ChatterPeaks, turn: float, bin_width: float) -> bool:
    """Return whether chatter has a peak k tooth passings or one turn away: a cut makes them, a pump does not. In Hz."""
    apart = np.abs(np.abs(left.frequency - chatter.frequency) - turn)
    return len(chatter.peaks) > 1 or bool(np.any(apart < spectral.PEAK_TOLERANCE * bin_width))


MAX_SPACING_DIFFERENCE = 2e-3
"""Largest relative difference between spacing of side bands and tooth passing; chosen, that of usual speeds."""


def has_other_spacing(chatter: ChatterPeaks, tooth_frequency: float) -> bool:
    """Return whether the side bands of chatter are not one tooth passing (Hz) apart, so that its speed is wrong."""
    found = chatter.peaks.frequency
    is_mirrored = fold_frequency(found + chatter.frequency, tooth_frequency) < fold_frequency(
        found - chatter.frequency, tooth_frequency
    )
    frequency = np.where(is_mirrored, -found, found)
    order = np.round((frequency - chatter.frequency) / tooth_frequency)
    if not np.ptp(order):
        return False
    spacing = float(np.polyfit(order, frequency, 1)[0])
    return abs(spacing / tooth_frequency - 1) > MAX_SPACING_DIFFERENCE


RIPPLE_DISTANCE = 30.0
"""Distance from a line of chatter within which it is widened by ripple (Hz), the highest frequency of a ripple."""


MIN_OWN_HARMONICS, MAX_OWN_HARMONICS = 4, 12
"""Smallest number of harmonics, and highest one, by which a tone is that of another machine; chosen."""


MIN_SIDEBAND_ENERGY = 1e-2
"""Energy of side bands over that of a tone and its harmonics, below which it is of another machine; chosen."""


def has_own_comb(left: SpectralPeaks, chatter: ChatterPeaks, tooth_frequency: float, bin_width: float) -> bool:
    """Return whether chatter has more harmonics than side bands, and these are faint, as another spindle has; in Hz.

    Chatter that leaves the cut has harmonics with side bands one tooth passing away.
    """
    order = np.round(left.frequency / chatter.frequency)
    reach = spectral.PEAK_TOLERANCE * bin_width * np.maximum(order / 2, 1)
    is_own = (np.abs(left.frequency - order * chatter.frequency) < reach) & (order > 0) & (order <= MAX_OWN_HARMONICS)
    is_sideband = (_find_explained(left, chatter.frequency, tooth_frequency, bin_width) > 0) & ~is_own
    is_comb = np.count_nonzero(is_own) > max(MIN_OWN_HARMONICS, len(chatter.peaks) + 1)
    return bool(is_comb and left[is_sideband].energy < MIN_SIDEBAND_ENERGY * left[is_own].energy)


MIN_CHATTER_SHARE, MIN_WEAK_CHATTER_SHARE = 0.5, 0.85
"""Smallest share of chatter in the energy of the unexplained peaks, and of faint chatter or few side bands; chosen.

Lossy coding, music and another spindle make many lines, of which few happen to be one tooth passing apart."""
MIN_SIDEBANDS = 3
"""Number of peaks of a sideband family that proves chatter."""


def is_other_source(
    left: SpectralPeaks, chatter: ChatterPeaks, turn: float, teeth: int, bin_width: float, is_faint: bool
) -> bool:
    """Return whether most unexplained peaks are no chatter, of which weak evidence needs a larger share; in Hz.

    The ripple of its lines counts as chatter, its harmonics too unless they are the comb of another spindle.
    """
    is_chatter = np.any(np.abs(left.frequency[:, np.newaxis] - chatter.peaks.frequency) < RIPPLE_DISTANCE, axis=1)
    is_comb = has_own_comb(left, chatter, teeth * turn, bin_width)
    if not is_comb:
        is_chatter |= _find_explained(left, chatter.frequency, turn, bin_width) > 0
    is_weak = is_faint or len(chatter.peaks) < MIN_SIDEBANDS or is_comb
    least = MIN_WEAK_CHATTER_SHARE if is_weak else MIN_CHATTER_SHARE
    return left[is_chatter].energy < least * left.energy


def _find_explained(left: SpectralPeaks, frequency: float, tooth_frequency: float, bin_width: float) -> Floats:
    """Return 1 for peaks that are harmonics of a frequency or their sidebands, else 0, shape (n,)."""
    explained = np.zeros(len(left))
    for order in range(1, CHATTER_HARMONICS + 1):
        apart = spectral.sideband_distance(left.frequency, order * frequency, tooth_frequency)
        explained[apart < spectral.PEAK_TOLERANCE * bin_width * max(1.0, order / 2)] = 1.0
    return explained
