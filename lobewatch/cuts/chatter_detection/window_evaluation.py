"""Evaluate the windows of a cut one by one, settle contradictions, and let the worst one decide."""

from collections.abc import Callable, Sequence
from typing import Any

from lobewatch.arrays import Floats
from lobewatch.cuts.chatter_detection import cut_windows as windowing
from lobewatch.cuts.chatter_detection.cut_detection import CutParts
from lobewatch.cuts.chatter_detection.cut_windows import HeardWindow, KnownCut

Sound = Any
"""Evaluation of a window, as a `CutEvaluation`."""
Evaluate = Callable[[slice, KnownCut], Sound]
"""Function that evaluates the samples of a window."""
MAX_SPEED_SEARCHES = 3
"""Number of windows of a cut in which its speed is searched from the set speed; chosen."""
MIN_STABLE_SHARE = 0.5
"""Share of stable windows of a cut without chatter above which it is stable, although others tell nothing; chosen."""


def evaluate_windows(evaluate: Evaluate, axes: Floats, parts: CutParts, rate: float, known: KnownCut) -> Sound:
    """Evaluate all windows of a cut, the last one first, as its speed is known then; axes: of the recording."""
    places, heard, n_searches = windowing.place_windows(parts, rate), list[Sound](), 0
    for place in reversed(places):
        if known.speed is None and n_searches == MAX_SPEED_SEARCHES:
            break
        n_searches += known.speed is None
        sound = evaluate(place, known._replace(is_begun=len(places) > 1))
        known = known._replace(speed=sound.spindle_speed or known.speed)
        heard.insert(0, sound)
    heard = _settle_contradictions(evaluate, parts, rate, heard, known)
    joined = windowing.join_windows(axes, [_summarize(sound) for sound in heard], parts, rate)
    return _worst_window(heard)._replace(part_verdicts=joined)


def _summarize(sound: Sound) -> HeardWindow:
    """Return what the parts of a cut need to know about a window."""
    chatter = sound.chatter
    if chatter is None:
        return HeardWindow(sound.parts.cut, sound.verdict)
    return HeardWindow(sound.parts.cut, sound.verdict, chatter.frequency, chatter.peaks.energy**0.5, sound.axis)


def _settle_contradictions(
    evaluate: Evaluate, parts: CutParts, rate: float, heard: Sequence[Sound], known: KnownCut
) -> list[Sound]:
    """Hear windows again half a step earlier and later if no neighbour has the same verdict on chatter.

    Chatter counts if one of the two has it, too, else they replace it.
    """
    chatters, settled = [sound.chatter is not None for sound in heard], list(heard)
    for i, sound in enumerate(heard):
        beside = chatters[max(i - 1, 0) : i] + chatters[i + 1 : i + 2]
        if not beside or chatters[i] in beside or sound.verdict == "cannot tell":
            continue
        about = known._replace(speed=sound.spindle_speed, is_begun=True)
        again = [evaluate(place, about) for place in windowing.shift_window(sound.parts.cut, parts, rate)]
        if again and not any((other.chatter is not None) == chatters[i] for other in again):
            settled[i] = again[0]._replace(parts=sound.parts)
    return settled


def _worst_window(heard: Sequence[Sound]) -> Sound:
    """Return the window that decides: the loudest chatter, else the last stable one if most of them are."""
    worst = max(heard, key=rank_evidence)
    if worst.chatter is not None:
        return worst
    stable = [sound for sound in heard if sound.verdict == "stable"]
    return stable[-1] if len(stable) > len(heard) * MIN_STABLE_SHARE else heard[-1]


def rank_evidence(sound: Sound) -> tuple[bool, float]:
    """Rank an axis: chatter first, then by energy."""
    peaks = sound.chatter.peaks if sound.chatter else sound.peaks and sound.peaks.comb
    return sound.chatter is not None, peaks.energy if peaks else 0.0
