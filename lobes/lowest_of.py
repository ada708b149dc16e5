"""Several diagrams of one cut as one: what is stable in all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from lobes.stability_lobes import Lobe, StabilityLobes


def lowest_of(diagrams: Sequence[StabilityLobes]) -> StabilityLobes:
    """At each speed the limit, frequency and kind of the lowest, such as of the directions of feed of one cut.

    All by one method at the same speeds. The lobes and remarks of all are kept, each remark once.
    """
    first = diagrams[0]
    lowest, speed = np.argmin([one.depth for one in diagrams], axis=0), np.arange(first.speed_rpm.size)
    width = max(one.crossings.shape[1] for one in diagrams)
    crossings = [
        np.pad(one.crossings, ((0, 0), (0, width - one.crossings.shape[1])), constant_values=np.inf) for one in diagrams
    ]
    return replace(
        first,
        depth=np.stack([one.depth for one in diagrams])[lowest, speed],
        chatter_frequency=np.stack([one.chatter_frequency for one in diagrams])[lowest, speed],
        kind=np.stack([one.kind for one in diagrams])[lowest, speed],
        crossings=np.stack(crossings)[lowest, speed],
        curves=partial(_lobes_of, diagrams),
        remarks=tuple(dict.fromkeys(remark for one in diagrams for remark in one.remarks)),
    )


def _lobes_of(diagrams: Sequence[StabilityLobes]) -> list[Lobe]:
    return [lobe for one in diagrams for lobe in one.lobes]
