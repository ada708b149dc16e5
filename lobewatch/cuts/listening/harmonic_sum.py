"""The speed by the sum over its multiples, also of those that are no lines by themselves: many weak ones are a comb."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lobewatch.cuts.listening.fold_frequency import fold_frequency
from lobewatch.cuts.listening.lattice import SpindleSpeed
from lobewatch.cuts.listening.plain_comb import CHANCE, LEAST, LOUDEST, refine_comb
from lobewatch.cuts.listening.sorted_lines import AIR_WIDE, FOREIGN, MULTIPLES
from lobewatch.cuts.listening.spectrum import Floats, SpectralLines, Spectrum, joined_lines, lines_of

FAINTEST = 0.6
"""log10 of its power over that of the noise from which on a multiple counts: noise is seldom so loud; chosen ..."""
MOST = 2.4
"""... and the most that it counts beyond that; chosen."""
STEP = 0.25
"""Step of the frequencies that are tried, over what moves the highest multiple by a bin; chosen."""
LEVELS = 100
"""Levels into which a multiple's part of the sum is divided."""
CLEAR = 1 / 3
"""Mean over the multiples below which a comb must be far rarer by chance, which takes each for itself: side bands of a
line that is no multiple come together; chosen ..."""
RARE = 1e-8
"""... as this; chosen."""
ALIKE = 0.05
"""How often chance may make the multiples that are left without those of one order; chosen."""
OWN = 4.0
"""Distance from a multiple up to which the spectrum is its own (bins): half the width of the window's main lobe."""
WEAK = 4.0
"""Power over that of the noise of the lines from which the frequency is made exact: as `FAINTEST`."""


def harmonic_sum(
    spectra: Sequence[Spectrum],
    air: Sequence[Spectrum],
    lines: SpectralLines,
    teeth: int,
    frequency: float,
    around: float,
    usual: float = 1.0,
) -> SpindleSpeed | None:
    """The comb near a frequency (Hz), up to `around` from it, relative, that is loudest over noise; None without one.

    spectra and air: of each axis; what is no louder than in air does not count. lines: those that stand clear, of all
    axes; where they are many, they settle it, and there is one on a multiple of anything. The mean over all axes of
    log10 of power over noise is summed over the multiples (Schroeder 1968, J. Acoust. Soc. Am. 43, 829-834). It is a
    comb where as many frequencies that are no multiples would have that sum less often than once in ten thousand, over
    all that are tried as near to the frequency as it is, or up to `usual` from it, relative.
    """
    if len(lines) >= LOUDEST * len(spectra):
        return None
    first, above = spectra[0], _mean_above(spectra, air)
    highest = int(min(MULTIPLES, first.sample_rate / 2 / (frequency * (1 + around))))
    lowest, most = (1 - around) * frequency, (1 + around) * frequency
    tried = np.arange(lowest, most, STEP * first.bin / max(highest, 1))
    parts = np.array([np.interp(k * tried, first.frequency, above) for k in range(1, highest + 1)])
    best = int(np.argmax(np.sum(parts, axis=0)))
    heard = parts[:, best]
    if not 0 < best < tried.size - 1 or np.count_nonzero(heard) < LEAST:
        return None
    inside = (first.frequency > lowest) & (first.frequency < highest * most)
    beside = inside & (fold_frequency(first.frequency, float(tried[best])) > OWN * first.bin)
    rarest = CHANCE if np.mean(heard) >= CLEAR else RARE
    likely = min(max(abs(float(tried[best]) / frequency - 1), usual) / around, 1.0)
    if STEP * tried.size * likely * _chance(heard, above[beside]) > rarest or _is_part(heard, above[beside], teeth):
        return None
    weak = joined_lines([lines_of(spectrum, WEAK) for spectrum in spectra])
    return refine_comb(float(tried[best]), weak[weak.frequency < (highest + 0.5) * tried[best]], first.bin)


def _mean_above(spectra: Sequence[Spectrum], air: Sequence[Spectrum]) -> Floats:
    """log10 of power over noise beyond `FAINTEST`, in the mean of all axes, 0 to `MOST`; 0 where it is of air."""
    total = np.zeros(spectra[0].power.size)
    for spectrum, quiet in zip(spectra, air, strict=True):
        above = np.log10(np.maximum(spectrum.power, np.finfo(np.float64).tiny) / spectrum.noise) - FAINTEST
        above[spectrum.power <= FOREIGN * quiet.loudest_near(spectrum.frequency, AIR_WIDE)] = 0.0
        total += np.clip(above, 0.0, MOST)
    return total / len(spectra)


def _is_part(heard: Floats, values: Floats, teeth: int) -> bool:
    """Whether the multiples that are heard have an order in common that the teeth have not: it is another's comb."""
    orders = np.arange(1, heard.size + 1)
    return any(_chance(heard[orders % part != 0], values) > ALIKE for part in orders[1:] if teeth % part)


def _chance(heard: Floats, values: Floats) -> float:
    """How often as many of the values, drawn anywhere, have a sum as large; noise is among them, if they are few."""
    count, level = heard.size, np.arange(LEVELS + 1) * (MOST / LEVELS)
    share = np.bincount(np.round(values * (LEVELS / MOST)).astype(int), minlength=level.size) / values.size
    louder = np.maximum(np.cumsum(share[::-1])[::-1], np.exp(-(10 ** (FAINTEST + level))))
    share = np.append(1.0, louder[1:]) - np.append(louder[1:], 0.0)
    size = LEVELS * count + 1
    sums = np.fft.irfft(np.fft.rfft(share, 2 * size) ** count, 2 * size)[:size]
    return float(np.sum(sums[int(np.sum(heard) * LEVELS / MOST) :]))
