"""Blocks of the dynamic stiffness matrix with damping."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dsm.matrix.dynamic_stiffness import DynamicStiffness
from dsm.spindle.spindle import Spindle

_Complex = NDArray[np.complex128]


def damped_blocks(
    model: DynamicStiffness, spindle: Spindle, w: NDArray[np.complex128], loss_factor: float = 0.0
) -> tuple[_Complex, _Complex]:
    """Blocks of K(w) as in DynamicStiffness.blocks, for a shaft that does not spin, at w (rad/s), shape (n,), complex.

    loss_factor eta: shaft, bearings, housing and joints get the complex stiffness k (1 + i eta). Beside it each bearing
    has its viscous damper, i w c in parallel with its spring. Raises ValueError for a loss factor below 0.
    """
    if not (math.isfinite(loss_factor) and loss_factor >= 0):
        raise ValueError(f"loss_factor={loss_factor} is not a finite number >= 0")
    complexity = 1 + 1j * loss_factor
    diagonal, coupling = (complexity * part for part in model.blocks(np.asarray(w * w / complexity)))
    for bearing in spindle.bearings:
        if bearing.damping > 0 and math.isfinite(bearing.stiffness):
            spring = complexity * bearing.stiffness + 1j * w * bearing.damping
            felt = spring / (1 + spring / complexity * (1 / bearing.housing_stiffness))
            diagonal[0, model.node(bearing.position)] += felt - complexity * bearing.support_stiffness
    return diagonal, coupling
