"""The stiffness of a damped shaft at one node, over frequency."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsm.matrix.condense import Condensed, condense
from dsm.matrix.damped_blocks import damped_blocks
from dsm.matrix.dynamic_stiffness import DynamicStiffness
from dsm.spindle.spindle import Spindle
from dsm.spindle.supports import given_damping

CHUNK = 1024
"""Frequencies whose blocks are in memory at a time: 2 MB for 30 nodes, and faster than all at once."""


def condense_damped(
    model: DynamicStiffness,
    spindle: Spindle,
    frequency: NDArray[np.float64],
    loss_factor: float,
    node: int,
    start: int | None = None,
    extra: NDArray[np.complex128] | None = None,
) -> Condensed:
    """All of a shaft that does not spin condensed to one node, dynamically, exact at each frequency (Hz), shape (n,).

    loss_factor: of all stiffness, see Damping; below 0 a ValueError. node and start: as for condense. extra: stiffness
    uu, ut, tt that something else adds at the last node, shape (3, n).
    """
    damping = given_damping(spindle.bearings, loss_factor)
    w = np.asarray(2 * np.pi * frequency, dtype=np.complex128)
    condensed = np.empty((5, w.size), dtype=np.complex128)
    for first in range(0, w.size, CHUNK):
        chunk = slice(first, first + CHUNK)
        diagonal, coupling = damped_blocks(model, spindle, w[chunk], damping)
        if extra is not None:
            diagonal[:, -1] += extra[:, chunk]
        for row, value in zip(condensed, condense(diagonal, coupling, model.is_link, node, start), strict=True):
            row[chunk] = value
    return Condensed(*condensed)
