"""Natural modes of a spindle, evaluated at any place."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from dsm.arrays import Floats, Indices
from dsm.elements.element_series import count_series_terms, transfer_series
from dsm.spindle.sections import sections
from dsm.spindle.segment import SAME_PLACE, nearest_index
from dsm.spindle.spindle import Spindle


class StateVectors(NamedTuple):
    """Motion and internal forces of modes at places, shape (n_modes, n_places) each."""

    deflection: Floats
    """Deflection u, in the scale of the modes."""
    slope: Floats
    """Rotation t of the cross-section."""
    force: Floats
    """Shear force Q."""
    moment: Floats
    """Bending moment M."""


def evaluate_between_nodes(modes: Modes, places: Floats, left: Indices) -> StateVectors:
    """Evaluate the modes of a shaft without rotation inside its elements, exactly.

    places (m), shape (n_places,), and the node left of each. The state (u, t, Q, M)' = T (u1, t1, Q1, M1)
    from the left node of the element must meet (u2, t2) at its right one: B (Q1, M1) = (u2, t2) - A (u1, t1).
    """
    shaft, start, end = sections(modes.spindle), modes.position[left], modes.position[left + 1]
    segment = shaft.segment_at((start + end) / 2)
    powers = np.vander((2 * np.pi * modes.frequency) ** 2, count_series_terms(apart=False), increasing=True)
    transfer = (transfer_series(shaft, modes.spindle.theory, segment, start, to) for to in (end, places))
    whole, part = (np.moveaxis(series @ powers.T, 3, 0) for series in transfer)
    shape = modes.deflection, modes.slope
    near, far = (np.stack([values[:, node] for values in shape], axis=-1) for node in (left, left + 1))
    strain = far[..., np.newaxis] - whole[..., :2, :2] @ near[..., np.newaxis]
    forces = np.linalg.solve(whole[..., :2, 2:], strain)
    return StateVectors(*np.moveaxis((part @ np.concatenate([near[..., np.newaxis], forces], axis=2))[..., 0], 2, 0))


@dataclass(frozen=True, eq=False)
class Modes:
    """Undamped natural modes, lowest first, scaled to a modal mass of 1 kg.

    Examples
    --------
    >>> shaft = Spindle([Segment(0.5, 0.05)], [Bearing(0.0, np.inf), Bearing(0.5, np.inf)])
    >>> modes = mode_shapes(shaft, 2)
    >>> (modes.stiffness_at(0.125) / 1e6).round(1).tolist()  # N/um, at a quarter of the length
    [50.2, 401.7]
    """

    frequency: Floats
    """Natural frequencies (Hz), shape (n_modes,)."""
    position: Floats
    """Positions along the shaft from the tool tip (m), shape (n_nodes,)."""
    deflection: Floats
    """Deflection (kg^-1/2), shape (n_modes, n_nodes)."""
    slope: Floats
    """Slope of the deflection (kg^-1/2 m^-1), shape (n_modes, n_nodes)."""
    spindle: Spindle
    """Spindle of the modes."""
    spin: float = 0.0
    """Speed of rotation (rad/s)."""

    def node(self, position: float) -> int:
        """Return the index of the position nearest to a place; at a joint that on the side of the tool tip.

        Parameters
        ----------
        position : float
            Distance from the tool tip (m).
        """
        return nearest_index(self.position, position)

    def at(self, places: Floats) -> Modes:
        """Return the modes at other places on the shaft, exactly; a place next to a node has its values.

        Parameters
        ----------
        places : ndarray, shape (n,)
            Distances from the tool tip (m).

        Returns
        -------
        Modes
            Same modes at these places.

        Raises
        ------
        ValueError
            For a spinning shaft: its modes have no modal mass of 1 kg.
        """
        if self.spin:
            raise ValueError(
                f"the shaft spins at {self.spin:g} rad/s. Mode shapes and stiffness need a shaft without spin."
            )
        left = np.clip(np.searchsorted(self.position, places, side="right") - 1, 0, self.position.size - 2)
        slack = SAME_PLACE * self.spindle.length
        from_left, from_right = places - self.position[left], self.position[left + 1] - places
        node = np.where(from_left <= slack, left, left + 1)
        deflection, slope = self.deflection[:, node], self.slope[:, node]
        inside = np.minimum(from_left, from_right) > slack
        if np.any(inside):
            state = evaluate_between_nodes(self, places[inside], left[inside])
            deflection[:, inside], slope[:, inside] = state.deflection, state.slope
        return replace(self, position=places, deflection=deflection, slope=slope)

    def deflection_at(self, position: float) -> Floats:
        """Return the deflection at a place, exactly (kg^-1/2), shape (n_modes,).

        Parameters
        ----------
        position : float
            Distance from the tool tip (m).
        """
        return self.at(np.array([position])).deflection[:, 0]

    def stiffness_at(self, position: float) -> Floats:
        """Return the modal stiffness w^2/deflection^2 at a place (N/m), shape (n_modes,); inf at a node of the mode.

        The driving-point receptance is the sum over modes of 1/K/(1 - (f/f_n)^2).

        Parameters
        ----------
        position : float
            Distance from the tool tip (m).
        """
        with np.errstate(divide="ignore"):
            return np.asarray((2 * np.pi * self.frequency / self.deflection_at(position)) ** 2)
