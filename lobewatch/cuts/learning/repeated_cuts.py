"""Cuts that were made already: settings that need no other cut, and verdicts worth a repetition or a question."""

import math
from collections.abc import Collection, Sequence

from lobewatch.cuts.learning.cut_likelihood import CutEvidence

TAKEN_SPEED_TOLERANCE, TAKEN_DEPTH_TOLERANCE = 0.01, 0.04
"""Relative distances in speed, and to smaller depth, within which a chattering cut excludes a candidate; chosen.

Smaller differences in depth than `LIMIT_SPREAD` are left to the posterior samples."""
REJECTED_DEPTH_TOLERANCE = 0.10
"""Relative distance in depth within which a cut with a rejected label excludes no candidate."""


def is_setting_taken(
    speed_rpm: float, depth: float, cuts: Sequence[CutEvidence], rejected: Collection[CutEvidence] = ()
) -> bool:
    """Return whether chatter was recorded at a setting (rpm, m) or hardly deeper, and no stable cut there since.

    rejected: cuts with a rejected verdict, which exclude less depth.
    """
    return any(
        cut.has_chatter
        and abs(math.log(speed_rpm / cut.speed_rpm)) < TAKEN_SPEED_TOLERANCE
        and depth > (1 - (REJECTED_DEPTH_TOLERANCE if cut in rejected else TAKEN_DEPTH_TOLERANCE)) * cut.depth
        and not any(cut.is_repeat_of(later) and not later.has_chatter for later in cuts[place + 1 :])
        for place, cut in enumerate(cuts)
    )


def find_cut_to_repeat(cuts: Sequence[CutEvidence], rejected: Collection[CutEvidence]) -> CutEvidence | None:
    """Find the first rejected cut that was made only once, or None."""
    made_once = (cut for cut in cuts if sum(cut.is_repeat_of(other) for other in cuts) == 1)
    return next((cut for cut in made_once if cut in rejected), None)


MIN_DEEPER_CHATTER = 3
"""Number of deeper cuts that chatter against one stable cut from which its verdict is asked again."""


def find_questioned_cut(cuts: Sequence[CutEvidence]) -> CutEvidence | None:
    """Find the deepest stable cut if it was made once and at least three deeper cuts chatter, or None."""
    stable = [cut for cut in cuts if cut.has_verdict and not cut.has_chatter]
    deepest = max(stable, key=lambda cut: cut.depth, default=None)
    if deepest is None or sum(deepest.is_repeat_of(cut) for cut in cuts) > 1:
        return None
    deeper = sum(cut.has_chatter and cut.depth > deepest.depth for cut in cuts)
    return deepest if deeper >= MIN_DEEPER_CHATTER else None
