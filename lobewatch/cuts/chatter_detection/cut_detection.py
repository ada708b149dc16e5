"""Find the cuts in a recording, and the air before and after them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from lobewatch.arrays import Flags, Floats

CUT_PIECE_LENGTH = 0.04
"""Length of the compared pieces (s), at least two turns; pieces overlap by half."""
MIN_CUT_LOUDNESS = 0.2
"""Smallest loudness of a cut above air (log10 of the power)."""
POWER_STEP_MARGIN = 1.0
"""Step of piece power over step of piece loudness above which power locates the cut (log10); chosen.

Chatter of few peaks is ten times louder than broadband air noise, and fills less of the spectrum."""
MIN_AIR_SHARE = 0.1
"""Smallest share of air in a recording; if there is less, the quietest part counts as air."""
N_QUIET_PIECES = 5
"""Number of consecutive pieces in the quietest part; chosen."""
MAX_POWER_OVER_AIR = 1e3
"""Largest ratio of power to air power that counts at one frequency."""
MIN_LOUDNESS_FREQUENCY = 100.0
"""Frequency above which the loudness of pieces is compared (Hz), as floor and pumps are loud below; chosen."""
N_SMOOTHED_PIECES = 3
"""Number of pieces over which the air power is smoothed; chosen."""
MAX_THRESHOLD_STEPS = 50
"""Largest number of iterations of the threshold."""
ENTRY_LOUDNESS_STEP = 0.3
"""Loudness difference of entry and exit from most of a cut (log10 of the power), a factor of two."""
MIN_CUT_LENGTH_SHARE = 1 / 6
"""Length over that of the longest cut, up to which a loud part is not a cut; chosen."""
MAX_ENTRY_TIME = 2.0
"""Longest entry or exit (s)."""
MAX_PAUSE_TIME = 0.1
"""Longest pause within a cut (s)."""
MAX_KNOCK_TIME = 0.15
"""Longest loud part that is a knock and not a cut (s)."""
MIN_AIR_TIME = 0.15
"""Shortest part that counts as air (s)."""
CUT_SETTLING_TIME = 0.1
"""Time after the beginning of a cut before its evaluated part starts (s)."""
MIN_CUT_TIME = 0.3
"""Shortest evaluated part of a cut (s)."""
MAX_CUT_TIME = 2.0
"""Longest evaluated part of a cut (s), its end; no spindle is steady enough for more."""
KNOCK_PEAK_RATIO = 4.0
"""Peak of a piece of a cut over the peaks around it, above which the piece is a knock."""
N_KNOCK_NEIGHBORS = 6
"""Number of pieces on each side that a piece is compared with."""
KNOCK_PEAK_QUANTILE = 0.75
"""Quantile of the neighboring peaks that a piece is compared with; chosen."""


class CutParts(NamedTuple):
    """Location of a cut in a recording, or the code of the reason why there is none."""

    reason: str
    """Code of the reason why there is no cut; empty if there is one."""
    air: slice = slice(0, 0)
    """Samples of air, with the spindle running."""
    cut: slice = slice(0, 0)
    """Evaluated samples: the end of the steady part of the cut."""
    begin: float = np.nan
    """Time at which the cut begins (s)."""
    end: float = np.nan
    """Time at which the cut ends (s)."""
    steady_begin: float = np.nan
    """Time at which the entry ends (s)."""
    steady_end: float = np.nan
    """Time at which the exit begins (s)."""
    shop: tuple[slice, ...] = ()
    """Samples of all air between passes in a shop, whose tones come and go."""


WHOLE_SIGNAL = CutParts("")
"""Parts of a cut that was given directly and not found in a recording."""


def find_cuts(signal: Floats, sample_rate: float, turn: float) -> list[CutParts]:
    """Find the cuts in a recording; without a cut the only entry gives the reason.

    signal: in any unit, shape (n,) or (axes, n); sample_rate in Hz; turn: of the spindle (s).

    A cut is louder than the log mean of quiet and loud pieces. A part that is too short to evaluate, or shorter than a
    sixth of the longest, is not a cut of its own, but a chip or a rubbing edge. Reasons: "too-short", "no-cut",
    "no-air", "knock".

    Example: a second of noise that gets 20 times as loud for a second.

    >>> noise = np.random.default_rng(0).normal(size=30_000)
    >>> noise[10_000:20_000] *= 20
    >>> [(round(parts.begin, 1), round(parts.end, 1)) for parts in find_cuts(noise, 10e3, 0.005)]
    [(1.0, 2.0)]
    """
    axes = np.atleast_2d(signal)
    count, size = axes.shape[1], round(max(CUT_PIECE_LENGTH, 2 * turn) * sample_rate)
    step = size // 2
    if count < (MIN_AIR_TIME + CUT_SETTLING_TIME + MIN_CUT_TIME) * sample_rate or count < 4 * size:
        return [CutParts("too-short")]
    pieces = np.lib.stride_tricks.sliding_window_view(axes, size, axis=1)[:, ::step]
    sounds = np.any(np.ptp(pieces, axis=2) > 0, axis=0)
    if np.count_nonzero(sounds) < 2 * N_QUIET_PIECES:
        return [CutParts("no-cut")]
    is_loud = np.zeros(sounds.size, dtype=np.bool_)
    is_loud[sounds] = find_loud_pieces([compute_piece_power(axis[sounds], sample_rate) for axis in pieces])
    joined = join_stretches(find_stretches(is_loud), MAX_PAUSE_TIME * sample_rate / step)
    stretches = [(first, last) for first, last in joined if (last - first) * step > MAX_KNOCK_TIME * sample_rate]
    if not stretches:
        return [CutParts("no-cut")]
    air = _find_longest_air(find_stretches(is_loud | ~sounds), sounds.size, step)
    power = np.log10(np.sum(np.var(pieces, axis=2), axis=0) + np.finfo(np.float64).tiny)
    cuts = [_build_parts(axes, power, stretch, air, sample_rate, size) for stretch in stretches]
    longest = max(cuts, key=lambda parts: parts.end - parts.begin)
    least = MIN_CUT_LENGTH_SHARE * (longest.end - longest.begin)
    return [parts for parts in cuts if parts.reason != "too-short" and parts.end - parts.begin > least] or [longest]


def find_loud_pieces(axes: Sequence[Floats]) -> Flags:
    """Find the loud pieces by loudness, or by power where that steps by `POWER_STEP_MARGIN` more.

    axes: power of the pieces of each axis at each frequency, shape (pieces, frequencies).
    """
    loudness = np.max([_loudness(power) for power in axes], axis=0)
    power = np.log10(np.sum([np.sum(power, axis=1) for power in axes], axis=0))
    is_loud, is_strong = (level > find_loudness_threshold(level) for level in (loudness, power))
    is_clearer = compute_loudness_step(power, is_strong) > compute_loudness_step(loudness, is_loud) + POWER_STEP_MARGIN
    return np.asarray(is_strong if is_clearer else is_loud)


def compute_loudness_step(level: Floats, is_loud: Flags) -> float:
    """Return the mean level of the loud pieces less that of the others (log10)."""
    return float(np.mean(level[is_loud]) - np.mean(level[~is_loud])) if np.any(is_loud) and not np.all(is_loud) else 0.0


def find_loudness_threshold(level: Floats) -> float:
    """Find the lowest level halfway between the means of the lower and the higher ones (Ridler & Calvard 1978)."""
    smooth = scipy.ndimage.uniform_filter1d(level, N_QUIET_PIECES)
    half_window = N_QUIET_PIECES // 2
    least = threshold = float(np.min(smooth[half_window:-half_window])) + MIN_CUT_LOUDNESS
    for _ in range(MAX_THRESHOLD_STEPS):
        above = smooth > threshold
        if np.all(above) or not np.any(above):
            break
        threshold = max(least, float(np.mean(smooth[above]) + np.mean(smooth[~above])) / 2)
    return threshold


def _build_parts(axes: Floats, power: Floats, stretch: tuple[int, int], air: slice, rate: float, size: int) -> CutParts:
    """Build entry, steady part and exit of a stretch of pieces, with its fault; size: of a piece (samples)."""
    step, longest = size // 2, round(MAX_CUT_TIME * rate)
    begin, end = (stretch[0] + 1) * step, stretch[1] * step
    first, last = begin + step + round(CUT_SETTLING_TIME * rate), end - size
    pause, most = MAX_PAUSE_TIME * rate / step, MAX_ENTRY_TIME * rate / step
    entry, leaving = _find_entry_and_exit(power[slice(*stretch)], pause, most)
    steady = max(first, begin + step + entry * step), last - leaving * step
    if steady[1] - steady[0] >= longest:
        first, last = steady
    settled = slice(max(first, last - longest), max(first, last))
    parts = CutParts("", air, settled, begin / rate, end / rate, first / rate, last / rate)
    return parts._replace(reason=find_cut_fault(axes, parts, rate, step))


def _find_entry_and_exit(power: Floats, join: float, most: float) -> tuple[int, int]:
    """Return the number of pieces at the beginning and the end of a cut outside its longest evenly loud part.

    Where those are more than a quarter of the cut, or than `most`, it is no entry and no exit: the cut itself
    changes.
    """
    smooth = scipy.ndimage.uniform_filter1d(power, N_QUIET_PIECES)
    usual = join_stretches(find_stretches(np.abs(smooth - np.median(smooth)) < ENTRY_LOUDNESS_STEP), join)
    first, last = max(usual, key=lambda stretch: stretch[1] - stretch[0])
    entry, leaving = (n if n <= min(power.size / 4, most) else 0 for n in (first, power.size - last))
    return entry, leaving


def find_cut_fault(axes: Floats, parts: CutParts, sample_rate: float, step: int) -> str:
    """Return the code of the fault of a cut; empty without one."""
    if parts.cut.stop - parts.cut.start < MIN_CUT_TIME * sample_rate:
        return "too-short"
    if parts.air.stop - parts.air.start < MIN_AIR_TIME * sample_rate:
        return "no-air"
    return "knock" if any(_has_knock(axis[parts.cut], step) for axis in axes) else ""


OVERLOAD_GUARD_TIME = 0.05
"""Time before and after an overload that is left out, too (s), as sensors and filters recover; chosen."""


def trim_overload(parts: CutParts, clipped: Flags, sample_rate: float) -> CutParts:
    """Leave out the samples of a cut near an overload, if a stretch of `MIN_CUT_TIME` remains; else keep them."""
    inside = clipped[parts.cut]
    if parts.reason or not np.any(inside):
        return parts
    width = 2 * round(OVERLOAD_GUARD_TIME * sample_rate) + 1
    clean = find_stretches(~scipy.ndimage.maximum_filter1d(inside, width))
    begin, end = max(clean, key=lambda stretch: stretch[1] - stretch[0], default=(0, 0))
    if end - begin < MIN_CUT_TIME * sample_rate:
        return parts
    return parts._replace(cut=slice(parts.cut.start + begin, parts.cut.start + end))


def compute_piece_power(pieces: Floats, sample_rate: float) -> Floats:
    """Return the power of pieces above `MIN_LOUDNESS_FREQUENCY`; pieces: shape (pieces, size)."""
    size = pieces.shape[1]
    pieces = (pieces - np.mean(pieces, axis=1, keepdims=True)) * np.hanning(size)
    power = np.abs(np.fft.rfft(pieces, axis=1)[:, int(MIN_LOUDNESS_FREQUENCY * size / sample_rate) + 1 :]) ** 2
    return np.asarray(power + np.finfo(np.float64).tiny)


def _loudness(power: Floats) -> Floats:
    """Return log10 of the power of each piece over that of the quietest part, averaged over the frequencies.

    Mean over frequency, not of logarithms: a light cut is recorded in few peaks. power: shape (pieces, frequencies).
    """
    smooth = scipy.ndimage.uniform_filter1d(power, N_SMOOTHED_PIECES, axis=0)
    half_window = N_QUIET_PIECES // 2
    level = scipy.ndimage.uniform_filter1d(np.mean(np.log10(power), axis=1), N_QUIET_PIECES)
    quiet = int(np.argmin(level[half_window:-half_window]))
    quietest = np.mean(power[quiet : quiet + N_QUIET_PIECES], axis=0)
    least = np.minimum(np.quantile(smooth, MIN_AIR_SHARE, axis=0), quietest)
    return np.asarray(np.log10(np.mean(np.minimum(power / least, MAX_POWER_OVER_AIR), axis=1)))


def find_stretches(loud: Flags) -> list[tuple[int, int]]:
    """Return the first piece and the one after the last of each stretch."""
    edge = np.diff(np.concatenate(([0], loud.astype(np.int8), [0])))
    return list(zip(np.flatnonzero(edge == 1).tolist(), np.flatnonzero(edge == -1).tolist(), strict=True))


def join_stretches(stretches: Sequence[tuple[int, int]], gap: float) -> list[tuple[int, int]]:
    """Join stretches with short pauses between them; gap: longest pause (pieces)."""
    joined: list[tuple[int, int]] = []
    for begin, end in stretches:
        if joined and begin - joined[-1][1] <= gap:
            joined[-1] = joined[-1][0], end
        else:
            joined.append((begin, end))
    return joined


def _find_longest_air(loud: Sequence[tuple[int, int]], count: int, step: int) -> slice:
    """Find the longest part without a cut or a knock."""
    ends, begins = [0, *(end + 1 for _, end in loud)], [*(begin for begin, _ in loud), count]
    begin, end = max(zip(ends, begins, strict=True), key=lambda gap: gap[1] - gap[0])
    return slice(begin * step, max(end, begin) * step)


def _has_knock(signal: Floats, step: int) -> bool:
    """Return whether single pieces exceed those around them, as by a hammer or a dropped part."""
    count = signal.size // step
    peak = np.max(np.abs(signal[: count * step].reshape(count, step)), axis=1)
    padded = np.pad(peak, N_KNOCK_NEIGHBORS, mode="reflect")
    wide = np.lib.stride_tricks.sliding_window_view(padded, 2 * N_KNOCK_NEIGHBORS + 1)
    return bool(np.any(peak > KNOCK_PEAK_RATIO * np.quantile(wide, KNOCK_PEAK_QUANTILE, axis=1)))
