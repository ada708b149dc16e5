"""Find the true spindle speed of a cut, with or without a tachometer."""

from collections.abc import Sequence

import numpy as np
import scipy

from lobewatch.arrays import Floats, Indices
from lobewatch.cuts.chatter_detection import load_ripple
from lobewatch.cuts.chatter_detection import spectrum as spectral
from lobewatch.cuts.chatter_detection import tooth_passing_comb as combs
from lobewatch.cuts.chatter_detection.peak_classification import find_cut_peaks
from lobewatch.cuts.chatter_detection.spectrum import Spectra, SpectralPeaks, Spectrum, fold_frequency
from lobewatch.cuts.chatter_detection.tooth_passing_comb import SpindleSpeed, find_comb, find_comb_by_sum, refine_speed

COMB_SPEED_TOLERANCE = 0.05
"""Relative distance from the commanded speed within which a plain comb is searched."""
USUAL_SPEED_TOLERANCE = 0.002
"""Relative speed deviation of most spindles, in which fewer neighboring combs are tried; chosen."""
SAME_SPEED_TOLERANCE = 1e-3
"""Relative distance within which a plain comb and the votes are the same speed.

A comb that explains as many peaks is preferred, since it has one unknown. Votes have one more for each family of
sidebands."""
MIN_SAME_AXES = 2
"""Number of axes whose speeds must be the same where all axes together have none."""
MIN_SURE_VOTES = 6
"""Number of matching peaks that a speed by votes needs without a plain comb and with a misfit (`MAX_SPEED_MISFIT`)."""
VOTE_SPEED_TOLERANCE = 0.021
"""Relative distance from the commanded speed within which votes are counted."""
MAX_VOTE_HARMONIC = 60
"""Largest difference of the orders of two voting harmonics."""
VOTE_WIDTH = 0.25
"""Standard deviation of a peak in the vote count (bins)."""
VOTE_GRID_STEP, FINEST_VOTE_HARMONIC = 0.25, 40
"""Step of the speed grid over the standard deviation of the vote of a harmonic, and that harmonic; chosen."""
OWN_PEAK_TOLERANCE = 0.5
"""Distance within which a peak is the first spindle harmonic (bins); chosen."""
VOTE_REACH = 2
"""Reach of a vote (standard deviations)."""
MIN_OWN_PEAK_VOTES = 0.2
"""Share of the most votes from which a speed with a recorded first harmonic is preferred."""
MAX_SPEED_MISFIT = 4.0
"""Misfit above which a speed is compared with others."""
MAX_RIVAL_SPEEDS = 12
"""Number of speeds with the most votes that are compared."""
VOTE_PEAK_WIDTH = 9
"""Number of grid steps around each compared speed."""
MIN_GRID_SHARE = 0.5
"""Smallest share of peaks on the harmonic grid, and of peaks with a neighbor one or two turns or teeth away."""
RIPPLE_EDGE = 8.0
"""Amplitude of a side band of ripple over its peak times their distance, at most (Hz); chosen.

A loudness that steps by 40 % up and down at 30 Hz has 0.25 over m at each odd multiple m."""
VOTE_PEAK_REACH = 1.5e-3
"""Relative distance from a speed up to which votes are its own; chosen."""
MIN_VOTE_RATIO = 1.5
"""Votes of a speed over those of any other from which it is the only one; chosen."""
MIN_CLEAR_PEAKS, MIN_EXPLAINED_SHARE = 20, 0.15
"""Number of clear peaks from which a speed must explain some, and smallest share of them, as music has many; chosen."""
MIN_AGREEING_PEAKS = 3
"""Smallest number of matching peaks, as a pump has a comb, too."""


def find_speed_of_spectra(spectra: Spectra, air: Spectra, teeth: int, commanded: float) -> SpindleSpeed | None:
    """Find the spindle frequency (Hz) in the steady part of a cut, near the commanded one (Hz), or None.

    spectra: of all axes of the cut; air: of the same spindle without a cut. If the speed of all axes together is that
    of none of them alone, the one on which most axes agree is taken: a loud axis of few peaks must not shift it.
    """
    together = _find_common_speed(spectra, air, teeth, commanded)
    if len(spectra) == 1:
        return together
    found = (_find_common_speed([axis], [quiet], teeth, commanded) for axis, quiet in zip(spectra, air, strict=True))
    return choose_common_speed(together, [speed for speed in found if speed is not None])


def choose_common_speed(together: SpindleSpeed | None, alone: Sequence[SpindleSpeed]) -> SpindleSpeed | None:
    """Choose the speed of all axes together if it is that of an axis alone, else that of most axes.

    Without a speed of all axes together, two axes must agree.
    """
    if together is not None and (not alone or _count_same(together, alone)):
        return together
    best = max(alone, key=lambda speed: (_count_same(speed, alone), speed.agreeing), default=None)
    is_confirmed = best is not None and (together is not None or _count_same(best, alone) >= MIN_SAME_AXES)
    return best if is_confirmed else together


def _count_same(speed: SpindleSpeed, others: Sequence[SpindleSpeed]) -> int:
    """Count the speeds that are the same as one."""
    return sum(abs(other.frequency / speed.frequency - 1) < SAME_SPEED_TOLERANCE for other in others)


def _find_common_speed(spectra: Spectra, air: Spectra, teeth: int, commanded: float) -> SpindleSpeed | None:
    """Find the speed of all axes together, if need be without side bands of ripple."""
    speed = _find_speed(spectra, air, teeth, commanded)
    for edge in (0.0, RIPPLE_EDGE):
        if speed is None:
            peaks = find_cut_peaks(spectra, air, load_ripple.MAX_RIPPLE_FREQUENCY, edge)
            speed = find_unique_speed(peaks, spectra[0].bin_width, teeth, commanded)
    return speed


def follow_speed(spectra: Spectra, air: Spectra, known: SpindleSpeed) -> SpindleSpeed | None:
    """Refine a speed of another part of the same cut by the multiples in this part; None if few agree."""
    peaks = find_cut_peaks(spectra, air).loudest(combs.MAX_COMB_PEAKS)
    speed = combs.refine_comb(known.frequency, peaks, spectra[0].bin_width)
    if speed is None or abs(speed.frequency / known.frequency - 1) > USUAL_SPEED_TOLERANCE:
        return None
    return speed if speed.agreeing >= MIN_SURE_VOTES else None


def _find_speed(spectra: Spectra, air: Spectra, teeth: int, commanded: float) -> SpindleSpeed | None:
    """Find the spindle frequency (Hz)."""
    peaks = find_cut_peaks(spectra, air)
    voted = _find_speed_by_peaks(spectra, peaks, teeth, commanded)
    summed = find_comb_by_sum(spectra, air, peaks, teeth, commanded, COMB_SPEED_TOLERANCE, USUAL_SPEED_TOLERANCE)
    if voted is None or summed is None or abs(summed.frequency / voted.frequency - 1) < SAME_SPEED_TOLERANCE:
        found = voted or summed
    else:
        is_sum = refine_speed(summed.frequency, peaks, spectra[0].bin_width).agreeing >= voted.agreeing
        found = summed if is_sum else voted
    return found if found is not None and _explains(found, peaks, spectra[0].bin_width) else None


def _explains(speed: SpindleSpeed, peaks: SpectralPeaks, bin_width: float) -> bool:
    """Return whether a speed explains enough of the clear peaks of a cut, where they are many."""
    return len(peaks) < MIN_CLEAR_PEAKS or refine_speed(speed.frequency, peaks, bin_width).share >= MIN_EXPLAINED_SHARE


def _find_speed_by_peaks(spectra: Spectra, of_cut: SpectralPeaks, teeth: int, commanded: float) -> SpindleSpeed | None:
    """Find the speed by peaks clear of the noise; of_cut: those that are not in air."""
    peaks, first = [spectral.find_separate_peaks(spectrum) for spectrum in spectra], spectra[0]
    voted = find_speed_by_votes(of_cut, spectral.join_peaks(peaks), first, teeth, commanded)
    comb = find_comb(of_cut, first.bin_width, first.sample_rate, teeth, commanded, COMB_SPEED_TOLERANCE)
    if comb is None:
        is_sure = voted is not None and (voted.misfit < MAX_SPEED_MISFIT or voted.agreeing >= MIN_SURE_VOTES)
        return voted if is_sure else None
    if voted is None or comb.agreeing >= voted.agreeing:
        is_same = voted is not None and abs(comb.frequency / voted.frequency - 1) < SAME_SPEED_TOLERANCE
        return voted if is_same else comb if comb.share >= MIN_GRID_SHARE else None
    return voted


def find_unique_speed(peaks: SpectralPeaks, bin_width: float, teeth: int, commanded: float) -> SpindleSpeed | None:
    """Find the spindle frequency (Hz) near the commanded one that has far more votes than any other, or None."""
    loudest = load_ripple.remove_slow_comb(peaks, bin_width, commanded).loudest(combs.MAX_COMB_PEAKS)
    if len(loudest) < 2:
        return None
    grid, votes = _vote(loudest, bin_width, teeth, commanded)
    best = int(np.argmax(votes))
    others = votes[np.abs(grid / grid[best] - 1) > VOTE_PEAK_REACH]
    if votes[best] <= MIN_VOTE_RATIO * np.max(others):
        return None
    speed = refine_speed(float(grid[best]), loudest, bin_width)
    is_sure = _spaced_share(loudest, speed.frequency, teeth, bin_width) >= MIN_GRID_SHARE
    return speed if is_sure and _fits_teeth(speed, loudest, bin_width, teeth) else None


def _fits_teeth(speed: SpindleSpeed, peaks: SpectralPeaks, bin_width: float, teeth: int) -> bool:
    """Return whether peaks are multiples of a turn or a tooth apart, not of another part of a chatter frequency."""
    tolerance = combs.GRID_TOLERANCES[-1] * bin_width
    harmonics, *others = combs.find_sideband_families(speed.frequency, peaks, tolerance)
    steps = np.concatenate([harmonics.order, *(family.order - family.order[0] for family in others)])
    common = int(np.gcd.reduce(steps.astype(np.int64)))
    return common > 0 and teeth % common == 0


def find_speed_by_votes(
    cut_lines: SpectralPeaks, all_lines: SpectralPeaks, spectrum: Spectrum, teeth: int, commanded: float
) -> SpindleSpeed | None:
    """Find the spindle frequency (Hz) by votes of peaks near the commanded one, or None.

    cut_lines: those that are not there in air; all_lines: with those that are. Each distance between two peaks, each
    sum and each peak itself votes for the frequencies that it is a harmonic of, for harmonics of the teeth twice:
    chatter f_c + k f counts as much as the harmonics k f. The best is made exact by least squares.
    """
    loudest = cut_lines.loudest(combs.MAX_COMB_PEAKS)
    if len(loudest) < 2:
        return None
    bin_width = spectrum.bin_width
    grid, votes = _vote(loudest, bin_width, teeth, commanded)
    if not np.any(votes):
        return None
    turning = all_lines.frequency[np.abs(all_lines.frequency / commanded - 1) < VOTE_SPEED_TOLERANCE]
    near = np.any(np.abs(grid[:, np.newaxis] - turning) < OWN_PEAK_TOLERANCE * spectrum.bin_width, axis=1)
    best = int(np.argmax(votes))
    known = int(np.argmax(np.where(near, votes, 0.0)))
    best = known if near[known] and votes[known] > MIN_OWN_PEAK_VOTES * votes[best] else best
    speed = refine_speed(float(grid[best]), loudest, spectrum.bin_width)
    if speed.misfit > MAX_SPEED_MISFIT:
        rivals = [refine_speed(frequency, loudest, bin_width) for frequency in grid[_vote_peaks(votes)].tolist()]
        speed = min((speed, *rivals), key=lambda rival: rival.misfit)
    is_sure = min(speed.share, _spaced_share(loudest, speed.frequency, teeth, spectrum.bin_width)) >= MIN_GRID_SHARE
    is_sure &= speed.agreeing >= MIN_AGREEING_PEAKS
    return speed if is_sure else None


def _spaced_share(peaks: SpectralPeaks, frequency: float, teeth: int, bin_width: float) -> float:
    """Return the share of peaks with another one or two turns or teeth away; a wrong frequency has few."""
    apart = np.abs(peaks.frequency[:, np.newaxis] - peaks.frequency)
    steps = (step * frequency for step in (1, 2, teeth, 2 * teeth))
    return float(np.mean(np.any([np.any(np.abs(apart - step) < bin_width, axis=1) for step in steps], axis=0)))


def _vote_peaks(votes: Floats) -> Indices:
    """Return the places of local maxima of the votes, the most votes first."""
    places = np.flatnonzero((scipy.ndimage.maximum_filter1d(votes, VOTE_PEAK_WIDTH) == votes) & (votes > 0))
    return places[np.argsort(-votes[places])[:MAX_RIVAL_SPEEDS]]


def _vote(peaks: SpectralPeaks, bin_width: float, teeth: int, commanded: float) -> tuple[Floats, Floats]:
    """Return frequencies near the commanded one (Hz) and the votes of peaks for each."""
    step = VOTE_GRID_STEP * VOTE_WIDTH * bin_width / (FINEST_VOTE_HARMONIC * commanded)
    grid = commanded * (1 + np.arange(-VOTE_SPEED_TOLERANCE, VOTE_SPEED_TOLERANCE, step))
    return grid, _count_votes(peaks, grid, teeth, VOTE_WIDTH * bin_width)


def _count_votes(peaks: SpectralPeaks, grid: Floats, teeth: int, sharpness: float) -> Floats:
    """Count the votes for each frequency of a grid (Hz); sharpness: of one peak (Hz)."""
    weight, step = np.log10(peaks.clearness), grid[1] - grid[0]
    i, j = np.triu_indices(len(peaks), 1)
    spaced = np.concatenate([np.abs(peaks.frequency[i] - peaks.frequency[j]), peaks.frequency[i] + peaks.frequency[j]])
    spaced = np.concatenate([spaced, peaks.frequency])
    weight = np.concatenate([*[np.minimum(weight[i], weight[j])] * 2, weight])
    votes = np.zeros(grid.size)
    for order in range(1, MAX_VOTE_HARMONIC + 1):
        place = np.round((spaced / order - grid[0]) / step).astype(int)
        inside = (place >= 0) & (place < grid.size)
        if np.any(inside):
            counted = np.bincount(place[inside], weight[inside] * (1 + (order % teeth == 0)), grid.size)
            width = np.sqrt(2) * sharpness / order / step
            reach = min(int(np.ceil(VOTE_REACH * width)), (votes.size - 1) // 2)
            spread = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
            votes += np.convolve(counted.astype(np.float64), spread, "same")
    return votes


TACHOMETER_TOLERANCE = 2e-3
"""Relative difference within which tachometer and peaks agree, as a column may be rounded; chosen."""
TACHOMETER_ERROR = 5e-5
"""Relative standard error of a tachometer: one sample at each end of one or two seconds; chosen."""
PULSE_RATIO_TOLERANCE = 0.02
"""Relative distance of a speed ratio from an integer that shows wrongly counted pulses; chosen.

The ratio is tachometer speed over commanded speed, or its inverse."""


def check_tachometer_speed(
    spectra: Spectra, air: Spectra, teeth: int, commanded: float, measured: float
) -> tuple[SpindleSpeed | None, float]:
    """Check a tachometer: return the spindle frequency (Hz), and one that contradicts it, else NaN.

    commanded: as it was set, measured: by the tachometer (Hz). If it is more than 5 % off what was set, it is
    used if the peaks fit only it and it is no harmonic of that. Where no peaks say a speed near it, it is the
    speed by itself, if three of them are its harmonics.
    """
    is_near = abs(measured / commanded - 1) < COMB_SPEED_TOLERANCE
    at_set = None if is_near else find_speed_of_spectra(spectra, air, teeth, commanded)
    if at_set is not None:
        return None, at_set.frequency
    known = find_speed_of_spectra(spectra, air, teeth, measured)
    if known is not None and abs(known.frequency / measured - 1) > TACHOMETER_TOLERANCE:
        return None, known.frequency
    if not is_near and (known is None or is_pulse_multiple(measured / commanded)):
        return None, commanded
    return known or _use_tachometer_speed(spectra, air, measured), np.nan


def is_pulse_multiple(ratio: float) -> bool:
    """Return whether tachometer speed over commanded speed is an integer above 1, or the reciprocal of one."""
    whole = max(ratio, 1 / ratio)
    return round(whole) > 1 and abs(whole / round(whole) - 1) < PULSE_RATIO_TOLERANCE


def _use_tachometer_speed(spectra: Spectra, air: Spectra, measured: float) -> SpindleSpeed | None:
    """Return the speed of the tachometer if some peaks are its harmonics, else None."""
    peaks, bin_width = find_cut_peaks(spectra, air), spectra[0].bin_width
    n_own = int(np.count_nonzero(fold_frequency(peaks.frequency, measured) < spectral.PEAK_TOLERANCE * bin_width))
    if n_own < MIN_AGREEING_PEAKS:
        return None
    refined = refine_speed(measured, peaks.loudest(combs.MAX_COMB_PEAKS), bin_width)
    return SpindleSpeed(measured, TACHOMETER_ERROR * measured, refined.share, n_own, refined.misfit)


HUM_FREQUENCIES, HUM_TOLERANCE = (50.0, 60.0), 2e-3
"""Mains frequencies (Hz), whose hum is a comb, too, and their largest relative deviation."""
MIN_DISTANT_SHARE = 0.5
"""Share of peaks or energy off a speed's harmonics, from which another speed replaces it; chosen."""


def find_distant_speed(
    spectra: Spectra, air: Spectra, teeth: int, commanded: float, known: SpindleSpeed | None, left: SpectralPeaks | None
) -> float:
    """Find a clear comb (Hz) far from the commanded speed, else NaN.

    known: the speed that was found; left: peaks that are no harmonics of it. Only a comb whose
    harmonics they are, and on which more peaks agree, is one then. That of half of it is none, which chatter of
    period two makes; the mains hum at harmonics of theirs.
    """
    peaks, first = find_cut_peaks(spectra, air), spectra[0]
    about = first.bin_width, first.sample_rate, teeth
    clearest = combs.find_distant_comb(peaks, *about, commanded, COMB_SPEED_TOLERANCE)
    if known is None or left is None:
        return np.nan if clearest is None else clearest.frequency
    mains_speeds = {hum: (known.frequency / hum, known.frequency / (2 * hum)) for hum in HUM_FREQUENCIES}
    hums = [hum for hum, ratios in mains_speeds.items() if all(abs(ratio - 1) >= HUM_TOLERANCE for ratio in ratios)]
    mains = [find_comb(peaks, *about, hum, HUM_TOLERANCE) for hum in hums]
    plain = [comb for comb in (clearest, *mains) if comb is not None and comb.agreeing >= known.agreeing]
    centres = combs.list_distant_centers(commanded, COMB_SPEED_TOLERANCE)
    sums = (find_comb_by_sum(spectra, air, peaks, teeth, centre, COMB_SPEED_TOLERANCE) for centre in centres)
    loudest = peaks.loudest(combs.MAX_COMB_PEAKS)
    width = first.bin_width
    agreeing = refine_speed(known.frequency, loudest, width).agreeing
    summed = [comb for comb in sums if comb and refine_speed(comb.frequency, loudest, width).agreeing > agreeing]
    better = [comb.frequency for comb in (*plain, *summed) if _is_better_comb(comb, known, left, width)]
    return max(better, key=lambda frequency: _rank_comb(frequency, loudest, width)) if better else np.nan


def _is_better_comb(comb: SpindleSpeed, known: SpindleSpeed, others: SpectralPeaks, bin_width: float) -> bool:
    """Return whether most peaks that are no harmonics of a speed fit another comb, not that of half of it."""
    belongs = fold_frequency(others.frequency, comb.frequency) < spectral.PEAK_TOLERANCE * bin_width
    is_half = abs(2 * comb.frequency / known.frequency - 1) < SAME_SPEED_TOLERANCE
    share = np.count_nonzero(belongs) / len(others), others[belongs].energy / others.energy
    return not is_half and max(share) > MIN_DISTANT_SHARE


def _rank_comb(frequency: float, peaks: SpectralPeaks, bin_width: float) -> tuple[float, float]:
    """Rank a comb by the tenths of peaks that are its harmonics, then by its frequency."""
    comb = combs.refine_comb(frequency, peaks, bin_width)
    return (0.0 if comb is None else round(10 * comb.share), frequency)
