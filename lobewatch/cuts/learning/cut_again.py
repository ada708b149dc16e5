"""Places that test cuts have taken: where chatter was heard no other is made, but to ask again what is not believed."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

from lobewatch.cuts.learning.cut_evidence import CutEvidence

SPEED, DEPTH = 0.01, 0.04
"""Relative distances in speed, and towards less depth, up to which a chattering cut takes the place; chosen: what is
less deep than an edge (`likelihood.EDGE`) the spindles that are learnt tell by themselves ..."""
DOUBTED_DEPTH = 0.10
"""... but not where they do not believe it."""


def is_taken(
    speed_rpm: float, depth: float, cuts: Sequence[CutEvidence], doubted: Collection[CutEvidence] = ()
) -> bool:
    """Whether chatter was written down at a place (rpm, m) or hardly deeper, and none is stable there since.

    doubted: cuts that are not believed, which take more.
    """
    return any(
        cut.chatters
        and abs(math.log(speed_rpm / cut.speed_rpm)) < SPEED
        and depth > (1 - (DOUBTED_DEPTH if cut in doubted else DEPTH)) * cut.depth
        and not any(cut.is_again(later) and not later.chatters for later in cuts[place + 1 :])
        for place, cut in enumerate(cuts)
    )


def cut_again(cuts: Sequence[CutEvidence], doubted: Collection[CutEvidence]) -> CutEvidence | None:
    """The first cut that is not believed and was made once only; None where there is none."""
    for cut in cuts:
        if cut in doubted and sum(cut.is_again(other) for other in cuts) == 1:
            return cut
    return None
