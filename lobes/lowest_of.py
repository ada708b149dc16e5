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

    >>> x, y = Mode(500.0, 0.02, 2e7), Mode(700.0, 0.02, 2e7)
    >>> along_x = Cut(teeth=2, immersion=0.5, direction="up", tangential=700e6, radial=200e6)
    >>> speeds = [9000.0, 12000.0, 15000.0]
    >>> fed = [zero_order([x], [y], along_x, speeds), zero_order([y], [x], along_x, speeds)]
    >>> [(lobes.depth * 1e3).round(2).tolist() for lobes in (*fed, lowest_of(fed))]  # mm
    [[4.3, 12.54, 8.37], [18.35, 5.59, 22.18], [4.3, 5.59, 8.37]]
    """
    first = diagrams[0]
    lowest, speed = np.argmin([diagram.depth for diagram in diagrams], axis=0), np.arange(first.speed_rpm.size)
    width = max(diagram.crossings.shape[1] for diagram in diagrams)
    crossings = [
        np.pad(diagram.crossings, ((0, 0), (0, width - diagram.crossings.shape[1])), constant_values=np.inf)
        for diagram in diagrams
    ]
    return replace(
        first,
        depth=np.stack([diagram.depth for diagram in diagrams])[lowest, speed],
        chatter_frequency=np.stack([diagram.chatter_frequency for diagram in diagrams])[lowest, speed],
        kind=np.stack([diagram.kind for diagram in diagrams])[lowest, speed],
        crossings=np.stack(crossings)[lowest, speed],
        curves=partial(_lobes_of, diagrams),
        remarks=tuple(dict.fromkeys(remark for diagram in diagrams for remark in diagram.remarks)),
    )


def _lobes_of(diagrams: Sequence[StabilityLobes]) -> list[Lobe]:
    return [lobe for diagram in diagrams for lobe in diagram.lobes]
