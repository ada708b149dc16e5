"""Stiffness against a steady force."""

from __future__ import annotations

import math

import numpy as np

from dsm.matrix.assemble import assemble
from dsm.matrix.condense_damped import condense_damped
from dsm.response.linearized_stiffness import linearized_stiffness
from dsm.spindle.spindle import Spindle, require_support


def static_stiffness(spindle: Spindle, position: float = 0.0, linearized_at: float = 0.0) -> float:
    """Steady radial force over deflection at `position` from the tool tip (m), in N/m.

    Term 0 of the dynamic stiffness, exact: at rest every element is a link, and nothing is lost however soft the
    bearings are. linearized_at: a frequency (Hz) at which K(w) is replaced by K_stat - w^2 M
    instead, as eqs. (30)-(36) of Gaber & Hashemi, Shock and Vibration, 2015, do; what they miss grows with its fourth
    power. Raises ValueError for a position off the shaft, a shaft that is not held, and a frequency below 0.

    In the middle between two knife edges it is 48 E I / L^3:

    >>> shaft = Spindle([Segment(0.5, 0.05)], [Bearing(0.0, np.inf), Bearing(0.5, np.inf)])
    >>> round(static_stiffness(shaft, position=0.25) / 1e6, 2)  # N/um
    24.74
    >>> round(48 * 210e9 * np.pi * 0.05**4 / 64 / 0.5**3 / 1e6, 2)
    24.74
    """
    require_support(spindle)
    if not (math.isfinite(linearized_at) and linearized_at >= 0):
        raise ValueError(f"linearized_at={linearized_at} Hz is not a finite number >= 0")
    model = assemble(spindle, linearized_at, [position])
    node = model.node(position)
    if model.held[node, 0]:
        return math.inf
    if linearized_at == 0:
        k = condense_damped(model, spindle, np.zeros(1), 0.0, node)
        return float((k.uu - k.ut**2 / k.tt)[0].real)
    terms = np.stack([model.term(power) for power in range(model.diagonal.shape[2])], axis=-1)
    stiffness, _ = linearized_stiffness(terms, 2 * np.pi * linearized_at)
    force = np.zeros(model.held.size)
    force[2 * node] = 1.0
    return float(1 / np.linalg.solve(stiffness, force)[2 * node])
