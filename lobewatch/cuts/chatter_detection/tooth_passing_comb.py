"""Fit spindle harmonics to spectral peaks: a grid with sidebands, or only the comb, also by a harmonic sum."""

from typing import NamedTuple

import numpy as np
import scipy

from lobewatch.arrays import Flags, Floats, Indices
from lobewatch.cuts.chatter_detection import spectrum as spectral
from lobewatch.cuts.chatter_detection.spectrum import Spectra, SpectralPeaks, find_peaks, fold_frequency, join_peaks

MAX_SIDEBAND_FAMILIES = 4
"""Largest number of sideband families, one for each frequency that is not a harmonic."""
MAX_GRID_ERRORS = 10.0
"""Distance (standard errors) above which a peak is not on the harmonic grid."""
GRID_TOLERANCES = 1.2, 0.6, 0.6, 0.6
"""Distances (bins) within which peaks belong to the harmonic grid, one for each least-squares step; chosen.

The first is a peak width (`PEAK_TOLERANCE`), since a speed by votes is rough, the others half of that."""
MAX_SPEED_CHANGE = 0.005
"""Relative change of the spindle frequency above which least squares have diverged; chosen."""


class SidebandFamily(NamedTuple):
    """Peaks at sign * r + k f with the spindle frequency f."""

    indices: Indices
    """Indices of the peaks of the family, shape (n,)."""
    sign: Floats
    """Sign of r in each peak, shape (n,); 0 if r is 0."""
    order: Floats
    """Order k of each peak, shape (n,)."""


class SpindleSpeed(NamedTuple):
    """True spindle speed with its error."""

    frequency: float
    """Spindle frequency (Hz)."""
    error: float
    """Standard error (Hz); inf unless it follows from several peaks."""
    share: float
    """Share of the checked peaks that it explains."""
    agreeing: int
    """Number of matching peaks beyond those that determine it."""
    misfit: float
    """Mean square distance of all peaks from it, in standard errors of each, at most `MAX_GRID_ERRORS` squared."""


def refine_speed(frequency: float, peaks: SpectralPeaks, bin_width: float) -> SpindleSpeed:
    """Refine a spindle frequency (Hz) by least squares over its harmonic grid; bin_width: of the spectrum (Hz)."""
    speed = SpindleSpeed(frequency, np.inf, 0.0, 0, MAX_GRID_ERRORS**2)
    for tolerance in GRID_TOLERANCES:
        families = find_sideband_families(speed.frequency, peaks, tolerance * bin_width)
        rows = np.concatenate([_design_rows(family, number, len(families)) for number, family in enumerate(families)])
        places = np.concatenate([family.indices for family in families])
        if np.linalg.matrix_rank(rows) < len(families):
            return speed
        root = 1 / peaks[places].frequency_error(bin_width)
        scaled, measured = rows * root[:, np.newaxis], peaks.frequency[places] * root
        solution = np.linalg.lstsq(scaled, measured, rcond=None)[0]
        if abs(solution[0] / frequency - 1) > MAX_SPEED_CHANGE:
            return speed
        error = float(np.sqrt(np.linalg.inv(scaled.T @ scaled)[0, 0]))
        away = np.minimum(np.abs(scaled @ solution - measured), MAX_GRID_ERRORS)
        misfit = float(np.sum(away**2) + (len(peaks) - places.size) * MAX_GRID_ERRORS**2) / len(peaks)
        share, agreeing = places.size / len(peaks), places.size - len(families)
        speed = SpindleSpeed(float(solution[0]), error, share, agreeing, misfit)
    return speed


def find_sideband_families(frequency: float, peaks: SpectralPeaks, tolerance: float) -> list[SidebandFamily]:
    """Find the harmonics of a frequency (Hz), then the sideband families of the clearest peaks left."""
    order = np.round(peaks.frequency / frequency)
    comb = (np.abs(peaks.frequency - order * frequency) < tolerance) & (order > 0)
    families = [SidebandFamily(np.flatnonzero(comb), np.zeros(int(comb.sum())), order[comb])]
    left = ~comb
    for _ in range(MAX_SIDEBAND_FAMILIES):
        if not np.any(left):
            break
        anchor = peaks.frequency[np.flatnonzero(left)[np.argmax(peaks.clearness[left])]]
        beyond, mirrored = peaks.frequency - anchor, peaks.frequency + anchor
        up, down = np.round(beyond / frequency), np.round(mirrored / frequency)
        off, off_mirrored = np.abs(beyond - up * frequency), np.abs(mirrored - down * frequency)
        members = left & (np.minimum(off, off_mirrored) < tolerance)
        sign = np.where(off <= off_mirrored, 1.0, -1.0)
        if np.count_nonzero(members) > 1:
            order = np.where(sign > 0, up, down)
            families.append(SidebandFamily(np.flatnonzero(members), sign[members], order[members]))
        left &= ~members
    return families


def _design_rows(family: SidebandFamily, number: int, count: int) -> Floats:
    """Return the rows of the least-squares problem for one family, shape (n, count)."""
    rows = np.zeros((family.indices.size, count))
    rows[:, number] = family.sign
    rows[:, 0] = family.order
    return rows


MAX_COMB_PEAKS = 40
"""Largest number of checked peaks."""
MAX_COMB_ANCHORS = 16
"""Largest number of peaks from which combs are searched; chosen."""
COMB_FIT_STEPS = 3
"""Number of least-squares steps."""
MAX_COMB_CHANCE = 1e-4
"""Largest probability of a comb among random peaks, over all combs tried."""
MAX_PEAK_WEIGHT = 3.0
"""Largest weight of a peak (log10 of its signal-to-noise ratio), so that one loud peak does not decide; chosen."""
MIN_COMB_SHARE = 0.5
"""Smallest share of peaks explained by a comb far from the commanded speed."""
MIN_COMB_HARMONICS = 3
"""Smallest number of harmonics of a comb, as any two peaks have one."""


class Comb(NamedTuple):
    """Frequency with the peaks that are its harmonics."""

    frequency: float
    """Frequency (Hz)."""
    is_member: Flags
    """Mask of the peaks that are harmonics, shape (n,)."""
    order: Floats
    """Order of each harmonic, shape (n,)."""
    offset: Floats
    """Distance of each peak from its folded harmonic (Hz), shape (n,)."""


def find_comb(
    peaks: SpectralPeaks, bin_width: float, sample_rate: float, teeth: int, frequency: float, tolerance: float
) -> SpindleSpeed | None:
    """Find the comb within `tolerance` (relative) of a frequency (Hz) that explains the most peaks, or None.

    peaks: of all axes, without skirts; bin_width: of the spectrum (Hz). Each peak is a vote for the frequencies that
    it is a harmonic of; those of the loudest are compared, after least squares, by the peaks that they explain.
    """
    peaks = peaks.loudest(MAX_COMB_PEAKS)
    few = sample_rate / 2 < spectral.MAX_HARMONICS * frequency  # those that are folded back count too
    levels = peaks.frequency
    folded = np.stack([levels, sample_rate - levels, sample_rate + levels, 2 * sample_rate - levels])
    for images in (folded[:1], folded) if few else (folded[:1],):
        best = _pick_comb(peaks, images, bin_width, frequency, tolerance)
        if best is not None and _comb_chance(best, peaks, images, bin_width, teeth, tolerance) < MAX_COMB_CHANCE:
            return _comb_speed(best, peaks, bin_width)
    return None


def find_distant_comb(
    peaks: SpectralPeaks, bin_width: float, sample_rate: float, teeth: int, frequency: float, tolerance: float
) -> SpindleSpeed | None:
    """Find the best comb between half and twice a frequency (Hz), farther than `tolerance` from it, or None.

    Of those that explain as many tenths of the peaks that of which all are tooth passing, else the highest; none of
    which all harmonics have an order in common that the teeth have not: that is a part of another.
    """
    peaks, best, rank = peaks.loudest(MAX_COMB_PEAKS), None, (0.0, False, 0.0)
    for centre in list_distant_centers(frequency, tolerance):
        comb = find_comb(peaks, bin_width, sample_rate, teeth, centre, tolerance)
        if comb is None or comb.share < MIN_COMB_SHARE:
            continue
        order = np.round(peaks.frequency / comb.frequency).astype(int)
        is_near = np.abs(peaks.frequency - order * comb.frequency) < spectral.PEAK_TOLERANCE * bin_width
        common = int(np.gcd.reduce(order[is_near]))
        ranked = round(comb.share, 1), common == teeth, comb.frequency
        if common and teeth % common == 0 and ranked > rank:
            best, rank = comb, ranked
    return best


def list_distant_centers(frequency: float, tolerance: float) -> list[float]:
    """List frequencies from half to twice one (Hz), each twice `tolerance` from the next, relative; itself left out."""
    steps = np.arange(1, int(np.log(2) / (2 * tolerance)) + 1)
    return [float(centre) for centre in frequency * np.exp(2 * tolerance * np.concatenate([-steps, steps]))]


def refine_comb(frequency: float, peaks: SpectralPeaks, bin_width: float) -> SpindleSpeed | None:
    """Refine a frequency (Hz) by least squares over its harmonics among peaks; None without any."""
    comb = _fit_comb(frequency, peaks, peaks.frequency[np.newaxis], bin_width)
    return _comb_speed(comb, peaks, bin_width) if np.any(comb.is_member) else None


def _pick_comb(peaks: SpectralPeaks, images: Floats, width: float, frequency: float, tolerance: float) -> Comb | None:
    weight, best, most = np.minimum(np.log10(peaks.clearness), MAX_PEAK_WEIGHT), None, 0.0
    for candidate in _candidate_frequencies(peaks, frequency, tolerance):
        comb = _fit_comb(float(candidate), peaks, images, width)
        score = float(np.sum(weight[comb.is_member]))
        if score > most and abs(comb.frequency / frequency - 1) <= tolerance:
            best, most = comb, score
    return best


def _candidate_frequencies(peaks: SpectralPeaks, frequency: float, tolerance: float) -> Floats:
    """Return the frequencies (Hz) that the loudest peaks are harmonics of."""
    loudest = peaks.frequency[:MAX_COMB_ANCHORS]
    orders = np.arange(1, int(np.max(loudest, initial=0.0) / frequency / (1 - tolerance)) + 1)
    parts = (loudest[:, np.newaxis] / orders).ravel()
    return np.asarray(parts[np.abs(parts / frequency - 1) <= tolerance])


def _fit_comb(frequency: float, peaks: SpectralPeaks, images: Floats, bin_width: float) -> Comb:
    """Fit a frequency by least squares to its harmonics."""
    comb = _build_comb(frequency, images, bin_width)
    for _ in range(COMB_FIT_STEPS):
        if not np.any(comb.is_member):
            break
        error, order = _peak_error(peaks, bin_width)[comb.is_member], comb.order[comb.is_member]
        off = float(np.sum(order * comb.offset[comb.is_member] / error**2) / np.sum((order / error) ** 2))
        comb = _build_comb(comb.frequency + off, images, bin_width)
    return comb


def _build_comb(frequency: float, images: Floats, bin_width: float) -> Comb:
    orders = np.round(images / frequency)
    beyond = np.where(orders > 0, images - orders * frequency, np.inf)
    nearest = np.argmin(np.abs(beyond), axis=0)[np.newaxis]
    order, away = (np.take_along_axis(values, nearest, axis=0)[0] for values in (orders, beyond))
    return Comb(frequency, np.abs(away) < spectral.PEAK_TOLERANCE * bin_width, order, away)


def _peak_error(peaks: SpectralPeaks, bin_width: float) -> Floats:
    """Return the standard error of each peak (Hz), with the variation of the speed."""
    return np.hypot(peaks.frequency_error(bin_width), spectral.MIN_UNSTEADINESS * peaks.frequency)


def _comb_chance(comb: Comb, peaks: SpectralPeaks, images: Floats, width: float, teeth: int, tolerance: float) -> float:
    """Return how many of all combs tried would have as many harmonics among random peaks.

    Harmonics of tooth passing only are this much rarer.
    """
    orders = np.unique(comb.order[comb.is_member])
    if orders.size < MIN_COMB_HARMONICS:
        return np.inf
    spacing = comb.frequency * (1 if np.any(orders % teeth) else teeth)
    near = min(2 * spectral.PEAK_TOLERANCE * width / spacing * len(images), 1.0)
    tried = max(tolerance * float(np.max(images)) / (spectral.PEAK_TOLERANCE * width), 1.0)
    apart = np.unique(np.round(peaks.frequency / (2 * spectral.PEAK_TOLERANCE * width))).size
    return float(tried * scipy.stats.binom.sf(orders.size - 1, apart, near))


def _comb_speed(comb: Comb, peaks: SpectralPeaks, bin_width: float) -> SpindleSpeed:
    off = comb.offset / _peak_error(peaks, bin_width)
    exact = 1 / np.sqrt(np.sum((comb.order / _peak_error(peaks, bin_width))[comb.is_member] ** 2))
    error = float(exact * max(1.0, float(np.sqrt(np.mean(off[comb.is_member] ** 2)))))
    misfit = float(np.mean(np.minimum(np.abs(off), MAX_GRID_ERRORS) ** 2))
    count = int(np.count_nonzero(comb.is_member))
    return SpindleSpeed(comb.frequency, error, count / len(peaks), count - 1, misfit)


MIN_HARMONIC_LEVEL = 0.6
"""Smallest level of a harmonic that counts (log10 of its power over the noise), seldom reached by noise; chosen."""
MAX_HARMONIC_LEVEL = 2.4
"""Largest level above that minimum that counts (log10); chosen."""
SUM_FREQUENCY_STEP = 0.25
"""Step of the tried frequencies over the change that moves the highest harmonic by one bin; chosen."""
N_SUM_LEVELS = 100
"""Number of levels into which the contribution of a harmonic is divided."""
CLEAR_SUM_MEAN = 1 / 3
"""Mean over the harmonics below which a comb must be rarer (`FAINT_SUM_CHANCE`); chosen.

Chance takes harmonics as independent, but sidebands of a peak that is not a harmonic come together."""
FAINT_SUM_CHANCE = 1e-8
"""Largest probability of a faint comb by chance; chosen."""
MAX_REMAINING_CHANCE = 0.05
"""Largest probability by chance of the harmonics that remain without those of one order; chosen."""
HARMONIC_BINS = 4.0
"""Distance from a harmonic within which the spectrum belongs to it (bins), half the main lobe of the window."""
WEAK_PEAK_POWER = 4.0
"""Power over the noise of peaks that refine the frequency, as for `MIN_HARMONIC_LEVEL`."""


def find_comb_by_sum(
    spectra: Spectra, air: Spectra, peaks: SpectralPeaks, teeth: int, center: float, tolerance: float, usual: float = 1
) -> SpindleSpeed | None:
    """Find the comb within `tolerance` (relative) of a center frequency (Hz) that is loudest over the noise, or None.

    spectra and air: of each axis; what is no louder than in air does not count. peaks: those that stand clear, of
    all axes; where they are many, they settle it, and there is one on a harmonic of anything. The mean over all axes
    of log10 of power over noise is summed over the harmonics (Schroeder 1968, J. Acoust. Soc. Am. 43, 829-834). It
    is a comb where as many frequencies that are no harmonics would have that sum less often than once in ten
    thousand, over all that are tried as near to the center as it is, or up to `usual` from it, relative.
    """
    if len(peaks) >= MAX_COMB_PEAKS * len(spectra):
        return None
    first, above = spectra[0], _mean_level(spectra, air)
    highest = int(min(spectral.MAX_HARMONICS, first.sample_rate / 2 / (center * (1 + tolerance))))
    lowest, most = (1 - tolerance) * center, (1 + tolerance) * center
    tried = np.arange(lowest, most, SUM_FREQUENCY_STEP * first.bin_width / max(highest, 1))
    parts = np.array([np.interp(k * tried, first.frequency, above) for k in range(1, highest + 1)])
    best = int(np.argmax(np.sum(parts, axis=0)))
    levels = parts[:, best]
    if not 0 < best < tried.size - 1 or np.count_nonzero(levels) < MIN_COMB_HARMONICS:
        return None
    inside = (first.frequency > lowest) & (first.frequency < highest * most)
    between = inside & (fold_frequency(first.frequency, float(tried[best])) > HARMONIC_BINS * first.bin_width)
    rarest = MAX_COMB_CHANCE if np.mean(levels) >= CLEAR_SUM_MEAN else FAINT_SUM_CHANCE
    likely = min(max(abs(float(tried[best]) / center - 1), usual) / tolerance, 1.0)
    noise = above[between]
    chance = SUM_FREQUENCY_STEP * tried.size * likely * _sum_chance(levels, noise)
    if chance > rarest or _is_partial_comb(levels, noise, teeth):
        return None
    weak = join_peaks([find_peaks(spectrum, WEAK_PEAK_POWER) for spectrum in spectra])
    return refine_comb(float(tried[best]), weak[weak.frequency < (highest + 0.5) * tried[best]], first.bin_width)


def _mean_level(spectra: Spectra, air: Spectra) -> Floats:
    """Return log10 of power over noise beyond `MIN_HARMONIC_LEVEL`, the mean of all axes; 0 where it is air."""
    total = np.zeros(spectra[0].power.size)
    for spectrum, quiet in zip(spectra, air, strict=True):
        above = np.log10(np.maximum(spectrum.power, np.finfo(np.float64).tiny) / spectrum.noise) - MIN_HARMONIC_LEVEL
        power = quiet.max_power_near(spectrum.frequency, spectral.AIR_PEAK_TOLERANCE)
        above[spectrum.power <= spectral.MAX_AIR_POWER_RATIO * power] = 0.0
        total += np.clip(above, 0.0, MAX_HARMONIC_LEVEL)
    return total / len(spectra)


def _is_partial_comb(levels: Floats, values: Floats, teeth: int) -> bool:
    """Return whether the harmonics share an order that the teeth do not: the comb belongs to another frequency."""
    orders = np.arange(1, levels.size + 1)
    parts = [part for part in orders[1:] if teeth % part]
    return any(_sum_chance(levels[orders % part != 0], values) > MAX_REMAINING_CHANCE for part in parts)


def _sum_chance(levels: Floats, values: Floats) -> float:
    """Return how often random values have a sum as large."""
    count, level = levels.size, np.arange(N_SUM_LEVELS + 1) * (MAX_HARMONIC_LEVEL / N_SUM_LEVELS)
    places = np.round(values * (N_SUM_LEVELS / MAX_HARMONIC_LEVEL)).astype(int)
    share = np.bincount(places, minlength=level.size) / values.size
    louder = np.maximum(np.cumsum(share[::-1])[::-1], np.exp(-(10 ** (MIN_HARMONIC_LEVEL + level))))
    share = np.append(1.0, louder[1:]) - np.append(louder[1:], 0.0)
    size = N_SUM_LEVELS * count + 1
    sums = np.fft.irfft(np.fft.rfft(share, 2 * size) ** count, 2 * size)[:size]
    return float(np.sum(sums[int(np.sum(levels) * N_SUM_LEVELS / MAX_HARMONIC_LEVEL) :]))
