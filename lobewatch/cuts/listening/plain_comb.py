"""The comb of a turning spindle: lines that are multiples of one frequency, more of them than chance makes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from lobewatch.cuts.listening.lattice import STRAY, SpindleSpeed
from lobewatch.cuts.listening.sorted_lines import MULTIPLES
from lobewatch.cuts.listening.spectrum import Floats, SpectralLines

TOLERANCE = 1.2
"""Distance from a multiple up to which a line belongs to it (bins): as wide as a line (`sorted_lines.WIDE`)."""
WAVER = 1e-4
"""Change of every speed, relative (`steadiness.LEAST`): by so much multiples are unsure."""
LOUDEST = 40
"""Lines that are looked at ..."""
ANCHORS = 16
"""... and those that a comb is looked for from; chosen."""
STEPS = 3
"""Steps of the least squares."""
CHANCE = 1e-4
"""A comb that as many lines as random would have more often than this, over all combs that are tried, is none."""
CAP = 3.0
"""Most that one line counts, in log10 of its clearness: a loud one is no more than a line; chosen."""
HALF = 0.5
"""Share of the lines that a comb far from the speed that was set explains at least."""
LEAST = 3
"""Multiples that a comb has at least: any two lines have one."""


class Comb(NamedTuple):
    """A frequency, and the lines that are its multiples."""

    frequency: float
    """Frequency (Hz)."""
    belongs: NDArray[np.bool_]
    """Which lines are multiples, shape (n,)."""
    order: Floats
    """Order of each, shape (n,)."""
    beyond: Floats
    """Distance of each from its multiple (Hz), as that is folded, shape (n,)."""


def plain_comb(
    lines: SpectralLines, bin_: float, sample_rate: float, teeth: int, frequency: float, around: float
) -> SpindleSpeed | None:
    """The comb near a frequency (Hz), up to `around` from it, relative, that explains the most; None without one.

    lines: of all axes, without skirts; bin_: of the spectrum (Hz). Each line is a vote for the frequencies that it is a
    multiple of; those of the loudest are compared, after least squares, by the lines that they explain.
    """
    lines = lines.loudest(LOUDEST)
    few = sample_rate / 2 < MULTIPLES * frequency  # those that are folded back count too
    for images in (_images(lines, sample_rate)[:1], *([_images(lines, sample_rate)] if few else [])):
        best = _best_comb(lines, images, bin_, frequency, around)
        if best is not None and _chance(best, lines, images, bin_, teeth, around) < CHANCE:
            return _speed(best, lines, bin_)
    return None


def comb_elsewhere(
    lines: SpectralLines, bin_: float, sample_rate: float, teeth: int, frequency: float, around: float
) -> SpindleSpeed | None:
    """The comb that explains the most, half or twice the frequency (Hz) at most and further than `around` from it.

    Of those that explain as many tenths of the lines that of which all are tooth passing, else the highest; none of
    which all multiples have an order in common that the teeth have not: that is a part of another.
    """
    lines, best, rank = lines.loudest(LOUDEST), None, (0.0, False, 0.0)
    for centre in centres_elsewhere(frequency, around):
        comb = plain_comb(lines, bin_, sample_rate, teeth, centre, around)
        if comb is None or comb.share < HALF:
            continue
        order = np.round(lines.frequency / comb.frequency).astype(int)
        common = int(np.gcd.reduce(order[np.abs(lines.frequency - order * comb.frequency) < TOLERANCE * bin_]))
        ranked = round(comb.share, 1), common == teeth, comb.frequency
        if common and teeth % common == 0 and ranked > rank:
            best, rank = comb, ranked
    return best


def centres_elsewhere(frequency: float, around: float) -> list[float]:
    """Frequencies from half to twice one (Hz), each twice `around` from the next, relative; itself left out."""
    steps = np.arange(1, int(np.log(2) / (2 * around)) + 1)
    return [float(centre) for centre in frequency * np.exp(2 * around * np.concatenate([-steps, steps]))]


def refine_comb(frequency: float, lines: SpectralLines, bin_: float) -> SpindleSpeed | None:
    """A frequency (Hz) made exact by least squares over its multiples among lines; None where there are none."""
    comb = _refined(frequency, lines, lines.frequency[np.newaxis], bin_)
    return _speed(comb, lines, bin_) if np.any(comb.belongs) else None


def _images(lines: SpectralLines, sample_rate: float) -> Floats:
    """What may have been folded to each line (Hz), itself first; shape (images, n)."""
    heard = lines.frequency
    return np.stack([heard, sample_rate - heard, sample_rate + heard, 2 * sample_rate - heard])


def _best_comb(lines: SpectralLines, images: Floats, bin_: float, frequency: float, around: float) -> Comb | None:
    weight, best, most = np.minimum(np.log10(lines.clearness), CAP), None, 0.0
    for candidate in _candidates(lines, frequency, around):
        comb = _refined(float(candidate), lines, images, bin_)
        score = float(np.sum(weight[comb.belongs]))
        if score > most and abs(comb.frequency / frequency - 1) <= around:
            best, most = comb, score
    return best


def _candidates(lines: SpectralLines, frequency: float, around: float) -> Floats:
    """Frequencies (Hz) that the loudest lines are multiples of."""
    loudest = lines.frequency[:ANCHORS]
    orders = np.arange(1, int(np.max(loudest, initial=0.0) / frequency / (1 - around)) + 1)
    parts = (loudest[:, np.newaxis] / orders).ravel()
    return np.asarray(parts[np.abs(parts / frequency - 1) <= around])


def _refined(frequency: float, lines: SpectralLines, images: Floats, bin_: float) -> Comb:
    """A frequency made exact by least squares over its multiples."""
    comb = _comb(frequency, images, bin_)
    for _ in range(STEPS):
        if not np.any(comb.belongs):
            break
        error, order = _error(lines, bin_)[comb.belongs], comb.order[comb.belongs]
        off = float(np.sum(order * comb.beyond[comb.belongs] / error**2) / np.sum((order / error) ** 2))
        comb = _comb(comb.frequency + off, images, bin_)
    return comb


def _comb(frequency: float, images: Floats, bin_: float) -> Comb:
    orders = np.round(images / frequency)
    beyond = np.where(orders > 0, images - orders * frequency, np.inf)
    nearest = np.argmin(np.abs(beyond), axis=0)[np.newaxis]
    order, away = (np.take_along_axis(values, nearest, axis=0)[0] for values in (orders, beyond))
    return Comb(frequency, np.abs(away) < TOLERANCE * bin_, order, away)


def _error(lines: SpectralLines, bin_: float) -> Floats:
    """Standard error of each line (Hz), with what the speed wavers by."""
    return np.hypot(lines.frequency_error(bin_), WAVER * lines.frequency)


def _chance(comb: Comb, lines: SpectralLines, images: Floats, bin_: float, teeth: int, around: float) -> float:
    """How many of all combs that are tried would have as many multiples among lines that lie anywhere.

    Multiples of tooth passing alone are so much rarer.
    """
    orders = np.unique(comb.order[comb.belongs])
    if orders.size < LEAST:
        return np.inf
    spacing = comb.frequency * (1 if np.any(orders % teeth) else teeth)
    near = min(2 * TOLERANCE * bin_ / spacing * len(images), 1.0)
    tried = max(around * float(np.max(images)) / (TOLERANCE * bin_), 1.0)
    apart = np.unique(np.round(lines.frequency / (2 * TOLERANCE * bin_))).size
    return float(tried * scipy.stats.binom.sf(orders.size - 1, apart, near))


def _speed(comb: Comb, lines: SpectralLines, bin_: float) -> SpindleSpeed:
    off = comb.beyond / _error(lines, bin_)
    exact = 1 / np.sqrt(np.sum((comb.order / _error(lines, bin_))[comb.belongs] ** 2))
    error = float(exact * max(1.0, float(np.sqrt(np.mean(off[comb.belongs] ** 2)))))
    misfit = float(np.mean(np.minimum(np.abs(off), STRAY) ** 2))
    count = int(np.count_nonzero(comb.belongs))
    return SpindleSpeed(comb.frequency, error, count / len(lines), count - 1, misfit)
