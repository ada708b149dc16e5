"""A comb that is further from the speed that was set than a spindle turns: it is named, never followed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lobewatch.cuts.listening.fold_frequency import fold_frequency
from lobewatch.cuts.listening.harmonic_sum import harmonic_sum
from lobewatch.cuts.listening.lattice import SpindleSpeed, refine_speed
from lobewatch.cuts.listening.plain_comb import LOUDEST, centres_elsewhere, comb_elsewhere, plain_comb, refine_comb
from lobewatch.cuts.listening.sorted_lines import WIDE, lines_of_cut
from lobewatch.cuts.listening.spectrum import SpectralLines, Spectrum
from lobewatch.cuts.listening.true_speed import COMB_AROUND, SAME

MAINS, MAINS_AROUND = (50.0, 60.0), 2e-3
"""Frequencies of the mains (Hz), whose hum is a comb too, and how far they are off at most, relative."""
ON_COMB = 0.5
"""Share of the lines beside the multiples of a speed, or of their energy, on another that takes its place; chosen."""


def speed_elsewhere(
    spectra: Sequence[Spectrum],
    air: Sequence[Spectrum],
    teeth: int,
    commanded: float,
    heard: SpindleSpeed | None,
    beside: SpectralLines | None = None,
) -> float:
    """Turns a second (Hz) of a clear comb further from the speed that was set; NaN without one.

    heard: the speed that was found, and beside: lines that are no multiples of it. Only a comb whose multiples
    they are, and on which more lines agree, is one then. That of half of it is none, which chatter of period two makes;
    the mains hum at multiples of theirs.
    """
    lines, first = lines_of_cut(spectra, air), spectra[0]
    about = first.bin, first.sample_rate, teeth
    clearest = comb_elsewhere(lines, *about, commanded, COMB_AROUND)
    if heard is None or beside is None:
        return np.nan if clearest is None else clearest.frequency
    mains = [plain_comb(lines, *about, hum, MAINS_AROUND) for hum in MAINS if not _is_same(heard, hum)]
    plain = [comb for comb in (clearest, *mains) if comb is not None and comb.agreeing >= heard.agreeing]
    centres = centres_elsewhere(commanded, COMB_AROUND)
    sums = (harmonic_sum(spectra, air, lines, teeth, centre, COMB_AROUND) for centre in centres)
    loudest = lines.loudest(LOUDEST)
    agreeing = refine_speed(heard.frequency, loudest, first.bin).agreeing
    summed = [comb for comb in sums if comb and refine_speed(comb.frequency, loudest, first.bin).agreeing > agreeing]
    better = [comb.frequency for comb in (*plain, *summed) if _takes_over(comb, heard, beside, first.bin)]
    return max(better, key=lambda frequency: _rank(frequency, loudest, first.bin)) if better else np.nan


def _takes_over(comb: SpindleSpeed, heard: SpindleSpeed, beside: SpectralLines, bin_: float) -> bool:
    """Whether most of what is beside the multiples of a speed is on another comb, not that of half of it."""
    belongs = fold_frequency(beside.frequency, comb.frequency) < WIDE * bin_
    is_half = abs(2 * comb.frequency / heard.frequency - 1) < SAME
    share = np.count_nonzero(belongs) / len(beside), beside[belongs].energy / beside.energy
    return not is_half and max(share) > ON_COMB


def _rank(frequency: float, lines: SpectralLines, bin_: float) -> tuple[float, float]:
    """Of a comb among others: the tenths of the lines that are its multiples, then its frequency: half has as many."""
    comb = refine_comb(frequency, lines, bin_)
    return (0.0 if comb is None else round(10 * comb.share), frequency)


def _is_same(speed: SpindleSpeed, hum: float) -> bool:
    """Whether a spindle turns as fast as a hum (Hz), or twice: its multiples, or those of period two, are the same."""
    return any(abs(speed.frequency / (times * hum) - 1) < MAINS_AROUND for times in (1, 2))
