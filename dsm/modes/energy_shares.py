"""Strain energy of a mode in segments, bearings, housings and joints."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dsm.arrays import Floats
from dsm.elements.element_series import GAUSS_POINTS
from dsm.modes.find_modes import find_modes
from dsm.modes.modes import Modes, evaluate_between_nodes
from dsm.spindle.sections import sections
from dsm.spindle.spindle import Spindle, require_support


class SpringEnergy(NamedTuple):
    """Twice the strain energy of each spring in each mode; for unit modal mass all parts together have w^2."""

    radial: Floats
    """Radial springs of the bearings, shape (n_modes, n_bearings); 0 if rigid."""
    tilting: Floats
    """Stiffness of the bearings against tilting, shape (n_modes, n_bearings)."""
    housings: Floats
    """Housings of the bearings, shape (n_modes, n_bearings); 0 if rigid."""
    shifts: Floats
    """Radial springs of the joints, shape (n_modes, n_joints)."""
    kinks: Floats
    """Stiffness of the joints against tilting, shape (n_modes, n_joints)."""


def spring_energy(modes: Modes) -> SpringEnergy:
    """Return the energy of all springs of modes with nodes at all parts, as find_modes gives them."""
    spindle = modes.spindle
    radial, tilting, housings = np.zeros((3, modes.frequency.size, len(spindle.bearings)))
    for index, bearing in enumerate(spindle.bearings):
        node = modes.node(bearing.position)
        tilting[:, index] = bearing.rotational_stiffness * modes.slope[:, node] ** 2
        if math.isfinite(bearing.support_stiffness):  # of springs in series the one of stiffness k takes force^2/k
            squared_force = (bearing.support_stiffness * modes.deflection[:, node]) ** 2
            radial[:, index] = squared_force / bearing.stiffness
            housings[:, index] = squared_force / bearing.housing_stiffness
    shifts, kinks = np.zeros((2, modes.frequency.size, len(spindle.joints)))
    for index, joint in enumerate(spindle.joints):
        node = modes.node(joint.position)  # a joint is between two nodes at one place
        shift, kink = (values[:, node + 1] - values[:, node] for values in (modes.deflection, modes.slope))
        shifts[:, index], kinks[:, index] = joint.stiffness * shift**2, joint.rotational_stiffness * kink**2
    return SpringEnergy(radial, tilting, housings, shifts, kinks)


@dataclass(frozen=True, eq=False)
class EnergyShares:
    """Shares of the parts of a spindle in the strain energy of its modes (-); they add up to 1.

    A share is d ln f^2 / d ln k, k the stiffness of the part: 1 % of k changes the square of the frequency by this many
    percent.
    """

    frequency: Floats
    """Natural frequencies (Hz), shape (n_modes,)."""
    segments: Floats
    """Bending (and shear) of the segments, shape (n_modes, n_segments)."""
    bearings: Floats
    """Bearings, radial and tilting stiffness together, shape (n_modes, n_bearings); 0 if rigid."""
    housings: Floats
    """Housing of each bearing, in series with its radial spring, shape (n_modes, n_bearings); 0 if rigid."""
    joints: Floats
    """Joints, both springs together, shape (n_modes, n_joints)."""


def energy_shares(spindle: Spindle, count: int) -> EnergyShares:
    """Compute the strain energy shares of the lowest modes, exact even for elements long against the wave.

    Parameters
    ----------
    spindle : Spindle
        Supported spindle.
    count : int
        Number of modes.

    Returns
    -------
    EnergyShares
        Shares of all parts.

    Raises
    ------
    ValueError
        For a count below 1 and an unsupported shaft.
    ArithmeticError
        If rounding spoils the count of modes.

    Examples
    --------
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
    parts = _segment_energy(spindle, modes), bearings, springs.housings, joints
    return EnergyShares(modes.frequency, *(energy / w2[:, np.newaxis] for energy in parts))


def _segment_energy(spindle: Spindle, modes: Modes) -> Floats:
    """Return twice the integral of M^2/EI + Q^2/(kappa G A) along each segment, by Gauss points in each element."""
    shaft = sections(spindle)
    element = np.flatnonzero(np.diff(modes.position) > 0)
    start, length = modes.position[element], np.diff(modes.position)[element]
    point, weight = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    places = (start[:, np.newaxis] + length[:, np.newaxis] * (point + 1) / 2).ravel()
    left = np.repeat(element, GAUSS_POINTS)
    state = evaluate_between_nodes(modes, places, left)
    segment = shaft.segment_at(start + length / 2)
    section = shaft.at(np.repeat(segment, GAUSS_POINTS), places)
    density = state.moment**2 / section.rigidity
    if spindle.theory == "timoshenko":
        density += state.force**2 / section.shear
    energy = density.reshape(modes.frequency.size, -1, GAUSS_POINTS) @ weight * length / 2
    total = np.zeros((len(spindle.segments), modes.frequency.size))
    np.add.at(total, segment, energy.T)
    return total.T
