"""Which part of a recording is the cut, and which the spindle turning in air."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

Floats = NDArray[np.float64]

BLOCK = 0.04
"""Length of the pieces that are compared (s), two turns at least; each begins in the middle of the one before it."""
LOUDER = 0.2
"""A cut is so much louder than air, in log10 of the power."""
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
    """Where the cut is; or why it cannot be said, a code."""

    reason: str
    """Code of what is wrong; empty where all is well."""
    air: slice = slice(0, 0)
    """Samples of the spindle turning in air."""
    cut: slice = slice(0, 0)
    """Samples of the cut, its beginning and its end left out."""
    begin: float = np.nan
    """Time at which the cut begins (s)."""
    end: float = np.nan
    """Time at which it ends (s)."""


def find_cut(signal: Floats, sample_rate: float, turn: float) -> CutParts:
    """The one cut in a recording; signal in m/s^2, shape (n,); turn: of the spindle (s).

    Reasons: "too-short", "no-cut", "no-air", "two-cuts", "knock".
    """
    size = round(max(BLOCK, 2 * turn) * sample_rate)
    step = size // 2
    if signal.size < (LEAST_AIR + SETTLED + LEAST_CUT) * sample_rate or signal.size < 4 * size:
        return CutParts("too-short")
    level = _loudness(signal, size, step, sample_rate)
    air = float(np.min(np.convolve(level, np.full(QUIET_PIECES, 1 / QUIET_PIECES), "valid")))
    loud = _stretches(level > air + LOUDER)
    joined = _join(loud, JOINED * sample_rate / step)
    cuts = [(first, last) for first, last in joined if (last - first) * step > KNOCK * sample_rate]
    if not cuts:
        return CutParts("no-cut")
    if len(cuts) > 1:
        return CutParts("two-cuts")
    begin, end = (cuts[0][0] + 1) * step, cuts[0][1] * step
    first, last = begin + step + round(SETTLED * sample_rate), end - size
    settled = slice(max(first, last - round(MOST_CUT * sample_rate)), last)
    parts = CutParts("", _longest_air(loud, level.size, step), settled, begin / sample_rate, end / sample_rate)
    return parts._replace(reason=_fault(signal, parts, sample_rate, step))


def _fault(signal: Floats, parts: CutParts, sample_rate: float, step: int) -> str:
    """Why parts cannot be listened to, a code; empty where they can."""
    if parts.air.stop - parts.air.start < LEAST_AIR * sample_rate:
        return "no-air"
    if parts.cut.stop - parts.cut.start < LEAST_CUT * sample_rate:
        return "too-short"
    return "knock" if _has_knock(signal[parts.cut], step) else ""


def _loudness(signal: Floats, size: int, step: int, sample_rate: float) -> Floats:
    """log10 of the power of each piece over that of the quietest part, in the mean over the frequencies above `LOWEST`.

    Mean over frequency, not of logarithms: a light cut is heard in few lines.
    """
    pieces = np.lib.stride_tricks.sliding_window_view(signal, size)[::step]
    pieces = (pieces - np.mean(pieces, axis=1, keepdims=True)) * np.hanning(size)
    power = np.abs(np.fft.rfft(pieces, axis=1)[:, int(LOWEST * size / sample_rate) + 1 :]) ** 2
    power += np.finfo(np.float64).tiny
    smooth = uniform_filter1d(power, SMOOTHED, axis=0)
    beside = QUIET_PIECES // 2
    quiet = int(np.argmin(uniform_filter1d(np.mean(np.log10(power), axis=1), QUIET_PIECES)[beside:-beside]))
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
