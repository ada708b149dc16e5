"""The lines of a cut by where they come from: the turning spindle, what was there before the cut, and what is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lobewatch.cuts.listening.fold_frequency import fold_frequency
from lobewatch.cuts.listening.lattice import SpindleSpeed
from lobewatch.cuts.listening.spectrum import (
    Floats,
    SpectralLines,
    Spectrum,
    joined_lines,
    lines_of,
    power_of,
    without_skirts,
)
from lobewatch.cuts.listening.steadiness import MOST

WIDE = 1.2
"""A line belongs to a frequency that is no further away than this (bins)."""
FOREIGN = 9.0
"""Power of a line over that which it has in air, below which it comes from elsewhere."""
AIR_WIDE = 2.0
"""Distance up to which a line of the air part is the same (bins of its own)."""
PIECE = 0.5
"""Length of the pieces of air in which tones are looked for that come and go (s); each begins in the middle of the one
before it; chosen ..."""
TONE, BESIDE = 12.0, 8
"""... and the power of a tone there over that of the noise of so many bins on each side: noise reaches it near a line
once in 1000 airs of 10 s; chosen."""
HIGHEST = 2.0
"""Multiples are looked for up to this many sample rates: a device without a filter folds them back ..."""
UPPER = 0.7
"""... and is hardly louder there (`LOUDER`) than the loudest multiple above this share of half the sample rate ..."""
MULTIPLES = 16
"""... or than any, where fewer than this are below half the sample rate; chosen."""
TOOTH_HARMONICS = 3
"""Multiples of tooth passing that are below half the sample rate, or folded ones are of any loudness ..."""
SLACK = 1e-3
"""... and so much further off, relative: from few lines the speed is no better known."""
LOUDER = 1.5
"""Amplitude of a folded multiple over that of the loudest multiple, at most."""
WAVERING = 0.05
"""Energy of all that is left over that of the multiples up to which lines as near to these as `steadiness.MOST` are of
a speed that wavers; chosen, with a stable cut that a microphone has heard in sight."""
SURE = 3.0
"""Standard errors of the spindle frequency within which its multiples may lie; chosen."""


@dataclass(frozen=True, eq=False)
class SortedLines:
    """All lines of a cut."""

    comb: SpectralLines
    """Multiples of the frequency of the spindle, the first left out: it is there in air."""
    tooth: NDArray[np.int64]
    """Order of each of these, modulo the number of teeth; 0 is tooth passing."""
    foreign: SpectralLines
    """Lines that are there in air."""
    folded: SpectralLines
    """Lines where multiples above half the sample rate are folded to."""
    left: SpectralLines
    """Lines that are left: chatter, where there is any."""


def is_foreign(lines: SpectralLines, air: Spectrum) -> NDArray[np.bool_]:
    """Whether lines are there in air too."""
    return np.asarray(lines.amplitude**2 <= FOREIGN * air.loudest_near(lines.frequency, AIR_WIDE))


def with_tones(air: Spectrum, signal: Floats, frequency: Floats) -> Spectrum:
    """The spectrum of air with tones of its pieces near frequencies (Hz): one that comes and goes is fainter in all.

    signal: of the air, shape (n,). What stands clear of what is beside it in its piece counts: a knock does not, nor
    does what passes by 40 Hz in a piece or faster, as a multiple of a spindle that is slowing down.
    """
    size = round(PIECE * air.sample_rate)
    step, level = air.sample_rate / size, np.zeros(frequency.size)
    near, around = (_places(frequency / step, bins, size // 2) for bins in (round(AIR_WIDE), BESIDE))
    for begin in range(0, signal.size - size + 1, size // 2):
        power = power_of(signal[begin : begin + size], size)
        tone, noise = np.max(power[near], axis=1), np.median(power[around], axis=1) / np.log(2)
        level = np.maximum(level, np.where(tone > TONE * noise, tone, 0.0))
    power = air.power.copy()
    np.maximum.at(power, np.round(frequency / air.frequency[1]).astype(int), level)
    return replace(air, power=power)


def _places(middle: Floats, reach: int, last: int) -> NDArray[np.intp]:
    """Bins up to so many from some, none beyond the last; shape (n, 2 reach + 1)."""
    places = np.round(middle).astype(np.intp)[:, np.newaxis] + np.arange(-reach, reach + 1)
    return np.asarray(np.clip(places, 0, last))


def lines_of_cut(spectra: Sequence[Spectrum], air: Sequence[Spectrum]) -> SpectralLines:
    """The lines of all axes that are not there in air, without skirts."""
    lines = [without_skirts(lines_of(spectrum), spectrum.bin) for spectrum in spectra]
    return joined_lines([axis[~is_foreign(axis, quiet)] for axis, quiet in zip(lines, air, strict=True)])


def is_slow(spectrum: Spectrum, turning: SpindleSpeed, teeth: int) -> bool:
    """Whether fewer than three multiples of tooth passing are below half the sample rate."""
    return spectrum.sample_rate / 2 < TOOTH_HARMONICS * teeth * turning.frequency


def sort_lines(
    lines: SpectralLines, spectrum: Spectrum, air: Spectrum, turning: SpindleSpeed, teeth: int, unsteady: float
) -> SortedLines:
    """Where each line comes from; a multiple of the spindle above half the sample rate is where it is folded to.

    unsteady: by how much the speed varies, relative: multiples are so much wider.
    """
    order = np.round(lines.frequency / turning.frequency)
    away = np.abs(lines.frequency - order * turning.frequency)
    unsure = order * (SURE * turning.error + unsteady * turning.frequency)
    comb = (away < WIDE * spectrum.bin + unsure) & (order > 0)
    foreign = ~comb & is_foreign(lines, air)
    half = spectrum.sample_rate / 2
    upper = comb & (lines.frequency > (UPPER * half if half > MULTIPLES * turning.frequency else 0.0))
    loudest = float(np.max(lines.amplitude[upper], initial=0.0))
    is_bounded = lines.amplitude <= LOUDER * loudest
    back = _near_folded(lines, spectrum, turning, teeth, unsteady) & (is_bounded | is_slow(spectrum, turning, teeth))
    back &= ~(comb | foreign)
    kept = comb & (order > 1)
    tooth = (order[kept] % teeth).astype(np.int64)
    left = _without_wavering(lines[~(comb | foreign | back)], lines[kept], spectrum, turning)
    return SortedLines(lines[kept], tooth, lines[foreign], lines[back], left)


def _without_wavering(
    left: SpectralLines, comb: SpectralLines, spectrum: Spectrum, turning: SpindleSpeed
) -> SpectralLines:
    """What is left but for faint lines that are multiples of a speed that wavers faster than is seen in its lines."""
    if left.energy > WAVERING * comb.energy:
        return left
    away = fold_frequency(left.frequency, turning.frequency)
    return left[away > MOST * left.frequency + WIDE * spectrum.bin]


def _near_folded(
    lines: SpectralLines, spectrum: Spectrum, turning: SpindleSpeed, teeth: int, unsteady: float
) -> NDArray[np.bool_]:
    """Whether lines lie where multiples of the spindle above half the sample rate are folded to."""
    rate = spectrum.sample_rate
    orders = np.arange(int(rate / 2 / turning.frequency) + 1, int(HIGHEST * rate / turning.frequency) + 1)
    if not orders.size:
        return np.zeros(len(lines), dtype=np.bool_)
    folded = fold_frequency(np.asarray(orders * turning.frequency), rate)
    slack = np.where(is_slow(spectrum, turning, teeth) & (orders % teeth == 0), SLACK, 0.0)
    unsure = orders * (SURE * turning.error + (unsteady + slack) * turning.frequency)
    away = np.abs(lines.frequency[:, np.newaxis] - folded) - unsure
    return np.asarray(np.min(away, axis=1, initial=np.inf) < WIDE * spectrum.bin)
