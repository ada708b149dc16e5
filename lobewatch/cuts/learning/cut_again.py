"""Places that test cuts have taken: where chatter was heard no other is made, but to ask again what is not believed."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

from lobewatch.cuts.learning.cut_evidence import CutEvidence

SPEED, DEPTH = 0.01, 0.10
"""Relative distances in speed, and towards less depth, up to which a chattering cut takes the place; chosen."""
SAME_SPEED, SAME_DEPTH = 0.002, 0.01
"""Relative distances up to which a cut is another one again."""


def is_taken(speed_rpm: float, depth: float, cuts: Sequence[CutEvidence]) -> bool:
    """Whether chatter was written down at a place (rpm, m) or hardly deeper, and none is stable there since."""
    return any(
        cut.chatters
        and abs(math.log(speed_rpm / cut.speed_rpm)) < SPEED
        and depth > (1 - DEPTH) * cut.depth
        and not any(_is_again(cut, later) and not later.chatters for later in cuts[place + 1 :])
        for place, cut in enumerate(cuts)
    )


def cut_again(cuts: Sequence[CutEvidence], doubted: Collection[CutEvidence]) -> CutEvidence | None:
    """The first cut that is not believed and was made once only; None where there is none."""
    for cut in cuts:
        if cut in doubted and sum(_is_again(cut, other) for other in cuts) == 1:
            return cut
    return None


def _is_again(cut: CutEvidence, other: CutEvidence) -> bool:
    near = abs(math.log(other.speed_rpm / cut.speed_rpm)) < SAME_SPEED
    return near and abs(math.log(other.depth / cut.depth)) < SAME_DEPTH
