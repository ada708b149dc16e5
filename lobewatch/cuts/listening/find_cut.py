"""Which parts of a recording are cuts, and which the spindle turning in air."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

Floats = NDArray[np.float64]

BLOCK = 0.04
"""Length of the pieces that are compared (s), two turns at least; each begins in the middle of the one before it."""
LOUDER = 0.2
"""A cut is so much louder than air, in log10 of the power."""
CLEARER = 1.0
"""Step of the power of pieces, over that of their loudness, from which on the power says what is a cut (log10): chatter
of few lines is ten times louder than air that rushes, and fills less of the spectrum; chosen."""
QUIETEST = 0.1
"""Share of a recording that is air, at least; or air is the quietest part."""
QUIET_PIECES = 5
"""Pieces in a row that the quietest part has; chosen."""
LOUDEST = 1e3
"""Largest power at one frequency, over that in air, that counts."""
LOWEST = 100.0
"""Frequency above which it is compared how loud pieces are (Hz): below it floors and pumps sound; chosen."""
SMOOTHED = 3
"""Pieces over which the power in air is smoothed; chosen."""
STEPS = 50
"""Steps after which the threshold stands."""
ENDS = 0.3
"""Entry and exit are so much louder or quieter than most of a cut, in log10 of the power: twice."""
BURST = 1 / 6
"""What has so much of the length of the longest cut beside it is none; chosen."""
MOST_ENDS = 2.0
"""Longest entry or exit (s)."""
JOINED = 0.1
"""Pauses up to this belong to a cut (s)."""
KNOCK = 0.15
"""Time up to which what is louder is a knock, not a cut (s)."""
LEAST_AIR = 0.15
"""Shortest air (s)."""
SETTLED = 0.1
"""Time after the beginning of a cut from which it is listened to (s)."""
LEAST_CUT = 0.3
"""Time that is listened to, at least (s) ..."""
MOST_CUT = 2.0
"""... and at most, its end: no spindle is so steady that more is of use (s)."""
SPIKE = 4.0
"""A piece of a cut with a peak so many times those around it is a knock."""
AROUND = 6
"""Pieces on each side that a piece is compared with ..."""
AMONG = 0.75
"""... by this quantile of their peaks; chosen."""


class CutParts(NamedTuple):
    """Where a cut is; or why it cannot be said, a code."""

    reason: str
    """Code of what is wrong; empty where all is well."""
    air: slice = slice(0, 0)
    """Samples of the spindle turning in air."""
    cut: slice = slice(0, 0)
    """Samples that are listened to: the end of its steady part."""
    begin: float = np.nan
    """Time at which the cut begins (s)."""
    end: float = np.nan
    """Time at which it ends (s)."""
    steady_begin: float = np.nan
    """Time at which its entry is over (s)."""
    steady_end: float = np.nan
    """Time at which its exit begins (s)."""


UNPLACED = CutParts("")
"""Of a cut that is given by itself, not found in a recording."""


def find_cuts(signal: Floats, sample_rate: float, turn: float) -> list[CutParts]:
    """The cuts in a recording, one at least: without a cut it stands for why there is none.

    signal: in any unit, shape (n,) or (axes, n); sample_rate in Hz; turn: of the spindle (s).

    A cut is louder than halfway, in log, between what is quiet and what is loud. What is too short to be told, or a
    sixth of the longest, is none of its own: a chip, an edge that rubs on its way out. Reasons: "too-short", "no-cut",
    "no-air", "knock".

    Example: a second of noise that gets 20 times as loud for a second.

    >>> noise = np.random.default_rng(0).normal(size=30_000)
    >>> noise[10_000:20_000] *= 20
    >>> [(round(parts.begin, 1), round(parts.end, 1)) for parts in find_cuts(noise, 10e3, 0.005)]
    [(1.0, 2.0)]
    """
    axes = np.atleast_2d(signal)
    count, size = axes.shape[1], round(max(BLOCK, 2 * turn) * sample_rate)
    step = size // 2
    if count < (LEAST_AIR + SETTLED + LEAST_CUT) * sample_rate or count < 4 * size:
        return [CutParts("too-short")]
    pieces = np.lib.stride_tricks.sliding_window_view(axes, size, axis=1)[:, ::step]
    sounds = np.any(np.ptp(pieces, axis=2) > 0, axis=0)
    if np.count_nonzero(sounds) < 2 * QUIET_PIECES:
        return [CutParts("no-cut")]
    is_loud = np.zeros(sounds.size, dtype=np.bool_)
    is_loud[sounds] = _loud_pieces([_power_above(axis[sounds], sample_rate) for axis in pieces])
    loud = _stretches(is_loud)
    joined = _join(loud, JOINED * sample_rate / step)
    stretches = [(first, last) for first, last in joined if (last - first) * step > KNOCK * sample_rate]
    if not stretches:
        return [CutParts("no-cut")]
    air = _longest_air(_stretches(is_loud | ~sounds), sounds.size, step)
    power = np.log10(np.sum(np.var(pieces, axis=2), axis=0) + np.finfo(np.float64).tiny)
    cuts = [_parts(axes, power, stretch, air, sample_rate, size) for stretch in stretches]
    longest = max(cuts, key=lambda parts: parts.end - parts.begin)
    least = BURST * (longest.end - longest.begin)
    kept = [parts for parts in cuts if parts.reason != "too-short" and parts.end - parts.begin > least]
    return kept or [longest]


def _loud_pieces(axes: Sequence[Floats]) -> NDArray[np.bool_]:
    """Which pieces are loud: by their loudness, or by their power where that steps by `CLEARER` more.

    axes: power of the pieces of each axis at each frequency, shape (pieces, frequencies).
    """
    loudness = np.max([_loudness(power) for power in axes], axis=0)
    power = np.log10(np.sum([np.sum(power, axis=1) for power in axes], axis=0))
    is_loud, is_strong = (level > _threshold(level) for level in (loudness, power))
    is_clearer = _step(power, is_strong) > _step(loudness, is_loud) + CLEARER
    return np.asarray(is_strong if is_clearer else is_loud)


def _step(level: Floats, is_loud: NDArray[np.bool_]) -> float:
    """By how much what is loud is louder than what is not, in the mean."""
    is_split = np.any(is_loud) and not np.all(is_loud)
    return float(np.mean(level[is_loud]) - np.mean(level[~is_loud])) if is_split else 0.0


def _threshold(level: Floats) -> float:
    """Halfway between the means of what is below and what is above it, the lowest such (Ridler & Calvard 1978)."""
    smooth = scipy.ndimage.uniform_filter1d(level, QUIET_PIECES)
    beside = QUIET_PIECES // 2
    least = threshold = float(np.min(smooth[beside:-beside])) + LOUDER
    for _ in range(STEPS):
        above = smooth > threshold
        if np.all(above) or not np.any(above):
            break
        threshold = max(least, float(np.mean(smooth[above]) + np.mean(smooth[~above])) / 2)
    return threshold


def _parts(
    axes: Floats, power: Floats, stretch: tuple[int, int], air: slice, sample_rate: float, size: int
) -> CutParts:
    """Entry, steady part and exit of a stretch of pieces, and what is wrong with it; size: of a piece (samples)."""
    step, longest = size // 2, round(MOST_CUT * sample_rate)
    begin, end = (stretch[0] + 1) * step, stretch[1] * step
    first, last = begin + step + round(SETTLED * sample_rate), end - size
    entry, leaving = _ends(power[slice(*stretch)], JOINED * sample_rate / step, MOST_ENDS * sample_rate / step)
    steady = max(first, begin + step + entry * step), last - leaving * step
    if steady[1] - steady[0] >= longest:
        first, last = steady
    settled = slice(max(first, last - longest), max(first, last))
    times = (place / sample_rate for place in (begin, end, first, last))
    parts = CutParts("", air, settled, *times)
    return parts._replace(reason=_fault(axes, parts, sample_rate, step))


def _ends(power: Floats, join: float, most: float) -> tuple[int, int]:
    """How many pieces at the beginning and at the end of a cut stand beside its longest part of one loudness.

    Where those are more than a quarter of the cut, or than `most`, it is no entry and no exit: the cut itself changes.
    """
    smooth = scipy.ndimage.uniform_filter1d(power, QUIET_PIECES)
    usual = _join(_stretches(np.abs(smooth - np.median(smooth)) < ENDS), join)
    first, last = max(usual, key=lambda stretch: stretch[1] - stretch[0])
    entry, leaving = (n if n <= min(power.size / 4, most) else 0 for n in (first, power.size - last))
    return entry, leaving


def _fault(axes: Floats, parts: CutParts, sample_rate: float, step: int) -> str:
    """Why parts cannot be listened to, a code; empty where they can."""
    if parts.cut.stop - parts.cut.start < LEAST_CUT * sample_rate:
        return "too-short"
    if parts.air.stop - parts.air.start < LEAST_AIR * sample_rate:
        return "no-air"
    return "knock" if any(_has_knock(axis[parts.cut], step) for axis in axes) else ""


def _power_above(pieces: Floats, sample_rate: float) -> Floats:
    """The power of pieces at the frequencies above `LOWEST`; pieces: shape (pieces, size)."""
    size = pieces.shape[1]
    pieces = (pieces - np.mean(pieces, axis=1, keepdims=True)) * np.hanning(size)
    power = np.abs(np.fft.rfft(pieces, axis=1)[:, int(LOWEST * size / sample_rate) + 1 :]) ** 2
    return np.asarray(power + np.finfo(np.float64).tiny)


def _loudness(power: Floats) -> Floats:
    """log10 of the power of each piece over that of the quietest part, in the mean over the frequencies.

    Mean over frequency, not of logarithms: a light cut is heard in few lines. power: shape (pieces, frequencies).
    """
    smooth = scipy.ndimage.uniform_filter1d(power, SMOOTHED, axis=0)
    beside = QUIET_PIECES // 2
    quiet = int(
        np.argmin(scipy.ndimage.uniform_filter1d(np.mean(np.log10(power), axis=1), QUIET_PIECES)[beside:-beside])
    )
    least = np.minimum(np.quantile(smooth, QUIETEST, axis=0), np.mean(power[quiet : quiet + QUIET_PIECES], axis=0))
    return np.asarray(np.log10(np.mean(np.minimum(power / least, LOUDEST), axis=1)))


def _stretches(loud: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First piece and the one after the last of each stretch."""
    edge = np.diff(np.concatenate(([0], loud.astype(np.int8), [0])))
    return list(zip(np.flatnonzero(edge == 1).tolist(), np.flatnonzero(edge == -1).tolist(), strict=True))


def _join(stretches: Sequence[tuple[int, int]], gap: float) -> list[tuple[int, int]]:
    """Stretches with short pauses between them as one; gap: longest pause (pieces)."""
    joined: list[tuple[int, int]] = []
    for begin, end in stretches:
        if joined and begin - joined[-1][1] <= gap:
            joined[-1] = joined[-1][0], end
        else:
            joined.append((begin, end))
    return joined


def _longest_air(loud: Sequence[tuple[int, int]], count: int, step: int) -> slice:
    """The longest part without a cut or a knock."""
    ends, begins = [0, *(end + 1 for _, end in loud)], [*(begin for begin, _ in loud), count]
    begin, end = max(zip(ends, begins, strict=True), key=lambda gap: gap[1] - gap[0])
    return slice(begin * step, max(end, begin) * step)


def _has_knock(signal: Floats, step: int) -> bool:
    """Whether single pieces stand out of those around them: a hammer, a dropped part."""
    count = signal.size // step
    peak = np.max(np.abs(signal[: count * step].reshape(count, step)), axis=1)
    wide = np.lib.stride_tricks.sliding_window_view(np.pad(peak, AROUND, mode="reflect"), 2 * AROUND + 1)
    return bool(np.any(peak > SPIKE * np.quantile(wide, AMONG, axis=1)))
