"""Stiffness against a steady force."""

from __future__ import annotations

import numpy as np

from dsm.assemble import assemble
from dsm.spindle import Spindle, require_support


def static_stiffness(spindle: Spindle, position: float = 0.0) -> float:
    """Steady radial force over deflection at `position` from the tool tip (m), in N/m.

    Term 0 of the dynamic stiffness, exact: no small frequency is put in. Raises ValueError for a position off the
    shaft and for fewer than two bearings.
    """
    require_support(spindle)
    model = assemble(spindle, 0.0, [position])
    force = np.zeros(model.held.size)
    force[2 * model.node(position)] = 1.0
    deflection = np.linalg.solve(model.term(0), force)
    return float(1 / deflection[2 * model.node(position)])
