"""Where the strain energy of a mode sits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsm.elements import POINTS
from dsm.modes.between_nodes import between_nodes
from dsm.modes.find_modes import find_modes
from dsm.modes.modes import Modes
from dsm.modes.spring_energy import spring_energy
from dsm.spindle.sections import sections
from dsm.spindle.spindle import Spindle, require_support

_Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class EnergyShares:
    """Shares of the parts of a spindle in the strain energy of its modes (-); over all parts they add up to 1.

    A share is d ln f^2 / d ln k, k the stiffness of the part: what 1 % of it moves the square of the frequency by, in
    percent.
    """

    frequency: _Float
    """Natural frequencies (Hz), shape (n_modes,)."""
    segments: _Float
    """Bending (and shear) of the segments, shape (n_modes, n_segments)."""
    bearings: _Float
    """Bearings, radial spring and stiffness against tilting together, shape (n_modes, n_bearings); 0 where rigid."""
    housings: _Float
    """Housing behind each bearing, in series with its radial spring, shape (n_modes, n_bearings); 0 where rigid."""
    joints: _Float
    """Joints, both their springs together, shape (n_modes, n_joints)."""


def energy_shares(spindle: Spindle, count: int) -> EnergyShares:
    """Strain energy shares of the `count` lowest modes, exact, also of elements long against the wave.

    Raises ValueError for a count below 1 and a shaft that is not held,
    ArithmeticError where rounding spoils the count of modes.

    >>> spindle = Spindle([Segment(0.1, 0.03), Segment(0.4, 0.06)], [Bearing(0.15, 2.5e8), Bearing(0.4, 2.5e8)])
    >>> shares = energy_shares(spindle, 1)
    >>> shares.bearings.round(2).tolist()  # front and rear, of the first mode
    [[0.15, 0.71]]
    >>> round(float(shares.segments.sum() + shares.bearings.sum()), 6)
    1.0
    """
    require_support(spindle)
    modes = find_modes(spindle, count)
    w2 = (2 * np.pi * modes.frequency) ** 2
    # Twice the energy of a mode of unit modal mass is w^2.
    springs = spring_energy(modes)
    bearings, joints = springs.radial + springs.tilting, springs.shifts + springs.kinks
    parts = _segments(spindle, modes), bearings, springs.housings, joints
    return EnergyShares(modes.frequency, *(energy / w2[:, np.newaxis] for energy in parts))


def _segments(spindle: Spindle, modes: Modes) -> _Float:
    """Twice the integral of M^2/EI + Q^2/(kappa G A) along each segment, by Gauss points in each element."""
    shaft = sections(spindle)
    element = np.flatnonzero(np.diff(modes.position) > 0)
    start, length = modes.position[element], np.diff(modes.position)[element]
    point, weight = np.polynomial.legendre.leggauss(POINTS)
    places = (start[:, np.newaxis] + length[:, np.newaxis] * (point + 1) / 2).ravel()
    left = np.repeat(element, POINTS)
    shape = modes.deflection, modes.slope
    state = between_nodes(shaft, spindle.theory, modes.frequency, modes.position, shape, places, left)
    segment = shaft.segment_at(start + length / 2)
    section = shaft.at(np.repeat(segment, POINTS), places)
    density = state.moment**2 / section.rigidity
    if spindle.theory == "timoshenko":
        density += state.force**2 / section.shear
    energy = density.reshape(modes.frequency.size, -1, POINTS) @ weight * length / 2
    total = np.zeros((len(spindle.segments), modes.frequency.size))
    np.add.at(total, segment, energy.T)
    return total.T
