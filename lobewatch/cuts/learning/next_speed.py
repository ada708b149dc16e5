"""Next speeds to try by the sound of cuts only, without a tap test."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lobewatch.cuts.chatter_detection.cut_evaluation import CutEvaluation, CutRecording, evaluate_recording
from lobewatch.machine.journal.entries import CutVerdict

ASSUMED_RANGE = (0.5, 1.5)
"""Speed range over the speed of the cut, if nobody gives the range of the machine; chosen."""
UNKNOWN_IMMERSION = 1.0
"""Radial depth over diameter assumed for a recording whose radial depth is unknown: a slot, which is checked least."""


class HeardCut(NamedTuple):
    """Cut as it was heard."""

    speed_rpm: float
    """Spindle speed (rpm)."""
    verdict: CutVerdict
    """Verdict on the cut."""
    frequency: float = math.nan
    """Chatter frequency (Hz); NaN if unknown or stable."""
    depth: float = math.nan
    """Axial depth of cut (m); NaN if unknown."""


class NextSpeed(NamedTuple):
    """Speed to try next, with what to expect."""

    speed_rpm: float
    """Spindle speed (rpm)."""
    depth: float
    """Axial depth of cut to try there (m); NaN if the depth of the cuts is unknown."""
    lobe: int
    """Whole chatter waves between two teeth at this speed."""
    stable_probability: float
    """Chance that the cut is stable."""
    relative_depth: float
    """Median of the stable depth there over that at the speed of the newest chattering cut."""
    window_rpm: tuple[float, float]
    """Slowest and fastest speed (rpm) around it with at least 0.8 of its stable depth."""


class NextSpeeds(NamedTuple):
    """Speeds to try next, best first, or the reason why there are none."""

    reason: str
    """Code of the reason; empty with speeds. "stable", "no-chatter-frequency", "no-speed-in-range", "no-deep-speed"."""
    speeds: tuple[NextSpeed, ...] = ()
    """Speeds to try."""
    range_rpm: tuple[float, float] = (math.nan, math.nan)
    """Speed range searched (rpm)."""


class HeardRecording(NamedTuple):
    """Cuts heard in one recording, and what to try next."""

    evaluations: list[CutEvaluation]
    """Evaluation of each cut, oldest first."""
    cuts: tuple[HeardCut, ...]
    """All usable cuts so far, oldest first."""
    next_speeds: NextSpeeds
    """Speeds to try next."""


def hear_recording(
    recording: CutRecording,
    range_rpm: tuple[float, float] | None = None,
    depth: float = math.nan,
    earlier: Sequence[HeardCut] = (),
) -> HeardRecording:
    """Evaluate a recording of a cut on a machine that nobody tapped, and suggest the next speeds.

    Parameters
    ----------
    recording
        Recording with number of teeth and set speed; `UNKNOWN_IMMERSION` if the radial depth is unknown.
    range_rpm
        Slowest and fastest speed of the machine (rpm). None for `ASSUMED_RANGE` times the set speed.
    depth
        Axial depth of cut (m). NaN if unknown.
    earlier
        Earlier cuts of the same tool and material, oldest first.
    """
    evaluations = evaluate_recording(recording)
    heard = [_hear(evaluation, depth) for evaluation in evaluations if evaluation.verdict != "cannot tell"]
    cuts = (*earlier, *heard)
    low, high = range_rpm or tuple(factor * recording.commanded_rpm for factor in ASSUMED_RANGE)
    return HeardRecording(evaluations, cuts, suggest_speeds(cuts, recording.teeth, (low, high)))


def _hear(evaluation: CutEvaluation, depth: float) -> HeardCut:
    frequency = math.nan if evaluation.chatter is None else evaluation.chatter.frequency
    return HeardCut(evaluation.speed_rpm, evaluation.verdict, frequency, depth)


def suggest_speeds(cuts: Sequence[HeardCut], teeth: int, range_rpm: tuple[float, float]) -> NextSpeeds:
    """Suggest the next speeds by the rule tooth passing = f_c / k, highest stable depth first.

    Parameters
    ----------
    cuts
        Cuts so far, oldest first.
    teeth
        Number of teeth N.
    range_rpm
        Slowest and fastest speed (rpm).
    """
    if not cuts or not any(math.isfinite(cut.frequency) for cut in cuts if cut.verdict != "stable"):
        return NextSpeeds("no-chatter-frequency", (), range_rpm)
    newest = cuts[-1]
    if newest.verdict == "stable":
        return NextSpeeds("stable", (), range_rpm)
    low, high = range_rpm
    base = 60 * newest.frequency / teeth
    lobes = np.arange(max(math.ceil(base / high), 1), math.floor(base / low) + 1)
    speeds = [NextSpeed(base / k, newest.depth, int(k), math.nan, math.nan, (math.nan, math.nan)) for k in lobes]
    return NextSpeeds("" if speeds else "no-speed-in-range", tuple(speeds), range_rpm)
