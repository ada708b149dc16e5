"""Detect a Hann window over the record from the shape of narrow peaks."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from acquisition import Frf
from modal.arrays import Complexes, Floats
from modal.bands.find_resonances import Resonance
from modal.bands.frf_lines import measured_over_receptance

NARROW_PEAK_LINES = (1.0, 12.0)
"""Half-widths (lines) of the peaks that show a window: the tail of narrower ones is too short, wider ones hide it."""
PEAK_HALF_WIDTHS, MIN_PEAK_LINES = 4.0, 17
"""Half-widths on either side of a peak, and lines at least, that its shape is fitted to; chosen."""
MIN_PEAK_DISTANCE = 6.0
"""Distance of the nearest other peak, over the sum of half-widths; chosen."""
MAX_PEAKS = 3
"""Most peaks that are compared, the highest ones; chosen."""
SPACING_FACTORS = (0.7, 1.4)
"""Other spacings of the side terms that must fit worse, over the spacing of the lines; chosen.

A drift of the structure widens a peak, too, but by a share of its frequency.
"""
MAX_WINDOW_RATIO, MAX_SINGLE_PEAK_RATIO = 0.6, 0.1
"""Largest sum of squares under a window over that without it, for two peaks or more, and for one; chosen.

Noise of 0.5 % of each line leaves 0.5 of a window.
"""
PHASES = np.arange(8) * np.pi / 4
"""Places of the hit in the record, over record length, times 2 pi."""
SEARCHED_PLACES, SEARCHED_WIDTHS = np.linspace(-1.2, 1.2, 9), np.linspace(-2.0, 1.0, 9)
"""Places around a peak (half-widths), and logarithms of widths over its width, that are tried first; chosen."""
SEARCH_SHRINKAGE = (1.0, 0.25, 0.06, 0.016)
"""Spans of the rounds of the search, over those of the first; chosen."""


def has_hann_shape(frf: Frf, resonances: Sequence[Resonance]) -> bool:
    """Return whether the narrow peaks have the shape of modes under a Hann window over the record.

    A Hann window adds to each mode half of itself at the neighbouring lines, exp(ip) H(f - d)/4 + H(f)/2 +
    exp(-ip) H(f + d)/4, with the spacing d of the lines and p by the place of the hit. The same number of modal
    unknowns is fitted with this shape, without it, and with other spacings.

    Source: Harris (1978), On the use of windows for harmonic analysis, Proc. IEEE 66, 51 (Hann window as a sum of three
    lines).
    """
    steps = np.diff(frf.frequency)
    if np.ptp(steps) > 1e-3 * steps[0]:
        return False
    step = float(np.mean(steps))
    peaks = list(_narrow_peaks(frf, resonances, step))
    most = MAX_WINDOW_RATIO if len(peaks) > 1 else MAX_SINGLE_PEAK_RATIO
    if not peaks:
        return False
    ratio = window_ratio(peaks, step)
    return ratio < most and ratio < min(window_ratio(peaks, factor * step) for factor in SPACING_FACTORS)


class NarrowPeak(NamedTuple):
    """Lines of a narrow peak."""

    frequency: Floats
    """Frequencies (Hz), shape (n,)."""
    values: Complexes
    """Measured values, shape (n,)."""
    resonance: Resonance
    """Peak."""


def _narrow_peaks(frf: Frf, resonances: Sequence[Resonance], step: float) -> Iterator[NarrowPeak]:
    """Yield the highest narrow peaks that are apart from all others."""
    measured, (least, most) = frf.receptance * measured_over_receptance(frf), NARROW_PEAK_LINES
    narrow = [peak for peak in resonances if least < peak.half_width / step < most and _is_apart(peak, resonances)]
    for peak in sorted(narrow, key=lambda peak: -peak.height)[:MAX_PEAKS]:
        reach = max(PEAK_HALF_WIDTHS * peak.half_width, MIN_PEAK_LINES // 2 * step)
        near = np.abs(frf.frequency - peak.frequency) <= reach
        yield NarrowPeak(frf.frequency[near], measured[near], peak)


def _is_apart(peak: Resonance, resonances: Sequence[Resonance]) -> bool:
    others = [other for other in resonances if other is not peak]
    gaps = [abs(other.frequency - peak.frequency) / (other.half_width + peak.half_width) for other in others]
    return min(gaps, default=np.inf) > MIN_PEAK_DISTANCE


def window_ratio(peaks: Sequence[NarrowPeak], spacing: float) -> float:
    """Return the sum of squares under a window with side terms at a spacing (Hz) over that without.

    It is the geometric mean over the peaks, at the best common place of the hit; infinite if a peak fits worse.
    """
    ratios = np.array([_squares(peak, PHASES, spacing) / _squares(peak, np.zeros(1), 0.0) for peak in peaks])
    means = np.exp(np.mean(np.log(ratios), axis=0))
    return float(np.min(np.where(np.max(ratios, axis=0) < 1, means, np.inf)))


def _squares(peak: NarrowPeak, phases: Floats, spacing: float) -> Floats:
    """Return the least sum of squares of one mode and a parabola, over its pole, for each phase of the window."""
    f, half_width = peak.frequency, peak.resonance.half_width
    terms, _ = np.linalg.qr(np.vander((f - np.mean(f)) / np.ptp(f), 3))
    rest = peak.values - (peak.values @ terms) @ terms.T
    centre, width = np.full(phases.size, peak.resonance.frequency), np.full(phases.size, half_width)
    for shrinkage in SEARCH_SHRINKAGE:
        places = centre[:, np.newaxis] + half_width * shrinkage * SEARCHED_PLACES
        widths = width[:, np.newaxis] * np.exp(shrinkage * SEARCHED_WIDTHS)
        columns = _windowed_modes(f, places[:, :, np.newaxis], widths[:, np.newaxis], phases, spacing)
        columns = columns.reshape(phases.size, -1, f.size)
        columns = columns - (columns @ terms) @ terms.T
        gains = np.abs(columns.conj() @ rest) ** 2 / np.sum(np.abs(columns) ** 2, axis=2)
        best = np.argmax(gains, axis=1)
        each = np.arange(phases.size)
        centre, width = places[each, best // SEARCHED_WIDTHS.size], widths[each, best % SEARCHED_WIDTHS.size]
    return np.asarray(np.sum(np.abs(rest) ** 2) - gains[each, best])


def _windowed_modes(f: Floats, places: Floats, widths: Floats, phases: Floats, spacing: float) -> Complexes:
    """Return modes under windows of these phases, (c,), shape (c, a, b, n); places (c, a, 1) and widths (c, 1, b)."""
    distance, damped = f - places[..., np.newaxis], widths[..., np.newaxis]
    middle = 1 / (1j * distance + damped)
    if not spacing:
        return np.asarray(middle)
    turn = np.exp(1j * phases)[:, np.newaxis, np.newaxis, np.newaxis]
    below, above = 1 / (1j * (distance - spacing) + damped), 1 / (1j * (distance + spacing) + damped)
    return np.asarray(middle / 2 + (turn * below + turn.conj() * above) / 4)
