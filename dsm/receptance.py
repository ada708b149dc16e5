"""Driving-point receptance of a spindle."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsm.assemble import assemble
from dsm.condense import condense
from dsm.frequency_axis import frequency_axis
from dsm.spindle import Spindle, require_support


def receptance(
    spindle: Spindle, frequency: ArrayLike, position: float = 0.0, loss_factor: float = 0.0
) -> NDArray[np.complex128]:
    """Deflection over force at one place (m/N), shape (n,), with all modes in it.

    frequency: (n,) Hz. position: distance from the tool tip (m). loss_factor eta: shaft and bearings get the complex
    stiffness k (1 + i eta), so that every mode has the damping ratio eta/2 and H(w) = H0(w^2/(1 + i eta))/(1 + i eta)
    with H0 the receptance of the undamped spindle.

    Raises ValueError for frequencies that are negative or not finite, a loss factor below 0, a position off the
    shaft, and 0 Hz with fewer than two bearings.
    """
    f = frequency_axis(frequency)
    if np.any(f == 0):
        require_support(spindle)
    if not (math.isfinite(loss_factor) and loss_factor >= 0):
        raise ValueError(f"loss_factor={loss_factor} is not a finite number >= 0")
    model = assemble(spindle, float(np.max(f, initial=0.0)), [position])
    complexity = 1 + 1j * loss_factor
    uu, ut, tt = condense(
        model, np.asarray((2 * np.pi * f) ** 2 / complexity, dtype=np.complex128), model.node(position)
    )
    return np.asarray(tt / (uu * tt - ut * ut) / complexity)
