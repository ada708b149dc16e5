"""Blocks of the dynamic stiffness matrix with damping."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dsm.matrix.dynamic_stiffness import DynamicStiffness
from dsm.spindle.spindle import Spindle
from dsm.spindle.supports import Damping, supports

_Complex = NDArray[np.complex128]


def damped_blocks(
    model: DynamicStiffness, spindle: Spindle, w: _Complex, damping: Damping, derivative: bool = False
) -> tuple[_Complex, _Complex]:
    """Blocks of K(w) as in DynamicStiffness.blocks, for a shaft that does not spin, at w (rad/s), shape (n,), complex.

    Shaft, bearings, housing and joints have the complex stiffness k (1 + i eta). Beside it each bearing has its viscous
    damper, i w c in parallel with its spring, before the housing; those of `damping` count, not those of the spindle.
    With `derivative`, the blocks of dK/dw.
    """
    complexity = damping.complexity
    w2 = np.asarray(w * w / complexity)
    diagonal, coupling = model.blocks(w2, derivative)
    factor = 2 * w if derivative else np.full(1, complexity)
    diagonal, coupling = factor * diagonal, factor * coupling
    damped = [i for i, b in enumerate(spindle.bearings) if damping.viscous[i] > 0 and math.isfinite(b.stiffness)]
    if damped:
        bearings, viscous = [spindle.bearings[i] for i in damped], damping.viscous[damped]
        held = supports(bearings, w, Damping(viscous, damping.loss_factor))
        node = [model.node(bearing.position) for bearing in bearings]
        undamped = complexity * np.array([bearing.support_stiffness for bearing in bearings])
        change = 1j * viscous * held.slope if derivative else held.felt - undamped
        diagonal[0, node] += change.T
    return diagonal, coupling
