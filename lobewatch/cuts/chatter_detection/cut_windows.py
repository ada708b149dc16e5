"""Windows of a cut that are evaluated one by one, and the parts of a cut that their verdicts give."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy

from lobewatch.arrays import Floats
from lobewatch.cuts.chatter_detection.cut_detection import CUT_PIECE_LENGTH, CUT_SETTLING_TIME, MAX_CUT_TIME, CutParts
from lobewatch.cuts.chatter_detection.spectrum import Spectra
from lobewatch.cuts.chatter_detection.tooth_passing_comb import SpindleSpeed
from lobewatch.machine.journal.entries import CutVerdict, PartVerdict

WINDOW_STEP = MAX_CUT_TIME / 2
"""Time between two windows (s), which overlap by half."""
SHORT_WINDOW_LENGTH = 0.5
"""Length of the windows in which short chatter is searched (s), which overlap by half; chosen."""
MIN_REST_TIME = 0.25
"""Time at the beginning of a cut before the first whole step that has a window of its own (s); chosen."""
CHATTER_BAND = 20.0
"""Half width of the band around chatter in which its beginning and end are searched (Hz); chosen."""
CHATTER_EDGE_SHARE = 0.5
"""Amplitude of chatter at its beginning and end over its quantile `CHATTER_QUANTILE`; chosen."""
CHATTER_QUANTILE = 0.9
"""Quantile of the amplitude of chatter in its windows; chosen."""


MIN_CHATTER_FREQUENCY = 100.0
"""Lowest frequency of chatter (Hz): floor, axes and rubber mounts move below it; chosen."""


class KnownCut(NamedTuple):
    """Facts about a cut that the evaluation of one of its windows may use."""

    speed: SpindleSpeed | None = None
    """Spindle speed in another window, which is tried first."""
    air: Spectra | None = None
    """Spectra of the air; None to compute them."""
    lowest: float = MIN_CHATTER_FREQUENCY
    """Lowest frequency of chatter (Hz)."""
    is_begun: bool = False
    """True for the windows of a long cut, in which no mode rings down from the entry for long."""
    is_short: bool = False
    """True for a short window, which has the speed of the others where it cannot be followed."""
    shop: tuple[Floats, ...] = ()
    """All air between passes in a shop, whose tones come and go, each of shape (axes, n)."""


NOTHING_KNOWN = KnownCut()
"""For a window without others."""


class HeardWindow(NamedTuple):
    """Window of a cut with its verdict."""

    place: slice
    """Its samples."""
    verdict: CutVerdict
    """Verdict on it."""
    hz: float | None = None
    """Chatter frequency (Hz); None without chatter."""
    amplitude: float = 0.0
    """Amplitude of the chatter."""
    axis: int = 0
    """Axis of the chatter."""

    @property
    def has_chatter(self) -> bool:
        """True if it chatters."""
        return self.hz is not None


def place_windows(parts: CutParts, rate: float) -> list[slice]:
    """Place windows from the beginning of a cut to its steady end, the last being the evaluated samples; rate in Hz."""
    first, last = round((parts.begin + CUT_SETTLING_TIME) * rate), parts.cut
    step, size = round(WINDOW_STEP * rate), last.stop - last.start
    count = max((last.start - first) // step, 0)
    windows = [slice(last.start - n * step, last.stop - n * step) for n in range(count, -1, -1)]
    has_rest = windows[0].start - first > MIN_REST_TIME * rate
    return [slice(first, first + size), *windows] if has_rest else windows


def place_short_windows(parts: CutParts, rate: float) -> list[slice]:
    """Place short windows from the beginning to the end of a cut, as short chatter weighs little in the others."""
    first, last = round((parts.begin + CUT_SETTLING_TIME) * rate), round((parts.end - CUT_PIECE_LENGTH) * rate)
    size = round(SHORT_WINDOW_LENGTH * rate)
    return [slice(start, start + size) for start in range(first, last - size, size // 2)] + [slice(last - size, last)]


def shift_window(window: slice, parts: CutParts, rate: float) -> list[slice]:
    """Return a window half a step earlier and later; at an end of the cut the half of the window at that end."""
    first, step = round((parts.begin + CUT_SETTLING_TIME) * rate), round(WINDOW_STEP / 2 * rate)
    middle = (window.start + window.stop) // 2
    earlier = slice(window.start - step, window.stop - step)
    later = slice(window.start + step, window.stop + step)
    return [
        earlier if earlier.start >= first else slice(window.start, middle),
        later if later.stop <= parts.cut.stop else slice(middle, window.stop),
    ]


def join_windows(axes: Floats, windows: Sequence[HeardWindow], parts: CutParts, rate: float) -> tuple[PartVerdict, ...]:
    """Join windows with the same verdict to parts of a cut; axes: of the recording, shape (axes, n).

    A window counts from halfway to the one before to halfway to the next one, chatter from where it becomes loud.
    """
    centers = [(window.place.start + window.place.stop) / 2 / rate for window in windows]
    edges = [parts.begin, *((one + other) / 2 for one, other in pairwise(centers)), parts.end]
    groups: list[list[int]] = []
    for i, window in enumerate(windows):
        if groups and windows[groups[-1][0]].verdict == window.verdict:
            groups[-1].append(i)
        else:
            groups.append([i])
    times = [edges[group[0]] for group in groups] + [edges[-1]]
    for number, group in enumerate(groups):
        if windows[group[0]].has_chatter:
            begin, end = _chatter_times(axes, [windows[i] for i in group], rate)
            times[number] = begin if number else times[number]
            times[number + 1] = end if number + 1 < len(groups) else times[number + 1]
    times = np.maximum.accumulate(times).tolist()  # chatter may last beyond the middle of the next windows
    return tuple(
        PartVerdict(
            round(float(begin), 3), round(float(end), 3), windows[group[0]].verdict, _loudest(windows, group).hz
        )
        for group, (begin, end) in zip(groups, pairwise(times), strict=True)
        if begin < end
    )


def _loudest(windows: Sequence[HeardWindow], group: Sequence[int]) -> HeardWindow:
    return max((windows[i] for i in group), key=lambda window: window.amplitude)


def _chatter_times(axes: Floats, windows: Sequence[HeardWindow], rate: float) -> tuple[float, float]:
    """Return when chatter begins and ends (s) in its windows: where its amplitude is half of its largest."""
    loudest = _loudest(windows, range(len(windows)))
    first, last = windows[0].place.start, windows[-1].place.stop
    level = band_amplitude(axes[loudest.axis, first:last], rate, loudest.hz or 0.0)
    loud = np.flatnonzero(level > CHATTER_EDGE_SHARE * np.quantile(level, CHATTER_QUANTILE))
    scale = (last - first) / level.size
    return (first + loud[0] * scale) / rate, (first + (loud[-1] + 1) * scale) / rate


def band_amplitude(signal: Floats, rate: float, frequency: float) -> Floats:
    """Return the amplitude of a signal within `CHATTER_BAND` of a frequency (Hz) over time, shape (times,)."""
    middle, half = round(frequency * signal.size / rate), int(CHATTER_BAND * signal.size / rate)
    transform = np.zeros(4 * half, dtype=complex)
    bins = scipy.fft.rfft(signal)[max(middle - half, 0) : middle + half]
    transform[: bins.size] = bins * np.hanning(bins.size)
    return np.asarray(np.abs(scipy.fft.ifft(transform)))
