"""Hear the cuts in a recording of a machine that nobody tapped, and suggest the next speeds."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from lobewatch.cuts.chatter_detection.cut_evaluation import CutEvaluation, CutRecording
from lobewatch.cuts.chatter_detection.without_air import evaluate_with_or_without_air
from lobewatch.cuts.learning.next_speed import HeardCut, NextSpeeds, suggest_speeds

ASSUMED_RANGE = (0.5, 1.5)
"""Speed range over the speed of the cut, if nobody gives the range of the machine; chosen."""
UNKNOWN_IMMERSION = 1.0
"""Radial depth over diameter of a recording if it is unknown: a slot, for which the fewest lines are checked."""


class HeardRecording(NamedTuple):
    """Cuts heard in one recording, and what to try next."""

    evaluations: list[CutEvaluation]
    """Evaluation of each cut in the recording, oldest first."""
    next_speeds: NextSpeeds
    """Speeds to try next."""


def hear_recording(
    recording: CutRecording,
    range_rpm: tuple[float, float] | None = None,
    depth: float = math.nan,
    earlier: Sequence[HeardCut] = (),
) -> HeardRecording:
    """Evaluate a recording of a cut on a machine that nobody tapped, and suggest the next speeds.

    Its cuts have one speed and depth, so that a stable one counts only if all are stable.

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
    evaluations = evaluate_with_or_without_air(recording)
    words = {found.verdict for found in evaluations} - {"stable"} or {"stable"}
    heard = [_to_heard_cut(found, depth) for found in evaluations if found.verdict in words - {"cannot tell"}]
    low, high = range_rpm or tuple(factor * recording.commanded_rpm for factor in ASSUMED_RANGE)
    return HeardRecording(evaluations, suggest_speeds([*earlier, *heard], recording.teeth, (low, high)))


def _to_heard_cut(found: CutEvaluation, depth: float) -> HeardCut:
    frequency = math.nan if found.chatter is None else found.chatter.frequency
    return HeardCut(found.speed_rpm, found.verdict, frequency, depth)
