"""How fast the spindle really turns in a cut, from the lines that its turning spaces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from lobewatch.cuts.listening.harmonic_sum import harmonic_sum
from lobewatch.cuts.listening.lattice import SpindleSpeed, refine_speed
from lobewatch.cuts.listening.plain_comb import LOUDEST, plain_comb
from lobewatch.cuts.listening.sorted_lines import lines_of_cut
from lobewatch.cuts.listening.spectrum import (
    Floats,
    SpectralLines,
    Spectrum,
    joined_lines,
    lines_of,
    spectra_of,
    without_skirts,
)

COMB_AROUND = 0.05
"""Relative distance from the speed that was set up to which a plain comb is looked for ..."""
USUAL = 0.002
"""... up to which most spindles turn: the nearer a comb is, the fewer as near are tried; chosen ..."""
SAME = 1e-3
"""... and up to which it is the same as that of the votes, which know of side bands; it is taken where it explains as
many lines: it has one unknown, they have one more for each family of side bands."""
SURE = 6
"""Lines that must agree on a speed by votes that has no plain comb, and that does not fit (`FITS`) all of them."""
AROUND = 0.021
"""Relative distance from the speed that was set up to which votes are counted."""
HIGHEST = 60
"""Multiples of the frequency of the spindle by which two of them may differ."""
SHARPNESS = 0.25
"""Standard deviation of a line in the count of votes (bins)."""
STEP, FINEST = 0.25, 40
"""Step of the grid of speeds, over the standard deviation of the vote of this multiple; chosen."""
OWN_LINE = 0.5
"""Distance up to which a line is that of the turning spindle (bins); chosen."""
REACH = 2
"""Standard deviations up to which a vote is spread."""
UNBALANCE = 0.2
"""A speed whose own line is heard is taken where it has so much of the votes of the best one."""
FITS = 4.0
"""A speed with a larger misfit is compared with others ..."""
PEAKS = 12
"""... so many that have the most votes ..."""
BESIDE = 9
"""... of as many steps of the grid around each."""
LEAST_SHARE = 0.5
"""Share of the lines that must belong to the lattice, and must have a neighbour one or two turns or teeth away ..."""
LEAST_AGREEING = 3
"""... and number of them that must agree: a pump that is switched on has lines of its own."""


def find_speed(cut: Floats, air: Floats, sample_rate: float, teeth: int, commanded_rpm: float) -> SpindleSpeed | None:
    """Turns a second in the steady part of a cut, near the speed that was set (rpm); None where too few lines agree.

    cut and air in any unit, shape (n,) or (axes, n); air: the same spindle without a cut; sample_rate in Hz.

    Example: tooth passing of four teeth at 6000 rpm, its multiples and a little noise.

    >>> time, random = np.arange(10_000) / 10e3, np.random.default_rng(0)
    >>> comb = sum(np.sin(2 * np.pi * 400 * k * time) / k for k in range(1, 9))
    >>> air, cut = 0.01 * random.normal(size=(2, time.size)) + [[0.0], [1.0]] * comb
    >>> speed = find_speed(cut, air, 10e3, 4, 6020.0)
    >>> round(60 * speed.frequency)
    6000
    """
    return speed_of_spectra(spectra_of(cut, sample_rate), spectra_of(air, sample_rate), teeth, commanded_rpm / 60)


def speed_of_spectra(
    spectra: Sequence[Spectrum], air: Sequence[Spectrum], teeth: int, commanded: float
) -> SpindleSpeed | None:
    """`find_speed` of the spectra of all axes; commanded in turns a second (Hz)."""
    lines, voted = lines_of_cut(spectra, air), _speed_of_lines(spectra, air, teeth, commanded)
    summed = harmonic_sum(spectra, air, lines, teeth, commanded, COMB_AROUND, USUAL)
    if voted is None or summed is None or abs(summed.frequency / voted.frequency - 1) < SAME:
        return voted or summed
    rival = refine_speed(summed.frequency, lines, spectra[0].bin)
    return summed if rival.agreeing >= voted.agreeing else voted


def _speed_of_lines(
    spectra: Sequence[Spectrum], air: Sequence[Spectrum], teeth: int, commanded: float
) -> SpindleSpeed | None:
    """The speed by what stands clear of the noise."""
    lines = [without_skirts(lines_of(spectrum), spectrum.bin) for spectrum in spectra]
    of_cut, first = lines_of_cut(spectra, air), spectra[0]
    voted = true_speed(of_cut, joined_lines(lines), first, teeth, commanded)
    comb = plain_comb(of_cut, first.bin, first.sample_rate, teeth, commanded, COMB_AROUND)
    if comb is None:
        return voted if voted is not None and (voted.misfit < FITS or voted.agreeing >= SURE) else None
    if voted is None or comb.agreeing >= voted.agreeing:
        is_same = voted is not None and abs(comb.frequency / voted.frequency - 1) < SAME
        return voted if is_same else comb if comb.share >= LEAST_SHARE else None
    return voted


def true_speed(
    cut_lines: SpectralLines, all_lines: SpectralLines, spectrum: Spectrum, teeth: int, commanded: float
) -> SpindleSpeed | None:
    """Turns a second, near those that were set (Hz); None where too few lines agree.

    cut_lines: those that are not there in air; all_lines: with those that are. Each distance between two lines, each
    sum and each line itself votes for the frequencies that it is a multiple of, for multiples of the teeth twice:
    chatter f_c + k f counts as much as the multiples k f. The best is made exact by least squares.
    """
    loudest = cut_lines.loudest(LOUDEST)
    if len(loudest) < 2:
        return None
    grid = commanded * (1 + np.arange(-AROUND, AROUND, STEP * SHARPNESS * spectrum.bin / (FINEST * commanded)))
    votes = _votes(loudest, grid, teeth, SHARPNESS * spectrum.bin)
    if not np.any(votes):
        return None
    turning = all_lines.frequency[np.abs(all_lines.frequency / commanded - 1) < AROUND]
    near = np.any(np.abs(grid[:, np.newaxis] - turning) < OWN_LINE * spectrum.bin, axis=1)
    best = int(np.argmax(votes))
    heard = int(np.argmax(np.where(near, votes, 0.0)))
    best = heard if near[heard] and votes[heard] > UNBALANCE * votes[best] else best
    speed = refine_speed(float(grid[best]), loudest, spectrum.bin)
    if speed.misfit > FITS:
        rivals = [refine_speed(frequency, loudest, spectrum.bin) for frequency in grid[_peaks(votes)].tolist()]
        speed = min((speed, *rivals), key=lambda rival: rival.misfit)
    is_sure = min(speed.share, _spaced(loudest, speed.frequency, teeth, spectrum.bin)) >= LEAST_SHARE
    is_sure &= speed.agreeing >= LEAST_AGREEING
    return speed if is_sure else None


def _spaced(lines: SpectralLines, frequency: float, teeth: int, bin_: float) -> float:
    """Share of lines with another one or two turns or teeth away: a wrong frequency may fit multiples, not these."""
    apart = np.abs(lines.frequency[:, np.newaxis] - lines.frequency)
    steps = (step * frequency for step in (1, 2, teeth, 2 * teeth))
    return float(np.mean(np.any([np.any(np.abs(apart - step) < bin_, axis=1) for step in steps], axis=0)))


def _peaks(votes: Floats) -> NDArray[np.intp]:
    """Where there are more votes than beside, the most first."""
    places = np.flatnonzero((scipy.ndimage.maximum_filter1d(votes, BESIDE) == votes) & (votes > 0))
    return places[np.argsort(-votes[places])[:PEAKS]]


def _votes(lines: SpectralLines, grid: Floats, teeth: int, sharpness: float) -> Floats:
    """Votes for each frequency of a grid (Hz); sharpness: of one line (Hz)."""
    weight, step = np.log10(lines.clearness), grid[1] - grid[0]
    i, j = np.triu_indices(len(lines), 1)
    spaced = np.concatenate([np.abs(lines.frequency[i] - lines.frequency[j]), lines.frequency[i] + lines.frequency[j]])
    spaced, weight = (
        np.concatenate([spaced, lines.frequency]),
        np.concatenate([*[np.minimum(weight[i], weight[j])] * 2, weight]),
    )
    votes = np.zeros(grid.size)
    for order in range(1, HIGHEST + 1):
        place = np.round((spaced / order - grid[0]) / step).astype(int)
        inside = (place >= 0) & (place < grid.size)
        if np.any(inside):
            counted = np.bincount(place[inside], weight[inside] * (1 + (order % teeth == 0)), grid.size)
            votes += _smoothed(counted.astype(np.float64), np.sqrt(2) * sharpness / order / step)
    return votes


def _smoothed(votes: Floats, width: float) -> Floats:
    """Each vote spread over its neighbours; width: standard deviation in steps of the grid."""
    reach = min(int(np.ceil(REACH * width)), (votes.size - 1) // 2)
    spread = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    return np.convolve(votes, spread, "same")
