"""Find the passes in a recording by their tooth passing, where a shop is as loud as the cut."""

from itertools import pairwise

import numpy as np
import scipy

from lobewatch.arrays import Floats
from lobewatch.cuts.chatter_detection import cut_detection as cuts
from lobewatch.cuts.chatter_detection.cut_detection import CutParts

PASS_PIECE_LENGTH, PASS_PIECE_PERIODS = 0.25, 12.0
"""Shortest length of the compared pieces (s), and shortest length in periods of tooth passing; chosen.

Twelve periods keep two harmonics apart."""
PASS_PIECE_STEPS = 4
"""Steps from one piece to the next in the length of a piece."""
N_PASS_HARMONICS = 8
"""Number of harmonics of tooth passing that are compared; chosen on a stable cut recorded by a microphone."""
PASS_SPEED_TOLERANCE, PASS_SPEED_STEP = 0.05, 5e-4
"""Largest distance from the commanded speed and step of the tried speeds, relative."""
N_BACKGROUND_BINS = 31
"""Number of bins for the mean logarithm around a harmonic."""
MAX_TOOTH_LEVEL = 2.4
"""Largest level of a harmonic that counts (log10 of its power over the background)."""
CLEAREST_SHARE = 0.1
"""Share of the pieces, the clearest, that tell the speed; chosen."""
MIN_TOOTH_STEP = 0.35
"""Smallest difference of the mean level in passes and outside (log10); chosen.

A stable cut recorded by a microphone has 0.7, the same spindle in air 0.2."""
MIN_PASS_LENGTH = cuts.MIN_CUT_TIME + 2 * cuts.CUT_SETTLING_TIME
"""Shortest pass (s): the shortest evaluated part, entry and exit."""
MAX_PASS_AIR = 2.0
"""Longest air next to a pass (s), as the sound of a shop changes; chosen."""
MIN_PASSES_IN_CUT = 3
"""Smallest number of passes that replace one cut found by its loudness, as tooth passing may fade in it; chosen."""
MIN_COVERED_SHARE = 0.5
"""Smallest length of all passes over that of the cuts found by loudness that they replace; chosen.

Chatter can hide tooth passing, so that only entry and exit of a cut look like passes."""


def find_cuts_in_shop(signal: Floats, sample_rate: float, teeth: int, commanded: float) -> list[CutParts]:
    """Find the cuts in a recording by their loudness, or by tooth passing if that finds more or joins fragments.

    signal: in any unit, shape (n,) or (axes, n); sample_rate in Hz; commanded: spindle frequency as set (Hz).
    """
    loud = cuts.find_cuts(signal, sample_rate, 1 / commanded)
    usable = [parts for parts in loud if parts.reason in ("", "knock")]
    length = sum(parts.end - parts.begin for parts in usable)
    passes = find_passes(signal, sample_rate, teeth, commanded)
    covered = sum(parts.end - parts.begin for parts in passes)
    least = MIN_PASSES_IN_CUT if len(usable) == 1 else len(usable) + 1
    is_broken = len(passes) >= MIN_PASSES_IN_CUT and _has_several(passes, usable)
    is_more = (is_broken or len(passes) >= least) and covered >= MIN_COVERED_SHARE * length
    if is_more and (not _has_several(usable, passes) or _are_gaps_quieter(signal, passes)):
        return passes
    if len(usable) < 2:
        return loud
    times = np.array([(parts.begin, parts.end) for parts in usable])
    shop = _list_gaps(times, np.shape(signal)[-1] / sample_rate, sample_rate)
    return [parts._replace(shop=shop) for parts in loud]


def _has_several(longer: list[CutParts], shorter: list[CutParts]) -> bool:
    """Return whether a cut found in one way holds several found in the other."""
    middles = np.array([(parts.begin + parts.end) / 2 for parts in shorter])
    return any(np.count_nonzero((middles > parts.begin) & (middles < parts.end)) > 1 for parts in longer)


def _are_gaps_quieter(signal: Floats, passes: list[CutParts]) -> bool:
    """Return whether it is quieter between the passes: within one cut, tooth passing may fade."""
    axes = np.atleast_2d(signal)
    between = [slice(one.cut.stop, other.cut.start) for one, other in pairwise(passes)]
    inside, gaps = (
        [np.sum(np.var(axes[:, part], axis=1)) for part in parts] for parts in ([one.cut for one in passes], between)
    )
    return bool(np.median(gaps) < np.median(inside) / 10**cuts.ENTRY_LOUDNESS_STEP)


def find_passes(signal: Floats, sample_rate: float, teeth: int, commanded: float) -> list[CutParts]:
    """Find the passes in a recording by the harmonics of tooth passing; empty if they never come and go.

    signal: in any unit, shape (n,) or (axes, n); sample_rate in Hz; commanded: spindle frequency as set (Hz). Other
    machines, voices and pumps have other harmonics, so that a pass need not be louder than the shop. Each pass has
    the longer air before or after it.

    Example: tooth passing at 400 Hz for a second in noise of constant loudness.

    >>> time, noise = np.arange(60_000) / 10e3, np.random.default_rng(0).normal(size=60_000)
    >>> comb = sum(np.sin(2 * np.pi * 400 * k * time) for k in range(1, 9)) / 4
    >>> sound = np.where((time > 2) & (time < 4), comb + noise, np.sqrt(1.25) * noise)
    >>> [(round(parts.begin), round(parts.end)) for parts in find_passes(sound, 10e3, 4, 100.0)]
    [(2, 4)]
    """
    axes = np.atleast_2d(signal)
    size = round(max(PASS_PIECE_LENGTH, PASS_PIECE_PERIODS / (teeth * commanded)) * sample_rate)
    step = size // PASS_PIECE_STEPS
    if axes.shape[1] < 2 * cuts.N_QUIET_PIECES * step + size:
        return []
    level = np.max([_tooth_level(axis, sample_rate, size, teeth * commanded) for axis in axes], axis=0)
    level = scipy.ndimage.uniform_filter1d(level, PASS_PIECE_STEPS - 1)
    is_pass = level > cuts.find_loudness_threshold(level)
    if cuts.compute_loudness_step(level, is_pass) < MIN_TOOTH_STEP:
        return []
    joined = cuts.join_stretches(cuts.find_stretches(is_pass), cuts.MAX_PAUSE_TIME * sample_rate / step)
    times = np.array(joined) * (step / sample_rate) + 0.5 * (size - step) / sample_rate
    times = times[times[:, 1] - times[:, 0] > MIN_PASS_LENGTH]
    step = round(cuts.CUT_PIECE_LENGTH * sample_rate) // 2
    passes = _build_passes(times, axes.shape[1] / sample_rate, sample_rate)
    return [parts._replace(reason=cuts.find_cut_fault(axes, parts, sample_rate, step)) for parts in passes]


def _tooth_level(signal: Floats, rate: float, size: int, tooth: float) -> Floats:
    """Return the mean level of the harmonics of tooth passing in each piece, at the speed of the clearest pieces."""
    pieces = np.lib.stride_tricks.sliding_window_view(signal, size)[:: size // PASS_PIECE_STEPS]
    tried = tooth * (1 + np.arange(-PASS_SPEED_TOLERANCE, PASS_SPEED_TOLERANCE, PASS_SPEED_STEP))
    count = max(min(N_PASS_HARMONICS, int(rate / 2 / tried[-1] - 0.5)), 1)
    last = min(int((count + 0.5) * tried[-1] * size / rate) + N_BACKGROUND_BINS, size // 2)
    power = np.array([np.abs(scipy.fft.rfft(piece * np.hanning(size))[:last]) ** 2 for piece in pieces])
    above = np.log10(power + np.finfo(np.float64).tiny)
    above -= scipy.ndimage.uniform_filter1d(above, N_BACKGROUND_BINS, axis=1)
    above = np.clip(scipy.ndimage.maximum_filter1d(above, 3, axis=1), 0.0, MAX_TOOTH_LEVEL)
    bins = np.round(np.outer(np.arange(1, count + 1), tried) * size / rate).astype(int)
    levels = np.mean([above[:, np.minimum(at, last - 1)] for at in bins], axis=0)
    n_clearest = max(round(CLEAREST_SHARE * len(levels)), PASS_PIECE_STEPS)
    clearest = np.mean(np.sort(levels, axis=0)[-n_clearest:], axis=0)
    return np.asarray(levels[:, int(np.argmax(clearest))])


def _list_gaps(times: Floats, duration: float, rate: float) -> tuple[slice, ...]:
    """List the samples of air between passes with times (s), shape (n, 2)."""
    settling = cuts.CUT_SETTLING_TIME
    gaps = zip([0.0, *(times[:, 1] + settling)], [*(times[:, 0] - settling), duration], strict=True)
    return tuple(slice(round(a * rate), round(b * rate)) for a, b in gaps if b - a > cuts.MIN_AIR_TIME)


def _build_passes(times: Floats, duration: float, rate: float) -> list[CutParts]:
    """Build the passes between times (s), shape (n, 2), with the air next to each."""
    settling = cuts.CUT_SETTLING_TIME
    ends, begins = [0.0, *(times[:, 1] + settling)], [*(times[:, 0] - settling), duration]
    shop = _list_gaps(times, duration, rate)
    passes = []
    for number, (begin, end) in enumerate(times.tolist()):
        before = max(ends[number], begins[number] - MAX_PASS_AIR), begins[number]
        after = ends[number + 1], min(begins[number + 1], ends[number + 1] + MAX_PASS_AIR)
        air = max(before, after, key=lambda gap: gap[1] - gap[0])
        last = end - settling
        steady = max(begin + settling, last - cuts.MAX_CUT_TIME), last
        air_slice, cut_slice = (
            slice(round(max(part[0], 0.0) * rate), max(round(part[1] * rate), 0)) for part in (air, steady)
        )
        passes.append(CutParts("", air_slice, cut_slice, begin, end, begin + settling, last, shop))
    return passes
