"""Receptance of a spindle."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsm.matrix.assemble import assemble
from dsm.matrix.condense_damped import condense_damped
from dsm.matrix.frequency_axis import frequency_axis
from dsm.spindle.spindle import Spindle, require_support


def receptance(
    spindle: Spindle,
    frequency: ArrayLike,
    position: float = 0.0,
    loss_factor: float = 0.0,
    force_position: float | None = None,
) -> NDArray[np.complex128]:
    """Driving-point or transfer receptance, deflection over force (m/N), shape (n,), of the shaft at rest: all modes.

    frequency: (n,) Hz. position: where the deflection is, distance from the tool tip (m). loss_factor eta: all
    stiffness k becomes k (1 + i eta), so that every mode has the damping ratio eta/2; the dampers of the bearings come
    on top. force_position: where the force is (m); None: at the same place, the driving point.

    Raises ValueError for frequencies that are negative or not finite, a loss factor below 0, a position off the
    shaft, and 0 Hz for a shaft that is not held.

    At resonance it is 1 / (eta K), for eta = 2 zeta; the other modes are hardly seen there:

    >>> shaft = Spindle([Segment(0.5, 0.05)], [Bearing(0.0, np.inf), Bearing(0.5, np.inf)])
    >>> peak = receptance(shaft, natural_frequencies(shaft, 1), position=0.25, loss_factor=0.04)
    >>> round(float(abs(peak[0])) * 1e6, 3)  # um/N
    0.996
    >>> round(1 / (0.04 * modal_stiffness(shaft, 1, 0.25)) * 1e6, 3)
    0.996
    """
    f = frequency_axis(frequency)
    if np.any(f == 0):
        require_support(spindle)
    places = sorted([position, position if force_position is None else force_position])
    model = assemble(spindle, float(np.max(f, initial=0.0)), places)
    nodes = [model.node(place) for place in places]
    if np.any(model.held[nodes, 0]):
        return np.zeros(f.size, dtype=np.complex128)
    k = condense_damped(model, spindle, f, loss_factor, node=nodes[1], start=nodes[0])
    return np.asarray((k.share_u * k.tt - k.share_t * k.ut) / (k.uu * k.tt - k.ut * k.ut))
