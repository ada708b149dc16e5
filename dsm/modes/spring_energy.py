"""Strain energy in the springs of a spindle: bearings, housings, joints."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsm.modes.modes import Modes

_Float = NDArray[np.float64]


class SpringEnergy(NamedTuple):
    """Twice the strain energy of each spring in each mode; of a mode of unit modal mass all parts together have w^2."""

    radial: _Float
    """Radial springs of the bearings, shape (n_modes, n_bearings); 0 where rigid."""
    tilting: _Float
    """Their stiffness against tilting, shape (n_modes, n_bearings)."""
    housings: _Float
    """Housings behind them, shape (n_modes, n_bearings); 0 where rigid."""
    shifts: _Float
    """Radial springs of the joints, shape (n_modes, n_joints)."""
    kinks: _Float
    """Their stiffness against tilting, shape (n_modes, n_joints)."""


def spring_energy(modes: Modes) -> SpringEnergy:
    """The energy of all springs of modes with nodes at all parts, as find_modes gives them."""
    spindle = modes.spindle
    radial, tilting, housings = np.zeros((3, modes.frequency.size, len(spindle.bearings)))
    for index, bearing in enumerate(spindle.bearings):
        node = modes.node(bearing.position)
        tilting[:, index] = bearing.rotational_stiffness * modes.slope[:, node] ** 2
        if math.isfinite(bearing.support_stiffness):  # of springs in series the one of stiffness k takes force^2/k
            squared_force = (bearing.support_stiffness * modes.deflection[:, node]) ** 2
            radial[:, index] = squared_force / bearing.stiffness
            housings[:, index] = squared_force / bearing.housing_stiffness
    return SpringEnergy(radial, tilting, housings, *_joints(modes))


def _joints(modes: Modes) -> tuple[_Float, _Float]:
    """A joint stands between two nodes at one place."""
    shifts, kinks = np.zeros((2, modes.frequency.size, len(modes.spindle.joints)))
    for index, joint in enumerate(modes.spindle.joints):
        node = modes.node(joint.position)
        shift = modes.deflection[:, node + 1] - modes.deflection[:, node]
        kink = modes.slope[:, node + 1] - modes.slope[:, node]
        shifts[:, index], kinks[:, index] = joint.stiffness * shift**2, joint.rotational_stiffness * kink**2
    return shifts, kinks
