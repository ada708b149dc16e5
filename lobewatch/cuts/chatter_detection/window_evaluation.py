"""Evaluate the windows of a cut one by one, settle contradictions, and let the worst one decide."""

from collections.abc import Callable, Sequence
from itertools import groupby

import numpy as np

from lobewatch.arrays import Floats
from lobewatch.cuts.chatter_detection import cut_windows as windowing
from lobewatch.cuts.chatter_detection import spectrum as spectral
from lobewatch.cuts.chatter_detection.cut_detection import CutParts
from lobewatch.cuts.chatter_detection.cut_windows import HeardWindow, KnownCut
from lobewatch.cuts.chatter_detection.evaluated_cut import CutEvaluation, is_beyond_ripple, rank_evidence

Evaluate = Callable[[slice, KnownCut], CutEvaluation]
"""Function that evaluates the samples of a window."""
MAX_SPEED_SEARCHES = 3
"""Number of windows of a cut in which its speed is searched from the set speed; chosen."""
MIN_STABLE_SHARE = 0.5
"""Share of stable windows of a cut without chatter above which it is stable, although others tell nothing; chosen."""
MIN_SHORT_ENERGY = 0.3
"""Least energy of chatter over that of the comb in a short window, which does not resolve ripple; chosen."""
MIN_RESOLVED_ENERGY = 0.03
"""Smallest energy of lines where ripple puts none over that of the comb, also in a short window; chosen."""
MIN_STRIKING_LOUDNESS = 3.0
"""Loudness of a short window over that of the stable ones, above which it counts unless it is stable; chosen."""
MIN_GROWTH = 3.0
"""Amplitude of chatter over that of the same line in the stable windows, below which they contradict it; chosen."""
SAME_LINE_DISTANCE = 3.0
"""Distance within which a line of another window is the same, as it drifts (Hz); chosen."""


def evaluate_windows(evaluate: Evaluate, axes: Floats, parts: CutParts, rate: float, known: KnownCut) -> CutEvaluation:
    """Evaluate all windows of a cut, the last one first, as its speed is known then; axes: of the recording."""
    places, heard, n_searches = windowing.place_windows(parts, rate), list[CutEvaluation](), 0
    for place in reversed(places):
        if known.speed is None and n_searches == MAX_SPEED_SEARCHES:
            break
        n_searches += known.speed is None
        sound = evaluate(place, known._replace(is_begun=len(places) > 1))
        known = known._replace(speed=sound.spindle_speed or known.speed)
        heard.insert(0, sound)
    heard = _settle_contradictions(evaluate, parts, rate, heard, known)
    if len(places) > 1 and known.speed and _has_speed_without_chatter(heard):
        about = known._replace(is_begun=True, is_short=True)
        short = [evaluate(place, about) for place in windowing.place_short_windows(parts, rate)]
        heard = sorted([*heard, *_pick_striking(axes, short, heard)], key=_center)
    heard = compare_with_stable(axes, rate, heard)
    joined = windowing.join_windows(axes, [_summarize(sound) for sound in heard], parts, rate)
    return with_usual_speed(_worst_window(heard), heard)._replace(part_verdicts=joined)


def with_usual_speed(worst: CutEvaluation, heard: Sequence[CutEvaluation]) -> CutEvaluation:
    """Return an evaluation with the median speed of the longest windows, as shorter ones resolve it worse."""
    longest = max(map(_length, heard))
    whole = [sound.spindle_speed for sound in heard if _length(sound) == longest]
    speeds = sorted(speed for speed in whole if speed is not None)
    if worst.spindle_speed is None or not speeds:
        return worst
    return worst._replace(spindle_speed=speeds[len(speeds) // 2])


def _center(sound: CutEvaluation) -> int:
    return int(sound.parts.cut.start + sound.parts.cut.stop)


def _pick_striking(axes: Floats, short: Sequence[CutEvaluation], heard: Sequence[CutEvaluation]) -> list[CutEvaluation]:
    """Pick short windows with loud chatter, and those not stable that are far louder than the stable windows."""
    stable = [_loudness(axes, sound) for sound in heard if sound.verdict == "stable"]
    least = MIN_STRIKING_LOUDNESS * float(np.median(stable)) if stable else np.inf
    usual = float(np.median([sound.peaks.comb.energy for sound in heard if sound.peaks]))
    picked = []
    for sound in short:
        if _is_clear_chatter(sound, usual):
            picked.append(sound)
        elif sound.verdict != "stable" and _loudness(axes, sound) > least:
            picked.append(sound._replace(verdict="cannot tell", reason=sound.reason or "faint", chatter=None))
    return picked


def _is_clear_chatter(sound: CutEvaluation, usual: float) -> bool:
    """Return whether a short window cuts, and chatters about as loudly as a cut is; usual: energy of its harmonics."""
    if sound.chatter is None or sound.peaks is None or not len(sound.peaks.comb):
        return False
    own = sound.peaks.comb.energy
    least = MIN_RESOLVED_ENERGY if is_beyond_ripple(sound) else MIN_SHORT_ENERGY
    return sound.energy_ratio * own > least * max(own, usual)


def _loudness(axes: Floats, sound: CutEvaluation) -> float:
    """Return the standard deviation of a window."""
    return float(np.std(axes[:, sound.parts.cut]))


def _summarize(sound: CutEvaluation) -> HeardWindow:
    """Return what the parts of a cut need to know about a window."""
    chatter = sound.chatter
    if chatter is None:
        return HeardWindow(sound.parts.cut, sound.verdict)
    return HeardWindow(sound.parts.cut, sound.verdict, chatter.frequency, chatter.peaks.energy**0.5, sound.axis)


def _settle_contradictions(
    evaluate: Evaluate, parts: CutParts, rate: float, heard: Sequence[CutEvaluation], known: KnownCut
) -> list[CutEvaluation]:
    """Hear windows again half a step earlier and later if no neighbour has the same verdict on chatter.

    Chatter counts if one of the two has it, too, else they replace it.
    """
    chatters, settled = [sound.chatter is not None for sound in heard], list(heard)
    for i, sound in enumerate(heard):
        neighbours = chatters[max(i - 1, 0) : i] + chatters[i + 1 : i + 2]
        if not neighbours or chatters[i] in neighbours or sound.verdict == "cannot tell":
            continue
        about = known._replace(speed=sound.spindle_speed, is_begun=True)
        again = [evaluate(place, about) for place in windowing.shift_window(sound.parts.cut, parts, rate)]
        if not any((other.chatter is not None) == chatters[i] for other in again):
            settled[i] = again[0]._replace(parts=sound.parts)
    return settled


def compare_with_stable(axes: Floats, rate: float, heard: Sequence[CutEvaluation]) -> list[CutEvaluation]:
    """Compare chatter with the same line in the stable windows of a cut.

    Where it is as loud there, chattering and stable windows contradict each other: the fewer of them tell nothing.
    """
    stable = [i for i, sound in enumerate(heard) if sound.verdict == "stable"]
    groups = [[i for i, _ in group] for _, group in groupby(enumerate(heard), lambda item: item[1].chatter is None)]
    doubted = [i for group in groups if stable and not _has_grown(axes, rate, heard, group, stable) for i in group]
    wrong = stable if len(doubted) > len(stable) else doubted
    tone = max((heard[i] for i in doubted), key=rank_evidence).chatter if doubted else None
    if tone is None:
        return list(heard)
    return [
        sound._replace(verdict="cannot tell", reason="unexplained-tone", chatter=None, tone=tone.frequency)
        if i in wrong
        else sound
        for i, sound in enumerate(heard)
    ]


def _has_grown(
    axes: Floats, rate: float, heard: Sequence[CutEvaluation], group: Sequence[int], stable: Sequence[int]
) -> bool:
    """Return whether chatter in neighbouring windows is far louder than its line in the stable ones."""
    loudest = max((heard[i] for i in group), key=rank_evidence)
    if loudest.chatter is None:
        return True
    frequency = np.array([loudest.chatter.frequency])

    def level(sound: CutEvaluation) -> float:
        spectrum = spectral.compute_spectrum(axes[loudest.axis, sound.parts.cut], rate)
        return float(spectrum.max_power_near(frequency, SAME_LINE_DISTANCE / spectrum.bin_width)[0] ** 0.5)

    return level(loudest) > MIN_GROWTH * float(np.median([level(heard[i]) for i in stable]))


def _has_speed_without_chatter(heard: Sequence[CutEvaluation]) -> bool:
    """Return whether most windows of a cut have a speed, and none chatters."""
    n_known = sum(sound.peaks is not None for sound in heard)
    return n_known > len(heard) / 2 and all(sound.chatter is None for sound in heard)


def _worst_window(heard: Sequence[CutEvaluation]) -> CutEvaluation:
    """Return the window that decides: the loudest chatter, a short one, the last stable one if most of them are."""
    worst = max(heard, key=rank_evidence)
    if worst.chatter is not None:
        return worst
    short = [sound for sound in heard if 2 * _length(sound) < max(map(_length, heard))]
    if short:
        return max(short, key=rank_evidence)
    stable = [sound for sound in heard if sound.verdict == "stable"]
    return stable[-1] if len(stable) > len(heard) * MIN_STABLE_SHARE else heard[-1]


def _length(sound: CutEvaluation) -> int:
    return int(sound.parts.cut.stop - sound.parts.cut.start)
